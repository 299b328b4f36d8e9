from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from patrol.tours.round import Round
from patrol.zones.division import Classes, Divisions, Group, ZonedGround


def a_round(length_m: float) -> Round:
    flat = np.zeros(1, dtype=np.int64)
    return Round(length_m, flat, np.zeros(1), flat, flat, flat)


def zoned(
    lengths: dict[Classes, float], classes: tuple[float, ...] = (1.0, 10.0), wanted: tuple[float | None, ...] = ()
) -> ZonedGround:
    rounds = {group: a_round(length) for group, length in lengths.items()}
    return ZonedGround(np.ones((2, 3)), classes, wanted or (None,) * len(classes), rounds, 1.0)


LENGTHS: dict[Classes, float] = {(0, 0): 540.0, (0, 1): 560.0, (1, 1): 60.0}
GROUND = zoned(LENGTHS)
VAULT = Divisions(GROUND)


def test_robots_go_where_the_greatest_weighted_time_is_least() -> None:
    groups = VAULT.divide(6)
    assert groups == (Group((0, 0), 3), Group((1, 1), 3))
    assert VAULT.cost_s(groups) == 200.0


THREE = {(0, 0): 300.0, (0, 1): 310.0, (0, 2): 320.0, (1, 1): 100.0, (1, 2): 150.0, (2, 2): 20.0}


@pytest.mark.parametrize(
    ("ground", "robots", "groups"),
    [
        (GROUND, 1, [Group((0, 1), 1)]),
        (zoned({(0, 0): 100.0, (0, 1): 100.0, (1, 1): 99.0}, classes=(1.0, 1.01)), 6, [Group((0, 1), 6)]),
        (zoned(THREE, classes=(1.0, 2.0, 30.0)), 2, [Group((0, 1), 1), Group((2, 2), 1)]),
        (zoned({}), 4, []),
    ],
    ids=["one robot", "two tours are no better than one", "two of three classes share a tour", "no rounds"],
)
def test_classes_share_a_tour_where_that_is_no_worse(ground: ZonedGround, robots: int, groups: list[Group]) -> None:
    assert list(Divisions(ground).divide(robots)) == groups


def test_wishes_go_first() -> None:
    """By weights alone three robots would be best in each group; the wish for 20 s takes four of them."""
    plain = VAULT.divide(6)
    wishing = Divisions(zoned(LENGTHS, wanted=(None, 18.75)))
    groups = wishing.divide(6)
    assert groups == (Group((0, 0), 2), Group((1, 1), 4))
    assert wishing.wish_kept(groups, 1)
    assert not wishing.wish_kept(plain, 1)
    assert wishing.wish_kept(groups, 0)


@pytest.mark.parametrize("robots", [1, 2, 5, 24])
def test_every_robot_and_every_class_has_one_group(robots: int) -> None:
    lengths = {(first, last): 50.0 * (last - first + 1) for first in range(4) for last in range(first, 4)}
    groups = Divisions(zoned(lengths, classes=(1.0, 3.0, 5.0, 9.0))).divide(robots)
    assert sum(group.robots for group in groups) == robots
    assert [n for group in groups for n in range(group.classes[0], group.classes[1] + 1)] == [0, 1, 2, 3]


def test_it_is_loaded_as_it_was_saved(tmp_path: Path) -> None:
    GROUND.save(tmp_path)
    loaded = ZonedGround.load(tmp_path)
    assert (loaded.classes, loaded.wanted, loaded.speed) == (GROUND.classes, GROUND.wanted, GROUND.speed)
    assert np.array_equal(loaded.weights, GROUND.weights)
    assert Divisions(loaded).divide(6) == VAULT.divide(6)
