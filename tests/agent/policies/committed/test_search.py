from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from agent.policies.committed.kernels.rivals import rivals_within
from agent.policies.committed.search import Decay, least_lengths
from patrol.scenario import CommittedOptions

PLACE = st.integers(-40, 40)


@given(st.lists(st.tuples(PLACE, PLACE), max_size=20), PLACE, PLACE, st.integers(0, 15), st.integers(0, 15), PLACE)
def test_rivals_count_from_which_a_way_over_open_ground_is_short_enough(
    others: list[tuple[int, int]], top: int, left: int, height: int, width: int, reach: int
) -> None:
    box, limit = (top, top + height, left, left + width), 100 * abs(reach) + 41
    places = np.array(others, dtype=np.int64).reshape(-1, 2)
    found = np.empty_like(places)
    count = rivals_within(places, limit, *box, found)
    to_box = np.clip(places, (box[0], box[2]), (box[1], box[3]))
    away = np.abs(places - to_box)
    expected = places[least_lengths(away[:, 0], away[:, 1]) <= limit]
    assert found[:count].tolist() == expected.tolist()


def test_what_is_remembered_of_the_law_is_forgotten_with_its_unit() -> None:
    decay = Decay(CommittedOptions(), 0.5)
    before = decay.from_on(1000, 5000, 1000).copy()
    assert before.tolist() == decay.of(np.arange(1000, 5000, 1000)).tolist()
    decay.stretch(2.0)
    after = decay.from_on(1000, 5000, 1000)
    assert after.tolist() == decay.of(np.arange(1000, 5000, 1000)).tolist()
    assert (after > before).all()
