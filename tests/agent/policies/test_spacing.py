"""Spacing: robots are followed along the tour by where they are heard, spread over it, and wait for equal gaps."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pytest

from agent.kernels.track import follow
from agent.policies.spacing import Spacing
from agent.routes.ground import Ground
from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.tours.round import Round

# Not the product's own, so that a wrong one there is noticed.
JUMP = 20.0
ZONE_SLACK = 0.15

STRIDE = 0.5
RANGE = 2.0
APART = {1: (10.5, 0.5), 2: (20.5, 0.5), 3: (20.5, 10.5)}
"""Robots at 10 m, 20 m and 60 m of the ring: from the first it is 10 m to the one ahead, 30 m to the one behind."""


class Heard(NamedTuple):
    """The part of a peer that a spacing reads."""

    pose: Pose
    tick: int


@dataclass(frozen=True)
class Spec:
    """The part of the robot's own specification that it reads."""

    number: int = 1
    radius: float = 0.1
    speed: float = 1.0
    model: str = "holonomic"


FIELD = Terrain("field", np.ones((20, 40), dtype=np.bool_), 1.0)
GROUND = Ground(FIELD, FIELD.passable)


@dataclass(frozen=True)
class Seen:
    """The part of a view that it reads."""

    tick: int
    reported: Pose
    peers: Mapping[int, Heard]
    bumped: bool = False
    charging: frozenset[int] = frozenset()
    spec: Spec = Spec()
    stride: float = STRIDE
    ground: Ground = GROUND

    def point_of(self, place: tuple[float, float]) -> tuple[int, int]:
        return self.ground.terrain.point_at(*place)

    @property
    def pose(self) -> Pose:
        return self.reported


def round_through(*corners: tuple[int, int]) -> tuple[Round, Terrain]:
    """A closed tour through columns and rows of points of 1 m, with a place on each point of the way."""
    places: list[int] = []
    for (col, row), (to_col, to_row) in zip(corners, [*corners[1:], corners[0]], strict=True):
        steps = max(abs(to_col - col), abs(to_row - row))
        up, across = to_row - row, to_col - col
        places += [(row + up * step // steps) * 40 + col + across * step // steps for step in range(steps)]
    flat = np.array(places, dtype=np.int64)
    return Round(float(len(flat)), flat, np.arange(float(len(flat))), flat[:0], flat[:0], flat[:0]), FIELD


RING = round_through((0, 0), (30, 0), (30, 10), (0, 10))
"""A ring of 80 m."""

DEAD_END = round_through((0, 0), (30, 0))
"""There and back: 60 m."""


def spacing_on(
    laid_out: tuple[Round, Terrain],
    number: int = 1,
    robots: int = 8,
    range_m: float = RANGE,
    most_slack: float = math.inf,
    spec: Spec = Spec(),
) -> Spacing:
    own, followers = replace(spec, number=number), frozenset(range(1, robots + 1))
    return Spacing(laid_out[0], own, followers, robots, STRIDE, range_m, laid_out[1], most_slack)  # type: ignore[arg-type]


def at(tick: int, places: Mapping[int, tuple[float, float]], own: int = 1) -> Seen:
    poses = {number: Pose(x, y, 0.0) for number, (x, y) in places.items()}
    return Seen(tick, poses[own], {number: Heard(pose, tick) for number, pose in poses.items() if number != own})


def listen(spacing: Spacing, seen: Seen) -> None:
    spacing.listen(seen)  # type: ignore[arg-type]


def note(spacing: Spacing, seen: Seen) -> None:
    listen(spacing, seen)
    spacing.note(seen)  # type: ignore[arg-type]


def begin(spacing: Spacing, seen: Seen) -> float:
    """Begin the round; m along the tour."""
    listen(spacing, seen)
    return spacing.along_m(spacing.begin(seen))  # type: ignore[arg-type]


def waits(spacing: Spacing, seen: Seen) -> bool:
    note(spacing, seen)
    return spacing.waits(seen)  # type: ignore[arg-type]


def spacing_at(number: int, places: Mapping[int, tuple[float, float]], **how: Any) -> Spacing:
    """The spacing of a robot that has heard all of them at their places for a while."""
    spacing = spacing_on(RING, number, **how)
    for tick in range(6):
        note(spacing, at(tick, places, number))
    return spacing


@pytest.mark.parametrize(("first", "course", "expected"), [(0.5, 1.0, 15.0), (29.5, -1.0, 45.0)])
def test_a_dead_end_is_told_from_the_way_back_by_a_robots_course(first: float, course: float, expected: float) -> None:
    spacing = spacing_on(DEAD_END)
    for tick in range(30):
        note(spacing, at(tick, {1: (first + course * STRIDE * tick, 0.5)}))
    assert spacing.along_m(spacing.own_place) == pytest.approx(expected, abs=2.0)


def test_frames_that_are_lost_do_not_lead_astray() -> None:
    spacing = spacing_on(DEAD_END)
    for tick in range(0, 100, 10):
        x = STRIDE * tick if tick < 60 else 60.0 - STRIDE * tick
        note(spacing, at(tick, {1: (x + 0.5, 0.5)}))
    assert spacing.along_m(spacing.own_place) == pytest.approx(STRIDE * 90, abs=2.0)


def test_all_robots_find_the_same_equally_spaced_places() -> None:
    places = {1: (0.5, 0.5), 2: (1.5, 0.5), 3: (20.5, 0.5), 4: (25.5, 10.5)}
    chosen = {}
    for number in places:
        spacing = spacing_on(RING, number)
        chosen[number] = begin(spacing, at(0, places, number))
    gaps = np.diff(sorted(chosen.values()))
    assert gaps == pytest.approx([20.0] * 3, abs=1.0)
    # The pair that stands together is parted, and the others stay near to where they are.
    assert abs(chosen[1] - chosen[2]) > 15.0


@pytest.mark.parametrize(("model", "is_closer"), [("holonomic", False), ("differential", True), ("car", True)])
def test_places_of_bodies_with_wheels_are_closer_where_the_tour_turns(model: str, is_closer: bool) -> None:
    turns = [(col, row) for col in range(18, 0, -2) for row in (14, 18)]
    laid_out, terrain = round_through((0, 0), (39, 0), (39, 18), *turns)
    spacing = spacing_on((laid_out, terrain), spec=Spec(radius=1.0, model=model))
    # The tour is straight at first, so half of the places reach farther than half of its length.
    assert (spacing.along_m(spacing.count // 2) > 0.55 * laid_out.length_m) is is_closer


def test_who_is_nearer_to_the_one_ahead_waits_until_the_gaps_are_equal() -> None:
    assert waits(spacing_at(1, APART), at(6, APART))
    assert not waits(spacing_at(2, APART), at(6, APART, 2))
    equal = {1: (10.5, 0.5), 2: (30.5, 6.5), 3: (7.5, 10.5)}
    assert not waits(spacing_at(1, equal), at(6, equal))


def test_nobody_waits_while_robots_may_be_on_the_way_to_their_first_places() -> None:
    spacing = spacing_on(RING)
    first_m = begin(spacing, at(0, APART))
    place = spacing.tour[round(first_m * spacing.count / spacing.round.length_m), :2]
    own_way = round(math.dist(place, APART[1]) / STRIDE)
    waited = [tick for tick in range(1, 200) if waits(spacing, at(tick, APART))]
    assert own_way > 0
    assert min(waited) >= 2 * own_way


def test_nobody_waits_for_ever_for_one_that_does_not_come() -> None:
    spacing = spacing_at(1, APART)
    waited = [waits(spacing, at(tick, APART)) for tick in range(6, 400)]
    assert any(waited)
    assert not all(waited)


@pytest.mark.parametrize(("speed", "ticks"), [(1.0, 27), (0.25, 23), (0.2, 18)])
def test_a_robot_waits_and_drives_in_turn_for_as_long(speed: float, ticks: int) -> None:
    """Half of the 53 ticks from one of three robots to the next; at most 45 s, which are 22.5 ticks of 2 s."""
    spacing = spacing_at(1, APART)
    seen = (replace(at(tick, APART), spec=Spec(speed=speed)) for tick in range(6, 6 + 4 * ticks))
    assert [waits(spacing, view) for view in seen] == ([True] * ticks + [False] * ticks) * 2


def test_a_wait_that_ends_by_itself_is_paid_back_tick_by_tick() -> None:
    """It waits for 20 ticks, and drives on for 14 because it bumps in the first 5 of them."""
    spacing = spacing_at(1, APART)
    assert all(waits(spacing, at(tick, APART)) for tick in range(6, 26))
    for tick in range(26, 31):
        assert not waits(spacing, replace(at(tick, APART), bumped=True))
    assert not any(waits(spacing, at(tick, APART)) for tick in range(31, 40)), "5 s after the bump at tick 30"
    # 20 - 14 = 6 ticks are left, and 21 more make 27.
    waited = [waits(spacing, at(tick, APART)) for tick in range(40, 63)]
    assert waited == [True] * 21 + [False] * 2


@pytest.mark.parametrize(
    ("model", "behind", "waited"),
    [
        ("holonomic", (2.5, 10.5), False),  # 22 m behind, 20 m ahead
        ("holonomic", (3.5, 10.5), True),  # 23 m
        ("differential", (3.5, 10.5), False),
        ("differential", (7.5, 10.5), True),  # 27 m
    ],
)
def test_gaps_may_differ_by_a_tenth_of_an_equal_one_and_with_wheels_by_a_fifth(
    model: str, behind: tuple[float, float], waited: bool
) -> None:
    """An equal gap is 26.7 m."""
    places = {1: (10.5, 0.5), 2: (30.5, 0.5), 3: behind}
    spacing = spacing_at(1, places, robots=3, range_m=0.0, spec=Spec(radius=1e-3, model=model))
    assert waits(spacing, at(6, places)) is waited


def test_who_has_bumped_drives_on() -> None:
    spacing = spacing_at(1, APART)
    seen = at(6, APART)
    bumped = Seen(6, seen.reported, seen.peers, bumped=True)
    assert not waits(spacing, bumped)
    assert not waits(spacing, at(8, APART))


@pytest.mark.parametrize(
    ("range_m", "most_slack", "waited"), [(2.0, math.inf, True), (50.0, math.inf, False), (50.0, 0.15, True)]
)
def test_gaps_that_differ_by_less_than_half_a_range_are_kept(range_m: float, most_slack: float, waited: bool) -> None:
    places = {1: (10.5, 0.5), 2: (20.5, 0.5), 3: (10.5, 10.5)}  # 10 m ahead of robot 1, 30 m behind
    spacing = spacing_at(1, places, robots=3, range_m=range_m, most_slack=most_slack)
    assert waits(spacing, at(6, places)) is waited


def test_robots_in_other_parts_of_the_terrain_do_not_count() -> None:
    spacing = spacing_on(RING, robots=2)
    seen = at(0, {1: (0.5, 0.5), 2: (1.5, 0.5), 3: (35.5, 15.5)})
    own_m = begin(spacing, seen)
    note(spacing, seen)
    assert sorted(spacing.robots) == [1, 2]
    assert spacing.team == 2
    assert abs(spacing.along_m(spacing.robots[2].place) - own_m) == pytest.approx(40.0, abs=1.0)


def test_a_robot_that_is_not_heard_for_a_while_is_expected_to_go_on() -> None:
    apart = {1: (10.5, 0.5), 2: (20.5, 0.5), 3: (10.5, 10.5)}
    spacing = spacing_at(1, apart, robots=3)
    assert waits(spacing, at(6, apart))
    # 20 ticks later the others are 10 m farther on.
    alone = {1: (10.5, 0.5)}
    assert not waits(spacing, at(26, alone))
    assert spacing.team == 3
    # Half of the 53 ticks between two of three robots.
    note(spacing, at(32, alone))
    assert spacing.team == 3
    note(spacing, at(33, alone))
    assert spacing.team == 1


def test_robots_that_hear_nobody_take_places_by_their_numbers() -> None:
    begun = [begin(spacing_on(RING, number), at(0, {number: (0.5, 0.5)}, number)) for number in range(1, 9)]
    assert begun == pytest.approx([10.0 * slot for slot in range(8)], abs=1.0)


@pytest.mark.parametrize(("tick", "team"), [(40, 2), (41, 1)])
def test_a_smaller_team_remembers_those_it_does_not_hear_for_longer(tick: int, team: int) -> None:
    """Half of the time between two robots: the ring takes 160 ticks, so 40 with two robots, 10 with eight."""
    spacing = spacing_on(RING)
    spacing.follow_with(frozenset((1, 2)))
    listen(spacing, at(0, {1: (10.5, 0.5), 2: (20.5, 0.5)}))
    listen(spacing, at(tick, {1: (10.5, 0.5)}))
    assert spacing.team == team


@pytest.mark.parametrize("place", [0, 1, 5])
def test_a_robot_that_goes_back_is_followed_over_the_seam_of_the_tour_as_elsewhere(place: int) -> None:
    sides = [(math.cos(0.1 * math.pi * number), math.sin(0.1 * math.pi * number)) for number in range(20)]
    tour = np.array([(3.0 * x, 3.0 * y, -y, x) for x, y in sides])
    costs = np.full(20, JUMP)
    costs[place] = 0.0
    before = (place - 1) % 20
    x, y = tour[before, :2].tolist()
    assert follow(costs, np.zeros(20), tour, 0.3 * math.pi, 1, x, y, 0.0, 0.0) == before


def place_of(place: int) -> tuple[float, float]:
    """The middle of a place of the ring, which lie 1 m apart."""
    row, col = divmod(int(RING[0].places[place % 80]), 40)
    return col + 0.5, row + 0.5


@pytest.mark.parametrize(
    ("ahead", "behind", "range_m", "most_slack", "waited"),
    [
        (10, 30, 39.0, math.inf, True),  # half of a range is 19.5 m
        (10, 30, 41.0, math.inf, False),
        (20, 23, 50.0, ZONE_SLACK, False),  # 0.15 of an equal gap is 4 m
        (20, 25, 50.0, ZONE_SLACK, True),
    ],
)
def test_how_much_more_the_gap_behind_may_be(
    ahead: int, behind: int, range_m: float, most_slack: float, waited: bool
) -> None:
    """Of three robots on 80 m, whose equal gap is 26.7 m."""
    spots = {1: place_of(10), 2: place_of(10 + ahead), 3: place_of(10 - behind)}
    spacing = spacing_at(1, spots, robots=3, range_m=range_m, most_slack=most_slack)
    assert waits(spacing, at(6, spots)) is waited


@pytest.mark.parametrize(("behind", "waited"), [(7, False), (8, True)])
def test_nobody_waits_for_a_gap_of_three_strides(behind: int, waited: bool) -> None:
    """Strides of 1 m; of 16 robots the equal gap is 5 m, so a tenth of it is no bound."""
    spots = {1: place_of(20), 2: place_of(24), 3: place_of(20 - behind), **{n: place_of(30 + n) for n in range(4, 17)}}
    laid_out, terrain = RING
    spec: Any = Spec()
    spacing = Spacing(laid_out, spec, frozenset(spots), 16, 1.0, 50.0, terrain, 0.0)
    seen = [replace(at(tick, spots), stride=1.0) for tick in range(7)]
    for view in seen[:-1]:
        note(spacing, view)
    assert waits(spacing, seen[-1]) is waited


@pytest.mark.parametrize(("radius", "lost_m"), [(0.5, 6.28), (1.0, 12.57)])
def test_wheels_lose_two_radii_for_each_radian_of_the_tour(radius: float, lost_m: float) -> None:
    """The ring turns by 2 pi."""
    spacing = spacing_on(RING, spec=Spec(radius=radius, model="differential"))
    assert spacing.length_m == pytest.approx(80.0 + lost_m, abs=0.01)
    assert spacing_on(RING, spec=Spec(radius=radius)).length_m == 80.0


@pytest.mark.parametrize(("tread", "least", "most"), [(2, 11.0, 14.0), (4, 20.0, 28.0)])
def test_turns_within_two_strides_are_no_turns(tread: int, least: float, most: float) -> None:
    """Stairs whose treads are as long as a stride of 2 m are a slope, and the tour turns by 2 pi; others turn more.

    Of treads of two strides each of 7 corners between them turns the way of a stride, of two, by a right angle.
    """
    stairs = [(step + side, step) for step in range(0, 16, tread) for side in (0, tread)]
    spacing = wheels_on(round_through(*stairs, (16, 16), (0, 16)))
    assert least < spacing.length_m - spacing.round.length_m < most


def wheels_on(laid_out: tuple[Round, Terrain], stride: float = 2.0) -> Spacing:
    """The spacing of a body with wheels, 1 m in radius."""
    spec: Any = Spec(radius=1.0, model="differential")
    return Spacing(laid_out[0], spec, frozenset({1}), 1, stride, RANGE, laid_out[1])


@pytest.mark.parametrize(("on_the_way_m", "corners"), [(15.0, 0.5), (55.0, 2.5)])
def test_places_come_after_the_ways_that_turns_before_them_cost(on_the_way_m: float, corners: float) -> None:
    """Each corner of the ring costs pi m, that at its begin half before it and half after it."""
    spacing = wheels_on(RING)
    assert spacing.count == 46
    apart_m = (80.0 + 4.0 * math.pi) / 46.0
    place = round((on_the_way_m + math.pi * corners) / apart_m)
    assert spacing.along_m(place) == pytest.approx(place * apart_m - math.pi * corners, abs=1.1)


@pytest.mark.parametrize(("stride", "count"), [(0.25, 8), (1.0, 8), (1.2, 6), (3.0, 4), (50.0, 4)])
def test_a_tour_has_a_place_for_each_stride_at_least_four_and_no_more_than_points(stride: float, count: int) -> None:
    laid_out, terrain = round_through((0, 0), (2, 0), (2, 2), (0, 2))
    spec: Any = Spec()
    assert Spacing(laid_out, spec, frozenset({1}), 1, stride, RANGE, terrain).count == count


@pytest.mark.parametrize("place", [0, 7, 33, 79])
def test_the_nearest_place_to_a_spot(place: int) -> None:
    x, y = place_of(place)
    assert spacing_on(RING).nearest((x + 0.3, y - 0.3)) == place


def test_who_has_bumped_drives_on_for_five_seconds_whatever_its_speed() -> None:
    """At 2 m/s a tick of 0.5 m is a quarter of a second."""
    spacing = spacing_at(1, APART)
    fast = Spec(speed=2.0)
    seen = [replace(at(tick, APART), spec=fast, bumped=tick == 6) for tick in range(6, 30)]
    assert [waits(spacing, view) for view in seen] == [False] * 20 + [True] * 4


@pytest.mark.parametrize(("place", "begun_m"), [(0, 0.0), (1, 0.0), (10, 10.0), (30, 30.0)])
def test_a_lone_robot_begins_at_the_nearest_of_24_places(place: int, begun_m: float) -> None:
    """They lie 3.3 m apart."""
    spacing = spacing_on(RING, robots=1)
    assert begin(spacing, at(0, {1: place_of(place)})) == begun_m


def test_nobody_waits_for_twice_the_time_of_the_longest_straight_way_to_a_first_place() -> None:
    """Both begin at one spot; one of them goes to the other side of the ring, 10 m away: 20 ticks."""
    spacing = spacing_on(RING, robots=2)
    begin(spacing, at(0, {1: place_of(15), 2: place_of(15)}))
    apart = {1: place_of(15), 2: place_of(25)}
    assert [waits(spacing, at(tick, apart)) for tick in range(1, 46)] == [False] * 39 + [True] * 6


@pytest.mark.parametrize(("silent", "far"), [(10, 10), (19, 19), (20, 20), (21, 20), (40, 20)])
def test_a_silent_robot_is_followed_on_for_20_ticks_at_most(silent: int, far: int) -> None:
    """It may be on any place up to so many ahead; on all of them at equal cost, but where the distance counts."""
    spacing = spacing_on(RING, robots=1)
    begin(spacing, at(0, {1: place_of(0)}))
    note(spacing, at(silent - 1, {1: place_of(0)}))
    costs = spacing.robots[1].costs[:41]
    assert np.flatnonzero(costs <= costs[10])[-1] == far


@pytest.mark.parametrize(
    ("driven", "course"),
    [((0.24, 0.0), (0.0, 0.0)), ((0.25, 0.0), (1.0, 0.0)), ((-0.3, 0.4), (-0.6, 0.8)), ((0.0, -2.0), (0.0, -1.0))],
)
def test_a_robot_has_a_course_once_it_has_driven_half_of_a_stride(
    driven: tuple[float, float], course: tuple[float, float]
) -> None:
    """Also in several ticks."""
    spacing = spacing_on(RING, robots=1)
    for tick, share in enumerate((0.0, 0.01, 1.0)):
        note(spacing, at(tick, {1: (5.5 + share * driven[0], 5.5 + share * driven[1])}))
    assert spacing.robots[1].course == pytest.approx(course)


def test_of_two_at_the_same_place_the_one_with_the_higher_number_waits() -> None:
    together = {1: (10.5, 0.5), 2: (10.5, 0.5)}
    assert [waits(spacing_at(number, together), at(6, together, number)) for number in (1, 2)] == [False, True]


def test_the_course_of_a_place_leads_from_the_one_before_to_the_one_behind() -> None:
    """At a corner between both."""
    tour = spacing_on(RING).tour
    assert tour[[10, 35, 50, 75], 2:] == pytest.approx(np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]]))
    assert tour[30, 2:] == pytest.approx([math.sqrt(0.5), math.sqrt(0.5)])
