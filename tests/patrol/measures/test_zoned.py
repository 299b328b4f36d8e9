from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from patrol.errors import BadInput
from patrol.measures.best_tour import best_tour
from patrol.measures.zoned import Weights, ZonedGround, best_weighted_s, with_rounds, zone_weights
from patrol.prepare import Prepared, prepare
from patrol.scenario import load_scenario
from tests.present import present


def box(left: float, low: float, right: float, high: float) -> list[list[float]]:
    return [[left, low], [right, low], [right, high], [left, high]]


VAULT = {"name": "vault", "polygon": box(0, 0, 30, 30)}
CELLAR = {"name": "cellar", "polygon": box(20, 20, 60, 60)}


def prepared(*zones: dict[str, Any], **more: Any) -> Prepared:
    robots = {"count": 4, "model": "holonomic", "radius": 1.0, "speed": 2.0}
    given = {"terrain": {"builtin": "yards"}, "point": 1.0, "robots": robots, "zones": list(zones), **more}
    return prepare(load_scenario(given))


def weights_of(made: Prepared, *zones: tuple[str, float | None]) -> Weights:
    """The weights under some zones, or under all of them with their first weights."""
    every = [(zone.name, zone.weight) for zone in made.scenario.zones if zone.weighs]
    return present(ZonedGround(made).under(frozenset(zones or every)))


def test_the_greatest_weight_holds_and_the_rest_counts_once() -> None:
    weights = weights_of(prepared(VAULT | {"weight": 10}, CELLAR | {"weight": 0.5}))
    assert (weights[5, 5], weights[25, 25], weights[40, 40], weights[80, 80]) == (10.0, 10.0, 0.5, 1.0)
    assert not weights.flags.writeable


def test_a_wanted_age_is_a_weight_against_the_best_tour_and_plans_leave_a_margin() -> None:
    made = with_rounds(prepared(VAULT | {"age": 20}, CELLAR | {"weight": 3}))
    tour_s = present(best_tour(made).bound_of_fleet_s(made.scenario))
    wish = zone_weights(made)["vault"]
    assert wish == pytest.approx(tour_s / 20.0, abs=1e-3)
    assert weights_of(made)[5, 5] == wish
    planned = present(ZonedGround(made).under(frozenset({("vault", None), ("cellar", 3.0)}), 2.5))
    assert (planned[5, 5], planned[40, 40], planned[80, 80]) == (2.5 * wish, 3.0, 1.0)


def test_the_weights_follow_the_zones_in_force() -> None:
    made = prepared(VAULT | {"weight": 10, "times": [[60, 120]]}, CELLAR | {"weight": 3})
    ground = ZonedGround(made)
    for zones, expected in ({}, (1, 1)), ({("vault", 10.0)}, (10, 1)), ({("vault", 5.0), ("cellar", 3.0)}, (5, 3)):
        weights = present(ground.under(frozenset(zones)))
        assert (weights[5, 5], weights[40, 40]) == expected
        assert ground.under(frozenset(zones)) is weights


def test_few_weights_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("patrol.measures.zoned.MOST_KEPT", 2)
    ground = ZonedGround(prepared(VAULT | {"weight": 10}))
    first, *_, last = [ground.under(frozenset({("vault", weight)})) for weight in (1.0, 2.0, 3.0)]
    assert ground.under(frozenset({("vault", 3.0)})) is last
    assert ground.under(frozenset({("vault", 1.0)})) is not first


def test_the_worst_ground_counts_on_the_best_tours() -> None:
    """The vault of weight 10 takes longer than all ground; of weight 1.01 it does not."""
    made = prepared(VAULT | {"weight": 10})
    heavy, light = weights_of(made), weights_of(made, ("vault", 1.01))
    vault_s = present(best_tour(made, heavy > 1.0).bound_of_fleet_s(made.scenario))
    all_s = present(best_tour(made).bound_of_fleet_s(made.scenario))
    assert vault_s < all_s < 10.0 * vault_s
    assert best_weighted_s(made, heavy) == 10.0 * vault_s
    assert best_weighted_s(made, light) == all_s


def test_spare_robots_are_not_counted_on() -> None:
    robots = {"count": 3, "spare": 1, "model": "holonomic", "radius": 1.0, "speed": 2.0}
    four, three = prepared(VAULT | {"weight": 10}), prepared(VAULT | {"weight": 10}, robots=robots)
    assert best_weighted_s(three, weights_of(three)) == pytest.approx(
        4 / 3 * present(best_weighted_s(four, weights_of(four)))
    )


@pytest.mark.parametrize("zones", [(), ({"name": "stairs", "polygon": box(10, 10, 20, 20), "keep_out": True},)])
def test_without_weights_nothing_is_zoned(zones: tuple[dict[str, Any], ...]) -> None:
    made = prepared(*zones)
    assert ZonedGround(made).under(frozenset()) is None
    assert not with_rounds(made, needed=False).zone_weights


def test_where_the_sensor_leaves_age_there_is_no_tour_and_no_wanted_age() -> None:
    no_tour = r"zones\.0\.age = 20: there is no tour .* to compare vault with; give it a weight"
    with pytest.raises(BadInput, match=no_tour):
        with_rounds(prepared(VAULT | {"age": 20}, sensor={"quality": 0.5}))
    made = prepared(VAULT | {"weight": 10}, sensor={"quality": 0.5})
    assert best_weighted_s(made, weights_of(made)) is None


def test_with_many_weights_there_are_no_tours() -> None:
    boxes = {name: box(20 * n, 0, 20 * n + 15, 20) for n, name in enumerate("abcd")}
    zones = [{"name": name, "polygon": where, "weight": n} for n, (name, where) in enumerate(boxes.items(), start=2)]
    made = prepared(*zones)
    assert best_weighted_s(made, weights_of(made)) is None


def test_a_zone_that_no_robot_sees_is_refused() -> None:
    shut = {"name": "shut", "polygon": box(0, 0, 0.5, 0.5), "weight": 2}
    walls = ~prepared().patrolled
    row, col = np.argwhere(walls)[0]
    shut["polygon"] = box(col + 0.2, row + 0.2, col + 0.8, row + 0.8)
    with pytest.raises(BadInput, match=r"zones\.0: shut: no robot sees any of it from ground that it can reach"):
        prepared(shut)


def test_rounds_are_found_once_where_they_are_needed_and_kept_with_the_rest(tmp_path: Path) -> None:
    ground = prepared()
    assert not with_rounds(ground, needed=False).rounds
    made = with_rounds(ground)
    assert not ground.rounds, "what was prepared does not change"
    assert with_rounds(made).rounds is made.rounds
    made.save(tmp_path)
    loaded = Prepared.load(made.scenario, tmp_path).rounds
    first = present(loaded[1])
    assert set(loaded) == {1, 2, 3, 4}
    assert all(laid_out is first for laid_out in loaded.values())
    assert np.array_equal(first.points, present(made.rounds[1]).points)


def test_the_weights_of_wishes_are_kept_with_the_rest(tmp_path: Path) -> None:
    made = with_rounds(prepared(VAULT | {"age": 20}))
    made.save(tmp_path)
    assert Prepared.load(made.scenario, tmp_path).zone_weights == zone_weights(made)
