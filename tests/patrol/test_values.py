"""The kinds of values of a scenario, at their limits, and the words in which others are refused."""

import math
from typing import Any

import pytest
from pydantic import TypeAdapter, ValidationError

from patrol import values

NUMBERS: list[tuple[str, list[float], list[float], str]] = [
    ("Number", [-1e9, 1e9], [-1.000001e9, 1.000001e9], "a number from -1e9 to 1e9"),
    ("Positive", [1e-300, 1e9], [0.0, -1.0, 1.000001e9], "a number above 0 and at most 1e9"),
    ("NotNegative", [0.0, 1e9], [-1e-300, 1.000001e9], "a number from 0 to 1e9"),
    ("Exponent", [1e-300, 600.0], [0.0, 600.1], "a number above 0 and at most 600"),
    ("Probability", [0.0, 1.0], [-1e-9, 1.0000001], "a number from 0 to 1"),
    ("Share", [1e-300, 1.0], [0.0, 1.0000001], "a number above 0 and at most 1"),
    ("Burst", [1.0, 1e9], [0.9999999, 1.000001e9], "a number from 1 to 1e9"),
    ("Growth", [-0.9999999, 1.0], [-1.0, 1.0000001], "a number above -1 and at most 1"),
    ("Degrees", [1e-300, 360.0], [0.0, 360.1], "a number above 0 and at most 360"),
    ("Power", [-200.0, 100.0], [-200.1, 100.1], "a number from -200 to 100"),
    ("Decibels", [0.0, 200.0], [-0.1, 200.1], "a number from 0 to 200"),
    ("PathLossExponent", [1.0, 10.0], [0.99, 10.1], "a number from 1 to 10"),
    ("Tolerance", [0.0, 0.9999999], [-1e-9, 1.0], "a number from 0 to below 1"),
    ("Step", [1e-300, 1e9], [0.0, 1.000001e9], "auto, or a number above 0 and at most 1e9"),
]
WHOLE: list[tuple[str, list[int], list[int], str]] = [
    ("Seed", [0, 2**63 - 1], [-1, 2**63], "a whole number from 0 to 2^63 - 1"),
    ("Count", [1, 65_000], [0, 65_001], "a whole number from 1 to 65000"),
    ("Spares", [0, 65_000], [-1, 65_001], "a whole number from 0 to 65000"),
    ("Ticks", [1, 10**9], [0, 10**9 + 1], "a whole number from 1 to 1e9"),
    ("Sectors", [3, 3600], [2, 3601], "a whole number from 3 to 3600"),
    ("Trail", [0, 4], [-1, 5], "a whole number from 0 to 4"),
    ("TrailEvery", [1, 15], [0, 16], "a whole number from 1 to 15"),
    ("Overhead", [0, 1000], [-1, 1001], "a whole number from 0 to 1000"),
    ("FrameBytes", [1, 64], [0, 65], "a whole number from 1 to 64"),
]
TEXTS: list[tuple[str, list[Any], list[Any]]] = [
    ("Name", ["a", "7.b_-", "a" * 64], ["", "a" * 65, ".a", "-a", "ä", "a b"]),
    ("RobotName", ["a", "7b_-", "a" * 32], ["", "a" * 33, "_a", "a.b", "a/b"]),
    ("Digest", ["0" * 64, "abcdef0123456789" * 4], ["0" * 63, "0" * 65, "A" * 64, "g" * 64]),
    ("PathText", ["a", "/a/b c.yaml"], ["", "a\nb", "a\0"]),
    ("Flag", [True, False], [0, 1, "true", None]),
    ("Corner", [[0.0, 1e9]], [[0.0], [0.0, 1.0, 2.0], [0.0, 2e9], "here"]),
    ("Place", [[1.0, 2.0], [1.0, 2.0, 3.0]], [[1.0], [1.0, 2.0, 3.0, 4.0]]),
    ("Pace", ["lockstep", "realtime", 2.0], ["fast", 0.0, -1.0]),
    ("AutoPositive", ["auto", 1e9], ["automatic", 0.0]),
    ("AutoNotNegative", ["auto", 0.0], ["automatic", -0.1]),
    ("Polygon", [[[0.0, 0.0]] * 3, [[0.0, 0.0]] * 5000], [[[0.0, 0.0]] * 2, [[0.0, 0.0]] * 5001]),
    ("Polygons", [[], [[[0.0, 0.0]] * 3] * 1000], [[[[0.0, 0.0]] * 3] * 1001]),
    ("Quality", [1.0, [[0.0, 0.5]], [[0.0, 0.5], [1.0, 0.4]]], [0.0, [], [[1.0, 0.5], [1.0, 0.4]], [[0.0, 0.0]]]),
    ("Start", ["random", [1.0, 2.0]], ["here", [1.0]]),
    ("Starts", ["random", [[1.0, 2.0], [1.0, 2.0, 0.5]], []], ["here", [1.0, 2.0]]),
    ("Separation", ["none", "claims", ["claims", "repulsion"]], ["nothing", ["none"]]),
]


def problem_of(kind: str, value: Any) -> str:
    """What is wrong with a value; empty where it may be."""
    try:
        TypeAdapter(getattr(values, kind)).validate_python(value)
    except ValidationError as error:
        return str(error.errors()[0]["msg"])
    return ""


@pytest.mark.parametrize(("kind", "good", "bad", "words"), NUMBERS, ids=[kind for kind, *_ in NUMBERS])
def test_numbers_are_within_their_limits(kind: str, good: list[float], bad: list[float], words: str) -> None:
    assert [problem_of(kind, value) for value in good] == [""] * len(good)
    for value in (*bad, math.nan, math.inf, "1", True, None):
        assert words in problem_of(kind, value), value


@pytest.mark.parametrize(("kind", "good", "bad", "words"), WHOLE, ids=[kind for kind, *_ in WHOLE])
def test_whole_numbers_are_within_their_limits(kind: str, good: list[int], bad: list[int], words: str) -> None:
    assert [problem_of(kind, value) for value in good] == [""] * len(good)
    for value in (*bad, float(good[0]), "1", True, None):
        assert words in problem_of(kind, value), value


@pytest.mark.parametrize(("kind", "good", "bad"), TEXTS, ids=[kind for kind, *_ in TEXTS])
def test_other_values_are_of_their_kind(kind: str, good: list[Any], bad: list[Any]) -> None:
    assert [problem_of(kind, value) for value in good] == [""] * len(good)
    assert [value for value in bad if not problem_of(kind, value)] == []
