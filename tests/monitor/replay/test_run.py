"""A run's journal as arrays: shares of links, and journals that do not fit their scenario."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monitor.replay.run import LinkTotals, open_run
from patrol.errors import BadInput
from patrol.journal.records import Status, TickRecord
from tests.monitor.conftest import rewritten


def test_the_share_of_a_link_is_of_the_frames_that_were_delivered_or_dropped() -> None:
    zero = np.zeros((3, 3), dtype=np.int64)
    delivered, weak, lossy = zero.copy(), zero.copy(), zero.copy()
    delivered[1, 2], weak[1, 2], lossy[1, 2] = 6, 1, 3
    lossy[2, 1] = 2
    delivered[0, 1] = 5  # forged
    none = np.zeros(4, dtype=np.int64)
    totals = LinkTotals(zero, delivered, {"range": weak, "loss": lossy}, 0, none, none)
    assert totals.lost.tolist() == [[0, 0, 0], [0, 0, 4], [0, 2, 0]]
    share = totals.share()
    assert share.shape == (2, 2)
    assert np.isnan(np.diag(share)).all()
    assert (share[0, 1], share[1, 0]) == (0.6, 0.0)
    assert LinkTotals(zero, zero, {}, 0, none, none).lost.tolist() == zero.tolist()


def test_each_robots_values_are_in_its_own_column(quiet: Any, tmp_path: Path) -> None:
    def told(record: TickRecord) -> TickRecord:
        rows = [
            replace(
                row,
                bumped=row.number == 2,
                state=f"s{row.number}" if record.k % 2 else "",
                goal=(10.0 * row.number, 0.5) if row.number != 3 else None,
                decision_ms=None if row.number == 1 else 1.5 * row.number,
            )
            for row in record.robots
        ]
        return replace(record, robots=tuple(rows))

    run = open_run(rewritten(quiet, tmp_path / "told", told))
    assert run.bumped.any(axis=0).tolist() == [False, True, False]
    assert [[run.labels[code] for code in codes] for codes in run.states[:2]] == [["", "", ""], ["s1", "s2", "s3"]]
    assert run.goals[5, :2].tolist() == [[10.0, 0.5], [20.0, 0.5]]
    assert np.isnan(run.goals[:, 2]).all()
    assert np.isnan(run.decision_ms[:, 0]).all()
    assert run.decision_ms[7, 1:].tolist() == [3.0, 4.5]
    assert run.times[:3].tolist() == [0.0, 0.5, 1.0]
    assert np.isnan(run.charge).all()
    assert run.charge.shape == (run.ticks, 3)
    assert run.positions == 3 * run.ticks
    assert [number for number, _ in run.alive(4)] == [1, 2, 3]
    number, pose = run.alive(4)[1]
    assert (number, [pose.x, pose.y, pose.heading]) == (2, run.poses[4, 1].tolist())


def test_only_the_living_take_part(quiet: Any, tmp_path: Path) -> None:
    def paused(record: TickRecord) -> TickRecord:
        statuses = {1: Status.PAUSED, 2: Status.ALIVE, 3: Status.DEAD}
        return replace(record, robots=tuple(replace(row, status=statuses[row.number]) for row in record.robots))

    run = open_run(rewritten(quiet, tmp_path / "paused", paused))
    assert [number for number, _ in run.alive(0)] == [2]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda record: None if record.k == 5 else record, "tick 5: its record is of tick 6"),
        (lambda _: None, "holds no complete tick"),
    ],
    ids=["a gap", "no tick"],
)
def test_a_journal_that_does_not_fit_is_refused(
    quiet: Any, tmp_path: Path, change: Callable[[TickRecord], TickRecord | None], words: str
) -> None:
    folder = rewritten_anyhow(quiet, tmp_path / "unfit", change)
    with pytest.raises(BadInput, match=words):
        open_run(folder)


def test_many_causes_of_loss_are_refused_beyond_a_limit(quiet: Any, tmp_path: Path) -> None:
    def lossy(most: int) -> Callable[[TickRecord], TickRecord]:
        def change(record: TickRecord) -> TickRecord:
            drops = [(1, 2, record.k, f"cause{number}") for number in range(most)] if record.k == 0 else []
            return replace(record, dropped=tuple(drops))

        return change

    assert len(open_run(rewritten_anyhow(quiet, tmp_path / "most", lossy(64))).links.dropped) == 64
    with pytest.raises(BadInput, match="frames were dropped for more than 64 causes"):
        open_run(rewritten_anyhow(quiet, tmp_path / "more", lossy(65)))


def rewritten_anyhow(seen: Any, folder: Path, change: Callable[[TickRecord], TickRecord | None]) -> Path:
    """Write a run's folder with another story in its journal, which nobody judges."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tests.monitor.conftest.write_summary", lambda *_: None)
        return rewritten(seen, folder, change)


@pytest.mark.parametrize(
    ("tagged", "key", "keyless"), [(False, None, False), (False, b"k", False), (True, None, True), (True, b"k", False)]
)
def test_a_run_is_keyless_if_its_messages_are_tagged_and_nobody_gave_the_key(
    quiet: Any, tagged: bool, key: bytes | None, keyless: bool
) -> None:
    run = quiet.open()
    scenario = run.prepared.scenario
    radio = scenario.radio.model_copy(update={"key": Path("fleet.key") if tagged else None})
    prepared = replace(run.prepared, scenario=scenario.model_copy(update={"radio": radio}))
    assert replace(run, prepared=prepared, key=key).keyless is keyless
    assert not run.direct


def test_a_run_over_direct_radio_says_so(quiet: Any) -> None:
    run = quiet.open()
    scenario = run.prepared.scenario
    radio = scenario.radio.model_copy(update={"via": "direct"})
    assert replace(run, prepared=replace(run.prepared, scenario=scenario.model_copy(update={"radio": radio}))).direct
