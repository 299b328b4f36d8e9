"""Giving way: the higher number goes round the lower, and nobody waits for ever."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest

from agent.bodies.giveway import LONGEST_S, PATIENCE, SHORTEST_S, GiveWay, nearest
from agent.chance import Chance
from patrol.pose import Pose
from patrol.radio.peers import Peer
from patrol.random import Purpose

RADII = {1: 0.3, 2: 0.3, 3: 0.3}
HERE = Pose(5.0, 5.0, 0.0)
CHANCE = partial(Chance(7).of_robot(2, 1), Purpose.GIVE_WAY)


def peers(**places: tuple[float, float]) -> dict[int, Peer]:
    return {int(name[1:]): Peer(0, Pose(x, y, 0.0), 0) for name, (x, y) in places.items()}


def test_the_higher_number_gives_way_for_a_while() -> None:
    others = peers(r1=(5.7, 5.0), r3=(9.0, 5.0))
    rule = GiveWay(2, CHANCE, RADII, 0.5)
    rule.update(10, HERE, True, others, 0.5)
    ((x, y, radius),) = rule.discs(10, HERE, others, 0.1)
    assert (x, y) == (5.7, 5.0)
    assert radius == pytest.approx(0.6)
    assert rule.discs(10 + round(SHORTEST_S / 0.5) - 1, HERE, others, 0.1)
    assert rule.discs(10 + round(LONGEST_S / 0.5) + 1, HERE, others, 0.1) == []


def test_once_the_while_is_over_the_other_is_not_asked_for() -> None:
    rule = GiveWay(2, CHANCE, RADII, 0.5)
    rule.update(10, HERE, True, peers(r1=(5.7, 5.0)), 0.5)
    assert rule.discs(10 + round(LONGEST_S / 0.5) + 1, HERE, {}, 0.1) == []


def test_the_lower_number_goes_on_until_its_patience_ends() -> None:
    others = peers(r3=(5.7, 5.0))
    rule = GiveWay(2, CHANCE, RADII, 0.5)
    for tick in range(PATIENCE):
        rule.update(tick, HERE, True, others, 0.5)
        assert rule.discs(tick, HERE, others, 0.1) == []
    rule.update(PATIENCE, HERE, True, others, 0.5)
    assert len(rule.discs(PATIENCE, HERE, others, 0.1)) == 1


def test_a_move_that_succeeds_restores_patience() -> None:
    others = peers(r3=(5.7, 5.0))
    rule = GiveWay(2, CHANCE, RADII, 0.5)
    for tick in range(4 * PATIENCE):
        rule.update(tick, HERE, tick % 4 != 0, others, 0.5)
        assert rule.discs(tick, HERE, others, 0.1) == []


def test_a_robot_can_stop_giving_way_at_once() -> None:
    others = peers(r1=(5.7, 5.0), r3=(5.0, 5.75))
    rule = GiveWay(2, CHANCE, RADII, 0.5)
    for tick in range(PATIENCE):
        rule.update(tick, HERE, True, others, 0.5)
    rule.stop(1)
    assert rule.discs(PATIENCE, HERE, others, 0.1) == []
    # It is patient again, too.
    rule.update(PATIENCE, HERE, True, peers(r3=(5.7, 5.0)), 0.5)
    assert rule.discs(PATIENCE, HERE, peers(r3=(5.7, 5.0)), 0.1) == []


def test_nobody_gives_way_to_a_distant_peer_or_to_none() -> None:
    rule = GiveWay(2, CHANCE, RADII, 0.5)
    rule.update(0, HERE, True, peers(r1=(8.0, 5.0)), 0.5)
    assert rule.discs(0, HERE, peers(r1=(8.0, 5.0)), 0.1) == []
    rule.update(1, HERE, True, {}, 0.5)


def test_the_obstacle_never_covers_the_robot_itself() -> None:
    others = peers(r1=(5.45, 5.0))
    rule = GiveWay(2, CHANCE, RADII, 0.5)
    rule.update(0, HERE, True, others, 0.5)
    ((_, _, radius),) = rule.discs(0, HERE, others, 0.1)
    assert radius < 0.45


@pytest.mark.parametrize("seed", range(20))
def test_the_nearest_is_whose_body_is_nearest_and_of_several_the_first(seed: int) -> None:
    dice = np.random.default_rng(seed)
    places = dice.integers(0, 4, (int(dice.integers(1, 40)), 2)).astype(np.float64) + seed / 3.0
    others = {
        int(number): Peer(0, Pose(float(x), float(y), 0.0), 0)
        for number, (x, y) in zip(dice.permutation(len(places)) + 1, places, strict=True)
    }
    radii = {number: float(dice.choice([0.2, 0.3, 0.45])) for number in others}
    here = Pose(seed / 3.0 + 1.0, seed / 3.0 + 2.0, 0.0)
    gaps = [
        (math.hypot(others[number].pose.x - here.x, others[number].pose.y - here.y) - radii[number], number)
        for number in sorted(others)
    ]
    assert nearest(here, others, radii) == min(gaps)


def test_of_nobody_nobody_is_the_nearest() -> None:
    assert nearest(HERE, {}, RADII) == (math.inf, 0)
