"""Frames by link, from ticks that are written down here."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from monitor.observation.link_counts import LinkLog, LiveLinks
from monitor.observation.source import LinkCounts
from patrol.journal.records import FORGED, Status

NUMBERS = (3, 7, 9)


def tick(k: int, frames: str = "", deliveries: str = "", present: tuple[int, ...] = NUMBERS) -> Any:
    """A tick in which robots send ("3 7") and hear ("3>7"); 0 is the forger."""
    rows = [
        SimpleNamespace(number=number, status=Status.ALIVE if number in present else Status.ABSENT)
        for number in NUMBERS
    ]
    pairs = [tuple(map(int, pair.split(">"))) for pair in deliveries.split()]
    return SimpleNamespace(
        k=k,
        robots=rows,
        frames=[(int(source), b"") for source in frames.split()],
        copies=(),
        deliveries=[(source, to, k) for source, to in pairs],
    )


TICKS = [
    tick(0),
    tick(1, "3 7", "3>7 3>9"),
    tick(2, "3 0", "7>9 0>9"),
    tick(3, "9 9", "9>3 9>3"),
    *(tick(k) for k in range(4, 130)),
    tick(130, "7", "7>3"),
]


def rows_of(counts: LinkCounts) -> list[list[list[int]]]:
    return [grid.tolist() for grid in (counts.sent, counts.delivered, counts.heard)]


NOTHING = [[[0] * 3] * 3, [[0] * 3] * 3, [[-1] * 3] * 3]
AT_3 = [[[0, 2, 2], [1, 0, 1], [2, 2, 0]], [[0, 1, 1], [0, 0, 1], [2, 0, 0]], [[-1, 1, 1], [-1, -1, 2], [3, -1, -1]]]
AT_130 = [[[0, 2, 2], [2, 0, 2], [2, 2, 0]], [[0, 1, 1], [1, 0, 1], [2, 0, 0]], [[-1, 1, 1], [130, -1, 2], [3, -1, -1]]]


@pytest.mark.parametrize(("k", "expected"), [(0, NOTHING), (3, AT_3), (64, AT_3), (129, AT_3), (130, AT_130)])
def test_counts_of_a_run_are_those_up_to_a_tick(k: int, expected: list[list[list[int]]]) -> None:
    log = LinkLog({number: place for place, number in enumerate(NUMBERS)})
    for record in TICKS:
        assert log.at(record.k) is None
        log.tick(record)
    counts = log.at(k)
    assert counts is not None
    assert rows_of(counts) == expected
    assert counts.since == 0


def test_a_live_page_counts_the_same_and_knows_when_each_was_heard_by_anybody() -> None:
    live = LiveLinks(NUMBERS, 5, direct=False)
    assert rows_of(live.counts) == NOTHING
    for record in TICKS[:4]:
        live.tick(record)
    assert rows_of(live.counts) == AT_3
    assert live.heard == {3: 1, 7: 2, 9: 3}
    assert live.counts.since == 5
    live.tick(TICKS[-1])
    assert rows_of(live.counts) == AT_130
    assert live.heard == {3: 1, 7: 130, 9: 3}


@pytest.mark.parametrize(("direct", "present"), [(True, NUMBERS), (False, (3,))])
def test_where_nobody_else_hears_who_sends_counts_as_heard(direct: bool, present: tuple[int, ...]) -> None:
    live = LiveLinks(NUMBERS, 0, direct=direct)
    live.tick(tick(4, "3 0", present=present))
    assert live.heard == {3: 4}
    assert FORGED not in live.heard
    assert np.all(live.counts.heard == -1)


def test_with_another_robot_there_sending_alone_is_not_being_heard() -> None:
    live = LiveLinks(NUMBERS, 0, direct=False)
    live.tick(tick(4, "3", present=(3, 7)))
    assert live.heard == {}
