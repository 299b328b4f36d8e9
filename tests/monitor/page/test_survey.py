import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from monitor.page.maps import Survey, survey_of
from patrol.ground.fog import NEVER

SHAPE = (7, 9)


@given(arrays(np.int32, SHAPE, elements=st.integers(NEVER, 4)), arrays(np.bool_, SHAPE))
def test_the_stalest_point_is_in_the_middle_of_the_stalest_ground(last_seen: np.ndarray, patrolled: np.ndarray) -> None:
    found = survey_of(last_seen, patrolled, 10)
    if not patrolled.any():
        assert found is None
        return
    assert found is not None
    oldest = last_seen[patrolled].min()
    places = np.argwhere(patrolled & (last_seen == oldest))
    distance = ((places - places.mean(axis=0)) ** 2).sum(axis=1)
    row, col = found.row, found.col
    assert patrolled[row, col]
    assert last_seen[row, col] == oldest
    assert ((np.array([row, col]) - places.mean(axis=0)) ** 2).sum() <= distance.min() + 1e-9
    assert found.age == 10 - max(oldest, 0)
    assert found.ever_seen == (oldest != NEVER)
    assert found.seen_share == (last_seen[patrolled] != NEVER).mean()


def test_a_fog_that_may_not_be_written_is_surveyed() -> None:
    last_seen, patrolled = np.zeros((2, 3), dtype=np.int32), np.ones((2, 3), dtype=np.bool_)
    last_seen[1, 2] = NEVER
    for grid in (last_seen, patrolled):
        grid.setflags(write=False)
    assert survey_of(last_seen, patrolled, 4) == Survey(1, 2, 4, False, 5 / 6)
