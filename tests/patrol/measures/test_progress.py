from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from patrol.ground.fields import compute_fields
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.journal.records import RobotTick, Status, TickRecord
from patrol.measures.best_tour import own_grounds
from patrol.measures.progress import Traps, judged_places, stalest_outside
from patrol.measures.stays import Place, Stay
from patrol.pose import Pose
from patrol.prepare import Prepared, prepare
from patrol.scenario import load_scenario


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
    return Prepared(scenario, terrain, starts, {spec.number: fields for spec in scenario.roster}, {})


def tick(k: int, *places: Place, status: Status = Status.ALIVE, state: str = "patrolling") -> TickRecord:
    rows = tuple(
        RobotTick(number, status, x, y, 0.0, 0.0, 0.0, False, state, None, None, None)
        for number, (x, y) in enumerate(places, start=1)
    )
    return TickRecord(k, rows, (), (), (), 0, 0.0, 0)


LEFT, RIGHT = Pose(5.0, 5.0, 0.0), Pose(30.0, 5.0, 0.0)


def test_a_robot_that_stays_while_the_other_room_is_stale_is_trapped_until_it_leaves() -> None:
    ready = prepared(rooms(), LEFT)
    traps, seen = Traps(ready, ready.open_ground()), np.zeros(ready.terrain.shape, dtype=np.int32)
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
    traps, seen = Traps(ready, ready.open_ground()), np.full(ready.terrain.shape, -1, dtype=np.int32)
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


@pytest.mark.parametrize(
    ("stale_from", "times"),
    [(0, range(360, 1100, 10)), (700, (360, 720, *range(1080, 1100, 10))), (1200, (360, 720, 1080))],
)
def test_the_fog_is_not_looked_at_unless_it_is_needed(stale_from: int, times: Sequence[int]) -> None:
    ready = prepared(rooms(), LEFT)
    traps, seen = Traps(ready, ready.open_ground()), np.full(ready.terrain.shape, -1, dtype=np.int32)
    asked: list[int] = []

    def last_seen() -> np.ndarray[tuple[int, int], np.dtype[np.int32]]:
        asked.append(k)
        return seen

    needed, found = [], []
    for k in range(1200):
        seen[:, : 40 if k >= stale_from else 81] = k
        place = (5.0, 5.0) if k < 1100 else (30.0, 5.0)
        needed += [k] if traps.needs_fog(k) else []
        found += traps.tick(tick(k, place), last_seen)
    assert set(asked) <= set(needed)
    assert set(needed) <= {*asked, 1100}
    assert asked == list(times)
    assert bool(found) == (stale_from < 1200)


@pytest.mark.parametrize("doors", [True, False])
def test_what_a_robot_cannot_get_to_does_not_trap_it(doors: bool) -> None:
    ready = prepared(rooms(doors), LEFT, RIGHT)
    first, second = (own.patrolled for own in own_grounds(ready).values())
    assert bool(first[5, 60]) is doors
    assert bool(second[5, 10]) is doors
    assert first[5, 10]
    assert second[5, 60]
    traps, seen = Traps(ready, ready.open_ground()), np.full(ready.terrain.shape, -1, dtype=np.int32)
    found = []
    for k in range(400):
        seen[:, :40] = k
        found += traps.tick(tick(k, (5.0, 5.0), (30.0 + k % 20, 5.0)), lambda: seen)
    assert [trap.robot for trap in found] == ([1] if doors else [])


@pytest.mark.parametrize(
    ("status", "state"), [(Status.PAUSED, ""), (Status.DEAD, ""), (Status.ABSENT, ""), (Status.ALIVE, "surrounding")]
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


@pytest.mark.parametrize(("seen_at", "found"), [(4, (10, 30)), (5, None)])
def test_a_point_seen_in_the_tick_in_which_a_stay_began_is_not_stale(
    seen_at: int, found: tuple[int, int] | None
) -> None:
    ground: BoolGrid = np.zeros((20, 81), dtype=np.bool_)
    ground[10, 30] = True
    seen = np.full(ground.shape, seen_at, dtype=np.int32)
    assert stalest_outside(Stay(5, 5.25, 5.25, 2.0), rooms(), ground, seen) == found
