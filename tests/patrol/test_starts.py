import math
import re
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from patrol.errors import BadInput
from patrol.ground.cspace import cspace_of
from patrol.ground.swept_path import free_fraction
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.maps.builtins import builtin_terrain
from patrol.maps.load import read_terrain
from patrol.pose import Pose
from patrol.scenario import RobotSpec
from patrol.scenario.sections import DEFAULT_RADIUS
from patrol.starts import clearance_at, place_starts, starting_part
from tests.patrol.maps.test_maps import write_map

FIELD = Terrain("field", np.ones((40, 40), dtype=np.bool_), 0.1)


def robots(*radii: float, starts: tuple[Pose | None, ...] = ()) -> list[RobotSpec]:
    given = [*starts, *[None] * (len(radii) - len(starts))]
    return [
        RobotSpec(number, f"r{number}", "holonomic", 1.0, radius, 1.0, start)
        for number, (radius, start) in enumerate(zip(radii, given, strict=True), start=1)
    ]


def building(side: int = 40, wall: int = 10, door: slice = slice(0, 0)) -> BoolGrid:
    """A field of side x side points with a building whose walls stand `wall` points from the border."""
    free = np.ones((side, side), dtype=np.bool_)
    free[wall : side - wall, wall : side - wall] = False
    free[wall + 1 : side - wall - 1, wall + 1 : side - wall - 1] = True
    free[door, wall] = True
    return free


def inside(pose: Pose, wall_m: float, side_m: float) -> bool:
    return wall_m < pose.x < side_m - wall_m and wall_m < pose.y < side_m - wall_m


@pytest.mark.parametrize("seed", range(5))
def test_bodies_fit_and_keep_apart(seed: int) -> None:
    terrain = Terrain("field", building(), 0.1, (-5.0, 3.0))
    roster = robots(0.2, 0.3, 0.1, 0.2)
    starts = place_starts(terrain, roster, seed)
    for spec, start in zip(roster, starts, strict=True):
        assert cspace_of(terrain, spec.radius)[terrain.point_at(start.x, start.y)]
        assert -math.pi < start.heading <= math.pi
    for (a, one), (b, other) in combinations(list(zip(roster, starts, strict=True)), 2):
        assert math.hypot(one.x - other.x, one.y - other.y) >= a.radius + b.radius + 0.2 - 1e-9


def test_random_starts_are_clear_of_closures_and_otherwise_the_same() -> None:
    passable = FIELD.passable.copy()
    passable[:, 14:] = False
    all_closed = Terrain("field", passable, 0.1)
    moved = 0
    for seed in range(20):
        before, after = (place_starts(FIELD, robots(0.2, 0.2), seed, ground) for ground in (None, all_closed))
        assert all(free_fraction(all_closed, start, start, 0.2) == 1.0 for start in after)
        if all(free_fraction(all_closed, start, start, 0.2) == 1.0 for start in before):
            assert after == before
        else:
            moved += 1
    assert 0 < moved < 20


def test_a_random_start_is_found_where_closures_leave_little_ground() -> None:
    terrain = Terrain("field", np.ones((60, 60), dtype=np.bool_), 0.1)
    passable = np.zeros((60, 60), dtype=np.bool_)
    passable[:6, :6] = True
    (start,) = place_starts(terrain, robots(0.2), 3, Terrain("field", passable, 0.1))
    assert start.x < 0.6
    assert start.y < 0.6
    with pytest.raises(BadInput, match="do not fit"):
        place_starts(terrain, robots(0.2, 0.2), 3, Terrain("field", passable, 0.1))


def test_starts_depend_on_the_seed_and_the_robots_number() -> None:
    terrain = Terrain("field", np.ones((300, 300), dtype=np.bool_), 0.1)
    assert place_starts(terrain, robots(0.2, 0.2, 0.2), 7) == place_starts(terrain, robots(0.2, 0.2, 0.2), 7)
    assert place_starts(terrain, robots(0.2, 0.2, 0.2), 7) != place_starts(terrain, robots(0.2, 0.2, 0.2), 8)
    assert len({(start.x, start.y, start.heading) for start in place_starts(terrain, robots(*[0.2] * 9), 7)}) == 9


def test_a_crowd_fills_the_last_gap_and_one_more_is_refused() -> None:
    # Centres may lie in columns 1 to 8 of one row; each body takes four of them from the others on either side.
    terrain = Terrain("lane", np.ones((3, 10), dtype=np.bool_), 1.0)
    for seed in range(20):
        fitting = place_starts(terrain, robots(1.0, 1.0), seed)
        assert abs(fitting[0].x - fitting[1].x) >= 4.0
    with pytest.raises(BadInput, match=r"3 robots do not fit on lane: no place is left .* after 2"):
        place_starts(terrain, robots(1.0, 1.0, 1.0), 1)


def test_a_fleet_larger_than_the_ground_is_refused_before_any_place_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    terrain = Terrain("hall", np.ones((60, 60), dtype=np.bool_), 1.0)
    assert len(place_starts(terrain, robots(*[1.0] * 150), 1)) == 150
    monkeypatch.setattr("patrol.starts.draw", lambda *_: pytest.fail("drew"))
    two_halls = np.ones((60, 121), dtype=np.bool_)
    two_halls[:, 60] = False  # robots start in one of them
    taken = r"with the distance that they keep they take 5027 m², and 3600 m² are free where they start"
    for ground in (terrain, Terrain("hall", two_halls, 1.0)):
        with pytest.raises(BadInput, match=rf"^robots: 400 robots do not fit on hall: {taken}; use .*fewer"):
            place_starts(ground, robots(*[1.0] * 400), 1)


def test_spare_robots_move_nobody_and_may_have_to_wait_for_their_place() -> None:
    terrain = Terrain("field", building(), 0.1, (-5.0, 3.0))
    fleet = robots(0.2, 0.3)
    for radius in (0.1, 0.3):
        spare = replace(robots(0.2, 0.3, radius)[2], spare=True)
        assert place_starts(terrain, [*fleet, spare], 3)[:2] == place_starts(terrain, fleet, 3)
    room = Terrain("closet", np.ones((6, 6), dtype=np.bool_), 0.1, (0.0, 0.0))
    one, other = robots(0.2, 0.2)
    with pytest.raises(BadInput, match=r"^robots: 2 robots do not fit"):
        place_starts(room, [one, other], 3)
    assert len(place_starts(room, [one, replace(other, spare=True)], 3)) == 2


def test_robots_start_inside_a_building_and_not_around_it() -> None:
    terrain = Terrain("hall", building(), 0.1)
    outside = cspace_of(terrain, 0.2) & ~starting_part(terrain, 0.2)
    assert np.count_nonzero(outside) > np.count_nonzero(starting_part(terrain, 0.2))
    for seed in range(5):
        assert all(inside(start, 1.0, 4.0) for start in place_starts(terrain, robots(0.2, 0.2), seed))


def test_a_shed_in_a_field_is_no_place_to_start() -> None:
    terrain = Terrain("shed", building(side=40, wall=16), 0.1)
    assert not starting_part(terrain, 0.2)[20, 20]
    # With an open door as wide as the body there is one part only, and it touches the border.
    terrain = Terrain("open hall", building(door=slice(15, 25)), 0.1)
    assert starting_part(terrain, 0.2)[5, 5]
    assert starting_part(terrain, 0.2)[20, 20]
    framed = building()  # a part is outside only if the border bounds it
    framed[[0, -1], :] = False
    framed[:, [0, -1]] = False
    terrain = Terrain("framed", framed, 0.1)
    assert starting_part(terrain, 0.2)[5, 5]


def test_a_given_start_draws_the_others_to_its_part() -> None:
    terrain = Terrain("hall", building(), 0.1)
    starts = place_starts(terrain, robots(0.2, 0.2, starts=(Pose(0.5, 0.5, 1.0),)), 3)
    assert starts[0] == Pose(0.5, 0.5, 1.0)
    assert not inside(starts[1], 1.0, 4.0)


@pytest.mark.parametrize(
    ("start", "problem"),
    [
        (Pose(4.5, 1.0, 0.0), "not on field, which spans x 0 to 4 m and y 0 to 4 m"),
        (Pose(math.nan, 1.0, 0.0), "not on field"),
        (Pose(0.19, 2.0, 0.0), r"is 0\.19 m away, nearer than the radius of 0\.2 m"),
        (Pose(0.85, 2.0, 0.0), r"is 0\.15 m away"),
        (Pose(1.05, 2.0, 0.0), "is 0 m away"),
    ],
)
def test_a_start_that_does_not_fit_is_named(start: Pose, problem: str) -> None:
    with pytest.raises(BadInput, match=problem) as caught:
        place_starts(Terrain("field", building(), 0.1), robots(0.2, starts=(start,)), 1)
    assert "of r1" in str(caught.value)


def test_starts_that_overlap_are_named() -> None:
    touching = (Pose(1.0, 1.0, 0.0), Pose(1.5, 1.0, 0.0))
    assert place_starts(FIELD, robots(0.2, 0.3, starts=touching), 1) == list(touching)
    with pytest.raises(BadInput, match="of r2: overlaps robot 1"):
        place_starts(FIELD, robots(0.2, 0.3, starts=(Pose(1.0, 1.0, 0.0), Pose(1.49, 1.0, 0.0))), 1)


def test_clearance_is_exact_anywhere_within_a_point() -> None:
    terrain = Terrain("field", building(), 0.1, (10.0, 20.0))
    rng = np.random.default_rng(2)
    low = np.argwhere(~terrain.passable)[:, ::-1] * 0.1 + [10.0, 20.0]
    for x, y in rng.uniform([10.0, 20.0], [14.0, 24.0], (50, 2)):
        away = np.maximum(np.maximum(low - [x, y], [x, y] - (low + 0.1)), 0.0)
        edge = min(x - 10.0, y - 20.0, 14.0 - x, 24.0 - y)
        expected = min(float(np.hypot(away[:, 0], away[:, 1]).min()), edge, 0.6)
        assert clearance_at(terrain, x, y, 0.6) == pytest.approx(expected)


def two_rooms(left: int, door: int) -> Terrain:
    """Rooms of 6 m and of 6 m less `left` points, 4 m high, joined by a door `door` points wide."""
    free = np.ones((40, 121 - left), dtype=np.bool_)
    free[:, 60] = False
    free[10 : 10 + door, 60] = True
    return Terrain("rooms", free, 0.1)


def test_a_body_that_fits_nowhere_is_refused_with_the_largest_radius_that_fits() -> None:
    with pytest.raises(BadInput, match=r"fits nowhere on rooms, .*use a radius of at most 1\.9 m$") as caught:
        place_starts(two_rooms(0, 9), robots(2.5), 1)
    most = float(str(caught.value).split()[-2])
    assert place_starts(two_rooms(0, 9), robots(most, starts=(Pose(3.0, 2.0, 0.0),)), 1)
    with pytest.raises(BadInput):
        place_starts(two_rooms(0, 9), robots(most + 0.02), 1)


@pytest.mark.parametrize(("name", "coarse"), [("yards", 5.0), ("clutter", 5.0), ("clutter", 10.0)])
def test_points_that_are_too_coarse_are_to_be_smaller_and_then_the_body_fits(name: str, coarse: float) -> None:
    with pytest.raises(BadInput, match=r"use a smaller point, such as --point [0-9.]+") as caught:
        place_starts(builtin_terrain(name, coarse), robots(1.0, 1.0), 1)
    advice = re.search(r"a smaller point, such as --point ([0-9.]+)", str(caught.value))
    assert advice
    assert "radius of 0 m" not in str(caught.value)
    assert place_starts(builtin_terrain(name, float(advice[1].rstrip("."))), robots(1.0, 1.0), 1)


def test_a_crowd_on_coarse_points_is_told_so() -> None:
    coarse = Terrain("lane", np.ones((3, 4), dtype=np.bool_), 2.0)
    with pytest.raises(BadInput, match=r"4 robots do not fit.*; use a smaller point, such as --point 0\.05, or fewer"):
        place_starts(coarse, robots(0.3, 0.3, 0.3, 0.3), 1)


def test_a_map_whose_settings_leave_only_the_walls_is_to_blame_and_not_the_body(tmp_path: Path) -> None:
    picture = np.pad(np.full((398, 398), 254, dtype=np.uint8), 1)
    plan = write_map(tmp_path, Image.fromarray(picture), {"negate": 1})
    with pytest.raises(BadInput, match=r"no room for a body .*make 1\.0 % of its cells free.*negate: 0") as caught:
        place_starts(read_terrain(plan, 0.1), robots(0.3), 1)
    assert str(caught.value).startswith(str(plan))
    assert "smaller radius" not in str(caught.value)


def test_a_body_too_wide_for_every_door_but_a_closets_is_refused_unless_told_where_to_start() -> None:
    assert place_starts(two_rooms(0, 9), robots(0.4), 1)
    too_wide = r"too wide for every door of rooms, .*; the widest, at \(6\.05, .* radius of 0\.4 m"
    with pytest.raises(BadInput, match=too_wide):
        place_starts(two_rooms(0, 9), robots(0.45), 1)
    chosen = Pose(3.0, 2.0, 0.0)
    assert place_starts(two_rooms(0, 9), robots(0.45, starts=(chosen,)), 1) == [chosen]
    assert place_starts(two_rooms(55, 9), robots(0.45), 1)[0].x < 6.0


def test_a_corridor_between_the_points_of_the_grid_opens_with_the_smaller_point_that_is_advised(tmp_path: Path) -> None:
    picture = np.zeros((100, 380), dtype=np.uint8)
    picture[10:90, 10:90] = picture[10:90, 290:370] = 254
    picture[43:57, 90:290] = 254  # 0.7 m wide, from 2.15 to 2.85 m: five whole points of 0.1 m
    plan = write_map(tmp_path, Image.fromarray(picture), {"resolution": 0.05})
    with pytest.raises(BadInput, match=r"too wide for every door .*; use a smaller point, such as --point 0\.05 or"):
        place_starts(read_terrain(plan, 0.1), robots(0.3), 1)
    assert place_starts(read_terrain(plan, 0.05), robots(0.3), 1)
    with pytest.raises(BadInput, match=r"too wide for every door .*; use a smaller radius"):
        place_starts(read_terrain(plan, 0.1), robots(0.4), 1)


def test_the_error_says_whether_the_radius_is_the_default() -> None:
    for rooms, radius, default in (
        (two_rooms(0, 9), DEFAULT_RADIUS, True),
        (two_rooms(0, 9), 0.45, False),
        (Terrain("closet", np.ones((6, 6), dtype=np.bool_), 0.1), DEFAULT_RADIUS, True),
        (Terrain("closet", np.ones((6, 6), dtype=np.bool_), 0.1), 0.45, False),
    ):
        with pytest.raises(BadInput) as caught:
            place_starts(rooms, robots(radius), 1)
        line = str(caught.value)
        assert line.startswith(f"robots.radius = {radius:g}{', the default' if default else ''}: ")
        assert ("your robot's own radius, or give starts" in line) == (default and rooms.name == "rooms")
