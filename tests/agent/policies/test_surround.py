"""Surrounding: places around an intruder, who takes which, and that everyone finds the same."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agent.belief.believed import Contacts
from agent.policies.surround import Stand, Surround, assign, spots_around, spread
from agent.ports import Intent, Stay
from agent.routes.ground import Ground
from agent.routes.routes import Routes, Way
from agent.view import View
from patrol.ground.fields import compute_fields
from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import Terrain
from patrol.pose import TAU, Pose
from patrol.prepare import Prepared
from patrol.radio.message import Position
from patrol.radio.peers import Peer
from patrol.scenario import load_scenario
from tests.agent.minds import prepared_on, setup_of
from tests.present import present

# Not the product's own, so that a wrong one there is noticed.
SAME = 2.0
FARTHEST = 1.25

SPACING = 3.0


def field(wall: bool = False) -> Terrain:
    """40 x 40 m; the wall stands over y in [22, 22.5) from x = 10 to the right edge."""
    passable = np.ones((80, 80), dtype=np.bool_)
    if wall:
        passable[44, 20:] = False
    return Terrain("field", passable, 0.5)


def bearings(terrain: Terrain, count: int, x: float = 20.0, y: float = 20.0) -> list[float]:
    reach = compute_fields(terrain, 1.0, 10.0, True, [Pose(20.0, 10.0, 0.0)]).reach
    spots = spots_around(footprint_of(terrain, FARTHEST * 8.0), reach, x, y, 8.0)
    return [spot.bearing for spot in spread(spots, count, SPACING)]


def least_gap(found: list[float]) -> float:
    return min((later - earlier) % TAU for earlier, later in zip(found, found[1:] + found[:1], strict=True))


@pytest.mark.parametrize("count", [2, 3, 4, 5, 8])
def test_on_open_ground_places_are_equally_spaced(count: int) -> None:
    found = bearings(field(), count)
    assert len(found) == count
    assert least_gap(found) > TAU / count - math.radians(4.0)


def test_next_to_a_wall_places_use_the_side_there_is() -> None:
    found = bearings(field(wall=True), 5, y=20.75)
    assert len(found) == 5
    assert least_gap(found) > math.radians(42.0)
    assert max(math.sin(bearing) for bearing in found) < 0.3


def test_a_full_ring_takes_no_more() -> None:
    found = bearings(field(), 60)
    assert 10 < len(found) <= TAU * FARTHEST * 8.0 / SPACING
    assert bearings(field(), 0) == []


def test_places_keep_bodies_apart_however_near_the_intruder() -> None:
    spots = [Stand(bearing, 0, 0, math.cos(bearing), math.sin(bearing)) for bearing in np.linspace(0, 6, 60).tolist()]
    assert len(spread(spots, 5, SPACING)) == 1


@given(st.integers(1, 4), st.data())
def test_the_assignment_is_the_best_there_is(rows: int, data: st.DataObject) -> None:
    cols = data.draw(st.integers(rows, 5))
    line = st.lists(st.integers(0, 30), min_size=cols, max_size=cols)
    costs = data.draw(st.lists(line, min_size=rows, max_size=rows))
    found = assign(costs)
    assert len(set(found)) == rows
    least = min(sum(costs[i][j] for i, j in enumerate(ways)) for ways in itertools.permutations(range(cols), rows))
    assert sum(costs[row][col] for row, col in enumerate(found)) == least
    assert assign([]) == []


def contact(k: int, x: float, y: float) -> Position:
    return Position.of_contact(k, 0.5 * k, x, y)


def test_an_intruder_is_known_until_some_time_after_its_last_report() -> None:
    contacts = Contacts()
    contacts.report(contact(3, 5.0, 5.0), 3)
    contacts.report(contact(4, 5.0, 5.0), 4)
    assert [contacts.known(k, 2) for k in (4, 6, 7)] == [[(5.0, 5.0)], [(5.0, 5.0)], []]


def test_reports_of_one_intruder_are_one_and_of_several_are_several() -> None:
    contacts = Contacts()
    for x in (5.0, 5.0 + SAME / 2, 20.0):
        contacts.report(contact(1, x, 5.0), 1)
    assert contacts.known(1, 4) == [(5.0, 5.0), (20.0, 5.0)]
    contacts.report(contact(2, 5.5, 5.0), 2)
    assert contacts.known(2, 4) == [(5.5, 5.0), (20.0, 5.0)]


class Otherwise:
    """The policy of robots that surround nothing."""

    def decide(self, view: View) -> Intent:
        del view
        return Stay("otherwise")


def prepared_for(terrain: Terrain, robots: int) -> Prepared:
    scenario = load_scenario({"terrain": {"builtin": "open"}, "point": 0.5, "robots": {"count": robots}})
    return prepared_on(scenario, terrain, [Pose(20.0, 10.0, 0.0)])


def ways(places: dict[int, Pose], contacts: list[tuple[float, float]], wall: bool = False) -> dict[int, Way | None]:
    """The decision of each robot from the same positions."""
    prepared = prepared_for(field(wall), len(places))
    ground = Ground(prepared.terrain, prepared.fields[1].reach)
    found = {}
    for number, pose in places.items():
        start = present(ground.join(pose.x, pose.y))
        peers = {other: Peer(0, place, 0) for other, place in places.items() if other != number}
        surround = Surround(setup_of(prepared, number), Otherwise())
        found[number] = surround.way(pose, peers, contacts, Routes(ground), start)
    return found


CORNER = {number: Pose(2.0 + 3.0 * number, 2.0, 0.0) for number in range(1, 6)}


def test_everyone_takes_a_place_of_its_own_around_the_intruder() -> None:
    found = ways(CORNER, [(20.0, 20.0)])
    places = [way.place for way in found.values() if way is not None]
    assert len(set(places)) == 5
    around = sorted(math.atan2(y - 20.0, x - 20.0) % TAU for x, y in places)
    assert least_gap(around) > math.radians(68.0)
    assert all(7.5 < math.dist(place, (20.0, 20.0)) < 8.5 for place in places)


def test_the_way_leads_round_walls() -> None:
    places = {1: Pose(30.0, 26.0, 0.0)}
    way = present(ways(places, [(30.0, 18.0)], wall=True)[1])
    assert way.place[1] < 22.0
    assert way.bend[0] < 11.0


def test_who_is_on_its_place_stays_and_so_does_everybody_else() -> None:
    first = ways(CORNER, [(20.0, 20.0)])
    arrived = {number: Pose(*way.place, 0.0) for number, way in first.items() if way is not None}
    places = {number: way and way.place for number, way in ways(arrived, [(20.0, 20.0)]).items()}
    assert places == {number: (pose.x, pose.y) for number, pose in arrived.items()}


def test_of_several_intruders_each_robot_takes_the_nearest() -> None:
    found = ways({1: Pose(5.0, 10.0, 0.0), 2: Pose(35.0, 10.0, 0.0)}, [(8.0, 20.0), (32.0, 20.0)])
    assert present(found[1]).place[0] < 20.0 < present(found[2]).place[0]


def test_an_intruder_that_nobody_gets_near_attracts_nobody() -> None:
    setup, reach = setup_of(prepared_for(field(wall=True), 1)), np.zeros((80, 80), dtype=np.bool_)
    reach[2:6, 2:6] = True
    setup = replace(setup, ground=replace(setup.ground, fields=replace(setup.ground.fields, reach=reach)))
    routes, surround = Routes(Ground(setup.ground.terrain, reach)), Surround(setup, Otherwise())
    assert surround.way(Pose(2.0, 2.0, 0.0), {}, [(30.0, 30.0)], routes, (4, 4)) is None


def test_others_close_by_push_a_little_and_those_far_off_do_not() -> None:
    surround = Surround(setup_of(prepared_for(field(), 1)), Otherwise())
    pose, bend = Pose(10.0, 10.0, 0.0), (20.0, 10.0)
    x, y = surround.pushed(pose, {2: Peer(0, Pose(11.0, 12.0, 0.0), 0)}, bend)
    assert math.dist((x, y), (10.0, 10.0)) == pytest.approx(10.0)
    assert 6.0 < y < 9.5
    assert surround.pushed(pose, {2: Peer(0, Pose(10.0, 40.0, 0.0), 0)}, bend) == pytest.approx(bend)
    assert surround.pushed(pose, {}, (10.0, 10.0)) == (10.0, 10.0)


def test_places_are_as_far_apart_as_the_widest_body_of_the_fleet_needs() -> None:
    """Two of 0.3 m and one of 1 m stand 2 m apart and more, though only one of them is wide."""
    robots = [{"model": "holonomic", "radius": radius} for radius in (0.3, 0.3, 1.0)]
    given_ = {"terrain": {"builtin": "open"}, "point": 0.5, "robots": robots, "sensor": {"range": 5}}
    scenario = load_scenario(given_)
    prepared = prepared_on(scenario, field(), [Pose(20.0, 10.0, 0.0)] * 3)
    for number in (1, 2, 3):
        stands = Surround(setup_of(prepared, number), Otherwise())._ring_of((20.0, 20.0), 60).stands
        places = [(stand.x, stand.y) for stand in stands]
        assert min(math.dist(*two) for two in itertools.combinations(places, 2)) >= 2.0
