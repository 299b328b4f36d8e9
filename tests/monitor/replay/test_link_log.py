from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from monitor.observation.source import LinkCounts
from monitor.replay.run import Run, open_run
from monitor.replay.run_log import RunLog
from patrol.journal.records import TickRecord, frame_sequence
from tests.monitor.conftest import QUIET, Seen, rewritten, run_of
from tests.monitor.live.test_feed_source import played
from tests.present import present

LATE: dict[str, Any] = {
    **QUIET,
    "name": "late",
    "duration": 80,
    "faults": [
        {"kind": "delay", "delay": {"uniform": [0.0, 3.0]}},
        {"kind": "loss", "rate": 0.5},
        {"kind": "duplicate", "rate": 0.2, "delay": {"constant": 1}, "at": 20},
        {"kind": "spoof", "by": "stranger", "as": "r1", "payload": "freeze", "at": 30, "for": 10},
    ],
}
"""160 ticks: more than two blocks."""


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> Seen:
    return run_of(tmp_path_factory.mktemp("late"), LATE)


@pytest.fixture(scope="module")
def late(seen: Seen) -> Run:
    return seen.open()


def at(log: RunLog, k: int) -> LinkCounts:
    while (links := log.links.at(k)) is None:
        log.read()
    return links


def of_summary(run: Run, what: str) -> NDArray[np.int64]:
    links = run.stated.document()["links"]
    return np.array([[links[a][b][what] if a != b else 0 for b in run.names] for a in run.names], dtype=np.int64)


def test_a_live_page_a_replay_a_report_and_the_summary_count_alike(seen: Seen, late: Run) -> None:
    live, replayed = present(played(seen)[1].links), at(RunLog(late), late.ticks - 1)
    for what in ("sent", "delivered"):
        for counts in (getattr(live, what), getattr(late.links, what)[1:, 1:], of_summary(late, what)):
            np.testing.assert_array_equal(counts, getattr(replayed, what))
    np.testing.assert_array_equal(live.heard, replayed.heard)
    assert of_summary(late, "in_flight").sum() > 0


def test_frames_that_arrive_at_once_count_each_at_every_tick_in_any_order(late: Run) -> None:
    log = RunLog(late)
    delivered = np.zeros((3, 3), dtype=np.int64)
    heard = np.full((3, 3), -1, dtype=np.int64)
    wanted = []
    for record in late.journal.ticks:
        for source, to, _ in record.deliveries:
            if source:
                delivered[source - 1, to - 1] += 1
                heard[source - 1, to - 1] = record.k
        wanted.append((delivered.copy(), heard.copy()))
    assert np.diff([one[0, 1] for one, _ in wanted]).max() > 1
    for k in (159, 0, 63, 64, 127, 128, 5, *range(100, 140)):
        links = at(log, k)
        np.testing.assert_array_equal(links.delivered, wanted[k][0])
        np.testing.assert_array_equal(links.heard, wanted[k][1])


def test_contacts_count_as_in_the_summary(quiet: Any, tmp_path: Path) -> None:
    """Every robot also reports a contact in each tick, and everybody hears of it."""

    def contacts(record: TickRecord) -> TickRecord:
        also = [(source, to, frame_sequence(record.k, 1)) for source, to, _ in record.deliveries]
        frames = [pair for source, frame in record.frames for pair in ((source, frame), (source, frame))]
        return replace(record, frames=tuple(frames), deliveries=(*record.deliveries, *also))

    run = open_run(rewritten(quiet, tmp_path / "contacts", contacts))
    links = at(RunLog(run), run.ticks - 1)
    assert links.delivered[0, 1] == 2 * run.ticks
    np.testing.assert_array_equal(links.sent, of_summary(run, "sent"))
    np.testing.assert_array_equal(links.delivered, of_summary(run, "delivered"))
