from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from patrol.radio.replay_window import SPAN, ReplayWindow


@given(st.lists(st.integers(0, 200) | st.integers(0, 2**32 - 1), max_size=200))
def test_a_window_is_a_set_that_forgets_the_old(sequences: list[int]) -> None:
    window = ReplayWindow()
    used: set[int] = set()
    for sequence in sequences:
        newest = max(used, default=-1)
        fresh = sequence not in used and sequence > newest - SPAN
        assert window.fresh(sequence) == fresh
        assert window.use(sequence) == fresh
        used.add(sequence)
        assert window.newest == max(used)
        assert not window.fresh(sequence)
