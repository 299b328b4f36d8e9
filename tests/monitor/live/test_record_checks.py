"""Records of a feed at the limits of what can be of its run."""

from dataclasses import replace
from typing import Any

import pytest

from monitor.live.record_checks import RunChecks, record_of
from patrol.journal import End, Event, RobotTick, Status, TickRecord, pack
from runtime.messages.feed import longest_record
from runtime.security.control_auth import MAX_CONTROL

CHECKS = RunChecks((1, 2), 10, (-1.0, -2.0, 30.0, 40.0), longest_record(2))
ROW = RobotTick(1, Status.ALIVE, 1.0, 2.0, 0.5, 0.0, 0.0, False, "holding", None, 1.0, 0)
OTHER = replace(ROW, number=2)
TICK = TickRecord(3, (ROW, OTHER), ((1, b"frame"),), ((1, 2, 3),), ((2, 1, 3, "loss"),), 4, 3.5, 9)


def tick(**changed: Any) -> TickRecord:
    return replace(TICK, **changed)


def row(**changed: Any) -> TickRecord:
    return replace(TICK, robots=(ROW, replace(OTHER, **changed)))


@pytest.mark.parametrize(
    ("fits", "beyond"),
    [
        *((row(x=good), row(x=bad)) for good, bad in ((-1.0, -1.01), (30.0, 30.01))),
        *((row(y=good), row(y=bad)) for good, bad in ((-2.0, -2.01), (40.0, 40.01))),
        *((row(heading=good), row(heading=bad)) for good, bad in ((1e6, 1.1e6), (-1e6, -1.1e6))),
        (row(state="s" * 500), row(state="s" * 501)),
        *((row(status=status, x=99.0), row(status=Status.DEAD, x=99.0)) for status in (Status.ABSENT, Status.LEFT)),
        (tick(k=9), tick(k=10)),
        (TICK, tick(robots=(ROW,))),
        (TICK, tick(robots=(OTHER, ROW))),
        (TICK, tick(robots=(ROW, replace(OTHER, number=3)))),
        (tick(frames=((0, b"f" * 65_536),)), tick(frames=((0, b"f" * 65_537),))),
        (tick(frames=((2, b""),)), tick(frames=((3, b""),))),
        (tick(deliveries=((0, 2, 2**62),)), tick(deliveries=((0, 2, 2**62 + 1),))),
        (tick(deliveries=((2, 0, 3),)), tick(deliveries=((3, 1, 3),))),
        (TICK, tick(deliveries=((1, 3, 3),))),
        (tick(dropped=((0, 2, 3, "c" * 500),)), tick(dropped=((0, 2, 3, "c" * 501),))),
        (TICK, tick(dropped=((1, 3, 3, "c"),))),
        (tick(copies=((1, 2, 3, "c"),)), tick(copies=((3, 2, 3, "c"),))),
        (tick(delayed=((1, 2, 3, "c"),)), tick(delayed=((1, 2, 2**62 + 1, "c"),))),
        (tick(forged=("f" * 500,)), tick(forged=("f" * 501,))),
        (tick(mfow=4), tick(mfow=5)),
        (tick(fog_mean=4.0), tick(fog_mean=4.01)),
    ],
)
def test_a_tick_fits_its_run_up_to_each_limit(fits: TickRecord, beyond: TickRecord) -> None:
    assert CHECKS.tick(fits)
    assert not CHECKS.tick(beyond)


@pytest.mark.parametrize(
    ("event", "fits"),
    [
        (Event(10, "dead", 2, "d"), True),
        (Event(11, "dead", 2, "d"), False),
        (Event(0, "note", None, "d" * MAX_CONTROL), True),
        (Event(0, "note", None, "d" * (MAX_CONTROL + 1)), False),
        (Event(0, "dead", 3, "d"), False),
    ],
)
def test_an_event_fits_its_run_up_to_each_limit(event: Event, fits: bool) -> None:
    assert CHECKS.event(event) == fits
    assert CHECKS.record(pack(event), 0) == (event if fits else None)
    assert CHECKS.events([pack(event), b"none", pack(TICK)]) == ([event] if fits else [])


def test_only_the_next_tick_follows_and_an_end_is_short() -> None:
    assert CHECKS.record(pack(TICK), 3) == TICK
    assert CHECKS.record(pack(TICK), 2) is CHECKS.record(pack(TICK), 4) is None
    end = End("e" * MAX_CONTROL, "0" * 64)
    assert CHECKS.record(pack(end), 4) == end
    assert CHECKS.record(pack(replace(end, reason="e" * (MAX_CONTROL + 1))), 4) is None


def test_longer_records_than_there_are_are_not_looked_at() -> None:
    packed = pack(TICK)
    assert record_of(packed, len(packed)) == TICK
    assert record_of(packed, len(packed) - 1) is None
    assert record_of(b"nothing") is None
