"""Robots without a world, as their positions show them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from monitor.live.positions_source import PositionsSource
from monitor.observation.source import Trapped
from patrol.net.keys import fleet_keys
from patrol.net.mailbox import Mailbox
from patrol.net.messages.telemetry import TRAPPED
from patrol.pose import Pose
from patrol.prepare import prepare
from patrol.radio.message import Position, encode
from patrol.scenario import load_scenario

SCENARIO: dict[str, Any] = {
    "terrain": {"builtin": "yards"},
    "point": 1.0,
    "step": 1.0,
    "robots": [{"name": "anna", "model": "holonomic"}, {"name": "bert", "spare": True}],
}


class Bytes(bytes):
    """A payload."""

    def to_bytes(self) -> bytes:
        return bytes(self)


class Ears:
    """A link on which the test speaks."""

    def __init__(self) -> None:
        self.subscribed: dict[str, Mailbox[Any]] = {}

    def subscribe(self, key: str, mailbox: Mailbox[Any]) -> None:
        self.subscribed[key] = mailbox

    watch: Callable[[Ears, str, Mailbox[Any]], None] = subscribe

    def close(self) -> None:
        pass


def test_a_robot_that_stays_is_said_to_be_trapped_and_how_long_it_has_been_is_unknown() -> None:
    keys, ears, clock = fleet_keys("real-1"), Ears(), [0.0]
    source: Any = PositionsSource(keys, prepare(load_scenario(SCENARIO)), ears, ears, lambda: clock[0])  # type: ignore[arg-type]
    assert [robot.spare for robot in source.static().robots] == [False, True]
    state = None
    for k in range(200):
        clock[0] = k + 0.5
        frame = encode(Position.of(1, k + 1, float(k), Pose(50.0 + k % 2, 20.0, 0.0)))
        ears.subscribed[keys.position("*")].deliver(keys.position("anna"), Bytes(frame))
        state = source.wait(0.0) or state
    assert state is not None
    assert [robot.trapped for robot in state.robots] == [Trapped(0.0, exact=False), None]
    (event,) = source.events(0)
    assert (event.kind, event.robot) == (TRAPPED, 1)
    assert "since before 0 s" in event.detail
