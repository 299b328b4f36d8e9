"""The statistical checks: few false alarms, whenever one stops counting, and power against another radio."""

import math

import numpy as np
import pytest

from worldsim.checks.check import Series, enough, evidence, unexplained

# Not the product's own, so that a wrong one there is noticed.
FAMILY = 1e-9


@pytest.mark.parametrize("p", [0.01, 0.3, 0.5, 0.97])
def test_the_evidence_is_a_martingale(p: float) -> None:
    """Its mean over the next draw is what it was; so its mean over all runs of any length is 1."""
    for hits, draws in ((0, 0), (3, 7), (40, 50)):
        after = [p * math.exp(evidence(hits + 1, draws + 1, p)), (1 - p) * math.exp(evidence(hits, draws + 1, p))]
        assert sum(after) == pytest.approx(math.exp(evidence(hits, draws, p)))


@pytest.mark.parametrize("p", [0.05, 0.3, 0.9])
def test_false_alarms_are_as_rare_as_promised_even_when_one_may_stop_at_will(p: float) -> None:
    """4000 runs of 400 draws, at one in a hundred: an alarm at any time in a run counts."""
    rng = np.random.default_rng(5)
    hits = np.cumsum(rng.random((4000, 400)) < p, axis=1)
    table = np.array([[evidence(x, n, p) if x <= n else 0.0 for x in range(401)] for n in range(1, 401)])
    ever = (table[np.arange(400)[None, :], hits] >= math.log(100.0)).any(axis=1)
    assert ever.mean() <= 0.01 + 3.0 * math.sqrt(0.01 * 0.99 / 4000)


@pytest.mark.parametrize(("asked", "done", "draws"), [(0.5, 0.55, 10_000), (0.1, 0.13, 12_000), (0.9, 0.8, 1500)])
def test_a_radio_that_loses_more_or_less_is_found_out(asked: float, done: float, draws: int) -> None:
    rng = np.random.default_rng(6)
    found = [unexplained(int(hits), draws, asked, FAMILY) for hits in rng.binomial(draws, done, size=300)]
    assert np.mean(found) > 0.99
    assert not any(unexplained(int(hits), draws, asked, FAMILY) for hits in rng.binomial(draws, asked, size=3000))


def test_a_certainty_is_contradicted_by_one_draw() -> None:
    assert unexplained(1, 10, 0.0, FAMILY)
    assert unexplained(9, 10, 1.0, FAMILY)
    assert not unexplained(0, 10**6, 0.0, FAMILY)
    assert not unexplained(10**6, 10**6, 1.0, FAMILY)


def test_too_few_draws_say_nothing() -> None:
    assert not enough(0, 0.0, FAMILY)
    assert not enough(20, 0.5, FAMILY)
    assert enough(40, 0.5, FAMILY)
    assert enough(1, 0.0, FAMILY)
    assert not any(unexplained(hits, 20, 0.5, FAMILY) for hits in range(21))


def test_a_series_counts_every_draw_and_every_hit() -> None:
    hits = [k % 3 == 0 or k % 7 == 0 for k in range(500)]
    series = Series(0.4, "{hits} of {draws}", "")
    for hit in hits:
        series.add(hit)
    assert (series.hits, series.draws, series.found()) == (sum(hits), 500, f"{sum(hits)} of 500")
