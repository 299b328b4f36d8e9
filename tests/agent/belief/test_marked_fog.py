"""A fog without counts answers as the one with counts."""

from __future__ import annotations

import numpy as np

from agent.belief.kernels.look import look, show
from agent.belief.marked_fog import MarkedFog
from patrol.ground.fog import Fog
from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import Terrain
from patrol.pose import Pose

PASSABLE = np.ones((30, 40), dtype=np.bool_)
PASSABLE[10:20, 15:18] = False


def test_it_answers_as_a_fog_that_counts() -> None:
    rng = np.random.default_rng(1)
    terrain = Terrain("test", PASSABLE, 1.0)
    footprint = footprint_of(terrain, 6.0)
    counted, marked, at_once = Fog(PASSABLE), MarkedFog(PASSABLE), MarkedFog(PASSABLE)
    for tick in range(60):
        poses = [Pose(x, y, 0.0) for x, y in rng.uniform((0.0, 0.0), (40.0, 30.0), (3, 2)).tolist()]
        views = [footprint.visible(pose) for pose in poses]
        for view in views:
            counted.observe(view, tick)
            marked.observe(view, tick)
        masks = np.stack([view.mask for view in views])
        rows, cols = (np.array([getattr(view, name) for view in views], dtype=np.int64) for name in ("row0", "col0"))
        show(masks, rows, cols, at_once.patrolled)
        look(at_once.last_seen, masks, rows, cols, np.ones(3, dtype=np.uint8), tick)
        for fog in (marked, at_once):
            assert np.array_equal(fog.last_seen, counted.last_seen)
            assert (fog.mfow(tick), fog.seen) == (counted.mfow(tick), counted.seen)
            assert fog.mean(tick) == counted.mean(tick)
            assert counted.last_seen[fog.stalest()] == counted.last_seen[counted.stalest()]
    late, forked = footprint.visible(Pose(3.0, 3.0, 0.0)), marked.fork()
    counted.observe(late, 5)
    forked.observe(late, 5)
    assert np.array_equal(forked.last_seen, counted.last_seen)
    forked.observe(late, 99)
    assert marked.last_seen.max() < 99


def test_a_look_beyond_the_terrain_changes_nothing() -> None:
    terrain = Terrain("test", PASSABLE, 1.0)
    fog = MarkedFog(PASSABLE)
    assert fog.observe(footprint_of(terrain, 2.0).visible(Pose(500.0, 3.0, 0.0)), 3) is None
    assert fog.seen == 0
