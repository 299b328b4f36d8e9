"""Robots without a world, as their positions show them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, cast

from monitor.live.positions_source import PositionsSource
from monitor.observation.source import Trapped
from patrol.journal.records import Status
from patrol.pose import Pose
from patrol.prepare import prepare
from patrol.radio.message import Position, encode
from patrol.scenario import load_scenario
from runtime.messages.telemetry import TRAPPED, Telemetry, Traffic, pack_view
from runtime.net.mailbox import Mailbox, Presence
from runtime.security.keys import WORLD, fleet_keys
from tests.present import present

SCENARIO: dict[str, Any] = {
    "terrain": {"builtin": "yards"},
    "point": 1.0,
    "step": 1.0,
    "robots": [{"name": "anna", "model": "holonomic"}, {"name": "bert", "spare": True}],
}


KEYS = fleet_keys("real-1")


class Ears:
    """A link on which the test speaks."""

    mesh = None

    def __init__(self) -> None:
        self.subscribed: dict[str, Mailbox[Any]] = {}

    def subscribe(self, key: str, mailbox: Mailbox[Any]) -> None:
        self.subscribed[key] = mailbox

    watch: Callable[[Ears, str, Mailbox[Any]], None] = subscribe

    def close(self) -> None:
        pass

    def seen(self, key: str, most: int) -> list[str]:
        """The robots that are there."""
        del most
        return [key.replace("*", name) for name in ("anna", "bert", WORLD)]

    def answers_until(self, keys: tuple[str, ...], order: bytes, longest: int, wait_s: float) -> Iterator[Any]:
        """One robot answers; the other one does not."""
        del longest, wait_s
        self.ordered = (keys, order)
        yield keys[0], b"done stopped by an operator"


def source_of(ears: Ears, clock: list[float], **more: bool) -> Any:
    """A viewer of robots whose links are these ears."""
    prepared, link = prepare(load_scenario(SCENARIO)), cast(Any, ears)
    return PositionsSource(KEYS, prepared, link, link, lambda: clock[0], **more)


def hear(ears: Ears, name: str, k: int, pose: Pose) -> None:
    """Have a robot's position come."""
    frame = encode(Position.of(1 + (name == "bert"), k + 1, float(k), pose))
    ears.subscribed[KEYS.position("*")].deliver(KEYS.position(name), frame)


def test_a_robot_that_stays_is_said_to_be_trapped_and_how_long_it_has_been_is_unknown() -> None:
    ears, clock = Ears(), [0.0]
    source = source_of(ears, clock)
    assert [robot.spare for robot in source.static().robots] == [False, True]
    state = None
    for k in range(200):
        clock[0] = k + 0.5
        hear(ears, "anna", k, Pose(50.0 + k % 2, 20.0, 0.0))
        state = source.wait(0.0) or state
    assert [robot.trapped for robot in present(state).robots] == [Trapped(0.0, exact=False), None]
    (event,) = source.events(0)
    assert (event.kind, event.robot) == (TRAPPED, 1)
    assert "since before 0 s" in event.detail


def test_a_robot_that_does_not_hear_another_one_is_told_by_its_reports() -> None:
    ears, clock = Ears(), [0.0]
    source = source_of(ears, clock)
    ears.subscribed[KEYS.alive("*")].put(KEYS.alive("bert"), Presence(True))
    state = None
    for k in range(12):
        clock[0] = k + 0.5
        hear(ears, "bert", k, Pose(50.0, 20.0, 0.0))
        report = Telemetry(k, "patrolling", None, None, None, 9, 1.5, 0, Traffic(0, 0, {"bert": 0}, 0, False))
        ears.subscribed[KEYS.telemetry("*")].deliver(KEYS.telemetry("anna"), pack_view(report))
        state = source.wait(0.0) or state
    assert [robot.radio_wrong for robot in present(state).robots] == ["does not hear bert", ""]


def test_only_an_operators_page_stops_robots_and_each_answers_for_itself() -> None:
    ears = Ears()
    viewer, operator = source_of(ears, [0.0]), source_of(ears, [0.0], may_stop=True)
    assert viewer.static().controls == ()
    assert not viewer.control({"do": "stop"}).done
    assert operator.static().controls == ("stop", "release")
    answer = operator.control({"do": "stop"})
    assert ears.ordered == ((KEYS.stop("anna"), KEYS.stop("bert")), b"stop")
    assert not answer.done
    assert answer.text == "anna: stopped by an operator; bert: no answer; use another way"
    assert not operator.control({"do": "fault", "fault": {"kind": "loss"}}).done


def test_a_robot_that_an_operator_has_stopped_is_stopped_and_not_trapped() -> None:
    ears, clock = Ears(), [0.0]
    source = source_of(ears, clock)

    def go_on(until: int, stopped: str) -> Any:
        state: Any = None
        for k in range(int(clock[0]), until):
            clock[0] = float(k)
            hear(ears, "anna", k, Pose(6.0, 6.0, 0.0))
            report = Telemetry(k, "patrolling", None, None, None, 9, 1.5, 0, stopped=stopped)
            ears.subscribed[KEYS.telemetry("*")].deliver(KEYS.telemetry("anna"), pack_view(report))
            state = source.wait(0.0) or state
        return state.robots[0]

    robot = go_on(400, "stopped by an operator (fogwatch control ... release)")
    assert (robot.status, robot.state, robot.trapped) == (Status.PAUSED, "stopped by an operator", None)
    assert not source.events(0)
    released = go_on(402, "")
    assert (released.status, released.state, released.trapped) == (Status.ALIVE, "patrolling", None)


def test_a_robot_is_lost_once_it_has_been_silent_for_longer_than_others_remember_it() -> None:
    ears, clock = Ears(), [0.0]
    source = source_of(ears, clock)
    forget_s = prepare(load_scenario(SCENARIO)).scenario.radio.forget_after
    ears.subscribed[KEYS.alive("*")].put(KEYS.alive("bert"), Presence(True))
    hear(ears, "anna", 0, Pose(50.0, 20.0, 0.5))
    found = {}
    state: Any = None
    for k in range(round(forget_s) + 3):
        clock[0] = k + 0.25
        state = present(source.wait(0.0))
        found[k] = [(robot.status, robot.heard_s) for robot in state.robots]
        assert (state.k, state.time_s, state.ticks_per_s, state.pace) == (k, float(k), 1.0, 1.0)
    assert found[0] == [(Status.ALIVE, 0.0), (Status.LOST, None)]
    assert found[round(forget_s)][0] == (Status.ALIVE, forget_s)
    assert found[round(forget_s) + 1][0] == (Status.LOST, forget_s + 1.0)
    pose = state.robots[0].pose
    assert (pose.x, pose.y, pose.heading) == (50.0, 20.0, 0.5)
    assert source.events(0)[0].kind == "connected"
    ears.subscribed[KEYS.alive("*")].put(KEYS.alive("bert"), Presence(False))
    clock[0] += 1.0
    assert present(source.wait(0.0)).robots[1].status is Status.ABSENT
    assert [event.kind for event in source.events(1)] == ["disconnected"]


def test_what_a_robot_reports_is_shown_and_the_measures_are_of_what_was_heard() -> None:
    ears, clock = Ears(), [0.0]
    source = source_of(ears, clock)
    assert present(source.wait(0.0)).note == "no position received yet"
    report = Telemetry(1, "holding", (1.0, 2.0), None, None, 9, 1.5, 0, charge=0.25)
    hear(ears, "anna", 0, Pose(50.0, 20.0, 0.0))
    ears.subscribed[KEYS.telemetry("*")].deliver(KEYS.telemetry("anna"), pack_view(report))
    clock[0] = 1.5
    state = present(source.wait(0.0))
    anna = state.robots[0]
    assert (anna.state, anna.goal, anna.decision_ms, anna.charge) == ("holding", (1.0, 2.0), 1.5, 0.25)
    assert state.note == ""
    refined = Telemetry(2, "holding", (1.0, 2.0), (3.0, 4.0), None, 9, 1.5, 0)
    ears.subscribed[KEYS.telemetry("*")].deliver(KEYS.telemetry("anna"), pack_view(refined))
    clock[0] = 4.0
    state = present(source.wait(0.0))
    assert state.robots[0].goal == (3.0, 4.0)
    series = source.series(-1)
    assert series.ticks.tolist() == [0, 1, 4]
    assert series.mfow_s.tolist() == [0.0, 1.0, 4.0]  # most was never seen
    assert (state.mfow_s, state.fog_mean_s) == (4.0, series.fog_mean_s[-1])
    assert source.series(0).ticks.tolist() == [1, 4]
    assert source.series(4).ticks.tolist() == []
    assert source.last_seen("heard").max() == 0
    assert source.last_seen("truth") is None
    assert (source.tick("heard"), source.since("heard")) == (4, 0)
    shape = source.static().robots[1]
    assert (shape.number, shape.name, shape.model, shape.spare) == (2, "bert", "car", True)
