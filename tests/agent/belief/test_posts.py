"""Posts: what they stand for, and the staleness they carry."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.belief.dilated import Posts
from agent.kernels.changes import NOTHING, SIDE, carry


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


def test_a_terrain_without_hidden_points_has_no_posts() -> None:
    posts = Posts(np.full((3, 3), -1, dtype=np.int32))
    assert posts.rows.shape == (0, 4)
    assert posts.gap == 0
