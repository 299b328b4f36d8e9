"""The time that slow zones cost on ways to a place."""

import numpy as np
import pytest

from agent.routes.ground import Ground
from agent.routes.routes import Routes
from agent.routes.slow_ways import SlowWays
from patrol.ground.terrain import Terrain
from patrol.zones.ground import SpeedLimits
from patrol.zones.spec import ZoneSpec

WARD = ZoneSpec(name="ward", polygon=((10, 0), (14, 0), (14, 10), (10, 10)), speed=0.2)
BED = ZoneSpec(name="bed", polygon=((10, 0), (12, 0), (12, 10), (10, 10)), speed=0.1)


def ways_to(place: tuple[float, float], free: np.ndarray, *zones: ZoneSpec) -> SlowWays:
    """The ways of a body of 1 m/s to a place on points of 0.5 m."""
    terrain = Terrain("ground", free, 0.5)
    lengths = Routes(Ground(terrain, free)).lengths(place).astype(np.float32)
    return SlowWays(lengths, 0.5, 1.0, SpeedLimits(zones, terrain))


@pytest.mark.parametrize(
    ("in_force", "delay_s"),
    [(set(), 0.0), ({"ward"}, 4 * 4.0), ({"bed"}, 2 * 9.0), ({"ward", "bed"}, 2 * 9.0 + 2 * 4.0)],
)
def test_each_metre_in_a_slow_zone_takes_longer(in_force: set[str], delay_s: float) -> None:
    ways = ways_to((2.25, 5.25), np.ones((20, 60), dtype=np.bool_), WARD, BED)
    assert ways.delay_s((10, 50), in_force) == pytest.approx(delay_s)
    assert ways.delay_s((10, 15), in_force) == 0.0


def test_a_way_beside_a_slow_zone_takes_no_longer() -> None:
    free = np.ones((40, 60), dtype=np.bool_)
    assert ways_to((2.25, 15.25), free, WARD).delay_s((30, 50), {"ward"}) == 0.0


def test_of_ways_of_one_length_the_slowest_counts() -> None:
    # From (0.25, 0.25) to (9.75, 4.75): diagonal first, through the zone, or straight on first, below it.
    zone = ZoneSpec(name="ward", polygon=((4, 4), (6, 4), (6, 6), (4, 6)), speed=0.5)
    assert ways_to((9.75, 4.75), np.ones((20, 20), dtype=np.bool_), zone).delay_s((0, 0), {"ward"}) > 1.0


def test_a_zone_faster_than_the_body_or_a_point_without_a_way_costs_nothing() -> None:
    free = np.ones((20, 60), dtype=np.bool_)
    fast = ZoneSpec(name="ward", polygon=((10, 0), (14, 0), (14, 10), (10, 10)), speed=2.0)
    assert ways_to((2.25, 5.25), free, fast).delay_s((10, 50), {"ward"}) == 0.0
    free[:, 40] = False
    assert ways_to((2.25, 5.25), free, WARD).delay_s((10, 50), {"ward"}) == 0.0


def test_many_points_agree_with_the_whole_ground() -> None:
    """A rectangle of slow ground around the place: the metres in it are those of the way at its rim."""
    free = np.ones((41, 41), dtype=np.bool_)
    zone = ZoneSpec(name="ward", polygon=((5, 5), (15.5, 5), (15.5, 15.5), (5, 15.5)), speed=0.5)
    ways = ways_to((10.25, 10.25), free, zone)
    assert ways.delay_s((20, 40), {"ward"}) == pytest.approx(10 * 0.5, abs=1.0)
    assert ways.delay_s((40, 40), {"ward"}) == pytest.approx(10 * 0.705, abs=1.0)


def test_a_step_is_as_slow_as_the_ground_on_which_it_begins() -> None:
    free = np.ones((20, 60), dtype=np.bool_)
    # Half a metre at 0.2 m/s takes 2 s longer than at 1 m/s.
    assert ways_to((9.75, 5.25), free, WARD).delay_s((10, 20), {"ward"}) == pytest.approx(2.0)
    assert ways_to((10.25, 5.25), free, WARD).delay_s((10, 19), {"ward"}) == 0.0
