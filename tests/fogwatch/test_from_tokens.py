"""Fleets without a world and without a scenario, by their processes and what they send."""

from __future__ import annotations

from typing import Any

import pytest

from fogwatch.status import TokenWatch
from patrol.messages.telemetry import Telemetry, Traffic, pack_view
from patrol.net.mailbox import Mailbox
from patrol.pose import Pose
from patrol.process.lifeline import Ending
from patrol.radio.message import CONTACT, Position, encode
from patrol.security.keys import WORLD, fleet_keys
from patrol.security.mesh import Mesh
from patrol.security.roles import VIEWER, robot_role

KEYS = fleet_keys("real-1")


class Air:
    """A link on which the test speaks, to those who have subscribed by then."""

    def __init__(self, *there: str) -> None:
        self.there = list(there)
        self.mailboxes: dict[str, Mailbox[Any]] = {}
        self.closed = 0
        self.mesh: Mesh | None = None
        self.has_world = False

    def subscribe(self, key: str, mailbox: Mailbox[Any]) -> None:
        self.mailboxes[key] = mailbox

    def seen(self, key: str, most: int) -> list[str]:
        del most
        return [key.replace("*", name) for name in self.there]

    def sees(self, key: str) -> bool:
        return key == KEYS.alive(WORLD) and self.has_world

    def close(self) -> None:
        self.closed += 1

    def say(self, key: str, payload: bytes) -> None:
        self.mailboxes[key].deliver(key, payload)

    def position(self, name: str, robot: int = 1) -> None:
        self.say(KEYS.position(name), encode(Position.of(robot, 7, 3.5, Pose(2.0, 3.0, 0.0))))

    def telemetry(self, name: str, heard: dict[str, int] | None = None) -> None:
        traffic = None if heard is None else Traffic(0, 0, heard, 0, False)
        self.say(KEYS.telemetry(name), pack_view(Telemetry(7, "patrolling", None, None, None, 9, 1.5, 0, traffic)))


class Fleet:
    """A watched fleet; between looks the test speaks and the time passes."""

    def __init__(self, *there: str) -> None:
        self.now_s = 0.0
        self.world: Any = None
        self.air = Air(*there)
        link: Any = self.air
        self.watch = TokenWatch(link, link, KEYS, "tcp/r:1", Ending(), 3.0, lambda: self.world, lambda: self.now_s)
        self.watch.look(0.0)

    def look(self, after_s: float = 0.0) -> Any:
        self.now_s += after_s
        return self.watch.look(0.0)


def test_a_robot_that_sends_is_well_until_it_is_silent_and_until_it_has_gone() -> None:
    fleet = Fleet("anna")
    fleet.air.position("anna")
    fleet.air.telemetry("anna")
    status = fleet.look()
    (robot,) = status.robots
    assert status.well
    said = (robot.status, robot.doing, robot.tick, robot.heard_s, robot.place)
    assert said == ("alive", "patrolling", 7, 0.0, (2.0, 3.0))
    assert fleet.look(2.9).well
    assert [robot.wrong for robot in fleet.look(0.2).robots] == ["no position for 3 s"]
    fleet.air.there.clear()
    assert [(robot.status, robot.wrong) for robot in fleet.look().robots] == [("gone", "its process has gone")]
    assert "give --scenario FILE" in status.unknown[0]


def test_robots_that_come_later_are_followed_too() -> None:
    fleet = Fleet("bert")
    fleet.air.there.append("anna")
    fleet.look()
    fleet.air.position("anna")
    fleet.air.position("bert", robot=2)
    assert [robot.name for robot in fleet.look().robots] == ["anna", "bert"]
    assert fleet.look().well


def test_a_mesh_names_its_robots_that_are_not_there() -> None:
    fleet = Fleet("bert")
    roles = (VIEWER, *map(robot_role, ("anna", "bert", "carl")))
    fleet.air.mesh = Mesh("real-1", {f"{role.user}.1": role for role in roles}, {})
    fleet.air.position("bert", robot=2)
    status = fleet.look()
    assert not status.well
    absent = ("absent", "is not there")
    robots = {robot.name: (robot.status, robot.wrong) for robot in status.robots}
    assert robots == {"anna": absent, "bert": ("alive", ""), "carl": absent}
    assert status.unknown == ("frames' tags, MFoW and trapped robots: give --scenario FILE",)
    fleet.air.there += ["anna", "carl"]
    assert fleet.look().well, "those that have just come may be silent for a moment"


@pytest.mark.parametrize(
    ("speak", "wrong"),
    [
        (lambda _: None, "has sent nothing for 3 s"),
        (
            lambda air: air.telemetry("anna"),
            "no position for 3 s here; if robots hear each other elsewhere, give --radio",
        ),
        (lambda air: air.say(KEYS.position("anna"), b"\xff\x00"), "has sent nothing for 3 s"),
        (lambda air: air.say(KEYS.telemetry("anna"), b"\xff\x00"), "has sent nothing for 3 s"),
        (lambda air: air.position("anna", CONTACT), "has sent nothing for 3 s"),
    ],
    ids=["nothing", "telemetry", "no frame", "no telemetry", "an intruder's position"],
)
def test_only_its_own_positions_count(speak: Any, wrong: str) -> None:
    fleet = Fleet("anna")
    speak(fleet.air)
    status = fleet.look(2.9)
    assert [robot.wrong for robot in status.robots] == [""]
    assert status.unknown[0] == "whether anna can be heard: followed for less than 3 s"
    assert [robot.wrong for robot in fleet.look(0.2).robots] == [wrong]


def test_a_robot_that_does_not_hear_another_one_is_not_well() -> None:
    fleet = Fleet("anna", "bert")
    fleet.air.telemetry("anna", {"bert": 0, "nobody": 0})
    fleet.air.telemetry("bert", {"anna": 0})
    fleet.look()
    for count in range(1, 11):
        fleet.air.position("anna")
        fleet.air.position("bert", robot=2)
        fleet.look()
        fleet.air.telemetry("anna", {"bert": 0, "nobody": 0})
        fleet.air.telemetry("bert", {"anna": count})
    assert [robot.wrong for robot in fleet.look().robots] == ["does not hear bert", ""]
    fleet.air.there.remove("bert")
    assert [robot.wrong for robot in fleet.look().robots] == ["", "its process has gone"]


def test_names_of_strangers_do_not_act_on_a_terminal() -> None:
    assert "\x1b" not in Fleet("a\x1b[2J").look().as_text()


def test_a_world_that_gives_no_answer_is_there_and_what_it_waits_for_is_said() -> None:
    fleet = Fleet("anna")
    assert "world   none" in fleet.look().as_text()
    fleet.air.has_world, fleet.world = True, "world waits for bert"
    status = fleet.look()
    assert "world   is there" in status.as_text()
    assert (status.warnings, status.well) == (("world waits for bert",), False)


def test_a_world_that_is_met_later_than_its_robots_is_looked_at_from_then_on() -> None:
    class World:
        closed = 0

        def look(self, seconds: float) -> str:
            return f"looked for {seconds:g} s"

        def close(self) -> None:
            self.closed += 1

    fleet, world = Fleet("anna"), World()
    fleet.air.has_world, fleet.world = True, world
    assert [fleet.look(), fleet.look()] == ["looked for 0 s", "looked for 0 s"]
    fleet.watch.close()
    assert (world.closed, fleet.air.closed) == (1, 1)


def test_a_robot_that_is_stopped_is_not_called_patrolling() -> None:
    fleet = Fleet("anna")
    fleet.air.position("anna")
    stopped = "stopped by an operator (fogwatch control ... release); stopped by the topic /stop (publish false there)"
    report = Telemetry(7, "patrolling", None, None, None, 9, 1.5, 0, stopped=stopped)
    fleet.air.say(KEYS.telemetry("anna"), pack_view(report))
    (robot,) = fleet.look().robots
    assert robot.doing == robot.wrong == "stopped by an operator; stopped by the topic /stop"
