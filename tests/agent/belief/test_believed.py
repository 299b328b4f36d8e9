"""The belief: fog from positions alone, its dilatation kept up to date, trails, and silent peers."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from agent.belief.believed import Area, Belief, Beliefs
from agent.belief.posts import Posts
from agent.kernels.dilate import dilate
from agent.view import FogView
from patrol.ground.fog import AGELESS, Fog
from patrol.ground.footprint import Footprint
from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.radio.inbox import Inboxes, Rules
from patrol.radio.message import Position, encode
from tests.agent.minds import STEP, fields_of

OPEN = np.ones((40, 50), dtype=np.bool_)


def belief_on(
    passable: NDArray[np.bool_], dilatation: int, sensor: float = 4.0, quality: float = 1.0, ahead: int = 0
) -> tuple[Belief, Footprint]:
    terrain = Terrain("t", passable, 0.5)
    fields = fields_of(passable)
    footprint = footprint_of(terrain, sensor, quality=quality)
    inboxes = Inboxes([1], Rules((1, 2, 3), terrain.bounds, 10.0, None, STEP, ahead))
    area = Area(fields.patrolled, fields.reach, Posts(fields.proxy), dilatation)
    return Beliefs(inboxes, footprint).join(1, area), footprint


def frame(robot: int, k: int, x: float, y: float, trail: tuple[tuple[int, int], ...] = ()) -> bytes:
    return encode(Position.of(robot, k, k * STEP, Pose(x, y, 0.0), trail))


@settings(max_examples=25)
@given(seed=st.integers(0, 10**6), dilatation=st.integers(0, 4), walls=st.sampled_from([0.0, 0.1]))
def test_the_dilated_fog_is_always_what_dilating_all_of_it_would_give(seed: int, dilatation: int, walls: float) -> None:
    rng = np.random.default_rng(seed)
    passable = rng.random((40, 50)) >= walls
    passable[0, 0] = True
    belief, _ = belief_on(passable, dilatation)
    x, y = 10.0, 10.0
    for k in range(12):
        x, y = (float(np.clip(v + rng.normal(0, 2), 0, limit)) for v, limit in ((x, 24.9), (y, 19.9)))
        heard = [frame(2, k, 24.0 - k, 5.0), frame(3, k, 3.0, 15.0 - k)]
        belief.hear(k, Pose(x, y, 0.0), heard)
        whole = np.empty_like(belief.fog.last_seen)
        grid = passable.view(np.uint8)
        dilate(belief.fog.last_seen, grid, grid, whole, 0, 39, 0, 49, dilatation, k, np.zeros(0, dtype=np.uint16))
        known = np.where(passable, np.maximum(belief.dilated, 0), 0)
        assert np.array_equal(known, np.where(passable, whole, 0))


@pytest.mark.parametrize("hears", [True, False])
def test_a_robot_believes_what_it_and_those_that_it_hears_have_seen(hears: bool) -> None:
    belief, footprint = belief_on(OPEN, 2)
    truth = Fog(OPEN)
    for k in range(20):
        own, peer = Pose(2.0 + k * 0.5, 5.0, 0.0), Pose(20.0 - k * 0.5, 15.0, 0.0)
        belief.hear(k, own, [frame(2, k, peer.x, peer.y)] if hears else [])
        for pose in (own, peer) if hears else (own,):
            truth.observe(footprint.visible(pose), k)
        assert np.array_equal(belief.fog.last_seen, truth.last_seen)
        assert belief.fog.mfow(k) == truth.mfow(k)


def test_garbage_changes_nothing_and_is_counted() -> None:
    belief, other = belief_on(OPEN, 2)[0], belief_on(OPEN, 2)[0]
    own = Pose(5.0, 5.0, 0.0)
    junk = [b"", b"\xc1", b"x" * 1000, frame(9, 0, 3.0, 3.0), frame(1, 0, 3.0, 3.0), frame(2, 0, 500.0, 3.0)]
    belief.hear(0, own, junk)
    other.hear(0, own, [])
    assert np.array_equal(belief.dilated, other.dilated)
    assert belief.rejected == sum(belief.refused.values()) == len(junk)


@pytest.mark.parametrize("dilatation", [0, 2])
def test_what_is_no_ground_has_no_age_where_there_are_no_posts(dilatation: int) -> None:
    """Straight paths lead through walls, which nobody ever sees."""
    passable = np.ones((20, 30), dtype=np.bool_)
    passable[5:9, 10:20] = False
    belief, _ = belief_on(passable, dilatation)
    for k in range(4):
        belief.hear(k, Pose(3.0 + k, 5.0, 0.0), [])
    assert (belief.dilated[~passable] == AGELESS).all()
    assert (belief.dilated[passable] <= 3).all()


@pytest.mark.parametrize("dilatation", [1, 3])
def test_what_is_left_out_makes_nothing_look_stale(dilatation: int) -> None:
    """Ground behind a closed door would have the ages of the ground before it exceed that of the stalest point."""
    belief, _ = belief_on(OPEN, dilatation, sensor=8.0)
    for k in range(20):
        belief.hear(k, Pose(5.0, 2.0 + 16.0 * (k % 10) / 9.0, 0.0), [])
    fog = FogView(belief, OPEN, Posts(np.full(OPEN.shape, -1, dtype=np.int32)))
    left_out = fog.last_seen < 3
    assert fog.dilated[~left_out].min() == 0
    fog.leave_out(left_out, None)
    assert (fog.dilated[left_out] == AGELESS).all()
    assert fog.dilated[~left_out].min() == fog.last_seen[~left_out].min() == 19 - fog.mfow(19) >= 3
    fog.leave_out(None, None)
    assert fog.dilated[~left_out].min() == 0


def test_a_point_that_is_not_patrolled_has_no_age() -> None:
    terrain = Terrain("t", OPEN, 0.5)
    patrolled = np.zeros_like(OPEN)
    patrolled[10, 10] = patrolled[10, 14] = True
    posts = Posts(np.full(OPEN.shape, -1, dtype=np.int32))
    inboxes = Inboxes([1], Rules((1,), terrain.bounds, 10.0, None, STEP, 0))
    belief = Beliefs(inboxes, footprint_of(terrain, 1.0)).join(1, Area(patrolled, patrolled, posts, 3))
    for k in range(5):
        belief.hear(k, Pose(5.25, 5.25, 0.0), [])
    for grid in (belief.fog.last_seen, belief.dilated):
        assert (grid[~patrolled] == AGELESS).all()
    assert belief.fog.mfow(4) == 4


def test_a_look_counts_once_whether_a_frame_or_a_trail_tells_of_it() -> None:
    """With a quality of one half, two looks would leave a quarter of the age."""
    place, trail = (15.0, 5.0), ((0, 0), (0, 0))

    def heard(arrivals: dict[int, list[bytes]]) -> NDArray[np.int32]:
        belief, _ = belief_on(OPEN, 0, quality=0.5)
        for k in range(20):
            belief.hear(k, Pose(1.0, 19.0, 0.0), arrivals.get(k, []))
        return belief.fog.last_seen

    once = heard({10: [frame(2, 10, *place)], 11: [frame(2, 11, *place)], 12: [frame(2, 12, *place)]})
    filled = heard({10: [frame(2, 10, *place)], 12: [frame(2, 12, *place, trail=trail), frame(2, 11, *place)]})
    assert np.array_equal(heard({10: [frame(2, 10, *place)], 11: [], 12: [frame(2, 12, *place, trail=trail)]}), filled)
    told_twice = {k: [frame(2, k, *place, trail=trail[: k - 10]), frame(2, k, *place)] for k in (10, 11, 12)}
    assert np.array_equal(once, heard(told_twice))
    assert once[10, 30] > 0


def test_a_frame_from_the_future_dates_late_ones_into_no_past() -> None:
    belief, _ = belief_on(OPEN, 0, ahead=60)
    belief.hear(0, Pose(1.0, 19.0, 0.0), [frame(2, 60, 15.0, 5.0), frame(2, 3, 15.0, 5.0)])
    assert belief.fog.last_seen.min() == -1
    assert belief.rejected == 0


@settings(max_examples=30)
@given(seed=st.integers(0, 10**6), loss=st.sampled_from([0.0, 0.3, 0.6]), late=st.booleans(), length=st.integers(0, 4))
def test_trails_and_late_frames_give_what_each_look_gives(seed: int, loss: float, late: bool, length: int) -> None:
    """Whatever is lost, late or told twice, the fog is that of the looks that were told of at all, each at its tick."""
    rng = np.random.default_rng(seed)
    belief, footprint = belief_on(OPEN, 0)
    expected, own = Fog(OPEN), Pose(1.0, 19.0, 0.0)
    places = [(4.0 + 0.5 * k, 5.0 + 3.0 * (k % 2)) for k in range(30)]
    arrivals: dict[int, list[int]] = {}
    for k in range(30):
        # The first frame is the quickest, so that all others can be dated by it.
        delay = int(rng.integers(0, 6)) if late and k else 0
        if k == 0 or rng.random() >= loss:
            arrivals.setdefault(k + delay, []).append(k)
    looks: set[int] = set()
    newest = heard_at = 0
    for tick in range(40):
        expected.observe(footprint.visible(own), tick)
        frames = []
        for k in sorted(arrivals.get(tick, [])):
            past = [places[k - ago] for ago in range(min(length, k) + 1)]
            steps = [(old[0] - new[0], old[1] - new[1]) for new, old in pairwise(past)]
            trail = tuple((round(100 * across), round(100 * up)) for across, up in steps)
            frames.append(frame(2, k, *places[k], trail=trail))
            if k > newest:
                newest, heard_at = k, tick
            for ago in range(min(length, k) + 1):
                if k - ago not in looks:
                    looks.add(k - ago)
                    at = heard_at - (newest - k) - ago
                    expected.observe(footprint.visible(Pose(*places[k - ago], 0.0)), at)
        belief.hear(tick, own, frames)
    assert belief.rejected == 0
    assert np.array_equal(belief.fog.last_seen, expected.last_seen)
