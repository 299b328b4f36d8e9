"""Ages and gaps of a ground of a few points, against adding them up tick by tick."""

import numpy as np
import pytest

from monitor.replay.replay import VisitCounter
from patrol.ground.fog import Fog
from patrol.ground.footprint import View

LOOKS = {
    "one at once": [[(0, 0)], [], [(0, 0)], [], [], [(0, 0)], []],
    "late": [[], [], [(1, 1)], [(1, 1)], [], [(2, 2)], [(1, 2)]],
    "two in a tick": [[(0, 0), (0, 1)], [], [], [(0, 1), (1, 1)], [(0, 1)], [], [(0, 0), (0, 0)]],
    "over the edge": [[(-1, -1)], [(2, 3)], [(-1, 3)], [], [(2, -1)], [(-1, -1)], [(2, 3)]],
    "none": [[], [], []],
}


@pytest.mark.parametrize("looks", LOOKS.values(), ids=LOOKS)
def test_ages_and_gaps_of_a_few_points(looks: list[list[tuple[int, int]]]) -> None:
    patrolled = np.ones((3, 4), dtype=np.bool_)
    patrolled[0, 2] = False
    mask = np.array([[1, 1], [1, 0]], dtype=np.uint8)
    fog, counter = Fog(patrolled), VisitCounter(patrolled, len(looks))
    seen = np.zeros((len(looks), 3, 4), dtype=np.bool_)
    for k, corners in enumerate(looks):
        views = [View(row0, col0, mask) for row0, col0 in corners]
        counter.before(k, fog, views)
        for row0, col0 in corners:
            for row, col in ((row0, col0), (row0, col0 + 1), (row0 + 1, col0)):
                if 0 <= row < 3 and 0 <= col < 4:
                    seen[k, row, col] = patrolled[row, col]
        for view in views:
            fog.observe(view, k)
        counter.after(k, fog)
    found = counter.result()
    for row, col in np.ndindex(3, 4):
        ticks: list[int] = np.flatnonzero(seen[:, row, col]).tolist()
        ages = [k - max([0, *(tick for tick in ticks if tick <= k)]) for k in range(len(looks))]
        expected = (np.mean(ages), max(ages)) if patrolled[row, col] else (0.0, 0)
        assert (found.mean[row, col], found.worst[row, col]) == pytest.approx(expected)
        assert found.never[row, col] == (patrolled[row, col] and not ticks)
    waits = [wait for row, col in np.ndindex(3, 4) for wait in np.diff(np.flatnonzero(seen[:, row, col])) if wait > 1]
    assert found.gaps.tolist() == np.bincount(waits, minlength=len(looks) + 1).tolist()
