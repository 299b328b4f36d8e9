import numpy as np
import pytest

from fogwatch.grounds.map_check import check_map
from patrol.ground.cspace import cspace_of, parts_of
from patrol.ground.doors import Rooms
from patrol.ground.left_out import left_out
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.pose import Pose

POINT = 0.1
WALLED_OFF = "walled off, without an opening"


def flat(*doors: int) -> Terrain:
    """A row of rooms of 4 x 4 m; between neighbours a wall of 0.2 m with a door of so many points."""
    free = np.ones((40, 42 * len(doors) + 40), dtype=np.bool_)
    for number, door in enumerate(doors):
        left = 40 + 42 * number
        free[:, left : left + 2] = False
        free[10 : 10 + door, left : left + 2] = True
    return Terrain("flat", free, POINT)


def at(x: float, y: float) -> list[Pose]:
    return [Pose(x, y, 0.0)]


def test_doors_are_found_with_place_width_and_what_lies_behind() -> None:
    report = check_map(flat(9, 15, 12), 0.2, starts=at(1.0, 1.0))
    assert [(round(door.width, 2), door.passes) for door in report.doors] == [(0.9, True), (1.1, True), (1.5, True)]
    narrow, middle, wide = report.doors
    assert narrow.x == pytest.approx(4.1, abs=0.15)
    assert narrow.y == pytest.approx(1.45, abs=0.06)
    assert narrow.radius == pytest.approx(0.4)
    assert narrow.behind == pytest.approx(16.1, abs=0.3)
    assert middle.x == pytest.approx(12.5, abs=0.15)
    assert wide.behind == pytest.approx(16.1, abs=0.3)
    assert report.parts == ()
    assert report.free == report.patrolled
    assert report.unseen == 0.0


@pytest.mark.parametrize("door", [5, 6, 9, 14])
def test_a_doors_radius_is_the_widest_that_passes(door: int) -> None:
    terrain = flat(door)
    found = check_map(terrain, 0.1, starts=at(1.0, 1.0)).doors[0]
    for radius, parts in ((found.radius - 1e-6, 1), (found.radius + 1e-6, 2)):
        assert parts_of(cspace_of(terrain, radius))[1] == parts


def test_rooms_behind_a_door_that_is_too_narrow_are_one_sealed_part() -> None:
    report = check_map(flat(12, 5, 9), 0.4, starts=at(1.0, 1.0))
    assert [door.passes for door in report.doors] == [False, True]
    (part,) = report.parts
    assert part.reason == "behind an opening that is too narrow for a body of radius 0.4 m"
    assert part.door == report.doors[0]
    assert part.area == pytest.approx(32.0, abs=0.5)
    assert part.x > 8.4
    assert 0.0 < part.seen < part.area
    assert part.standable < part.area
    assert report.unseen == pytest.approx(part.area - part.seen, abs=0.05)
    assert report.unseen == report.unseen_sealed
    assert np.count_nonzero(report.sealed == 1) * POINT**2 == pytest.approx(part.area)


def test_what_is_walled_off_or_too_small_is_told_apart() -> None:
    free = np.ones((60, 60), dtype=np.bool_)
    free[20:45, 20:45] = False
    free[22:43, 22:43] = True  # 2.1 x 2.1 m, no door
    free[:, 50:] = False
    free[10:16, 50:] = True  # a lane 0.6 m wide
    free[55, 55] = True  # a crumb
    report = check_map(Terrain("mixed", free, POINT), 0.35, sensor_range=1.5, starts=at(1.0, 1.0))
    assert [part.reason for part in report.parts] == [WALLED_OFF]
    walled = report.parts[0]
    assert walled.area == pytest.approx(21 * 21 * POINT**2)
    assert walled.seen == 0.0
    assert report.small_parts == 1
    assert report.small_area == pytest.approx(POINT**2)
    assert report.unseen == pytest.approx(report.free - report.patrolled)


@pytest.mark.parametrize("ring", [20, 4], ids=["wide", "narrow"])
def test_the_ground_outside_a_building_is_named_as_in_a_run(ring: int) -> None:
    free = np.ones((40 + 2 * ring, 40 + 2 * ring), dtype=np.bool_)
    free[ring:-ring, ring:-ring] = False
    free[ring + 1 : -ring - 1, ring + 1 : -ring - 1] = True
    report = check_map(Terrain("hall", free, POINT), 0.3)
    (part,) = report.parts
    assert part.at_border
    assert part.reason == WALLED_OFF
    assert report.patrolled == pytest.approx(38 * 38 * POINT**2)
    left = left_out(report.terrain, report.fields.patrolled, report.fields, 0.3)
    assert left is not None
    assert left.why == part.reason
    assert (left.x, left.y) == pytest.approx((part.x, part.y))


@pytest.mark.parametrize(
    ("rows", "columns", "at_border"),
    [
        (slice(0, 15), slice(20, 35), True),
        (slice(-15, None), slice(20, 35), True),
        (slice(20, 35), slice(0, 15), True),
        (slice(20, 35), slice(-15, None), True),
        (slice(20, 35), slice(20, 35), False),
        (slice(1, 15), slice(20, 35), False),
        (slice(-15, -1), slice(20, 35), False),
        (slice(20, 35), slice(1, 15), False),
        (slice(20, 35), slice(-16, -1), False),
    ],
    ids=[
        "bottom",
        "top",
        "left",
        "right",
        "inside",
        *(f"one off the {edge}" for edge in ("bottom", "top", "left", "right")),
    ],
)
def test_a_part_at_any_edge_of_the_map_is_at_the_border(rows: slice, columns: slice, at_border: bool) -> None:
    free = np.zeros((60, 70), dtype=np.bool_)
    free[rows, columns] = free[40:55, 40:60] = True
    (part,) = check_map(Terrain("parts", free, POINT), 0.3, starts=at(5.0, 4.7)).parts
    assert part.at_border is at_border


def test_the_starts_decide_what_is_sealed_off() -> None:
    terrain = flat(5)
    left = check_map(terrain, 0.3, starts=at(1.0, 1.0))
    right = check_map(terrain, 0.3, starts=at(7.0, 1.0))
    both = check_map(terrain, 0.3, starts=[*at(1.0, 1.0), *at(7.0, 1.0)])
    assert left.parts[0].x > 4.0 > right.parts[0].x
    assert both.parts == ()
    assert both.reachable == pytest.approx(left.reachable + right.reachable)
    assert not both.doors[0].passes


def test_unseen_corners_are_not_blamed_on_doors() -> None:
    free = np.ones((40, 40), dtype=np.bool_)
    free[:, 30:] = False
    free[2:4, 30:] = True
    free[4:30, 36:38] = True  # a crooked gap
    report = check_map(Terrain("crooked", free, POINT), 0.3, starts=at(1.0, 1.0))
    assert report.unseen > 0.2
    assert report.unseen_sealed <= report.unseen


def test_a_crumb_that_nobody_sees_is_sealed_off_and_no_blind_corner() -> None:
    free = np.zeros((40, 60), dtype=np.bool_)
    free[:, :40] = True
    free[20, 55] = True  # beyond a wall of 1.5 m, and too small for a room
    report = check_map(Terrain("crumb", free, POINT), 0.3, starts=at(1.0, 1.0))
    assert report.unseen == pytest.approx(POINT**2)
    assert report.unseen_sealed == pytest.approx(POINT**2)


@pytest.mark.parametrize("seed", range(6))
def test_rooms_tile_the_free_space_and_doors_split_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    free: BoolGrid = rng.random((60, 80)) > 0.03
    terrain = Terrain("noise", free, POINT)
    labels, count = parts_of(cspace_of(terrain, 0.15))
    reach = labels == 1 + int(np.argmax(np.bincount(labels.ravel())[1:]))
    rooms = Rooms(terrain, 0.15, reach)
    assert count > 1
    assert np.array_equal(rooms.labels > 0, free & ~rooms.crumbs)
    roots = np.flatnonzero(rooms.is_root)
    assert rooms.areas[roots].sum() == pytest.approx(np.count_nonzero(rooms.labels) * POINT**2)
    # Whatever is in one room and takes the body is in one part of the C-space.
    for room in np.unique(rooms.labels[rooms.labels > 0]):
        inside = labels[(rooms.labels == room) & (labels > 0)]
        assert np.unique(inside).size <= 1
