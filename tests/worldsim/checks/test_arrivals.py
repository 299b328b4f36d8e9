"""Parts of the checks of arrivals, by themselves."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from worldsim.checks.arrivals import mark_among

NUMBERS = st.lists(st.integers(-5, 5).map(lambda number: number << 48), unique=True)


@given(NUMBERS, NUMBERS)
def test_keys_are_marked_that_are_among_others_in_any_order(keys: list[int], some: list[int]) -> None:
    marks = mark_among(np.array(keys, dtype=np.int64), np.array(some, dtype=np.int64))
    assert marks.tolist() == [key in some for key in keys]
