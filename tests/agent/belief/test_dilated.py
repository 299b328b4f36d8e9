"""Dilatation where it is read and where something changed, against dilating all of the fog anew."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from agent.belief.dilated import Dilated
from agent.belief.posts import Posts
from agent.kernels.changes import NOTHING, SIDE, WIDEST, boxes_due, carry
from agent.kernels.dilate import dilate
from patrol.ground.fog import AGELESS, Box, Fog

SHAPE = (70, 90)


def anew(fog: Fog, ground: NDArray[np.bool_], proxy: NDArray[np.int32], reach: int, tick: int) -> NDArray[np.int32]:
    """The dilated ticks of all points, with the staleness of hidden points carried to their posts first."""
    carried = np.maximum(fog.last_seen, 0)
    hidden = np.flatnonzero(proxy >= 0)
    np.minimum.at(carried.reshape(-1), proxy.reshape(-1)[hidden], np.maximum(fog.last_seen.reshape(-1)[hidden], 0))
    whole, passable = np.full(ground.shape, AGELESS, dtype=np.int32), ground.view(np.uint8)
    box = 0, ground.shape[0] - 1, 0, ground.shape[1] - 1
    dilate(carried, passable, passable, whole, *box, reach, tick, np.zeros(0, dtype=np.uint16))
    return whole


def look(fog: Fog, dice: np.random.Generator, tick: int) -> Box | None:
    """A rectangle of points is seen; the box of what changed."""
    top, left = (int(dice.integers(0, size)) for size in SHAPE)
    part = slice(top, top + int(dice.integers(1, 25))), slice(left, left + int(dice.integers(1, 25)))
    changed = np.argwhere((fog.last_seen[part] < tick) & (fog.patrolled[part] != 0)) + np.array([top, left])
    fog.last_seen[part] = np.where(fog.patrolled[part] != 0, tick, fog.last_seen[part])
    if not len(changed):
        return None
    (low, first), (high, last) = changed.min(axis=0), changed.max(axis=0)
    return int(low), int(high), int(first), int(last)


@settings(max_examples=40)
@given(
    seed=st.integers(0, 2**32 - 1),
    reach=st.sampled_from([0, 1, 5, 16, 17, 70]),
    walls=st.sampled_from([0.0, 0.02, 0.3]),
    hidden=st.booleans(),
)
def test_what_is_read_is_what_dilating_everything_anew_gives(seed: int, reach: int, walls: float, hidden: bool) -> None:
    dice = np.random.default_rng(seed)
    ground = dice.random(SHAPE) >= walls
    ground[:3, :3] = True
    proxy = np.full(SHAPE, -1, dtype=np.int32)
    if hidden:
        beside = np.argwhere(~ground)
        for row, col in beside[dice.random(len(beside)) < 0.5]:
            near = np.argwhere(ground[max(0, row - 4) : row + 5, max(0, col - 4) : col + 5])
            if len(near):
                up, across = dice.choice(near)
                proxy[row, col] = (max(0, row - 4) + up) * SHAPE[1] + max(0, col - 4) + across
    fog = Fog(ground | (proxy >= 0))
    dilated = Dilated(fog, ground, Posts(proxy), reach)
    for tick in range(12):
        looks = [look(fog, dice, tick) for _ in range(int(dice.integers(0, 4)))]
        dilated.changed([box for box in looks if box is not None])
        rows, cols = (np.sort(dice.integers(-10, size + 10, 2)) for size in SHAPE)
        box = int(rows[0]), int(rows[1]), int(cols[0]), int(cols[1])
        part = slice(max(0, box[0]), max(0, box[1] + 1)), slice(max(0, box[2]), max(0, box[3] + 1))
        found = dilated.within(box, tick)
        assert np.array_equal(found[part], anew(fog, ground, proxy, reach, tick)[part])
    whole = 0, SHAPE[0] - 1, 0, SHAPE[1] - 1
    assert np.array_equal(dilated.within(whole, 12), anew(fog, ground, proxy, reach, 12))


def test_ground_wider_than_a_box_is_dilated_by_boxes_of_blocks_near_obstacles_and_of_others() -> None:
    ground = np.ones((300, 2 * WIDEST), dtype=np.bool_)
    ground[100:200, 200] = ground[40, 300:] = False
    fog, proxy = Fog(ground), np.full(ground.shape, -1, dtype=np.int32)
    dilated = Dilated(fog, ground, Posts(proxy), 20)
    for tick, (top, left) in enumerate([(0, 0), (90, 150), (90, 230), (20, 280), (180, 400), (210, 30)]):
        fog.last_seen[top : top + 80, left : left + 80] = np.where(ground[top : top + 80, left : left + 80], tick, -1)
        dilated.changed([(top, top + 79, left, left + 79)])
        found = dilated.within((0, ground.shape[0] - 1, 0, ground.shape[1] - 1), tick)
        assert np.array_equal(found, anew(fog, ground, proxy, 20, tick))


@settings(max_examples=100)
@given(seed=st.integers(0, 2**32 - 1), reach=st.sampled_from([1, 10, 50]), share=st.sampled_from([0.02, 0.3, 1.0]))
def test_boxes_hold_all_blocks_that_are_due_and_no_block_beyond_the_range(seed: int, reach: int, share: float) -> None:
    dice, (height, width) = np.random.default_rng(seed), (20 * SIDE - 3, 30 * SIDE - 7)
    due = (dice.random((20, 30)) < share).astype(np.uint8)
    clear, before = (dice.random((20, 30)) < 0.8).astype(np.uint8), due.copy()
    first_row, last_row, first_col, last_col = 2, 18, 1, 29
    boxes = np.zeros((due.size, 4), dtype=np.int64)
    count = boxes_due(due, clear, height, width, first_row, last_row, first_col, last_col, reach, boxes)
    inside = np.zeros((20, 30), dtype=np.bool_)
    inside[first_row : last_row + 1, first_col : last_col + 1] = True
    in_boxes = np.zeros((20, 30), dtype=np.bool_)
    for top, bottom, left, right in boxes[:count].tolist():
        assert bottom - top < WIDEST
        assert right - left < WIDEST
        assert bottom < height
        assert right < width
        in_boxes[top // SIDE : bottom // SIDE + 1, left // SIDE : right // SIDE + 1] = True
    assert in_boxes[inside & (before != 0)].all()
    assert not in_boxes[~inside].any()
    assert np.array_equal(due, np.where(inside, 0, before))


@pytest.mark.parametrize("reach", [0, 5, 16])
def test_a_fork_goes_its_own_way_from_what_both_know_and_have_yet_to_compute(reach: int) -> None:
    dice = np.random.default_rng(reach)
    ground, proxy = dice.random(SHAPE) >= 0.1, np.full(SHAPE, -1, dtype=np.int32)
    fogs, whole = [Fog(ground)], (0, SHAPE[0] - 1, 0, SHAPE[1] - 1)
    dilated = [Dilated(fogs[0], ground, Posts(proxy), reach)]
    for tick in range(12):
        for fog, one in zip(fogs, dilated, strict=True):
            looks = [look(fog, dice, tick) for _ in range(3)]
            one.changed([box for box in looks if box is not None])
        if tick in (4, 8):
            dilated[0].within((20, 40, 20, 40), tick)
            fogs.append(fogs[0].fork())
            dilated.append(dilated[0].fork(fogs[-1]))
    for fog, one in zip(fogs, dilated, strict=True):
        assert np.array_equal(one.within(whole, 12), anew(fog, ground, proxy, reach, 12))
    assert not np.array_equal(fogs[0].last_seen, fogs[1].last_seen)


@pytest.mark.parametrize("box", [(-50, -20, 0, 9), (0, 9, 200, 300), (5, 4, 0, 9)])
def test_a_box_without_ground_changes_nothing(box: Box) -> None:
    ground = np.ones(SHAPE, dtype=np.bool_)
    fog = Fog(ground)
    dilated = Dilated(fog, ground, Posts(np.full(SHAPE, -1, dtype=np.int32)), 3)
    assert (dilated.within(box, 0) == 0).all()


# --- posts -----------------------------------------------------------------------------------------------------------


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_post_carries_the_oldest_of_what_it_sees(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = (9, 11)
    reach = rng.random(shape) < 0.5
    reach[4, 4] = True
    places = np.flatnonzero(reach)
    proxy = np.full(shape, -1, dtype=np.int32)
    hidden = ~reach & (rng.random(shape) < 0.7)
    proxy[hidden] = rng.choice(places, np.count_nonzero(hidden))
    posts = Posts(proxy)
    last_seen = rng.integers(-1, 100, shape).astype(np.int32)
    before = np.maximum(last_seen, 0)
    carried = before.copy()
    outdated = np.full((1, 1), NOTHING, dtype=np.int32)
    assert max(shape) <= SIDE
    ends = np.array([0, len(posts.rows)])
    carry(posts.rows, ends, last_seen, carried, outdated, 0, 0, 0, 0)
    for place in places:
        row, col = divmod(int(place), shape[1])
        seen = [int(last_seen[row, col]), *(int(v) for v in last_seen[proxy == place])]
        assert carried[row, col] == max(min(seen), 0)
    moved = carried != before
    assert outdated[0, 0] == (before[moved].min() if moved.any() else NOTHING)


def test_entries_are_found_by_their_posts_rows() -> None:
    proxy = np.full((6, 5), -1, dtype=np.int32)
    proxy[0, 0] = 2 * 5 + 1
    proxy[5, 4] = 4 * 5 + 3
    proxy[1, 1] = 2 * 5 + 1
    posts = Posts(proxy)
    assert posts.rows.tolist() == [[0, 0, 2, 1], [1, 1, 2, 1], [5, 4, 4, 3]]
    assert posts.gap == 2
    assert posts.between(0, 2).tolist() == [[0, 0, 2, 1], [1, 1, 2, 1]]
    assert posts.between(3, 4).tolist() == [[5, 4, 4, 3]]
    assert len(posts.between(5, 9)) == 0
    assert len(posts.between(-9, 1)) == 0
    assert posts.between(-9, 9).tolist() == posts.rows.tolist()
    none = Posts(np.full((3, 3), -1, dtype=np.int32))
    assert (none.rows.shape, none.gap) == ((0, 4), 0)
