import hashlib
import struct
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from patrol.journal.links import WholeLinks, to_others
from patrol.journal.records import RobotTick, Status, TickRecord
from patrol.journal.trace import TraceHash, trace_hash

CAR = RobotTick(1, Status.ALIVE, 1.25, -2.5, 0.5, 4.4, 0.1, False, "patrolling", (3.0, 4.0), 1.5, 0)
GONE = RobotTick(2, Status.DEAD, 7.0, 8.0, -1.0, 0.0, 0.0, False, "", None, None, None)
TICK = TickRecord(3, (CAR, GONE), ((1, b"frame"),), ((1, 2, 3), (2, 1, 3)), ((1, 2, 3, "dead"),), 12, 3.5, 99)


def test_the_hash_is_of_the_documented_bytes() -> None:
    """Published hashes stay comparable only while this layout stays."""
    data = struct.pack("<qI", 3, 2)
    data += struct.pack("<HB5d", 1, 1, 1.25, -2.5, 0.5, 4.4, 0.1)
    data += struct.pack("<HB5d", 2, 3, 7.0, 8.0, -1.0, 0.0, 0.0)
    data += struct.pack("<HHIHHIIq", 1, 2, 3, 2, 1, 3, 2, 12)
    assert trace_hash([TICK]) == hashlib.sha256(data).hexdigest()


def test_a_hash_can_be_read_on_the_way() -> None:
    trace = TraceHash()
    assert trace.hexdigest() == trace_hash([])
    trace.tick(TICK)
    assert trace.hexdigest() == trace_hash([TICK])
    trace.tick(replace(TICK, k=4))
    assert trace.hexdigest() == trace_hash([TICK, replace(TICK, k=4)])


@pytest.mark.parametrize(
    "other",
    [
        replace(TICK, robots=(replace(CAR, state="dead-end", goal=None, decision_ms=9.9, rejected=7), GONE)),
        replace(TICK, deliveries=TICK.deliveries[::-1]),
        replace(TICK, dropped=(), frames=(), fog_mean=0.0, seen=0),
    ],
)
def test_diagnostics_and_the_order_of_delivery_do_not_matter(other: TickRecord) -> None:
    assert trace_hash([other]) == trace_hash([TICK])


@pytest.mark.parametrize(
    "other",
    [
        *({"k": 4}, {"mfow": 13}, {"robots": (GONE, CAR)}, {"robots": (CAR,)}, {"deliveries": TICK.deliveries[:1]}),
        *({"deliveries": ((1, 2, 3), (2, 1, sequence))} for sequence in (4, 3 + 2**32)),
        {"deliveries": ((1, 2, 3), (1, 2, 3), (2, 1, 3))},
        *({"robots": (car, GONE)} for car in (replace(CAR, x=0.125), replace(CAR, y=-2.5000000000000004))),
        *({"robots": (car, GONE)} for car in (replace(CAR, heading=0.125), replace(CAR, status=Status.PAUSED))),
        *({"robots": (car, GONE)} for car in (replace(CAR, c0=0.125), replace(CAR, c1=0.125))),
        {"robots": (CAR, replace(GONE, c0=-0.0))},
    ],
)
def test_whatever_happened_matters(other: dict[str, Any]) -> None:
    assert trace_hash([replace(TICK, **other)]) != trace_hash([TICK])


def test_a_spare_robot_is_no_robot_of_a_tick_before_it_has_joined() -> None:
    waiting = replace(GONE, number=3, status=Status.ABSENT)
    with_it = replace(TICK, robots=(CAR, GONE, waiting))
    assert trace_hash([with_it], {3}) == trace_hash([TICK])
    assert trace_hash([with_it]) != trace_hash([TICK])
    joined = replace(TICK, robots=(CAR, GONE, replace(waiting, status=Status.LEFT)))
    assert trace_hash([joined], {3}) == trace_hash([joined])


@pytest.mark.parametrize("sources", [(1, 2, 3), (2, 1, 3), (1, 1, 2)])
@pytest.mark.parametrize("latest", [7, 2**40])
def test_links_of_which_none_is_missing_hash_as_their_rows(sources: tuple[int, ...], latest: int) -> None:
    whole = WholeLinks(to_others(sources, (1, 2, 3)).pairs, np.array([7, 8, latest]))
    assert trace_hash([replace(TICK, deliveries=whole)]) == trace_hash([replace(TICK, deliveries=tuple(whole))])
