from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monitor.replay.player import Player
from monitor.replay.replay import Replay, play
from monitor.replay.run import open_run
from patrol.errors import BadInput
from patrol.journal.records import Status
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
