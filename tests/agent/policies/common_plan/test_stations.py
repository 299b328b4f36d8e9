"""Groups of a large fleet: each station is one group's, and a death changes the plan of its own group alone."""

import numpy as np
import pytest

from agent.policies.common_plan import stations as module
from agent.policies.common_plan.stations import Group, Groups
from patrol.pose import Pose
from patrol.prepare import Prepared
from patrol.tours import round as rounds
from tests.agent.plans import prepared_in, stations_of, two_rooms

ALL = frozenset(range(1, 7))


def prepared(speeds: tuple[float, ...] = (1.0,) * 6) -> Prepared:
    starts = [Pose(1.0 + 4.0 * i, 4.0, 0.0) for i in range(6)]
    robots = {"radius": 0.2, "speed": 1.0}
    return prepared_in(two_rooms(), starts, robots, speeds=speeds, sensor={"range": 2.0})


def groups_of(ready: Prepared) -> Groups:
    return Groups(stations_of(ready), ready.scenario.roster, ready.starts, ready.terrain)


@pytest.fixture
def groups(monkeypatch: pytest.MonkeyPatch) -> Groups:
    monkeypatch.setattr(module, "MOST_TOGETHER", 2)
    return groups_of(prepared())


def all_of(groups: Groups, team: frozenset[int], living: frozenset[int]) -> list[Group]:
    distinct = {id(group.known): group for number in sorted(living) if (group := groups.find(number, team, living))}
    return list(distinct.values())


def test_few_robots_are_one_group() -> None:
    groups = groups_of(prepared())
    assert groups.find(3, ALL, ALL) == Group(ALL, groups.known)


def test_each_robot_and_each_point_is_in_one_group(groups: Groups) -> None:
    found = all_of(groups, ALL, ALL)
    assert sorted(number for group in found for number in group.robots) == sorted(ALL)
    points = np.concatenate([group.known.points for group in found])
    assert sorted(points.tolist()) == sorted(groups.known.points.tolist())
    assert sum(group.known.length_m for group in found) == pytest.approx(groups.known.length_m)


def test_a_stretch_is_the_round_without_the_other_stations(groups: Groups) -> None:
    known = groups.known
    part = known.stretch(2, 7)
    assert len(part) == 5
    assert part.apart_m.tolist() == known.apart_m[2:7, 2:7].tolist()
    for station in range(5):
        assert part.points[part.span(station)].tolist() == known.points[known.span(2 + station)].tolist()
        assert (part.around.flat[part.points[part.span(station)]] == station).all()
    assert np.count_nonzero(part.around >= 0) == part.points.size


def test_on_large_ground_each_group_finds_the_ways_of_its_own_stations(monkeypatch: pytest.MonkeyPatch) -> None:
    known = groups_of(prepared()).known
    monkeypatch.setattr(module, "STATIONS_TOGETHER", 8)
    monkeypatch.setattr(rounds, "MOST_STATIONS", 8)
    groups = groups_of(prepared())
    assert len(groups.known) == len(known)
    parts = [group.known for group in all_of(groups, ALL, ALL)]
    assert len(parts) == -(-len(known) // 8)
    for part in parts:
        first = known.begins.tolist().index(part.first)
        whole_m = known.apart_m[first : first + len(part), first : first + len(part)]
        is_near = whole_m < rounds.NEAR * 2.0
        np.testing.assert_allclose(part.apart_m[is_near], whole_m[is_near])
        assert (part.apart_m[~is_near] >= whole_m[~is_near]).all()
        assert part.near.shape == (len(part), min(8, len(part) - 1))


def test_neighbours_are_together(groups: Groups) -> None:
    """The first stations of two robots of one group are nearer along the round than those of two of different ones."""
    assert groups.find(1, ALL, ALL).robots != groups.find(6, ALL, ALL).robots


def test_fast_robots_get_more_stations(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_TOGETHER", 1)
    groups = groups_of(prepared(speeds=(2.0, 1.0, 1.0, 1.0, 1.0, 1.0)))
    sizes = {number: len(groups.find(number, ALL, ALL).known) for number in ALL}
    assert sizes[1] > 1.5 * max(sizes[number] for number in ALL - {1})


def test_a_death_changes_its_own_group_alone_until_half_of_one_is_lost(
    groups: Groups, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MOST_TOGETHER", 3)
    before = {number: groups.find(number, ALL, ALL) for number in ALL}
    lost = min(before[1].robots)
    living = ALL - {lost}
    for number in living:
        after = groups.find(number, ALL, living)
        assert after == Group(before[number].robots - {lost}, before[number].known)
    living -= {min(before[1].robots - {lost})}
    anew = all_of(groups, ALL, living)
    assert sorted(number for group in anew for number in group.robots) == sorted(living)
    assert sum(len(group.known) for group in anew) == len(groups.known)


def test_a_robot_that_joins_is_in_a_group(groups: Groups) -> None:
    team = ALL - {4}
    assert 4 in groups.find(4, team, ALL).robots


def test_where_ground_weighs_more_a_group_has_fewer_stations(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_TOGETHER", 3)
    ready = prepared()
    weights = np.ones(ready.terrain.shape)
    weights[:, : ready.terrain.width // 2] = 3.0
    groups = Groups(stations_of(ready, weights), ready.scenario.roster, ready.starts, ready.terrain)
    heavy, light = sorted((group.known for group in all_of(groups, ALL, ALL)), key=len)
    assert heavy.rates.sum() == pytest.approx(light.rates.sum(), rel=0.15)
    assert len(heavy) < 0.8 * len(light)
    for part in (heavy, light):
        assert part.rates.tolist() == np.maximum.reduceat(part.weights, part.begins[:-1]).tolist()


def test_robots_of_a_part_in_which_all_are_spare_share_it() -> None:
    groups = groups_of(prepared())
    assert groups.find(2, frozenset(), frozenset({2, 3})).robots == {2, 3}


@pytest.mark.parametrize("factor", [0.001, 1.0, 30.0])
def test_most_stations_count_as_without_weights(factor: float) -> None:
    """A light corner does not make all other ground heavy, nor does a zone over all of it."""
    ready = prepared()
    weights = np.full(ready.terrain.shape, factor)
    weights[:, : ready.terrain.width // 3] *= 0.01
    rates = stations_of(ready, weights).rates
    assert np.median(rates) == rates.max() == 1.0
    assert rates.min() <= 0.02


def test_few_divisions_are_kept_and_that_of_all_robots_stays(groups: Groups) -> None:
    whole = groups.find(1, ALL, ALL)
    for lost in range(2, 7):
        groups.find(1, ALL, frozenset({1, lost}))
    assert len(groups._divided) == module.MOST_DIVISIONS
    assert groups.find(1, ALL, ALL).known is whole.known
