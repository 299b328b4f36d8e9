"""Robots without a world, as their positions show them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from monitor.live.positions_source import PositionsSource
from monitor.observation.source import Trapped
from patrol.messages.telemetry import TRAPPED, Telemetry, Traffic, pack_view
from patrol.net.mailbox import Mailbox, Presence
from patrol.pose import Pose
from patrol.prepare import prepare
from patrol.radio.message import Position, encode
from patrol.scenario import load_scenario
from patrol.security.keys import WORLD, fleet_keys

SCENARIO: dict[str, Any] = {
    "terrain": {"builtin": "yards"},
    "point": 1.0,
    "step": 1.0,
    "robots": [{"name": "anna", "model": "holonomic"}, {"name": "bert", "spare": True}],
}


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


def test_a_robot_that_stays_is_said_to_be_trapped_and_how_long_it_has_been_is_unknown() -> None:
    keys, ears, clock = fleet_keys("real-1"), Ears(), [0.0]
    source: Any = PositionsSource(keys, prepare(load_scenario(SCENARIO)), ears, ears, lambda: clock[0])  # type: ignore[arg-type]
    assert [robot.spare for robot in source.static().robots] == [False, True]
    state = None
    for k in range(200):
        clock[0] = k + 0.5
        frame = encode(Position.of(1, k + 1, float(k), Pose(50.0 + k % 2, 20.0, 0.0)))
        ears.subscribed[keys.position("*")].deliver(keys.position("anna"), frame)
        state = source.wait(0.0) or state
    assert state is not None
    assert [robot.trapped for robot in state.robots] == [Trapped(0.0, exact=False), None]
    (event,) = source.events(0)
    assert (event.kind, event.robot) == (TRAPPED, 1)
    assert "since before 0 s" in event.detail


def test_a_robot_that_does_not_hear_another_one_is_told_by_its_reports() -> None:
    keys, ears, clock = fleet_keys("real-1"), Ears(), [0.0]
    source: Any = PositionsSource(keys, prepare(load_scenario(SCENARIO)), ears, ears, lambda: clock[0])  # type: ignore[arg-type]
    ears.subscribed[keys.alive("*")].put(keys.alive("bert"), Presence(True))
    state = None
    for k in range(12):
        clock[0] = k + 0.5
        frame = encode(Position.of(2, k + 1, float(k), Pose(50.0, 20.0, 0.0)))
        ears.subscribed[keys.position("*")].deliver(keys.position("bert"), frame)
        report = Telemetry(k, "patrolling", None, None, None, 9, 1.5, 0, Traffic(0, 0, {"bert": 0}, 0, False))
        ears.subscribed[keys.telemetry("*")].deliver(keys.telemetry("anna"), pack_view(report))
        state = source.wait(0.0) or state
    assert state is not None
    assert [robot.radio_wrong for robot in state.robots] == ["does not hear bert", ""]


def test_only_an_operators_page_stops_robots_and_each_answers_for_itself() -> None:
    keys, ears = fleet_keys("real-1"), Ears()
    prepared = prepare(load_scenario(SCENARIO))
    viewer = PositionsSource(keys, prepared, ears, ears)  # type: ignore[arg-type]
    assert viewer.static().controls == ()
    assert not viewer.control({"do": "stop"}).done
    operator = PositionsSource(keys, prepared, ears, ears, may_stop=True)  # type: ignore[arg-type]
    assert operator.static().controls == ("stop", "release")
    answer = operator.control({"do": "stop"})
    assert ears.ordered == ((keys.stop("anna"), keys.stop("bert")), b"stop")
    assert not answer.done
    assert answer.text == "anna: stopped by an operator; bert: no answer; use another way"
    assert not operator.control({"do": "fault", "fault": {"kind": "loss"}}).done
