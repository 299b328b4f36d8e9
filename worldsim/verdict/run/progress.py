"""The verdict's check of progress: whether the patrol gets on, and where it does not."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from patrol.ground.cspace import parts_of
from patrol.ground.fog import NEVER
from patrol.journal import Status
from patrol.measures.best_tour import best_tour
from patrol.measures.progress import Trap, Traps, judged_places
from patrol.measures.stays import TRAPPED_S, Place, Stay
from worldsim.verdict.common.check import Check, CheckResult
from worldsim.verdict.common.robots_there import RobotsThere
from worldsim.verdict.common.true_fog import TrueFog
from worldsim.verdict.run.open_ages import GroundOpen

if TYPE_CHECKING:
    from patrol.journal import RobotTick, TickRecord
    from worldsim.verdict.common.check import JudgedRun, Readings

STALE_TOURS = 8.0
"""The fog counts as growing where the stalest point at the end is older than so many times the best tour takes."""

TOURS = 4.0
"""Number of best tours that the robots could have driven before the fog of a run is judged."""

SHORTEST_S = 2.0 * TRAPPED_S
"""The shortest run whose fog is judged, s: on small ground a tour takes seconds."""

NEW_SHARE = 0.1
"""Without a tour, ground that was never seen is judged where the run's second half saw at most this share more points
than its first."""


@dataclass(frozen=True, slots=True)
class Stalest:
    """The stalest place at some time."""

    x: float
    y: float
    age_s: float  # since it was last seen, or since the start if never
    at_s: float  # the time at which it had this age
    seen: bool  # it had been seen at least once
    nearest: str | None  # living robot nearest in a straight line; None if none was alive
    nearest_m: float | None


@dataclass(frozen=True, slots=True)
class LongestStay:
    """The longest time for which a robot stayed in one place (`patrol.measures.stays.Stays`)."""

    seconds: float
    since_s: float
    x: float  # of the circle's centre, m
    y: float  # of the circle's centre, m
    radius_m: float


@dataclass(frozen=True, slots=True)
class TrappedRobot:
    """A time for which a robot was trapped."""

    robot: str
    x: float  # of the circle's centre, m
    y: float  # of the circle's centre, m
    radius_m: float
    from_s: float  # when it came, or when all that it could see elsewhere had been seen
    until_s: float | None  # when it left, or all that it could see elsewhere had been seen; None if trapped to the end
    stale: Place  # x and y in m of a stale point outside the circle that it could have gone to and seen
    seen_s: float | None  # when that point had last been seen; None if never


@dataclass(frozen=True, slots=True)
class RunProgress:
    """The progress of a patrol."""

    worst: Stalest | None  # over the whole run; None without a tick
    end: Stalest | None  # at the end of the run; None without a tick
    stays: dict[int, LongestStay]  # by robot number
    trapped: tuple[TrappedRobot, ...]  # in the order in which they began


class ProgressCheck(Check):
    """Warns of robots that are trapped, of fog that grows to the end, and of ground that was never seen.

    A patrol without progress is no error of the run: its numbers are right, and they say how bad the policy is. So this
    check fails no run.
    """

    name = "progress"
    needs = (RobotsThere, GroundOpen, TrueFog)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._fog = readings[TrueFog].fog
        self._open_ground = readings[GroundOpen].open_ground
        self._was_closed_out = False
        self._traps = Traps(run.prepared, self._open_ground)
        self._found: dict[tuple[int, int], Trap] = {}
        self._stays: dict[int, tuple[int, Stay]] = {}
        self._patrolled: Counter[int] = Counter()
        self._seen: list[int] = []
        self._worst: tuple[int, int, tuple[int, int], int, tuple[RobotTick, ...]] | None = None
        self._last: TickRecord | None = None

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if there is a fog to look at."""
        return run.verify_fog or run.fog is not None

    def _tick(self, record: TickRecord) -> None:
        fog, k = self._fog, record.k
        for trap in self._traps.tick(record, lambda: fog.last_seen):
            self._found[trap.robot, trap.since] = trap
        places, free = judged_places(record)
        self._patrolled.update(places.keys() - free)
        for number in places:
            since = self._traps.stays.since(number)
            longest = self._stays.get(number)
            if since is not None and k - since > (0 if longest is None else longest[0]):
                stay = self._traps.stays.stay(number)
                assert stay is not None
                self._stays[number] = k - since, stay
        self._seen.append(fog.seen)
        self._was_closed_out |= self._open_ground is not None and bool(self._open_ground.closed_out.any())
        age = fog.mfow(k)
        if self._worst is None or age > self._worst[0]:
            point = fog.stalest()
            self._worst = age, k, point, int(fog.last_seen[point]), record.robots
        self._last = record

    def facts(self) -> RunProgress:
        """Return the progress of the patrol, once all ticks are in."""
        last, step = self._last, self._run.step
        if last is None or self._worst is None:
            return RunProgress(None, None, {}, ())
        point = self._fog.stalest()
        end = self._fog.mfow(last.k), last.k, point, int(self._fog.last_seen[point]), last.robots
        stays = {
            number: LongestStay(ticks * step, stay.since * step, stay.x, stay.y, stay.radius)
            for number, (ticks, stay) in self._stays.items()
        }
        traps = sorted(self._found.values(), key=lambda trap: (trap.since, trap.robot))
        trapped = tuple(self._trapped_robot(trap) for trap in traps)
        return RunProgress(self._stalest(*self._worst), self._stalest(*end), stays, trapped)

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in."""
        if self._last is None:
            return self._not_judged("not judged: the run has no tick")
        warnings = self._trapped()
        about_fog, judged = self._about_fog()
        warnings += about_fog
        said = "; ".join(warnings)
        return CheckResult(self.name, True, said or f"no robot was trapped; {judged}", warnings=tuple(warnings))

    def _good(self) -> str:
        return ""

    # --- trapped robots ----------------------------------------------------------------------------------------------

    def _trapped(self) -> list[str]:
        """One line for each robot that was trapped, about the longest time."""
        lines = []
        for number, name in self._run.names.items():
            traps = [trap for trap in self._found.values() if trap.robot == number]
            if traps:
                longest = max(traps, key=self._ticks)
                total = f"; {len(traps)} times in all, {self._together(traps) * self._run.step:g} s"
                lines.append(f"{name} was trapped: {self._told(longest)}{total if len(traps) > 1 else ''}")
        return lines

    def _trapped_robot(self, trap: Trap) -> TrappedRobot:
        stay, step = trap.stay, self._run.step
        return TrappedRobot(
            self._run.names[trap.robot],
            stay.x,
            stay.y,
            stay.radius,
            trap.since * step,
            None if trap.until is None else trap.until * step,
            trap.point,
            None if trap.unseen_since == NEVER else trap.unseen_since * step,
        )

    def _ticks(self, trap: Trap) -> int:
        return (self._end if trap.until is None else trap.until) - trap.since

    def _together(self, traps: list[Trap]) -> int:
        """Count the ticks in which one robot was trapped; a tick that lies in two stays counts once."""
        ticks = known = 0
        for trap in sorted(traps, key=lambda trap: trap.since):
            until = trap.since + self._ticks(trap)
            ticks += max(until - max(trap.since, known), 0)
            known = max(known, until)
        return ticks

    @property
    def _end(self) -> int:
        return 0 if self._last is None else self._last.k + 1

    def _told(self, trap: Trap) -> str:
        step, stay = self._run.step, trap.stay
        until = f"the end ({self._end * step:g} s)" if trap.until is None else f"{trap.until * step:g} s"
        unseen = (
            "had never been seen" if trap.unseen_since == NEVER else f"was last seen at {trap.unseen_since * step:g} s"
        )
        seen = "; then all that it could see elsewhere had been seen" if trap.all_seen else ""
        return (
            f"it stayed within {stay.radius:.1f} m of {_at((stay.x, stay.y))} from {trap.since * step:g} s to {until}, "
            f"while {_at(trap.point)}, {trap.away:.0f} m away, {unseen}{seen}"
        )

    # --- fog ---------------------------------------------------------------------------------------------------------

    def _about_fog(self) -> tuple[list[str], str]:
        """Warnings about the fog at the end, and without any what was found."""
        if self._was_closed_out:
            return [], self._behind_closures()
        end, never = self.facts().end, self._fog.points - self._fog.seen
        took_s = self._end * self._run.step
        assert end is not None
        if not never and end.age_s <= min(0.5 * took_s, SHORTEST_S):
            return [], "all that can be seen was seen, and nothing was stale for long at the end"
        tour_s = best_tour(self._run.prepared).bound_s({n: ticks / self._end for n, ticks in self._patrolled.items()})
        if tour_s is None:
            return self._without_tour(never, took_s)
        least_s = max(TOURS * tour_s, SHORTEST_S)
        if not never and end.age_s <= min(0.5 * took_s, max(STALE_TOURS * tour_s, SHORTEST_S)):
            return [], "all that can be seen was seen, and nothing was stale for long at the end"
        if took_s < least_s:
            return [], f"the fog is not judged: the run takes {took_s:g} s, and it would have to take {least_s:.0f} s"
        return [self._never(never, took_s) if never else self._stale(end)], ""

    def _behind_closures(self) -> str:
        """Return what is said of the fog where ground was closed out."""
        assert self._open_ground is not None
        missing = (self._fog.last_seen == NEVER) & (self._fog.patrolled != 0)
        said = "the fog is not judged, as ground was closed out; mfow_open_max_s says how old open ground got"
        if not missing.any():
            return said
        area = self._run.prepared.terrain.point_area
        never, out = (area * np.count_nonzero(points) for points in (missing, missing & self._open_ground.closed_out))
        return f"{said}; {never:.0f} m² were never seen, of which {out:.0f} m² are closed out at the end"

    def _without_tour(self, never: int, took_s: float) -> tuple[list[str], str]:
        """Return the same where there is no tour to compare with: only ground that was never seen is judged."""
        if not never:
            return [], "all that can be seen was seen; there is no tour to compare the fog's growth with"
        if took_s < SHORTEST_S:
            return [], f"the fog is not judged: the run takes {took_s:g} s, and it would have to take {SHORTEST_S:g} s"
        before = self._seen[self._end // 2 - 1]
        if self._fog.seen - before > NEW_SHARE * before:
            return (
                [],
                "the fog is not judged: there is no tour to compare with, and new ground was seen to the end",
            )
        return [self._never(never, took_s)], ""

    def _stale(self, end: Stalest) -> str:
        near = "" if end.nearest is None else f"; {end.nearest} was nearest to it then, {end.nearest_m:.0f} m away"
        seen = f"was last seen at {end.at_s - end.age_s:g} s, {end.age_s:g} s before the end"
        return f"the fog grew to the end: {_at((end.x, end.y))} {seen}{near}"

    def _never(self, never: int, took_s: float) -> str:
        terrain = self._run.prepared.terrain
        missing = (self._fog.last_seen == NEVER) & (self._fog.patrolled != 0)
        labels, count = parts_of(missing)
        sizes = np.bincount(labels.reshape(-1), minlength=count + 1)
        sizes[0] = 0
        rows, cols = np.nonzero(labels == int(sizes.argmax()))
        middle = np.argmin((rows - rows.mean()) ** 2 + (cols - cols.mean()) ** 2)
        where = terrain.centre(int(rows[middle]), int(cols[middle]))
        points = f"{never} point{'s' if never != 1 else ''} ({_area(never * terrain.point_area)}, "
        share = 100.0 * never / self._fog.points
        points += f"{share:{'.0f' if share >= 10.0 else '.2g'}} % of what can be seen)"
        largest = (
            "" if count == 1 else f"the largest of {count} pieces, {_area(int(sizes.max()) * terrain.point_area)}, "
        )
        return f"{points} {'was' if never == 1 else 'were'} never seen in {took_s:g} s: {largest}at {_at(where)}"

    def _stalest(
        self, age: int, k: int, point: tuple[int, int], last_seen: int, rows: tuple[RobotTick, ...]
    ) -> Stalest:
        x, y = self._run.prepared.terrain.centre(*point)
        away = [(math.dist((x, y), (r.x, r.y)), r.number) for r in rows if r.status is Status.ALIVE]
        nearest_m, number = min(away, default=(None, 0))
        step = self._run.step
        return Stalest(x, y, age * step, k * step, last_seen != NEVER, self._run.names.get(number), nearest_m)


def _at(place: Place) -> str:
    return f"({place[0]:.1f}, {place[1]:.1f})"


def _area(m2: float) -> str:
    return f"{m2:.0f} m²" if m2 >= 10.0 else f"{m2:.2g} m²"
