"""The chance of a fleet: one answer for those who hold the key, another for each other secret."""

from itertools import product

import pytest

from agent.chance import Chance
from patrol.random import Purpose, draw

KEYS = (None, b"k" * 16, b"K" * 64)


@pytest.mark.parametrize("key", KEYS)
def test_robots_with_the_same_secret_agree_and_each_draws_its_own(key: bytes | None) -> None:
    here, there = Chance(31, key), Chance(31, key)
    assert here.draw(Purpose.PLAN, 4) == there.draw(Purpose.PLAN, 4)
    asked = list(product((1, 2), (1, 2), (Purpose.POLICY, Purpose.UNSTUCK), (10, 11), (0, 1)))
    draws = [here.of_robot(number, incarnation)(purpose, *more) for number, incarnation, purpose, *more in asked]
    assert draws == [there.of_robot(number, birth)(purpose, *more) for number, birth, purpose, *more in asked]
    assert len(set(draws)) == len(asked)
    assert all(0.0 <= drawn < 1.0 for drawn in draws)


def test_without_a_key_the_seed_tells_every_draw_and_with_one_it_does_not() -> None:
    seed = 2**63 - 1
    assert Chance(seed).draw(Purpose.PLAN, 4) == draw(seed, Purpose.PLAN, 4)
    assert Chance(seed).of_robot(2, 1)(Purpose.POLICY, 10, 0) == draw(seed, Purpose.POLICY, 2, 1, 10, 0)
    chances = [Chance(seed, key) for key in KEYS] + [Chance(5, KEYS[1])]
    assert len({chance.draw(Purpose.PLAN, 4) for chance in chances}) == len(chances)


def test_another_secret_holds_for_all_draws_from_then_on() -> None:
    chance = Chance(31, KEYS[1])
    own = chance.of_robot(2, 1)
    before = own(Purpose.POLICY, 10, 0)
    chance.key = KEYS[2]
    assert own(Purpose.POLICY, 10, 0) == Chance(31, KEYS[2]).of_robot(2, 1)(Purpose.POLICY, 10, 0) != before


def test_draws_from_a_key_are_uniform() -> None:
    """Chi-square over 64 bins: its mean is 63 and its deviation 11.2."""
    chance, count = Chance(1, KEYS[1]), [0] * 64
    for question in range(6400):
        count[int(64 * chance.draw(Purpose.PLAN, question))] += 1
    assert sum((hits - 100) ** 2 / 100 for hits in count) < 63 + 5 * 11.2
