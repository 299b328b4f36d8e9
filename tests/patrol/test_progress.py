from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.ground.fields import compute_fields
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.journal.records import RobotTick, Status, TickRecord
from patrol.own_ground import own_grounds
from patrol.pose import Pose
from patrol.prepare import Prepared, prepare
from patrol.progress import (
    TRAPPED_S,
    Place,
    Stay,
    Stays,
    Traps,
    judged_places,
    roaming_radius,
    stalest_outside,
)
from patrol.scenario import load_scenario

R = 3.0001234567  # which no sum of round numbers hits, so that rounding decides nothing
LONG = int(TRAPPED_S)


def tracked(path: list[Place], radius: float = R, step: float = 1.0) -> list[Stay]:
    """The stay after each position of one robot that is looked at in each tick."""
    stays = Stays({1: radius}, step)
    found = []
    for k, place in enumerate(path):
        stays.tick(k, {1: place})
        stay = stays.stay(1)
        assert stay is not None
        assert (1 in stays.long(k)) == (k - stay.since >= LONG)
        found.append(stay)
    return found


def fits(places: list[Place], radius: float) -> bool:
    x = (min(x for x, _ in places) + max(x for x, _ in places)) / 2.0
    y = (min(y for _, y in places) + max(y for _, y in places)) / 2.0
    return all(math.dist((x, y), place) <= radius for place in places)


def slowly(path: list[Place], radius: float) -> list[int]:
    """When each stay began, by the rule and nothing else."""
    since, circle = 0, None
    found = []
    for k, place in enumerate(path):
        if circle is not None and math.dist(circle, place) > radius:
            corners = [(min(x), min(y)) for x, y in [zip(*path[since : k + 1], strict=True)]]
            corners += [(max(x), max(y)) for x, y in [zip(*path[since : k + 1], strict=True)]]
            if math.dist(*corners) <= 2.0 * radius:
                circle = ((corners[0][0] + corners[1][0]) / 2.0, (corners[0][1] + corners[1][1]) / 2.0)
            else:
                circle, since = None, max(since, k - LONG)
        if circle is None:
            while not fits(path[since : k + 1], radius):
                since += 1
            if k - since >= LONG:
                xs, ys = zip(*path[since : k + 1], strict=True)
                circle = ((min(xs) + max(xs)) / 2.0, (min(ys) + max(ys)) / 2.0)
        found.append(since)
    return found


@st.composite
def walks(draw: st.DrawFn) -> list[Place]:
    """Ways of a robot that stays for a while, swings, moves on, or jumps."""
    path: list[Place] = []
    x = y = 0.0
    for _ in range(draw(st.integers(1, 5))):
        ticks = draw(st.integers(1, 250))
        kind = draw(st.sampled_from(["stands", "swings", "circles", "drives", "jumps"]))
        size = draw(st.floats(0.0, 5.0))
        for i in range(ticks):
            match kind:
                case "stands":
                    path.append((x, y))
                case "swings":
                    path.append((x + size * math.sin(i), y))
                case "circles":
                    path.append((x + size * math.cos(0.3 * i), y + size * math.sin(0.3 * i)))
                case "drives":
                    path.append((x + 0.05 * size * i, y))
                case _:
                    path.append((x + size * (i * 7 % 5), y + size * (i * 3 % 4)))
        x, y = path[-1]
    return path


# --- stays -----------------------------------------------------------------------------------------------------------


@given(walks())
def test_a_stay_begins_where_the_rule_says(path: list[Place]) -> None:
    assert [stay.since for stay in tracked(path)] == slowly(path, R)


@given(walks())
def test_the_circle_holds_all_positions_since_the_stay_began(path: list[Place]) -> None:
    for k, stay in enumerate(tracked(path)):
        assert all(math.dist((stay.x, stay.y), place) <= R * (1 + 1e-12) for place in path[stay.since : k + 1])


@given(walks())
def test_nobody_who_keeps_to_one_place_for_long_is_overlooked(path: list[Place]) -> None:
    for k, stay in enumerate(tracked(path)):
        xs, ys = zip(*path[max(k - LONG, 0) : k + 1], strict=True)
        if k >= LONG and math.hypot(max(xs) - min(xs), max(ys) - min(ys)) < 2.0 * R * (1 - 1e-9):
            assert k - stay.since >= LONG


def test_a_robot_that_swings_stays_though_it_leaves_where_it_began() -> None:
    swing = [(2.9 * math.sin(0.4 * k), 0.0) for k in range(400)]
    stay = tracked([(-2.9, 0.0), *swing])[-1]
    assert (stay.since, stay.radius) == (0, R)
    assert (stay.x, stay.y) == pytest.approx((0.0, 0.0), abs=0.01)


def test_a_robot_that_drives_through_does_not_stay() -> None:
    assert all(k - stay.since <= 6 for k, stay in enumerate(tracked([(1.0 * k, 0.0) for k in range(400)])))


def test_a_long_stay_ends_when_the_robot_leaves_its_circle() -> None:
    path = [(0.0, 0.0)] * 300 + [(1.0 * i, 0.0) for i in range(30)]
    stays = tracked(path)
    assert stays[303].since == 0  # 3 m from where it stood
    assert stays[307].since > 290  # more than a circle away
    assert stays[-1].since >= len(path) - 8


def test_positions_are_looked_at_once_a_second() -> None:
    stays = Stays({1: R}, 0.1)
    for k in range(1900):
        away = 50.0 if k % 10 else 0.0  # between two looks
        stays.tick(k, {1: (away, 0.0)})
    assert stays.long(1899)[1].since == 0


def test_a_free_robot_begins_anew() -> None:
    stays = Stays({1: R, 2: R}, 1.0)
    for k in range(LONG + 1):
        stays.tick(k, {1: (0.0, 0.0), 2: (9.0, 9.0)}, free=[2] if k == 100 else [])
    assert set(stays.long(LONG)) == {1}
    second = stays.stay(2)
    assert second is not None
    assert second.since == 101
    stays.tick(LONG + 1, {2: (9.0, 9.0)})
    assert stays.stay(1) is None


def test_the_radius_counts_radii_and_strides() -> None:
    spec = load_scenario({"terrain": {"builtin": "open"}, "robots": {"speed": 1.0, "radius": 0.3}}).roster[0]
    assert roaming_radius(spec, 0.5) == pytest.approx(3.2)


# --- traps -----------------------------------------------------------------------------------------------------------


def rooms(doors: bool = True) -> Terrain:
    """Two rooms of 20 x 10 m with a wall between them, in points of 0.5 m."""
    free = np.ones((20, 81), dtype=np.bool_)
    free[:, 40] = False
    if doors:
        free[8:12, 40] = True
    return Terrain("rooms", free, 0.5)


def prepared(terrain: Terrain, *starts: Pose) -> Prepared:
    """Robots of 0.3 m at 1 m/s on a terrain."""
    robots = {"count": len(starts), "model": "holonomic", "radius": 0.3, "speed": 1.0, "spare": 0}
    scenario = load_scenario({"terrain": {"builtin": "open"}, "robots": robots})
    fields = compute_fields(terrain, 0.3, 10.0, True, starts)
    return Prepared(scenario, terrain, starts, {spec.number: fields for spec in scenario.roster})


def tick(k: int, *places: Place, status: Status = Status.ALIVE, state: str = "patrolling") -> TickRecord:
    rows = tuple(
        RobotTick(number, status, x, y, 0.0, 0.0, 0.0, False, state, None, None, None)
        for number, (x, y) in enumerate(places, start=1)
    )
    return TickRecord(k, rows, (), (), (), 0, 0.0, 0)


LEFT, RIGHT = Pose(5.0, 5.0, 0.0), Pose(30.0, 5.0, 0.0)


def test_a_robot_that_stays_while_the_other_room_is_stale_is_trapped_until_it_leaves() -> None:
    ready = prepared(rooms(), LEFT)
    traps, seen = Traps(ready), np.zeros(ready.terrain.shape, dtype=np.int32)
    found = []
    for k in range(1000):
        seen[:, :40] = k
        seen[:, 40:] = 3
        place = (5.0 + (k % 3), 5.0) if 20 <= k < 900 else (30.0, 5.0)
        found += traps.tick(tick(k, place), lambda: seen)
    begun, ended = found
    assert (begun.robot, begun.since, begun.stay.since, begun.until, begun.unseen_since) == (1, 20, 20, None, 3)
    assert (begun.stay.x, begun.stay.y) == (6.0, 5.0)
    assert begun.point == (20.25, 5.25)
    assert begun.away == pytest.approx(14.25, abs=0.1)
    assert ended == replace(begun, until=900)
    assert not ended.all_seen
    assert not traps.open
    where = "within 3.2 m of (6.0, 5.0)"
    assert begun.told(0.5) == f"{where} since 10 s; nobody has seen (20.2, 5.2) in that time"
    assert begun.told(0.5, "before ").startswith(f"{where} since before 10 s; ")
    assert ended.told(0.5) == f"after 440 s {where}"


def test_a_trap_is_over_when_all_outside_has_been_seen_and_the_time_counts_anew() -> None:
    ready = prepared(rooms(), LEFT)
    traps, seen = Traps(ready), np.full(ready.terrain.shape, -1, dtype=np.int32)
    found = []
    for k in range(1300):
        seen[:, :40] = k
        if k in (470, 501):
            seen[:, 40 : 60 if k == 470 else 81] = k  # a part of the other room, then all of it
        found += traps.tick(tick(k, (5.0, 5.0)), lambda: seen)
        assert set(traps.open) == ({1} if 360 <= k < 510 or k >= 870 else set())
    first, over, second = found
    assert (first.since, first.until, first.unseen_since) == (0, None, -1)
    assert over == replace(first, until=510, all_seen=True)
    assert over.told(0.5).endswith("m of (5.0, 5.0); all that it could see elsewhere has been seen")
    assert (second.since, second.stay, second.until, second.unseen_since) == (510, first.stay, None, 501)
    assert traps.open == {1: second}


@pytest.mark.parametrize("stale_from", [0, 700])
def test_the_fog_is_not_looked_at_unless_it_is_needed(stale_from: int) -> None:
    ready = prepared(rooms(), LEFT)
    traps, seen = Traps(ready), np.full(ready.terrain.shape, -1, dtype=np.int32)
    asked: list[int] = []

    def last_seen() -> np.ndarray[tuple[int, int], np.dtype[np.int32]]:
        asked.append(k)
        return seen

    needed = []
    for k in range(1200):
        seen[:, : 40 if k >= stale_from else 81] = k
        place = (5.0, 5.0) if k < 1100 else (30.0, 5.0)
        needed += [k] if traps.needs_fog(k) else []
        traps.tick(tick(k, place), last_seen)
    assert set(asked) <= set(needed)
    assert set(needed) <= {*asked, 1100}
    assert asked == list(range(360, 1100, 10)) if stale_from == 0 else [360, 720, *range(1080, 1100, 10)]


def test_the_fog_is_asked_for_only_when_a_robot_stays() -> None:
    ready = prepared(rooms(), LEFT)
    traps = Traps(ready)
    asked: list[int] = []

    def last_seen() -> np.ndarray[tuple[int, int], np.dtype[np.int32]]:
        asked.append(k)
        return np.full(ready.terrain.shape, k, dtype=np.int32)

    for k in range(1100):
        assert not traps.tick(tick(k, (5.0, 5.0)), last_seen)
    assert asked == [360, 720, 1080]


@pytest.mark.parametrize("doors", [True, False])
def test_what_a_robot_cannot_get_to_does_not_trap_it(doors: bool) -> None:
    ready = prepared(rooms(doors), LEFT, RIGHT)
    first, second = (own.patrolled for own in own_grounds(ready).values())
    assert bool(first[5, 60]) is doors
    assert bool(second[5, 10]) is doors
    assert first[5, 10]
    assert second[5, 60]
    traps, seen = Traps(ready), np.full(ready.terrain.shape, -1, dtype=np.int32)
    found = []
    for k in range(400):
        seen[:, :40] = k
        found += traps.tick(tick(k, (5.0, 5.0), (30.0 + k % 20, 5.0)), lambda: seen)
    assert [trap.robot for trap in found] == ([1] if doors else [])


@pytest.mark.parametrize(
    ("status", "state"),
    [(Status.PAUSED, ""), (Status.DEAD, ""), (Status.ABSENT, ""), (Status.ALIVE, "surrounding")],
)
def test_who_is_down_or_surrounds_an_intruder_may_stay(status: Status, state: str) -> None:
    assert judged_places(tick(0, (1.0, 2.0), status=status, state=state)) == ({1: (1.0, 2.0)}, [1])
    assert judged_places(tick(0, (1.0, 2.0), state="dead-end")) == ({1: (1.0, 2.0)}, [])


def test_of_equally_stale_points_the_nearest_outside_of_the_circle_counts() -> None:
    ground: BoolGrid = np.ones((20, 81), dtype=np.bool_)
    seen = np.full(ground.shape, 9, dtype=np.int32)
    stay = Stay(5, 5.25, 5.25, 2.0)
    assert stalest_outside(stay, rooms(), ground, seen) is None
    seen[10, 11] = seen[10, 50] = seen[10, 30] = 2
    seen[4, 70] = 3
    assert stalest_outside(stay, rooms(), ground, seen) == (10, 30)
    ground[10, 11:51] = False
    assert stalest_outside(stay, rooms(), ground, seen) == (4, 70)


def test_a_scenario_of_the_project_has_a_ground_for_each_robot() -> None:
    ready = prepare(load_scenario({"terrain": {"builtin": "clutter"}, "point": 0.5, "robots": {"count": 2}}))
    for number, own in own_grounds(ready).items():
        assert np.array_equal(own.patrolled, ready.fields[number].patrolled)
        assert np.array_equal(own.reach, ready.fields[number].reach)
