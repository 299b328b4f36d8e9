"""The check of progress warns of trapped robots, of fog that grows to the end, and of ground that nobody has seen."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from patrol.ground.fields import compute_fields
from patrol.ground.terrain import Terrain
from patrol.journal import Status, TickRecord
from patrol.journal.records import RobotTick
from patrol.pose import Pose
from patrol.prepare import Prepared, closable_ground, sensor_footprint
from patrol.scenario import load_scenario
from tests.worldsim.checks.judged import result_of
from worldsim.checks.check import CheckResult
from worldsim.checks.ground import FogIsTrue
from worldsim.checks.progress import ProgressCheck, TrappedRobot
from worldsim.output.record import header_of
from worldsim.run_record import MemoryJournal
from worldsim.truth import Truth
from worldsim.verdict.judge import Judge, Verdict, judge
from worldsim.world import World

Place = tuple[float, float]
Path = Callable[[int], Place]

STEP = 0.5


def rooms(quality: float = 1.0) -> Prepared:
    """Two rooms of 10 x 10 m, joined by a door; two robots of 0.3 m at 1 m/s that see 3 m far."""
    free = np.ones((20, 41), dtype=np.bool_)
    free[:, 20] = False
    free[8:12, 20] = True
    starts = (Pose(5.0, 5.0, 0.0), Pose(15.0, 5.0, 0.0))
    robots = [{"name": name, "model": "holonomic", "radius": 0.3, "speed": 1.0} for name in ("r1", "r2")]
    facts = {"terrain": {"builtin": "open"}, "point": 0.5, "step": STEP, "sensor": {"range": 3.0, "quality": quality}}
    scenario = load_scenario({**facts, "robots": robots})
    terrain = Terrain("rooms", free, 0.5)
    fields = compute_fields(terrain, 0.3, 3.0, True, starts)
    return Prepared(scenario, terrain, starts, {1: fields, 2: fields}, closable_ground(scenario, terrain))


def made(prepared: Prepared, ticks: int, *paths: Path, **row: Any) -> MemoryJournal:
    """A run in which robots are where the paths say."""
    truth = Truth(sensor_footprint(prepared.scenario, prepared.terrain), prepared.patrolled)
    journal = MemoryJournal(header_of(World(prepared)))
    for k in range(ticks):
        rows = []
        for number, path in enumerate(paths, start=1):
            x, y = path(k)
            facts = RobotTick(number, Status.ALIVE, x, y, 0.0, 0.0, 0.0, False, "patrolling", None, None, None)
            rows.append(replace(facts, **row) if number == 1 else facts)
        living = [(one.number, Pose(one.x, one.y, 0.0)) for one in rows if one.status is Status.ALIVE]
        truth.observe(k, living)
        fog = truth.fog
        journal.write(TickRecord(k, tuple(rows), (), (), (), fog.mfow(k), fog.mean(k), fog.seen))
    return journal


def round_of(left: float, right: float, seconds: float = 60.0) -> Path:
    """A path that goes up and down between two x, in rows 2 m apart, once each so many seconds."""

    def path(k: int) -> Place:
        share = k * STEP / seconds % 1.0
        row = int(share * 5.0)
        along = share * 5.0 % 1.0
        return left + (right - left) * (along if row % 2 else 1.0 - along), 1.0 + 2.0 * row

    return path


WHOLE = round_of(1.0, 19.5)
LEFT_ROOM = round_of(1.0, 9.0)


def swings(x: float, y: float) -> Path:
    """A path within 2 m of a place."""
    return lambda k: (x + (1.5 if k // 8 % 2 else -1.5), y)


@pytest.fixture
def ready() -> Prepared:
    return rooms()


def judged(ready: Prepared, ticks: int, *paths: Path, **row: Any) -> CheckResult:
    return result_of(ProgressCheck, ready, made(ready, ticks, *paths, **row))


def trapped_in(journal: MemoryJournal, ready: Prepared) -> list[TrappedRobot]:
    progress = judge(journal, {}, ready).progress
    assert progress is not None
    return list(progress.trapped)


def of_r1(result: CheckResult) -> str:
    (line,) = [warning for warning in result.warnings if warning.startswith("r1")]
    return line


def test_a_patrol_that_gets_on_has_no_warning(ready: Prepared) -> None:
    good = "no robot was trapped; all that can be seen was seen, and nothing was stale for long at the end"
    assert judged(ready, 1000, WHOLE, WHOLE) == CheckResult("progress", True, good)


def test_a_trapped_robot_is_named_with_place_and_time(ready: Prepared) -> None:
    def stuck(k: int) -> Place:
        return WHOLE(k) if k < 200 else swings(5.0, 8.0)(k)

    result = judged(ready, 1000, stuck, lambda k: WHOLE(k) if k < 150 else (18.0, 8.0))
    assert result.ok
    first, second, third = result.warnings
    where = "within 3.2 m of (3.8, 6.5) from 93 s to the end (500 s)"
    assert first == f"r1 was trapped: it stayed {where}, while (14.8, 8.8), 11 m away, was last seen at 52.5 s"
    assert second.startswith("r2 was trapped: it stayed within 3.2 m of (18.0, 8.0) from 7")
    assert third.startswith("the fog grew to the end: (")
    assert result.detail == "; ".join(result.warnings)


def test_several_traps_of_one_robot_are_one_line_about_the_longest(ready: Prepared) -> None:
    def path(k: int) -> Place:
        return (2.0, 2.0) if k < 500 else (18.0, 8.0) if k < 1400 else WHOLE(k)

    journal = made(ready, 1600, path, lambda _: (2.0, 8.0))
    line = result_of(ProgressCheck, ready, journal).warnings[0]
    assert line.startswith("r1 was trapped: it stayed within 3.2 m of (18.0, 8.0) from 250 s to 700 s")
    assert line.endswith("; 2 times in all, 700 s")
    first, other, second = trapped_in(journal, ready)
    assert (first.robot, first.from_s, first.until_s, first.seen_s) == ("r1", 0.0, 250.0, None)
    assert (other.robot, other.from_s, other.until_s) == ("r2", 0.0, 745.0)  # when r1 had been everywhere
    assert (second.robot, second.from_s, second.until_s) == ("r1", 250.0, 700.0)


def test_times_that_overlap_count_once(ready: Prepared) -> None:
    journal = made(ready, 1400, lambda k: (2.0 + 0.005 * k, 2.0), lambda _: (2.0, 8.0))
    assert of_r1(result_of(ProgressCheck, ready, journal)).endswith("; 2 times in all, 700 s")
    first, second = [trapped for trapped in trapped_in(journal, ready) if trapped.robot == "r1"]
    assert (first.from_s, second.until_s) == (0.0, None)
    assert first.until_s is not None
    assert second.from_s < first.until_s


def test_a_robot_is_trapped_until_others_have_seen_all_that_it_could_see_elsewhere(ready: Prepared) -> None:
    journal = made(ready, 1000, lambda _: (2.0, 2.0), lambda k: (2.0, 8.0) if k < 500 else WHOLE(k))
    line = of_r1(result_of(ProgressCheck, ready, journal))
    assert line.startswith("r1 was trapped: it stayed within 3.2 m of (2.0, 2.0) from 0 s to 3")
    assert line.endswith("had never been seen; then all that it could see elsewhere had been seen")
    (one,) = [trapped for trapped in trapped_in(journal, ready) if trapped.robot == "r1"]
    assert one.until_s is not None
    assert 250.0 < one.until_s <= 315.0
    progress = judge(journal, {}, ready).progress
    assert progress is not None
    assert progress.stays[1].seconds == 499.5  # it goes on staying


@pytest.mark.parametrize("free", [{"status": Status.PAUSED}, {"status": Status.DEAD}, {"state": "surrounding"}])
def test_who_is_down_or_surrounds_an_intruder_is_not_trapped(ready: Prepared, free: dict[str, Any]) -> None:
    result = judged(ready, 1000, lambda _: (5.0, 5.0), lambda _: (15.0, 5.0), **free)
    assert [line.split(" ", 1)[0] for line in result.warnings if "trapped" in line] == ["r2"]


def test_ground_that_nobody_has_seen_is_counted_and_placed(ready: Prepared) -> None:
    (line,) = judged(ready, 1000, LEFT_ROOM, LEFT_ROOM).warnings
    truth = Truth(sensor_footprint(ready.scenario, ready.terrain), ready.patrolled)
    for k in range(1000):
        truth.observe(k, [(1, Pose(*LEFT_ROOM(k), 0.0))])
    never = truth.fog.points - truth.fog.seen
    share = round(100.0 * never / truth.fog.points)
    area = f"{never} points ({never / 4:.0f} m², {share} % of what can be seen)"
    assert line.startswith(f"{area} were never seen in 500 s:")
    x, y = (float(number) for number in line.rpartition("(")[2].strip(")").split(", "))
    assert 10.5 < x < 20.5
    assert 0.0 < y < 10.0
    assert truth.fog.last_seen[ready.terrain.point_at(x, y)] == -1


def test_fog_that_grows_to_the_end_is_told_with_the_nearest_robot(ready: Prepared) -> None:
    def path(k: int) -> Place:
        return WHOLE(k) if k < 200 else LEFT_ROOM(k)

    (line,) = judged(ready, 1000, path, path).warnings
    assert line.startswith("the fog grew to the end: (")
    assert " s before the end; r1 was nearest to it then, " in line


SHORT = "the fog is not judged: the run takes {} s, and it would have to take 360 s"


def test_the_fog_of_a_short_run_is_not_judged(ready: Prepared) -> None:
    result = judged(ready, 300, LEFT_ROOM, LEFT_ROOM)
    assert result.warnings == ()
    assert SHORT.format(150) in result.detail
    assert SHORT.format(359.5) in judged(ready, 719, LEFT_ROOM, LEFT_ROOM).detail
    (line,) = judged(ready, 720, LEFT_ROOM, LEFT_ROOM).warnings
    assert " were never seen in 360 s:" in line
    narrow = rooms(quality=0.99)
    assert SHORT.format(359.5) in judged(narrow, 719, LEFT_ROOM, LEFT_ROOM).detail
    assert judged(narrow, 720, LEFT_ROOM, LEFT_ROOM).warnings == (line,)


def test_without_a_tour_ground_that_nobody_has_seen_is_judged_once_no_more_is_found() -> None:
    narrow = rooms(quality=0.99)
    (line,) = judged(narrow, 1000, LEFT_ROOM, LEFT_ROOM).warnings
    assert " were never seen in 500 s:" in line

    def late(k: int) -> Place:
        return LEFT_ROOM(k) if k < 600 else round_of(1.0, 15.0)(k)

    def leaves(k: int) -> Place:
        return WHOLE(k) if k < 480 else LEFT_ROOM(k)

    no_tour = "the fog is not judged: there is no tour to compare with, and new ground was seen to the end"
    grown = "all that can be seen was seen; there is no tour to compare the fog's growth with"
    for ticks, path, detail in ((700, LEFT_ROOM, SHORT.format(350)), (1000, late, no_tour), (1400, leaves, grown)):
        result = judged(narrow, ticks, path, path)
        assert (result.warnings, result.detail) == ((), f"no robot was trapped; {detail}")


@pytest.mark.parametrize(
    ("beyond", "more", "is_judged"), [((0.0, 0.5), 13, True), ((0.5, 0.5), 17, True), ((1.0, 0.0), 24, False)]
)
def test_without_a_tour_a_tenth_more_ground_in_the_second_half_is_no_more(
    beyond: Place, more: int, is_judged: bool
) -> None:
    narrow = rooms(quality=0.99)

    def moves(k: int) -> Place:
        return (4.0, 5.0) if k < 500 else (4.0 + beyond[0], 5.0 + beyond[1])

    journal = made(narrow, 1000, moves, lambda _: (15.0, 5.0))
    assert [journal.records[k].seen for k in (499, 999)] == [226, 226 + more]
    check = result_of(ProgressCheck, narrow, journal)
    assert any(" were never seen in 500 s:" in warning for warning in check.warnings) is is_judged


def test_robots_that_were_down_leave_more_time(ready: Prepared) -> None:
    journal = made(ready, 1000, LEFT_ROOM, lambda _: (15.0, 5.0))
    for k, record in enumerate(journal.records):
        rows = [replace(row, status=Status.DEAD) for row in record.robots]
        journal.records[k] = replace(record, robots=tuple(rows) if k > 50 else record.robots)
    assert "the fog is not judged" in result_of(ProgressCheck, ready, journal).detail


def test_warnings_leave_the_outcome_as_it_is_and_name_the_stalest_place(ready: Prepared) -> None:
    verdict = judge(made(ready, 1000, LEFT_ROOM, LEFT_ROOM), {}, ready)
    assert len(verdict.warnings) == 1
    assert all(check.ok for check in verdict.checks if check.name == "progress")
    assert verdict.progress is not None
    end = verdict.progress.stalest.end
    assert verdict.progress.stalest.worst == end
    assert end is not None
    assert (end.age_s, end.at_s, end.seen, end.nearest) == (499.5, 499.5, False, "r1")
    assert Verdict("valid", verdict.checks).warnings == verdict.warnings
    assert Verdict("valid", verdict.checks).exit_code == 0


def test_without_recomputing_the_fog_that_of_the_world_gives_the_same_warnings(ready: Prepared) -> None:
    journal = made(ready, 1000, LEFT_ROOM, LEFT_ROOM)
    truth = Truth(sensor_footprint(ready.scenario, ready.terrain), ready.patrolled)
    judging = Judge(journal, {}, ready, verify_fog=False, fog=truth.fog)
    blind = Judge(journal, {}, ready, verify_fog=False)
    for record in journal.ticks:
        truth.observe(record.k, [(row.number, Pose(row.x, row.y, 0.0)) for row in record.robots])
        judging.tick(record)
        blind.tick(record)
    verdict = judging.verdict()
    assert verdict.warnings == judge(journal, {}, ready).warnings
    assert FogIsTrue.name not in {check.name for check in verdict.checks}
    assert blind.verdict().progress is None


def test_a_run_without_a_tick_is_not_judged(ready: Prepared) -> None:
    result = judged(ready, 0, WHOLE, WHOLE)
    assert (result.ok, result.judged, result.detail) == (True, False, "not judged: the run has no tick")
