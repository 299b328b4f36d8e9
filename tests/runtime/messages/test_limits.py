"""Messages and views at the limits of their fields: the limit is taken, what is just beyond it is refused."""

import math
from typing import Any

import msgpack
import pytest

from patrol.errors import Malformed
from patrol.exchange import MOST_BLOCKED, MOST_ZONES
from patrol.journal import RobotTick, Status, TickRecord
from patrol.wire import read
from runtime.messages.phases import Failed, PhaseB, decode_to_robot, decode_to_world, encode, max_to_robot
from runtime.messages.telemetry import Metrics, Notice, Telemetry, Watcher, longest_metrics, pack_view

HEAD = [1, 2, 3, 4]
"""Incarnation, instance, tick and run."""

PHASE_A: list[Any] = [1, *HEAD, 1.0, 2.0, 0.5, False, [], 1.5, None, [], None, []]
STOP = [3, *HEAD, True, "over"]
HELLO_REPLY = [0, *HEAD, "hash", 9]
REPLY_A = [1, *HEAD, [b"frame"]]
REPLY_B = [2, *HEAD, 2, 1.0, 2.0, None, "patrolling", None, 1.5, 7]


def is_taken(message: list[Any], place: int, value: Any, decode: Any) -> bool:
    """Return True if a message with a value in one place is decoded."""
    try:
        decode(msgpack.packb([*message[:place], value, *message[place + 1 :]]))
    except Malformed:
        return False
    return True


COUNT, ID = ([0, 2**31 - 1], [-1, 2**31, 1.0, True, None]), ([0, 2**63 - 1], [-1, 2**63, 1.0])
FINITE = ([-1e300, 1e300, 0.0], [math.inf, -math.inf, math.nan, "1", None])
TO_ROBOT: list[tuple[list[Any], int, tuple[list[Any], list[Any]]]] = [
    *((PHASE_A, place, COUNT) for place in (1, 3)),
    *((PHASE_A, place, ID) for place in (2, 4)),
    *((PHASE_A, place, FINITE) for place in (5, 6, 7, 10)),
    (PHASE_A, 8, ([True, False], [0, 1, None])),
    (PHASE_A, 9, ([[], [1.0] * 8], [[1.0], [1.0] * 10, [math.nan, 1.0], None])),
    (PHASE_A, 11, ([None, 0.0, 1.0], [math.nan, "1"])),
    (PHASE_A, 12, ([[], [0] * MOST_BLOCKED], [[0] * (MOST_BLOCKED + 1), [-1], None])),
    (PHASE_A, 13, ([None, [], [0] * MOST_ZONES, [63]], [[0] * (MOST_ZONES + 1), [64], [-1]])),
    (PHASE_A, 14, ([[], [[0, 0.001]], [[63, 1000.0]]], [[[0, 0.00099]], [[0, 1000.1]], [[64, 1.0]], [[0]]])),
    (STOP, 5, ([True, False], [0, 1])),
    (STOP, 6, (["", "r" * 400], ["r" * 401, "a\nb", "\x1b[2J", None])),
    ([2, *HEAD, []], 5, ([[], [b""], [b"f" * 64] * 9], [[b"f" * 65], ["f"], None])),
]
TO_WORLD: list[tuple[list[Any], int, tuple[list[Any], list[Any]]]] = [
    (HELLO_REPLY, 5, (["", "h" * 64], ["h" * 65, "a\nb", None])),
    (HELLO_REPLY, 6, COUNT),
    (REPLY_A, 5, ([[], [b"f"] * 5], [[b"f"] * 6, ["f"], None])),
    (REPLY_B, 5, ([0, 1, 2], [3, -1])),
    ([2, *HEAD, 0, *REPLY_B[6:]], 8, ([None, 0.5, -9.0, math.nan], ["x", 1, True])),
    (REPLY_B, 8, ([None], [0.5])),
    (REPLY_B, 9, (["", "s" * 32], ["s" * 33, "a\nb", None])),
    (REPLY_B, 10, ([None, [1.0, 2.0]], [[1.0], [1.0, 2.0, 3.0], [math.inf, 1.0]])),
    (REPLY_B, 11, FINITE),
    (REPLY_B, 12, ID),
    ([3, *HEAD, ""], 5, (["", "r" * 400], ["r" * 401, "a\nb", "\x1b[2J", 7, None, b"bytes"])),
]


@pytest.mark.parametrize(
    ("decode", "message", "place", "values"),
    [*((decode_to_robot, *case) for case in TO_ROBOT), *((decode_to_world, *case) for case in TO_WORLD)],
)
def test_a_message_keeps_its_limits(decode: Any, message: list[Any], place: int, values: Any) -> None:
    good, bad = values
    assert [value for value in good if not is_taken(message, place, value, decode)] == []
    assert [value for value in bad if is_taken(message, place, value, decode)] == []


def test_the_longest_messages_are_as_long_as_receivers_allow() -> None:
    frames = (b"f" * 64,) * (5 * 3)  # a position and four contacts of each of three robots
    blocked = [2**31 - 1] * MOST_BLOCKED
    assert len(encode(PhaseB(1, 2, 3, 4, frames))) <= max_to_robot(3)
    assert len(msgpack.packb([*PHASE_A[:12], blocked, *PHASE_A[13:]])) <= max_to_robot(1)
    assert max_to_robot(4) - max_to_robot(3) == 5 * 66
    assert len(encode(Failed(1, 2, 3, 4, "ä" * 500))) <= 2048


METRICS: dict[str, Any] = {
    "k": 3,
    "ticks": 10,
    "time_s": 1.5,
    "mfow_s": 2.0,
    "mfow_mean_s": 1.0,
    "mfow_max_s": 2.5,
    "seen_share": 0.5,
    "ticks_per_s": 40.0,
    "robots": [],
    "stalest": None,
}
VIEW: dict[str, Any] = {"name": "r1", "status": 1, "state": "", "x": 1.0, "y": 2.0, "heading": 0.5}
TELEMETRY: dict[str, Any] = {
    "k": 3,
    "state": "",
    "goal": None,
    "refined": None,
    "direction": None,
    "mfow": 2,
    "decision_ms": 1.5,
    "rejected": 0,
    "traffic": None,
}
Values = tuple[list[Any], list[Any]]
NUMBER: Values = ([-1e12, 1e12, 0.0], [-1.1e12, 1.1e12, math.nan, "1"])
AMOUNT: Values = ([0.0, 1e12], [-1e-9, 1.1e12, math.inf, math.nan, 1])
TEXT: Values = (["", "t" * 500], ["t" * 501, "a\nb", None])
VIEWS: list[tuple[type[Any], dict[str, Any], str, tuple[list[Any], list[Any]]]] = [
    (Metrics, METRICS, "k", ([1, 10], [-1, 0, 11, 1.0])),
    (Metrics, METRICS, "ticks", ([3], [2, 2**62])),
    (Metrics, METRICS, "robots", ([[]], [None, [1]])),
    *((Metrics, METRICS, name, AMOUNT) for name in ("time_s", "mfow_s", "mfow_mean_s", "mfow_max_s", "ticks_per_s")),
    (Metrics, METRICS, "seen_share", ([0.0, 1.0], [-1e-9, 1.0000001])),
    (Metrics, METRICS, "stalest", ([None, [1e12, -1e12]], [[1.1e12, 0.0], [1.0], [1.0, 2.0, 3.0]])),
    *(
        (
            Metrics,
            METRICS,
            "robots",
            ([[VIEW | {name: value}] for value in good], [[VIEW | {name: value}] for value in bad]),
        )
        for name, (good, bad) in {"x": NUMBER, "y": NUMBER, "heading": NUMBER, "state": TEXT, "name": TEXT}.items()
    ),
    (
        Metrics,
        METRICS,
        "robots",
        ([[VIEW | {"status": n}] for n in range(6)], [[VIEW | {"status": n}] for n in (-1, 6)]),
    ),
    *((Notice, {"k": 3, "kind": "", "robot": "", "detail": ""}, name, TEXT) for name in ("kind", "robot", "detail")),
    (Notice, {"k": 3, "kind": "", "robot": "", "detail": ""}, "k", ([0, 2**29 - 1], [-1, 2**29])),
    *((Telemetry, TELEMETRY, name, TEXT) for name in ("state", "stopped")),
    *((Telemetry, TELEMETRY, name, NUMBER) for name in ("direction", "decision_ms")),
    *((Telemetry, TELEMETRY, name, ([0, 2**63 - 1], [-1, 1.0, None])) for name in ("k", "mfow", "rejected")),
    *((Telemetry, TELEMETRY, name, ([None, [1e12, -1e12]], [[1.1e12, 0.0], [1.0]])) for name in ("goal", "refined")),
    (Telemetry, TELEMETRY, "charge", ([None, 0.0, 1.0], [-1e-9, 1.0000001])),
]


@pytest.mark.parametrize(("view", "says", "field", "values"), VIEWS)
def test_a_view_keeps_its_limits(view: type[Any], says: dict[str, Any], field: str, values: Any) -> None:
    good, bad = values
    for value in good:
        read(view, msgpack.packb(says | {field: value}))
    for value in bad:
        with pytest.raises(Malformed):
            read(view, msgpack.packb(says | {field: value}))


def test_the_longest_metrics_of_a_fleet_can_be_read() -> None:
    robots = [VIEW | {"name": "n" * 32, "state": "s" * 500}] * 100
    assert len(msgpack.packb(METRICS | {"robots": robots})) <= longest_metrics(100)
    assert longest_metrics(0) == 2**13
    assert longest_metrics(3) - longest_metrics(2) == 1000
    assert longest_metrics(65_000) == 2**22


def test_views_leave_out_that_nothing_stops_a_robot_and_that_it_has_no_battery() -> None:
    plain = Telemetry(3, "", None, None, None, 2, 1.5, 0)
    assert not {"stopped", "charge"} & msgpack.unpackb(pack_view(plain)).keys()
    held = Telemetry(3, "", None, None, None, 2, 1.5, 0, stopped="by hand", charge=0.0)
    assert read(Telemetry, pack_view(held)) == held
    assert msgpack.unpackb(pack_view(held))["charge"] == 0.0


def test_a_rate_is_that_of_the_last_three_seconds_and_metrics_come_every_tenth() -> None:
    now = [100.0]
    watcher = Watcher({1: "r1"}, points=100, step=0.5, ticks=1000, now=lambda: now[0])
    row = RobotTick(1, Status.ALIVE, 1.0, 2.0, 0.5, 0.0, 0.0, False, "", None, 1.0, 0)

    def rate(k: int, at_s: float) -> float | None:
        now[0] = at_s
        metrics = watcher.take(TickRecord(k, (row,), (), (), (), 2, 0.5, 50))
        return None if metrics is None else metrics.ticks_per_s

    assert rate(9, 101.0) == 10.0
    assert rate(19, 101.09) is None
    assert rate(19, 101.1) == pytest.approx(20 / 1.1)
    assert rate(39, 103.9) == pytest.approx(40 / 3.9)
    assert rate(49, 104.0) == pytest.approx(40 / 3.0)
    assert rate(999, 104.01) is not None, "the last tick is always told"
