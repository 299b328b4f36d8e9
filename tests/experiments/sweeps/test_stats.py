"""Means and intervals, against scipy and by hand."""

import numpy as np
import pytest
import scipy
from hypothesis import given
from hypothesis import strategies as st

from experiments.sweeps.stats import estimate
from tests.present import present

NUMBERS = st.lists(st.floats(min_value=-1e6, max_value=1e6), min_size=2, max_size=30)


@given(values=NUMBERS, confidence=st.sampled_from([0.8, 0.95, 0.99]))
def test_the_interval_is_students(values: list[float], confidence: float) -> None:
    found = estimate(values, confidence)
    spread = float(scipy.stats.sem(values))
    assert found.count == len(values)
    assert found.mean == pytest.approx(np.mean(values), abs=1e-6)
    assert found.low is not None
    assert found.high is not None
    if spread == 0.0:
        assert found.low == found.mean == found.high
    else:
        low, high = scipy.stats.t.interval(confidence, len(values) - 1, loc=np.mean(values), scale=spread)
        assert found.low == pytest.approx(low, abs=1e-5)
        assert found.high == pytest.approx(high, abs=1e-5)


def test_an_interval_excludes_zero_when_the_t_test_rejects() -> None:
    values = [0.3, 0.1, 0.5, 0.2, 0.4]
    found = estimate(values)
    assert present(found.low) > 0.0
    assert found.p == pytest.approx(scipy.stats.ttest_1samp(values, 0.0).pvalue, rel=1e-12)
    assert present(found.p) < 0.05


def test_one_value_has_no_interval_and_none_no_mean() -> None:
    alone = estimate([3.0])
    assert (alone.mean, alone.count) == (3.0, 1)
    assert [alone.low, alone.high, alone.half, alone.p] == [None] * 4
    with pytest.raises(ValueError, match="at least one value"):
        estimate([])
