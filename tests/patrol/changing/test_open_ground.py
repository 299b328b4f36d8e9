from dataclasses import replace

import numpy as np
import pytest

from patrol.changing.ground import ChangingTerrain, ClosedPoints
from patrol.changing.open_ground import OpenAges, OpenGround
from patrol.ground.terrain import Terrain
from patrol.journal import Event
from patrol.prepare import Prepared, prepare, sensor_footprint
from patrol.scenario import load_scenario

WALL = {"name": "wall", "polygon": [[50, 0], [51, 0], [51, 88], [50, 88]], "closed": [[10, 20]]}
WEST, EAST = (20.5, 40.5), (80.5, 40.5)


@pytest.fixture(scope="module")
def halves() -> Prepared:
    """The terrain `open` for two robots, with a wall between its halves at times."""
    robots = {"count": 2, "model": "holonomic", "radius": 0.4, "starts": [list(WEST), list(EAST)]}
    given = {"terrain": {"builtin": "open"}, "point": 1.0, "robots": robots, "closures": [WALL]}
    return prepare(load_scenario(given))


def open_ground_of(prepared: Prepared) -> OpenGround:
    ground = prepared.open_ground()
    assert ground is not None
    return ground


def closed(prepared: Prepared) -> Terrain:
    points = ClosedPoints(prepared.closable, prepared.terrain)
    points.take(Event(0, "closed", None, "wall"))
    ground = ChangingTerrain(prepared.terrain)
    ground.close(points.grid)
    return ground


def test_a_half_without_a_robot_is_closed_out(halves: Prepared) -> None:
    ground = open_ground_of(halves)
    ground.tick(0, halves.terrain, (), {1: WEST}, {})
    assert not ground.closed_out.any()
    ground.tick(1, closed(halves), {"wall"}, {1: WEST}, {})
    assert ground.closed_out[40, 80]
    assert not ground.closed_out[40, 20]
    assert not ground.closed_out[40, 49]  # beside the wall, in sight from where a body fits
    assert ground.closed_out[40, 50]
    ground.tick(2, closed(halves), {"wall"}, {1: WEST, 2: EAST}, {})
    assert not ground.closed_out[40, 80]
    assert ground.closed_out[40, 50]
    ground.tick(3, closed(halves), {"wall"}, {}, {})
    assert not ground.closed_out.any(), "nor is anything without robots"
    ground.tick(4, closed(halves), {"wall"}, {1: WEST}, {})
    assert ground.closed_out.any()
    ground.tick(5, halves.terrain, (), {1: WEST}, {})
    assert not ground.closed_out.any()


def test_ground_behind_a_wreck_is_closed_out_as_behind_a_door(halves: Prepared) -> None:
    """The wall has a gap of 6 m, which a row of wrecks fills."""
    points = ClosedPoints(halves.closable, halves.terrain)
    points.take(Event(0, "closed", None, "wall"))
    shut = points.grid.copy()
    shut[40:46] = False
    gap, wrecks = ChangingTerrain(halves.terrain), {2: (50.5, 41.0), 3: (50.5, 43.0), 4: (50.5, 45.0)}
    gap.close(shut)
    radii = dict.fromkeys((1, 2, 3, 4), 0.4)
    ground = OpenGround(gap, halves.patrolled, radii, 10.0, line_of_sight=True)
    ground.tick(0, gap, (), {1: WEST}, {2: wrecks[2]})
    assert not ground.closed_out.any(), "there is a way past it"
    ground.tick(1, gap, (), {1: WEST}, wrecks)
    assert ground.closed_out[40, 80]
    assert not ground.closed_out[42, 53], "in sight past them"
    assert not ground.closed_out[40, 20]
    ground.tick(2, gap, (), {1: WEST, 2: EAST}, {3: wrecks[3], 4: wrecks[4]})
    assert not ground.closed_out[40, 80], "there is a robot behind"
    ground.tick(3, gap, (), {1: WEST}, {})
    assert not ground.closed_out.any()


def test_a_wreck_that_a_robot_gets_past_bars_nothing_from_then_on(halves: Prepared) -> None:
    shut, wreck = closed(halves).passable.copy(), {2: (50.5, 43.0)}
    shut[42:45, 50] = True
    ground = OpenGround(Terrain("gap", shut, 1.0), halves.patrolled, dict.fromkeys((1, 2, 3), 0.4), 10.0, True)

    def tick(k: int, place: tuple[float, float], wrecks: dict[int, tuple[float, float]] = wreck) -> bool:
        ground.tick(k, ground._terrain, (), {1: place}, wrecks)
        return bool(ground.closed_out[40, 80])

    assert tick(0, (48.5, 43.5))
    assert tick(1, (49.5, 43.5)), "it is right beside the wreck"
    assert not tick(2, (54.5, 43.5))
    assert not tick(3, WEST)
    assert not tick(4, WEST, {**wreck, 3: (10.5, 10.5)})
    assert tick(5, WEST, {2: (50.5, 43.5)}), "it stands elsewhere"


def test_a_robot_right_beside_a_wreck_is_on_the_side_that_it_leaves_to(halves: Prepared) -> None:
    shut = closed(halves).passable.copy()
    shut[42:45, 50] = True
    ground = OpenGround(Terrain("gap", shut, 1.0), halves.patrolled, dict.fromkeys((1, 2), 0.4), 10.0, True)
    wreck = {2: (50.5, 43.5)}
    for k, (place, west, east) in enumerate([((51.5, 43.5), False, True), (WEST, False, True), (EAST, False, False)]):
        ground.tick(k, ground._terrain, (), {1: place}, wreck)
        if k:
            assert (bool(ground.closed_out[40, 20]), bool(ground.closed_out[40, 80])) == (west, east)


def test_a_robot_is_not_asked_to_see_what_it_cannot_get_to(halves: Prepared) -> None:
    ground, seen = open_ground_of(halves), np.full(halves.terrain.shape, 3, dtype=np.int32)
    both = {1: WEST, 2: EAST}
    ground.tick(5, closed(halves), {"wall"}, both, {})
    now = ground.last_seen_or_out(1, 8, seen)
    assert (now[40, 80], now[40, 20]) == (8, 3)
    ground.tick(10, halves.terrain, (), both, {})
    later = ground.last_seen_or_out(1, 12, seen)
    assert (later[40, 80], later[40, 20]) == (9, 3)


def test_ages_stand_still_while_a_point_is_closed_out() -> None:
    patrolled = np.ones((1, 2), dtype=np.bool_)
    out, seen = np.array([[False, True]]), np.array([[0, 0]], dtype=np.int32)
    none = np.zeros((1, 2), dtype=np.bool_)
    ages = OpenAges(patrolled)
    for k in range(1, 11):
        seen[0, 0] = k
        ages.tick(k, out if 3 <= k <= 6 else none, seen)
    assert ages.greatest == [1, 2, 2, 2, 2, 2, 3, 4, 5, 6]
    assert ages.closed_share == [0.0, 0.0, 0.5, 0.5, 0.5, 0.5, 0.0, 0.0, 0.0, 0.0]
    seen[0, 1] = 11
    ages.tick(11, none, seen)
    ages.tick(12, none, seen)
    assert ages.greatest[-2:] == [1, 2]


def test_closings_say_what_is_closed_and_waits_at_any_tick_and_show_it_to_a_sensor(halves: Prepared) -> None:
    events = [Event(4, "closed", None, "wall"), Event(4, "dead", 1, "wall"), Event(9, "opened", None, "wall")]
    assert not halves.closings(events[:1]).grid(0).any(), "closed at the end"
    closings = halves.closings(events)
    assert [len(closings.names(k)) for k in (0, 3, 4, 8, 9, 20)] == [0, 0, 1, 1, 0, 0]
    assert closings.grid(8)[40, 50]
    assert not closings.grid(9).any()
    assert not closings.grid(0).any()
    waits = Event(3, "waiting", 1, "wall waits to close: r1 in it")
    closings = halves.closings([waits, Event(6, "closed", None, "wall")])
    more = [Event(8, "opened", None, "wall"), replace(waits, k=9), Event(12, "stays open", None, "wall")]
    closings.take(more)
    assert [len(closings.at(k)[1]) for k in (2, 3, 5, 6, 8, 9, 12)] == [0, 1, 1, 0, 0, 1, 0]
    assert (closings.now.names, closings.now.waiting) == (set(), set())
    sensor, other = (sensor_footprint(halves.scenario, halves.terrain) for _ in range(2))
    for k, footprint, closed in ((6, sensor, True), (8, other, False), (7, other, True), (0, sensor, False)):
        closings.show(k, footprint)
        assert bool(footprint.terrain.passable[40, 50]) is not closed


@pytest.mark.parametrize(("behind", "shut_in"), [(50, []), (51, [1])])
def test_a_robot_that_can_see_half_of_the_ground_is_not_shut_in(
    halves: Prepared, behind: int, shut_in: list[int]
) -> None:
    patrolled = np.zeros(halves.terrain.shape, dtype=np.bool_)
    patrolled[10:59, 20] = patrolled[10:60, 80] = True
    patrolled[60, 80 if behind == 51 else 20] = True
    fields = {number: replace(of_body, patrolled=patrolled) for number, of_body in halves.fields.items()}
    ground = open_ground_of(replace(halves, fields=fields))
    ground.tick(0, closed(halves), {"wall"}, {1: WEST}, {})
    assert ground.shut_in() == shut_in


def test_a_point_that_is_seen_again_has_no_closed_time_behind_it() -> None:
    patrolled, seen = np.ones((1, 1), dtype=np.bool_), np.zeros((1, 1), dtype=np.int32)
    ages = OpenAges(patrolled)
    for k in range(1, 13):
        seen[0, 0] = 8 if k >= 8 else 0
        ages.tick(k, patrolled & (3 <= k <= 6), seen)
    assert ages.greatest == [1, 2, 2, 2, 2, 2, 3, 0, 1, 2, 3, 4]
