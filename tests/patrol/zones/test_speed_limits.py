import math

import numpy as np
import pytest

from patrol.ground.terrain import Terrain
from patrol.zones.ground import SpeedLimits
from patrol.zones.spec import ZoneSpec

GROUND = Terrain("ground", np.ones((20, 20), dtype=np.bool_), 0.5)
WARD = ZoneSpec(name="ward", polygon=((2, 2), (8, 2), (8, 8), (2, 8)), speed=0.3)
BED = ZoneSpec(name="bed", polygon=((4, 4), (6, 4), (6, 6), (4, 6)), speed=0.1)
VAULT = ZoneSpec(name="vault", polygon=((0, 0), (9, 0), (9, 9)), weight=3.0)
ALL = {"ward", "bed", "vault"}


@pytest.mark.parametrize(
    ("place", "in_force", "limit"),
    [
        ((3.0, 3.0), ALL, 0.3),
        ((5.0, 5.0), ALL, 0.1),
        ((5.0, 5.0), {"ward"}, 0.3),
        ((5.0, 5.0), {"bed"}, 0.1),
        ((3.0, 3.0), {"bed", "vault"}, math.inf),
        ((1.9, 3.0), ALL, math.inf),
        ((2.0, 2.0), ALL, 0.3),
        ((8.0, 8.0), ALL, math.inf),
        ((-3.0, 50.0), ALL, math.inf),
    ],
)
def test_the_lowest_speed_of_the_zones_in_force_holds(
    place: tuple[float, float], in_force: set[str], limit: float
) -> None:
    assert SpeedLimits([VAULT, WARD, BED], GROUND).at(*place, in_force) == limit


def test_limits_add_time_to_each_metre_and_without_slow_zones_there_are_none() -> None:
    assert SpeedLimits([VAULT], GROUND).at(3.0, 1.0, ALL) == math.inf
    limits = SpeedLimits([VAULT, WARD, BED], GROUND)
    added = limits.delays(1.0, ALL)
    assert added is not None
    assert [added[10, 10], added[6, 6], added[0, 0]] == pytest.approx([9.0, 1 / 0.3 - 1.0, 0.0])
    for speed, in_force in ((0.1, {"bed"}), (1.0, {"vault"})):
        assert limits.delays(speed, in_force) is None
