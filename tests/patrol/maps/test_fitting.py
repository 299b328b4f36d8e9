"""The advice to a body that does not fit is right: what is advised fits, and a hundredth more does not."""

import re

import numpy as np
import pytest

from patrol.ground.cspace import cspace_of
from patrol.ground.doors import Door
from patrol.ground.terrain import Terrain
from patrol.maps.fitting import fits_no_door, fits_nowhere, largest_radius, no_room_for_all


def room(width_m: float, height_m: float, point: float) -> Terrain:
    return Terrain("room", np.ones((round(height_m / point), round(width_m / point)), dtype=np.bool_), point)


@pytest.mark.parametrize(
    ("width_m", "height_m", "point", "radius"),
    [(3.0, 9.0, 1.0, 1.0), (9.0, 5.0, 1.0, 2.0), (4.0, 4.0, 1.0, 1.0), (1.0, 8.0, 1.0, 0.0), (1.1, 3.0, 0.1, 0.5)],
)
def test_the_largest_radius_fits_and_a_hundredth_more_does_not(
    width_m: float, height_m: float, point: float, radius: float
) -> None:
    """A centre lies in the middle of a point, and keeps its radius and half a point to all walls."""
    terrain = room(width_m, height_m, point)
    assert largest_radius(terrain) == pytest.approx(radius)
    assert not cspace_of(terrain, radius + 0.01).any()
    assert radius == 0.0 or cspace_of(terrain, radius).any()


def advised(text: str) -> float:
    found = re.search(r"a smaller point, such as --point ([0-9.]+)", text)
    return float(found[1].rstrip(".")) if found else 0.0


@pytest.mark.parametrize(
    ("width_m", "radius", "finer", "fits"),
    [
        (3.0, 1.2, 0.2, True),  # 0.3 m to spare on each side, of which a point and a half are needed
        (3.0, 1.34, 0.1, True),
        (3.0, 1.47, 0.0, False),  # 0.02 m: a point below a twentieth of the radius is not advised
        (3.0, 1.6, 0.0, False),
        (1.0, 0.45, 0.1, False),  # nor here, but such coarse points are to be a quarter of the radius
        (2.0, 0.7, 0.1, True),
    ],
)
def test_a_finer_grid_is_advised_where_it_may_help(width_m: float, radius: float, finer: float, fits: bool) -> None:
    text = fits_nowhere(room(width_m, width_m, 1.0), radius)
    assert text.startswith(f"robots.radius = {radius:g}: a body this wide fits nowhere on room, on points of 1 m; use ")
    assert advised(text) == finer
    assert fits == bool(finer and cspace_of(room(width_m, width_m, finer), radius).any())


def test_radii_below_a_centimetre_are_not_advised() -> None:
    assert fits_nowhere(room(1.0, 8.0, 1.0), 1.1).endswith("use a smaller radius")
    assert fits_nowhere(room(1.02, 8.0, 0.34), 0.5).endswith("a radius of at most 0.34 m")
    line = Terrain("line", np.ones((3, 30), dtype=np.bool_), 0.01)
    assert fits_nowhere(line, 0.5).endswith("use a radius of at most 0.01 m")


def test_a_crowd_is_counted_and_told_why() -> None:
    one = no_room_for_all(room(3.0, 3.0, 0.1), 0.3, 1, "no place is left")
    assert one == "robots: 1 robot do not fit on room: no place is left; use fewer or smaller robots"
    two = no_room_for_all(room(3.0, 3.0, 1.0), 0.8, 2, "full")
    assert two.startswith(
        "robots: 2 robots do not fit on room: full; use a smaller point, such as --point 0.2, or fewer"
    )


@pytest.mark.parametrize(
    ("passing", "lets", "remedy"),
    [
        (0.356, "lets a radius of 0.35 m pass", "a smaller radius"),
        (0.01, "lets a radius of 0.01 m pass", "a smaller radius"),
        (0.0099, "lets no body pass", "a smaller radius"),
    ],
)
def test_the_widest_door_is_told_with_what_passes(passing: float, lets: str, remedy: str) -> None:
    door = Door(6.054, 1.25, 0.812, passing, 4.0, False)
    text = fits_no_door(room(9.0, 9.0, 0.1), 0.45, door, False, lambda _: False)
    assert text == (
        "robots.radius = 0.45: too wide for every door of room, on points of 0.1 m; the widest, at (6.05, 1.25), is "
        f"0.81 m wide and {lets}; use {remedy}, or give starts to patrol one room"
    )
    own = fits_no_door(room(9.0, 9.0, 0.1), 0.45, door, True, lambda _: False)
    assert f"{lets}; use your robot's own radius, or" in own
    assert own.startswith("robots.radius = 0.45, the default: ")
