"""Router, world and agents started one by one, as on several hosts, and what strangers send to them."""

import json
import os
import signal
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

import fogwatch
from patrol.exchange import Sensed
from patrol.journal import read_journal
from patrol.pose import Pose
from patrol.scenario import load_scenario, scenario_hash
from runtime.messages.phases import PhaseA, ReplyA, Stop, encode
from runtime.net.link import open_link
from runtime.security.keys import WORLD, FleetKeys
from tests.fleets import Processes, trace_of
from tests.routers import free_endpoint
from worldsim.run_record import DESERTED

pytestmark = pytest.mark.processes

SCENARIO: dict[str, Any] = {
    "name": "by-hand",
    "terrain": {"builtin": "open"},
    "point": 0.5,
    "duration": 100,
    "robots": [{"name": "anna", "model": "holonomic"}, {"name": "bert", "model": "car"}],
}
PATIENCE_S = 800.0
"""How long anything may take, s: less than pytest's own limit, and more than any run here on a busy machine."""
LIVING = ("anna", "bert", WORLD)
"""Whose liveliness tokens there are during a run."""
PREPARES = "compiling the kernels"
"""In the lines that are logged where the cache is cold."""


class Hand(Processes):
    """Starts the processes of one fleet and ends them."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, PATIENCE_S)
        self.router = free_endpoint()
        self.out = folder / "run"
        self.scenario = folder / "scenario.yaml"
        self.fleet = "by-hand-1"
        self.write(SCENARIO)

    def write(self, scenario: dict[str, Any]) -> None:
        self.scenario.write_text(json.dumps(scenario), encoding="utf-8")

    def start_router(self) -> None:
        self.start("router", "fogwatch.router", "--listen", self.router)

    def start_world(self, *arguments: str) -> None:
        self.start("world", "worldsim", *self.common(), "--out", str(self.out), *arguments)

    def start_agent(self, robot: str, *arguments: str, name: str = "") -> None:
        self.start(name or robot, "agent", *self.common(), "--robot", robot, *arguments)

    def start_all(self, *arguments: str) -> None:
        """Start a long run, of which the world gets these arguments, and wait until it is under way."""
        self.write({**SCENARIO, "duration": 100_000})
        self.start_router()
        self.start_world(*arguments)
        for robot in ("anna", "bert"):
            self.start_agent(robot)
        self.until(lambda: self.ticks() > 10)

    def codes(self, *names: str) -> list[int]:
        return [self.code(name) for name in names]

    def summary(self) -> dict[str, Any]:
        return dict(json.loads((self.out / "summary.json").read_text(encoding="utf-8")))

    def common(self) -> list[str]:
        return ["--router", self.router, "--fleet", self.fleet, "--scenario", str(self.scenario)]

    def ticks(self) -> int:
        table = self.out / "ticks.csv"
        return table.read_text(encoding="ascii").count("\n") - 1 if table.exists() else 0


@pytest.fixture
def hand(tmp_path: Path) -> Iterator[Hand]:
    hand = Hand(tmp_path)
    yield hand
    hand.end()


def test_a_fleet_started_by_hand_in_any_order(hand: Hand, tmp_path: Path) -> None:
    hand.start_world()
    hand.start_agent("bert")
    hand.start_router()
    hand.start_agent("anna")
    assert hand.codes("world", "anna", "bert") == [0, 0, 0]
    summary = hand.summary()
    assert summary["verdict"]["valid"]
    end = read_journal(hand.out / "journal").end
    assert end is not None
    assert end.notes["refused"] == {}
    assert summary["trace_hash"] == trace_of(SCENARIO, summary["ticks"], tmp_path)
    hand.start("report", "fogwatch", "report", str(hand.out))
    assert hand.code("report") == 0, hand.said("report")
    assert (hand.out / "report.html").is_file()
    again = fogwatch.run(hand.out / "scenario.yaml", out=tmp_path / "again", picture=False)
    assert again.trace_hash == summary["trace_hash"]
    hand.processes["router"].terminate()
    assert hand.code("router") == 0


@pytest.mark.kind("direct radio")
def test_robots_that_hear_each_other_by_a_router_of_their_own(hand: Hand) -> None:
    hand.write({**SCENARIO, "duration": 15, "pace": 3, "radio": {"via": "direct"}})
    radio = free_endpoint()
    hand.start_router()
    hand.start("radio", "fogwatch.router", "--listen", radio)
    hand.start_world("--radio", radio)
    for robot in ("anna", "bert"):
        hand.start_agent(robot, "--radio", radio)
    assert hand.codes("world", "anna", "bert") == [0, 0, 0], hand.said("world")
    summary = hand.summary()
    assert summary["direct"]["unsaid"] == []
    assert set(summary["direct"]["links"]) == {"anna to bert", "bert to anna"}
    for counts in summary["direct"]["links"].values():
        assert 1 <= counts["heard"] <= counts["sent"] <= 30
    assert summary["messages"]["frames"] >= 1, "the world overhears them too"


def test_a_radio_that_nobody_asked_for_is_bad_input(hand: Hand) -> None:
    hand.start_world("--radio", "tcp/127.0.0.1:7448")
    hand.start_agent("anna", "--radio", "tcp/127.0.0.1:7448")
    assert hand.codes("world", "anna") == [2, 2]
    assert "radio.via is ether" in hand.said("world")


def test_an_agent_that_is_paused_too_long_is_left_out_and_leaves(hand: Hand) -> None:
    hand.start_all("--deadline", "20")
    hand.processes["anna"].send_signal(signal.SIGSTOP)
    paused = hand.ticks()
    hand.until(lambda: hand.ticks() > paused + 10)
    hand.processes["anna"].send_signal(signal.SIGCONT)
    assert hand.code("anna") == 1
    assert "left out: no answer in phase" in hand.said("anna")
    hand.processes["world"].terminate()
    assert hand.codes("world", "bert") == [130, 0]
    assert hand.summary()["verdict"]["outcome"] == "invalid"
    assert "anna lost" in hand.said("world")


def test_garbage_and_floods_on_every_key_change_nothing(hand: Hand, tmp_path: Path) -> None:
    hand.start_all()
    keys = FleetKeys(hand.fleet)
    link = open_link(hand.router, PATIENCE_S)
    head = (1, 12345, 7, 6789)
    hostile = [
        b"",
        b"junk",
        os.urandom(60),
        bytes(100_000),
        b"\xdd\xff\xff\xff\xff",
        encode(ReplyA(*head, (b"frame",))),
        encode(PhaseA(*head, Sensed(head[2], Pose(0.0, 0.0, 0.0)))),
        encode(Stop(*head, orderly=True, reason="go home")),
    ]
    names = ("anna", "bert", "nobody")
    targets = [make(name) for name in names for make in (keys.tick, keys.reply, keys.telemetry, keys.position)]
    targets += [keys.truth("metrics"), keys.truth("events"), keys.control("stop"), f"{keys.alive('nobody')}"]
    posts = [link.post(target) for target in targets]
    for _ in range(30):
        for post in posts:
            for payload in hostile:
                post(payload)
    link.live(keys.alive("nobody"))
    flood = link.publisher(keys.reply("anna"))
    for _ in range(20_000):
        flood(b"junk")
    link.close()
    with closing(open_link(hand.router, PATIENCE_S)) as looking:
        # Once its token has gone, the router has read all that came before.
        hand.until(lambda: set(looking.seen(keys.alive("*"), 9)) == {keys.alive(name) for name in LIVING})
    before = hand.ticks()
    hand.until(lambda: hand.ticks() > before + 50)
    hand.processes["world"].terminate()
    assert hand.codes("world", "anna", "bert") == [130, 0, 0], hand.said("world")
    summary = hand.summary()
    assert summary["verdict"]["valid"], summary["verdict"]
    assert summary["trace_hash"] == trace_of(SCENARIO, summary["ticks"], tmp_path)
    end = read_journal(hand.out / "journal").end
    assert end is not None
    refused = end.notes["refused"]
    assert refused["malformed"] >= 2 * 30 * 3
    assert refused["oversized"] >= 2 * 30
    assert refused["stranger"] >= 2 * 30
    assert refused["unknown"] >= 30
    assert summary["robots"]["anna"]["rejected"] >= 30 * 6


def test_a_second_world_and_a_second_process_for_a_robot_are_turned_away(hand: Hand) -> None:
    hand.start_all()
    hand.start("second", "worldsim", *hand.common(), "--out", str(hand.folder / "second"))
    assert hand.code("second") == 2
    assert "--fleet by-hand-1: a world of this fleet is running already" in hand.said("second")
    hand.start_agent("anna", name="impostor")
    assert hand.code("impostor") == 1
    assert "another process is anna already" in hand.said("impostor")
    before = hand.ticks()
    hand.until(lambda: hand.ticks() > before + 10)
    hand.processes["world"].terminate()
    assert hand.codes("world", "anna", "bert") == [130, 0, 0]


def test_a_run_ends_when_nobody_is_living(hand: Hand) -> None:
    hand.start_all()
    for robot in ("anna", "bert"):
        hand.processes[robot].kill()
    assert hand.code("world") == 1
    assert hand.summary()["ended"] == DESERTED
    assert hand.summary()["ticks"] < 200_000


def test_another_scenario_is_refused_and_both_sides_say_why(hand: Hand) -> None:
    hand.start_router()
    hand.start_world()
    other = hand.folder / "other.yaml"
    other.write_text(json.dumps({**SCENARIO, "seed": 8}), encoding="utf-8")
    hand.start("bert", "agent", *hand.common()[:-1], str(other), "--robot", "bert", "--wait", "100000")
    assert hand.code("bert") == 2
    hashes = [scenario_hash(load_scenario(path))[:12] for path in (other, hand.scenario)]
    why = f"another scenario (hash {hashes[0]}, the world's is {hashes[1]}); give all processes the same file"
    assert hand.said("bert").splitlines()[-1] == f"bert: this process was started with {why}"
    assert hand.code("world") == 2
    assert f"world: bert was started with {why}" in hand.said("world")


def test_a_robot_that_the_worlds_scenario_does_not_have_is_told_that_nobody_greets_it(hand: Hand) -> None:
    hand.start_router()
    hand.start_world()
    other = hand.folder / "other.yaml"
    other.write_text(json.dumps({**SCENARIO, "robots": [{"name": "carl"}]}), encoding="utf-8")
    hand.start("carl", "agent", *hand.common()[:-1], str(other), "--robot", "carl")
    hand.until(lambda: "the world of fleet by-hand-1 is there, but has not greeted carl" in hand.said("carl"))
    for name in ("carl", "world"):
        hand.processes[name].terminate()
    assert hand.codes("world", "carl") == [130, 130]


def test_without_a_router_or_a_world_people_are_told(hand: Hand) -> None:
    hand.start_agent("anna", "--wait", "5")
    hand.start_world("--wait", "5")
    assert hand.codes("anna", "world") == [2, 2]
    for name in ("anna", "world"):
        assert "waiting for a router at" in hand.said(name)
        assert "start one with: fogwatch router --listen" in hand.said(name)
    hand.start_router()
    hand.until(lambda: "router ready" in hand.said("router"))
    hand.start_agent("bert")
    hand.until(lambda: "waiting for the world" in hand.said("bert"))
    hand.start("alone", "worldsim", *hand.common(), "--out", str(hand.folder / "other"), "--wait", "5")
    hand.fleet = "another-fleet"
    hand.start_agent("anna", "--wait", "3", name="lonely")
    assert hand.code("alone") == 3
    assert "no process came for anna" in hand.said("alone")
    assert hand.code("lonely") == 1
    assert "waiting for the world of fleet another-fleet" in hand.said("lonely")


def test_what_cannot_be_started_is_said_in_one_line(hand: Hand) -> None:
    hand.start("unknown", "agent", *hand.common(), "--robot", "carl")
    hand.start("address", "agent", "--router", "here", *hand.common()[2:], "--robot", "anna")
    hand.start("fleet", "worldsim", *hand.common()[:2], "--fleet", "a/*", *hand.common()[4:], "--out", str(hand.out))
    hand.start("static", "agent", *hand.common(), "--robot", "anna", "--static", "none", "--wait", "0.1")
    hand.start("taken", "worldsim", *hand.common(), "--out", str(hand.scenario))
    (hand.folder / "given").mkdir()
    (hand.folder / "given" / "scenario.yaml").touch()
    hand.start("given", "worldsim", *hand.common(), "--out", str(hand.folder / "given"))
    for name in ("unknown", "address", "fleet", "static", "taken", "given"):
        assert hand.code(name) == 2
        lines = [line for line in hand.said(name).splitlines() if PREPARES not in line]
        assert len(lines) == 1, lines


def test_a_busy_port_is_said_in_one_line(hand: Hand) -> None:
    hand.start_router()
    hand.until(lambda: "router ready" in hand.said("router"))
    hand.start("second", "fogwatch.router", "--listen", hand.router)
    assert hand.code("second") == 2
    assert hand.said("second") == f"fogwatch router: {hand.router}: the port is busy; choose another\n"


def test_a_world_started_by_hand_refuses_to_kill_what_it_did_not_start(hand: Hand) -> None:
    hand.write({**SCENARIO, "faults": [{"kind": "kill", "who": "anna", "at": 5}]})
    hand.start_world()
    assert hand.code("world") == 2
    assert "which only a run that started these can do" in hand.said("world")
    assert not hand.out.exists()
