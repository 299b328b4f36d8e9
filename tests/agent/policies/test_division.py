"""The division of the robots that one robot hears between the rounds of zoned ground."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from agent.policies.division import Crew, Division
from patrol.tours.round import Round
from patrol.zones.division import Divisions, ZonedGround

# Not the product's own, so that a wrong one there is noticed.
LEAST_MEMORY_S = 30.0

FLAT = np.zeros(1, dtype=np.int64)
LENGTHS = {(0, 0): 540.0, (0, 1): 560.0, (1, 1): 60.0}
ZONED = ZonedGround(
    np.ones((2, 3)),
    (1.0, 10.0),
    (None, None),
    {group: Round(length, FLAT, np.zeros(1), FLAT, FLAT, FLAT) for group, length in LENGTHS.items()},
    speed=20.0,
)
STEP = 0.5
REST, VAULT, ALL = (0, 0), (1, 1), (0, 1)


@dataclass
class Heard:
    tick: int


@dataclass
class Seen:
    """The part of a view that a division reads."""

    tick: int
    peers: dict[int, Heard] = field(default_factory=dict)


def view(tick: int, *numbers: int) -> Any:
    return Seen(tick, {number: Heard(tick) for number in numbers})


def division(number: int) -> Division:
    return Division(Divisions(ZONED), number, frozenset(range(1, 7)), 6, STEP)


def test_all_that_hear_each_other_find_the_same() -> None:
    crews = {n: division(n).crew(view(0, *(set(range(1, 7)) - {n}))) for n in range(1, 7)}
    assert {crews[n] for n in (1, 2, 3)} == {Crew(VAULT, frozenset({1, 2, 3}))}
    assert {crews[n] for n in (4, 5, 6)} == {Crew(REST, frozenset({4, 5, 6}))}


def test_a_robot_that_hears_nobody_follows_all_of_the_ground() -> None:
    assert division(4).crew(view(0)) == Crew(ALL, frozenset({4}))


@pytest.mark.parametrize(("number", "classes"), [(1, VAULT), (3, VAULT), (4, VAULT), (5, REST), (6, REST)])
def test_after_a_death_the_division_is_made_anew(number: int, classes: tuple[int, int]) -> None:
    made, others = division(number), {1, 2, 3, 4, 5, 6} - {number}
    before = made.crew(view(0, *others))
    lapsed = int(LEAST_MEMORY_S / STEP) + 1
    kept = made.crew(view(lapsed - 1, *(others - {2})))
    assert kept == before
    anew = made.crew(view(lapsed, *(others - {2})))
    assert anew == Crew(classes, frozenset({1, 3, 4} if classes == VAULT else {5, 6}))
