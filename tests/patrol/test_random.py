import math
import statistics

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.random import Draws, Purpose, draw, gauss, mix

GOLDEN = 0x9E3779B97F4A7C15
MASK = 2**64 - 1


def test_mix_gives_the_reference_outputs_of_splitmix64() -> None:
    """The generator seeded with s gives, as its n-th output, the hash of s advanced n - 1 times."""
    published = [
        6457827717110365317,
        3203168211198807973,
        9817491932198370423,
        4593380528125082431,
        16408922859458223821,
    ]
    assert [mix((1234567 + n * GOLDEN) & MASK) for n in range(5)] == published


def test_a_chain_hashes_each_value_into_the_last_hash_so_order_and_length_matter() -> None:
    assert mix(1, 2, 3) == mix(mix(mix(1) ^ 2) ^ 3)
    assert len({mix(1, 2), mix(2, 1), mix(1), mix(2), mix(0, 1, 2), mix(1, 2, 0), mix(1, 0, 2)}) == 7


@given(st.lists(st.integers(-(2**70), 2**70), min_size=1, max_size=5))
def test_values_count_modulo_two_to_the_64(values: list[int]) -> None:
    assert mix(*values) == mix(*(value % 2**64 for value in values))
    assert 0 <= mix(*values) < 2**64
    assert 0.0 <= draw(*values) < 1.0


def test_draws_depend_neither_on_their_order_nor_on_the_type_of_an_integer_which_they_need() -> None:
    with pytest.raises(TypeError):
        draw(7, 1.0)  # type: ignore[arg-type]
    with pytest.raises(TypeError):
        draw()
    forwards = [draw(1, Purpose.ETHER, n) for n in range(50)]
    assert [draw(1, Purpose.ETHER, n) for n in reversed(range(50))] == forwards[::-1]
    assert draw(7, Purpose.START, 3) == draw(np.int64(7), 1, np.int32(3))


def test_draws_are_uniform() -> None:
    """Chi-square over 64 bins: its mean is 63 and its deviation 11.2, so 63 + 5 * 11.2 is never seen by chance."""
    count = 20_000
    for purpose in Purpose:
        draws = np.array([draw(7, purpose, robot, tick) for robot in range(20) for tick in range(count // 20)])
        observed = np.histogram(draws, bins=64, range=(0.0, 1.0))[0]
        expected = count / 64
        assert float(((observed - expected) ** 2 / expected).sum()) < 120.0


@pytest.mark.parametrize("position", range(4))
def test_draws_for_neighbouring_arguments_are_independent(position: int) -> None:
    """The correlation of n pairs deviates from 0 by 1 / sqrt(n)."""
    count = 10_000

    def at(offset: int) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        arguments = [[7, 3, 5, n] for n in range(count)]
        for values in arguments:
            values[position] += offset
        return np.array([draw(*values) for values in arguments])

    assert abs(float(np.corrcoef(at(0), at(1))[0, 1])) < 5.0 / math.sqrt(count)


def test_one_bit_in_changes_half_of_the_bits_out() -> None:
    flips = [(mix(7, 3, n) ^ mix(7, 3, n ^ (1 << bit))).bit_count() for n in range(200) for bit in range(64)]
    assert abs(sum(flips) / len(flips) - 32.0) < 0.2
    assert min(flips) > 8


def test_normal_draws_are_normal_and_repeat() -> None:
    values = [gauss(7, Purpose.SENSES, k) for k in range(20_000)]
    assert statistics.mean(values) == pytest.approx(0.0, abs=0.03)
    assert statistics.stdev(values) == pytest.approx(1.0, abs=0.03)
    beyond = sum(abs(value) > 1.959964 for value in values) / len(values)
    assert beyond == pytest.approx(0.05, abs=0.006)
    assert gauss(7, Purpose.SENSES, 3) == values[3]


@given(st.integers(0, 2**63 - 1), st.integers(-5, 5), st.integers(0, 6))
def test_draws_stay_within_their_bounds(seed: int, least: int, more: int) -> None:
    draws = Draws(seed, 8)
    assert {draws.whole(least, least + more) for _ in range(60)} <= set(range(least, least + more + 1))
    assert all(least <= draws.between(least, least + more) <= least + more for _ in range(20))
    assert sorted(draws.shuffled(range(more))) == list(range(more))
    names = [f"r{number}" for number in range(more + 1)]
    some = draws.some(names, more + 1)
    assert some == sorted(set(some))
    assert 1 <= len(some) <= more + 1
    assert set(some) <= set(names)


def test_every_value_is_drawn() -> None:
    draws = Draws(7, 8)
    assert {draws.whole(1, 6) for _ in range(200)} == {1, 2, 3, 4, 5, 6}
    assert {draws.choice("a", "b") for _ in range(50)} == {"a", "b"}
    assert {tuple(draws.shuffled("abc")) for _ in range(200)} == {
        *map(tuple, ("abc", "acb", "bac", "bca", "cab", "cba"))
    }
