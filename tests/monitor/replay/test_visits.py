import numpy as np
import pytest

from monitor.replay.replay import VisitCounter, play
from patrol.prepare import sensor_footprint
from patrol.radio.message import as_received


@pytest.mark.parametrize("which", ["quiet", "faulty", "hazy"])
def test_sums_are_those_of_every_tick(which: str, request: pytest.FixtureRequest) -> None:
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
