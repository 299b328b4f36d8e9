"""Paired tests: what they compare, and p-values that can be looked up."""

import csv
import io
from collections.abc import Mapping
from dataclasses import replace

import pytest

from experiments.sweeps.cases import PAIRING, TEST, CaseRow, comparisons_table, paired_tests
from experiments.sweeps.stats import estimate


def row(case: str, against: str | None, values: Mapping[int, float]) -> CaseRow:
    means = {"mfow_mean_s": estimate(list(values.values()))}
    return CaseRow(case, {}, len(values), 0, 0, means, {"mfow_mean_s": values}, against, {})


def test_p_is_that_of_students_table() -> None:
    # t = 4.303 has p = 0.05 with 2 degrees of freedom, 2.776 with 4.
    for differences, t in (((1.0, 2.0, 3.0), 4.303), ((1.0, 2.0, 3.0, 4.0, 5.0), 2.776)):
        spread = estimate(differences).half or 0.0
        shift = spread - estimate(differences).mean  # then the interval of the mean just touches 0
        assert estimate([value + shift for value in differences]).p == pytest.approx(0.05, abs=1e-9), t


def test_without_spread_there_is_no_p() -> None:
    assert estimate([3.0]).p is None
    assert estimate([2.1, 2.1, 2.1]).p is None


@pytest.mark.parametrize("seeds", [(1, 2, 3, 4), (4, 1, 2, 3), (1, 4, 2, 3)])
def test_only_seeds_that_both_cases_have_are_paired(seeds: tuple[int, ...]) -> None:
    """Wherever the seed that has no partner stands among them."""
    old, values = {5: 1.0, 3: 97.0, 1: 90.0, 2: 99.0}, {1: 81.0, 2: 95.0, 3: 88.0, 4: 9.0}
    new = {seed: values[seed] for seed in seeds}
    rows = [row("old", None, old), row("new", "old", new)]
    (test,) = paired_tests(rows)
    assert (test.case, test.against, test.pairs) == ("new", "old", 3)
    assert test.difference.mean == pytest.approx(-22.0 / 3.0)
    (line,) = csv.DictReader(io.StringIO(comparisons_table([test]).csv()))
    assert (line["test"], line["pairing"], line["pairs"]) == (TEST, PAIRING, "3")
    assert float(line["low"]) < float(line["difference"]) < float(line["high"]) < 0.0
    assert float(line["p"]) < 0.05, "as the interval does not hold 0"
    assert line["p_holm"] == line["p"], "one test needs no correction"


def test_the_first_and_the_last_seed_count_like_all_others() -> None:
    old = {seed: 10.0 * seed for seed in range(1, 6)}
    new = {seed: old[seed] + 2.0**seed for seed in reversed(old)}
    (test,) = paired_tests([row("old", None, old), row("new", "old", new)])
    assert (test.pairs, test.difference.mean) == (5, 62.0 / 5.0)
    assert test.p == estimate([2.0, 4.0, 8.0, 16.0, 32.0]).p
    (pair,) = paired_tests([row("old", None, {7: 1.0}), row("new", "old", {7: 4.0})])
    assert (pair.pairs, pair.difference.mean, pair.p) == (1, 3.0, None)


def test_p_values_are_corrected_for_the_tests_of_their_metric() -> None:
    """Holm 1979: the k-th smallest of n times n - k + 1, and none below a smaller one."""
    old = {seed: 10.0 * seed for seed in range(1, 5)}
    shifts = {"near": (-1.0, 2.0, -1.5, 1.0), "far": (5.0, 5.1, 5.2, 4.9), "between": (1.0, 3.0, 2.0, 0.5)}
    cases = {name: {seed: old[seed] + shift[seed - 1] for seed in old} for name, shift in shifts.items()}
    cases["same"] = {seed: value + 2.0 for seed, value in old.items()}
    rows = [row("old", None, old), *(row(name, "old", values) for name, values in cases.items())]
    tests = {test.case: test for test in paired_tests(rows)}
    p = {name: test.p for name, test in tests.items() if test.p is not None}
    assert p["far"] < p["between"] < p["near"]
    assert tests["same"].p_holm is None
    assert tests["far"].p_holm == pytest.approx(3 * p["far"])
    assert tests["between"].p_holm == pytest.approx(2 * p["between"])
    assert tests["near"].p_holm == pytest.approx(max(p["near"], 2 * p["between"]))


def test_no_corrected_p_is_below_that_of_a_smaller_one_or_above_1() -> None:
    near, between, far = (-1.0, 2.0, -1.5, 1.0), (-1.0, 2.5, -1.5, 1.0), (-1.0, 2.9, -1.5, 1.0)
    shifts = {"near": near, "between": between, "far": far, "farthest": (5.0, 5.1, 5.2, 4.9)}
    old = dict.fromkeys(range(1, 5), 0.0)
    rows = [
        row("old", None, old),
        *(row(case, "old", dict(zip(old, some, strict=True))) for case, some in shifts.items()),
    ]
    other = {case.case: {seed: 2.0 * value for seed, value in case.values["mfow_mean_s"].items()} for case in rows}
    rows = [replace(case, values={**case.values, "fog_mean_s": other[case.case]}) for case in rows]
    tests = {test.case: test for test in paired_tests(rows) if test.metric == "mfow_mean_s"}
    p = {case: test.p or 0.0 for case, test in tests.items()}
    assert p["farthest"] < 0.001 < p["far"] < p["between"] < p["near"] < 1.0
    assert 2.0 * p["between"] > 1.0
    assert tests["farthest"].p_holm == pytest.approx(4.0 * p["farthest"])
    assert [tests[case].p_holm for case in ("far", "between", "near")] == [1.0, 1.0, 1.0]


def test_a_larger_p_is_corrected_to_that_of_the_smaller_one_before_it() -> None:
    """0.03 becomes 0.06, and so does 0.04, which alone would stay as it is."""
    shifts = {"first": (5.0, 5.1, 5.2, 4.9), "second": (1.0, 2.5, 3.5, 2.6), "third": (1.0, 2.7, 3.5, 2.4)}
    old = dict.fromkeys(range(1, 5), 0.0)
    rows = [
        row("old", None, old),
        *(row(case, "old", dict(zip(old, some, strict=True))) for case, some in shifts.items()),
    ]
    tests = {test.case: test for test in paired_tests(rows)}
    p = {case: test.p or 0.0 for case, test in tests.items()}
    low, high = sorted(("second", "third"), key=p.__getitem__)
    assert p["first"] < p[low] < p[high] < 2.0 * p[low]
    assert tests[low].p_holm == tests[high].p_holm == pytest.approx(2.0 * p[low])
