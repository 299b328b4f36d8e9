"""Means, intervals and fits, against scipy and by hand."""

import math

import numpy as np
import pytest
import scipy
from hypothesis import given
from hypothesis import strategies as st

from experiments.sweeps.stats import estimate, fit
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


def test_a_fit_by_hand() -> None:
    found = fit([100.0, 200.0, 800.0], [100.0, 100.0, 400.0])
    assert found.cells == 3
    assert found.median_ratio == pytest.approx(2.0)
    assert found.rms_log_error == pytest.approx(math.log(2.0) * math.sqrt(2.0 / 3.0))
    ours, theirs = ([math.log(value) for value in values] for values in ([100, 200, 800], [100, 100, 400]))
    assert found.correlation == pytest.approx(scipy.stats.pearsonr(ours, theirs).statistic)


def test_a_fit_to_numbers_that_do_not_vary_has_no_correlation() -> None:
    assert fit([1.0, 2.0], [3.0, 3.0]).correlation is None
    assert fit([1.0], [3.0]).correlation is None
    with pytest.raises(ValueError, match="as many"):
        fit([1.0], [1.0, 2.0])
