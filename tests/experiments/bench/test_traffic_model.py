"""The model of a fleet's messages."""

from __future__ import annotations

import math

import pytest

from experiments.bench.measures.scale import SHARE, modelled
from experiments.bench.traffic_model import Fleet, RouterCost, cores_needed, largest_fleet, regions_of

COST = RouterCost(core_s=5e-6, wire_bytes=130.0)


def fleet(robots: int) -> Fleet:
    return Fleet(robots, rate=2.0, density=1e-4)


def test_where_everybody_hears_everybody_deliveries_are_all_pairs() -> None:
    assert fleet(5).deliveries() == 5 * 4 * 2
    assert cores_needed(fleet(1000), COST) == pytest.approx(1000 * 999 * 2 * 5e-6)


def test_where_robots_hear_those_near_them_deliveries_grow_with_the_fleet_alone() -> None:
    assert fleet(1000).heard(70.0) == pytest.approx(math.pi * 0.49)
    assert fleet(100_000).deliveries(70.0) == pytest.approx(100 * fleet(1000).deliveries(70.0))
    assert fleet(2).heard(1e6) == 1.0  # nobody hears more than all others


@pytest.mark.parametrize("share", [0.01, 0.5, 1.0, 8.0])
def test_the_largest_fleet_of_one_router_is_the_largest(share: float) -> None:
    size = largest_fleet(2.0, COST, share)
    assert cores_needed(fleet(size), COST) <= share < cores_needed(fleet(size + 1), COST)


@pytest.mark.parametrize("robots", [100, 10_000, 1_000_000])
def test_regions_are_as_few_as_their_routers_allow(robots: int) -> None:
    found = regions_of(fleet(robots), COST, 70.0, SHARE)
    along = math.isqrt(found.count)
    assert found.count == along**2
    assert found.core_share <= SHARE
    assert found.robots * found.count == pytest.approx(robots)
    if along == 1:
        assert found.foreign == 0.0
    else:
        fewer = robots / (along - 1) ** 2 * fleet(robots).heard(70.0) * 2.0 * COST.core_s
        assert fewer + 0.05 > SHARE
        assert 0.0 < found.foreign < found.robots


def test_no_number_of_regions_helps_where_one_robot_hears_too_many() -> None:
    with pytest.raises(ValueError, match="a router for each robot would still use"):
        regions_of(Fleet(200_000, 2.0, 1.0), COST, 1000.0, SHARE)


def test_what_is_modelled_says_how_many_one_router_carries() -> None:
    found = {one.name: one for one in modelled(fleet(1000), COST, 70.0)}
    assert (
        found["cores of one router, everybody heard"].says
        == f"half a core carries {largest_fleet(2, COST, 0.5)} robots"
    )
    assert found["routers of half a core"].values == (1.0,)
