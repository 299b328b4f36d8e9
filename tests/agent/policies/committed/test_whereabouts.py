from __future__ import annotations

import math

import numpy as np
import pytest

from agent.policies.committed.whereabouts import ROAM_REACH, ROAM_S, Whereabouts


def test_nothing_is_said_before_the_time_is_over() -> None:
    whereabouts = Whereabouts(0.3, 0.5, 0.5)
    for tick in range(round(ROAM_S / 0.5) - 1):
        assert whereabouts.home() is None
        whereabouts.note(tick, (1.0, 2.0))
    whereabouts.note(round(ROAM_S / 0.5), (1.0, 2.0))
    assert whereabouts.home() == (1.0, 2.0)


@pytest.mark.parametrize("seed", range(40))
def test_it_has_stayed_where_no_place_is_farther_from_the_middle_than_the_circle_s_radius(seed: int) -> None:
    dice = np.random.default_rng(seed)
    whereabouts = Whereabouts(0.3, 0.5, 1.0)
    assert whereabouts.reach == ROAM_REACH * 0.8
    wide = dice.choice([0.5, 0.7, 1.0]) * whereabouts.reach
    places = [(float(x), float(y)) for x, y in dice.uniform(-wide, wide, (80, 2))]
    for tick, place in enumerate(places):
        whereabouts.note(tick, place)
    last = places[-math.ceil(ROAM_S) :]
    xs, ys = zip(*last, strict=True)
    centre = 0.5 * (min(xs) + max(xs)), 0.5 * (min(ys) + max(ys))
    stayed = all(math.dist(centre, place) <= whereabouts.reach for place in last)
    assert whereabouts.home() == (centre if stayed else None)


def test_of_many_ticks_a_second_one_counts() -> None:
    fast, slow = Whereabouts(0.3, 0.5, 0.1), Whereabouts(0.3, 0.5, 1.0)
    for tick in range(460):
        fast.note(tick, (0.01 * tick, 0.0))
        if tick % 10 == 0:
            slow.note(tick // 10, (0.01 * tick, 0.0))
    assert fast.home() == slow.home() is not None
