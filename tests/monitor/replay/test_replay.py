from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monitor.replay.player import Player
from monitor.replay.replay import Replay, play
from monitor.replay.run import open_run
from monitor.replay.visits import VisitCounter
from patrol.errors import BadInput
from patrol.journal.records import Status
from patrol.prepare import sensor_footprint
from patrol.radio.message import as_received
from tests.monitor.conftest import QUIET, run_of, shorten_range
from tests.present import present

CHOSEN = (7, 41, 78)
"""Ticks at which the replay is held against the run's own fog."""


@pytest.mark.parametrize("which", ["quiet", "faulty", "hazy"])
@pytest.mark.parametrize("order", [CHOSEN, CHOSEN[::-1], (78, 7, 41)], ids=str)
@pytest.mark.parametrize("memory", [0, 1 << 26])
def test_the_fog_is_the_runs_own(
    which: str, order: tuple[int, ...], memory: int, request: pytest.FixtureRequest
) -> None:
    seen = request.getfixturevalue(which)
    replay = Replay(seen.open(), memory)
    for k in order:
        assert np.array_equal(replay.fog(k).last_seen, seen.truth[k])


@pytest.mark.parametrize("which", ["quiet", "hazy"])
def test_every_tick_backwards_and_forwards(which: str, request: pytest.FixtureRequest) -> None:
    seen = request.getfixturevalue(which)
    run = seen.open()
    replay = Replay(run)
    for k in [*range(run.ticks - 1, -1, -1), *range(run.ticks)]:
        fog = replay.fog(k)
        assert np.array_equal(fog.last_seen, seen.truth[k])
        assert (fog.mfow(k), fog.seen) == (run.mfow[k], run.seen[k])
        assert fog.mean(k) == pytest.approx(run.fog_mean[k])


def test_there_is_nothing_beyond_the_end(quiet: Any) -> None:
    replay = Replay(quiet.open())
    for k in (-1, replay.run.ticks):
        with pytest.raises(BadInput, match="ticks 0 to 79"):
            replay.fog(k)


def test_a_fog_that_is_not_the_runs_is_noticed(quiet: Any, copied: Callable[..., Path]) -> None:
    assert play(quiet.open(), []) is None
    folder = copied(quiet)
    shorten_range(folder)
    run = open_run(folder)
    assert play(run, []) is not None
    # Jumps do not trust the journal's MFoW either.
    assert all(Replay(run).fog(k).last_seen.max() == k for k in (79, 3, 40))


def test_spare_robots_that_never_came_are_not_shown(tmp_path: Path) -> None:
    faults = [{"kind": "join", "who": "r5", "at": 5}, {"kind": "kill", "who": "all", "at": 12}]
    robots = {**QUIET["robots"], "spare": 2}
    run = run_of(tmp_path, {**QUIET, "duration": 15, "robots": robots, "faults": faults}).open()
    assert run.names == ("r1", "r2", "r3", "r5")
    assert present(run.stated.verdict).valid
    assert play(run, []) is None
    assert (run.numbers[-1], run.status[14, -1]) == (5, Status.ALIVE)
    assert run.status[28].tolist() == [Status.DEAD] * 4
    assert len(present(Player(run).wait(1.0)).robots) == len(Player(run).static().robots) == 4


@pytest.mark.parametrize("which", ["quiet", "faulty", "hazy"])
def test_sums_over_visits_are_those_of_every_tick(which: str, request: pytest.FixtureRequest) -> None:
    """Against the plain way: all ages of all points in all ticks."""
    seen = request.getfixturevalue(which)
    run = seen.open()
    counted = run.prepared.patrolled
    counter = VisitCounter(counted, run.ticks)
    assert play(run, [counter]) is None
    found = counter.result()

    ages = np.array([k - np.maximum(seen.truth[k], 0) for k in range(run.ticks)])
    assert np.allclose(found.mean, np.where(counted, ages.mean(axis=0), 0.0))
    assert np.array_equal(found.worst, np.where(counted, ages.max(axis=0), 0))
    assert found.worst.max() == run.mfow.max()
    assert found.mean[counted].mean() == pytest.approx(run.fog_mean.mean())

    footprint = sensor_footprint(run.prepared.scenario, run.prepared.terrain)
    looked = np.zeros((run.ticks, *counted.shape), dtype=bool)
    for k in range(run.ticks):
        for _, pose in run.alive(k):
            view = footprint.visible(as_received(pose))
            for row, col in np.argwhere(view.mask) + np.array([view.row0, view.col0]):
                if 0 <= row < counted.shape[0] and 0 <= col < counted.shape[1]:
                    looked[k, row, col] = counted[row, col]
    gaps = np.zeros(run.ticks + 1, dtype=np.int64)
    for row, col in np.argwhere(counted):
        waits = np.diff(np.flatnonzero(looked[:, row, col]))
        np.add.at(gaps, waits[waits > 1], 1)
    assert np.array_equal(found.gaps, gaps)
    assert np.array_equal(found.never, counted & ~looked.any(axis=0))
