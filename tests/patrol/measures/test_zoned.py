from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from patrol.errors import BadInput
from patrol.measures.best_tour import best_tour
from patrol.measures.zoned import ZonedGrounds, with_rounds, zone_weights
from patrol.prepare import Prepared, prepare
from patrol.scenario import load_scenario
from patrol.tours.round import Round
from patrol.tours.visits import Ground, Visit, plan_visits
from patrol.zones.division import Divisions, Group, ZonedGround
from patrol.zones.spec import Weighing
from tests.present import present


def box(left: float, low: float, right: float, high: float) -> list[list[float]]:
    return [[left, low], [right, low], [right, high], [left, high]]


VAULT = {"name": "vault", "polygon": box(0, 0, 30, 30)}
CELLAR = {"name": "cellar", "polygon": box(20, 20, 60, 60)}


def prepared(*zones: dict[str, Any], **more: Any) -> Prepared:
    robots = {"count": 4, "model": "holonomic", "radius": 1.0, "speed": 2.0}
    given = {"terrain": {"builtin": "yards"}, "point": 1.0, "robots": robots, "zones": list(zones), **more}
    return prepare(load_scenario(given))


def divisions_of(made: Prepared, weighing: Weighing | None = None) -> Divisions:
    """The divisions under some zones, or under all of them with their first weights."""
    zones = frozenset((zone.name, zone.weight) for zone in made.scenario.zones if zone.weighs)
    divisions = ZonedGrounds(made).under(zones if weighing is None else weighing)
    assert divisions is not None
    return divisions


def ground_of(made: Prepared, weighing: Weighing | None = None) -> ZonedGround:
    return divisions_of(made, weighing).zoned


def test_the_greatest_weight_holds_and_the_rest_counts_once() -> None:
    ground = ground_of(prepared(VAULT | {"weight": 10}, CELLAR | {"weight": 0.5}))
    weights = ground.weights
    assert (weights[5, 5], weights[25, 25], weights[40, 40], weights[80, 80]) == (10.0, 10.0, 0.5, 1.0)
    assert ground.classes == (0.5, 1.0, 10.0)


def test_a_wanted_age_is_a_weight_against_the_best_tour() -> None:
    made = prepared(VAULT | {"age": 20})
    tour_s = best_tour(made).bound_of_fleet_s(made.scenario)
    assert tour_s is not None
    assert zone_weights(made) == {"vault": pytest.approx(tour_s / 20.0, abs=1e-3)}
    ground = ground_of(made)
    assert ground.wanted == tuple(20.0 if weight != 1.0 else None for weight in ground.classes)


@pytest.mark.parametrize("order", [1, -1])
def test_of_two_wishes_for_the_same_ground_the_lesser_age_counts(order: int) -> None:
    """The inner zone lies within the outer one, which weighs more."""
    zones: list[dict[str, Any]] = [VAULT | {"age": 30}, {"name": "safe", "polygon": box(5, 5, 20, 20), "age": 60}]
    ground = ground_of(prepared(*zones[::order]))
    assert [age for age in ground.wanted if age is not None] == [30.0]


def test_spare_robots_are_not_counted_on() -> None:
    robots = {"count": 3, "spare": 1, "model": "holonomic", "radius": 1.0, "speed": 2.0}
    made = prepared(VAULT | {"weight": 10}, robots=robots)
    divisions = divisions_of(made)
    assert len(made.scenario.roster) == 4
    assert present(divisions.best_s(made.scenario.team)) > present(divisions.best_s(4))


def test_rounds_show_the_ground_of_their_classes_and_none_is_longer_than_one_of_more() -> None:
    made = prepared(VAULT | {"weight": 10}, CELLAR | {"weight": 3})
    ground = ground_of(made)
    for (first, last), laid_out in ground.rounds.items():
        weights = ground.weights.reshape(-1)[laid_out.points]
        assert set(np.unique(weights)) == set(ground.classes[first : last + 1])
        wider = [ground.rounds[low, high] for low, high in ground.rounds if low <= first and last <= high]
        assert laid_out.length_m == min(other.length_m for other in wider)


def test_the_ground_follows_the_zones_in_force() -> None:
    made = prepared(VAULT | {"weight": 10, "times": [[60, 120]]}, CELLAR | {"weight": 3})
    expected: dict[Weighing, tuple[float, ...]] = {
        frozenset(): (1.0,),
        frozenset({("vault", 10.0)}): (1.0, 10.0),
        frozenset({("cellar", 3.0)}): (1.0, 3.0),
    }
    grounds = ZonedGrounds(made)
    for weighing, classes in expected.items():
        divisions = grounds.under(weighing)
        assert divisions is not None
        assert divisions.zoned.classes == classes
        assert grounds.under(weighing) is divisions
        assert len(divisions.zoned.rounds) == 1 + 2 * bool(weighing)
        assert divisions.best_s(4) == divisions.cost_s(divisions.divide(4))


def test_another_weight_in_the_same_order_keeps_the_rounds() -> None:
    made = prepared(VAULT | {"weight": 10}, CELLAR | {"weight": 3})
    grounds = ZonedGrounds(made)
    (first, *others) = [grounds.under(frozenset({("vault", w), ("cellar", 3.0)})) for w in (10.0, 30.0, 2.0, 3.0)]
    for vault, divisions, kept in zip((30.0, 2.0, 3.0), others, (True, False, False), strict=True):
        ground = present(divisions).zoned
        assert ground.classes == tuple(sorted({1.0, 3.0, vault}))
        assert (ground.rounds is present(first).zoned.rounds) == kept
        assert len(ground.rounds) == (6 if vault != 3.0 else 3)


def test_few_grounds_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("patrol.measures.zoned.MOST_PREPARED", 1)
    monkeypatch.setattr("patrol.measures.zoned.MOST_LATER", 1)
    grounds = ZonedGrounds(prepared(VAULT | {"weight": 10}, sensor={"angle": 90}))
    sets: list[Weighing] = [frozenset({("vault", weight)}) for weight in (1.0, 2.0, 3.0)]
    first, second, last = [grounds.under(weighing) for weighing in sets]
    assert grounds.under(sets[0]) is first, "it may have been prepared"
    assert grounds.under(sets[2]) is last
    assert grounds.under(sets[1]) is not second


def test_visits_are_chosen_only_where_they_may_be_best_and_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A group with visits that cannot be in the best division is not laid out."""
    boxes = [box(0, 0, 30, 30), box(60, 0, 90, 30), box(0, 60, 30, 90)]
    zones = [
        {"name": f"z{n}", "polygon": where, "age": age}
        for n, (where, age) in enumerate(zip(boxes, (12, 15, 20), strict=True))
    ]
    made = prepared(*zones, sensor={"range": 5.0})
    chosen: list[int] = []

    def count(base: Round, grounds: Mapping[int, Ground], robots: int) -> tuple[Visit, ...]:
        chosen.append(robots)
        return plan_visits(base, grounds, robots)

    monkeypatch.setattr("patrol.zones.division.plan_visits", count)
    grounds, weights = ZonedGrounds(made), zone_weights(made)
    best = present(grounds.under(frozenset((name, None) for name in weights))).divide(20)
    assert best == (Group((0, 0), 4), Group((1, 1), 3), Group((2, 2), 4), Group((3, 3), 9))
    assert len(chosen) < 20, "91 groups of the divisions would have visits"
    heavier = grounds.under(frozenset((name, 1.001 * weight) for name, weight in weights.items()))
    before = len(chosen)
    assert present(heavier).divide(20) == best
    assert len(chosen) == before, "the same rounds with the same wishes"


def test_all_combinations_of_few_zones_are_prepared_and_kept_with_the_rest(tmp_path: Path) -> None:
    made = prepared(VAULT | {"weight": 10, "times": [[60, 120]]}, CELLAR | {"weight": 3})
    made = with_rounds(made, switched=True)
    vault, cellar = ("vault", 10.0), ("cellar", 3.0)
    sets: set[Weighing] = {frozenset(), frozenset({vault}), frozenset({cellar}), frozenset({vault, cellar})}
    assert set(made.zoned) == sets
    made.save(tmp_path)
    loaded = Prepared.load(made.scenario, tmp_path)
    assert set(loaded.zoned) == sets
    for zones in sets:
        assert loaded.zoned[zones].classes == made.zoned[zones].classes
        assert Divisions(loaded.zoned[zones]).divide(4) == Divisions(made.zoned[zones]).divide(4)
        assert np.array_equal(loaded.zoned[zones].weights, made.zoned[zones].weights)


def test_changes_of_weights_and_of_many_zones_one_switch_away_are_prepared() -> None:
    boxes = {name: box(20 * n, 0, 20 * n + 15, 20) for n, name in enumerate("abcd")}
    zones = [{"name": name, "polygon": where, "weight": 2, "times": [[60, 90]]} for name, where in boxes.items()]
    made = prepared(*zones, sensor={"angle": 90})  # it has no rounds, whose search takes long
    made = with_rounds(made, switched=True)
    everything: Weighing = frozenset((name, 2.0) for name in "abcd")
    one_away = {frozenset({zone}) for zone in everything} | {everything - {zone} for zone in everything}
    assert set(made.zoned) == {frozenset(), everything, *one_away}
    made = prepared(VAULT | {"weight": 10, "weights": [[60, 5], [90, 10]]}, sensor={"angle": 90})
    made = with_rounds(made, switched=True)
    assert set(made.zoned) == {frozenset(), frozenset({("vault", 10.0)}), frozenset({("vault", 5.0)})}


@pytest.mark.parametrize("zones", [(), ({"name": "stairs", "polygon": box(10, 10, 20, 20), "keep_out": True},)])
def test_without_weights_nothing_is_zoned(zones: tuple[dict[str, Any], ...]) -> None:
    made = prepared(*zones)
    assert ZonedGrounds(made).under(frozenset()) is None
    assert not with_rounds(made, needed=False).zoned


def test_where_the_sensor_looks_ahead_only_there_are_no_rounds_and_no_wanted_age() -> None:
    no_tour = r"zones\.0\.age = 20: there is no tour .* to compare vault with; give it a weight"
    with pytest.raises(BadInput, match=no_tour):
        with_rounds(prepared(VAULT | {"age": 20}, sensor={"angle": 90}))
    divisions = divisions_of(prepared(VAULT | {"weight": 10}, sensor={"angle": 90}))
    assert not divisions.zoned.rounds
    assert divisions.best_s(4) is None


def test_a_zone_that_no_robot_sees_is_refused() -> None:
    shut = {"name": "shut", "polygon": box(0, 0, 0.5, 0.5), "weight": 2}
    walls = ~prepared().patrolled
    row, col = np.argwhere(walls)[0]
    shut["polygon"] = box(col + 0.2, row + 0.2, col + 0.8, row + 0.8)
    with pytest.raises(BadInput, match=r"zones\.0: shut: no robot sees any of it from ground that it can reach"):
        prepared(shut)


def test_rounds_are_found_once_where_they_are_needed_and_kept_with_the_rest(tmp_path: Path) -> None:
    ground = prepared()
    assert with_rounds(ground, needed=False) is ground
    made = with_rounds(ground)
    assert not ground.rounds, "what was prepared does not change"
    assert with_rounds(made) is made
    made.save(tmp_path)
    loaded = Prepared.load(made.scenario, tmp_path).rounds
    first = present(loaded[1])
    assert set(loaded) == {1, 2, 3, 4}
    assert all(laid_out is first for laid_out in loaded.values())
    assert np.array_equal(first.points, present(made.rounds[1]).points)
