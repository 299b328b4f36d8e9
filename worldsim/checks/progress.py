"""The verdict's checks of the patrol: whether it gets on, and recovers once faults are over."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from patrol.faults.kinds import Fault
from patrol.ground.cspace import parts_of
from patrol.ground.fog import NEVER
from patrol.journal import Status
from patrol.measures.best_tour import best_tour
from patrol.measures.progress import Trap, Traps, judged_places
from patrol.measures.stays import TRAPPED_S, Place, Stay
from patrol.pose import Pose
from patrol.summary.model import Stalest, Stalests
from worldsim.checks.check import Check
from worldsim.checks.ground import ClosedGround, GroundOpen, TrueFog
from worldsim.faults import FAULT_EVENT
from worldsim.truth import Truth

if TYPE_CHECKING:
    from patrol.ground.terrain import BoolGrid
    from patrol.journal import TickRecord
    from worldsim.checks.check import JudgedRun

STALE_TOURS = 8.0
"""The fog counts as growing where the stalest point at the end is older than so many times the best tour takes."""

TOURS = 4.0
"""Number of best tours that the robots could have driven before the fog of a run is judged."""

SHORTEST_S = 2.0 * TRAPPED_S
"""The shortest run whose fog is judged, s: on small ground a tour takes seconds."""

NEW_SHARE = 0.1
"""Without a tour, ground that was never seen is judged where the run's second half saw at most this share more points
than its first."""

WITHIN = 5.0
"""Longest time to see every point again once faults are over, in fault-free mean MFoW."""


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

    stalest: Stalests
    stays: dict[int, LongestStay]  # by robot number
    trapped: tuple[TrappedRobot, ...]  # in the order in which they began


class ProgressCheck(Check):
    """Warns of robots that are trapped, of fog that grows to the end, and of ground that was never seen.

    A patrol without progress is no error of the run: its numbers are right, and they say how bad the policy is. So this
    check fails no run.
    """

    name = "progress"

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._fog = run.reading(TrueFog).fog
        self._open_ground = run.reading(GroundOpen).open_ground
        self._is_closed_out = False
        self._traps = Traps(run.prepared, self._open_ground)
        self._found: dict[tuple[int, int], Trap] = {}
        self._stays: dict[int, tuple[int, Stay]] = {}
        self._patrolled: Counter[int] = Counter()
        self._seen: list[int] = []
        self._worst: tuple[int, Stalest] | None = None
        self._last: TickRecord | None = None
        self._ticks = 0

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
        # What closures leave old is excused for good, what a wreck leaves old while it stands.
        lasts = self._is_closed_out and self._run.prepared.scenario.changes_ground
        self._is_closed_out = lasts or bool(self._open_ground.closed_out.any())
        age = fog.mfow(k)
        if self._worst is None or age > self._worst[0]:
            self._worst = age, self._find_stalest(record)
        self._last, self._ticks = record, k + 1

    def facts(self) -> RunProgress:
        """Return the progress of the patrol, once all ticks are in."""
        if self._last is None or self._worst is None:
            return RunProgress(Stalests(worst=None, end=None), {}, ())
        step = self._step
        stays = {
            number: LongestStay(ticks * step, stay.since * step, stay.x, stay.y, stay.radius)
            for number, (ticks, stay) in self._stays.items()
        }
        traps = sorted(self._found.values(), key=lambda trap: (trap.since, trap.robot))
        trapped = tuple(self._trapped_robot(trap) for trap in traps)
        return RunProgress(Stalests(worst=self._worst[1], end=self._find_stalest(self._last)), stays, trapped)

    def _end(self) -> str:
        if self._last is None:
            self._unknown = "not judged: the run has no tick"
            return ""
        warning, judged = self._about_fog(self._find_stalest(self._last))
        self._warnings = [*self._list_trapped(), *([warning] if warning else [])]
        return "; ".join(self._warnings) or f"no robot was trapped; {judged}"

    # --- trapped robots ----------------------------------------------------------------------------------------------

    def _list_trapped(self) -> Iterator[str]:
        """Yield one line for each robot that was trapped, about the longest time."""
        for number, name in self._run.names.items():
            traps = [trap for trap in self._found.values() if trap.robot == number]
            if traps:
                longest = max(traps, key=lambda trap: self._find_end(trap) - trap.since)
                total = f"; {len(traps)} times in all, {self._count_trapped(traps) * self._step:g} s"
                yield f"{name} was trapped: {self._describe_trap(longest)}{total if len(traps) > 1 else ''}"

    def _trapped_robot(self, trap: Trap) -> TrappedRobot:
        stay, step = trap.stay, self._step
        until_s = None if trap.until is None else trap.until * step
        seen_s = None if trap.unseen_since == NEVER else trap.unseen_since * step
        name = self._name(trap.robot)
        return TrappedRobot(name, stay.x, stay.y, stay.radius, trap.since * step, until_s, trap.point, seen_s)

    def _find_end(self, trap: Trap) -> int:
        return self._ticks if trap.until is None else trap.until

    def _count_trapped(self, traps: Sequence[Trap]) -> int:
        """Count the ticks in which one robot was trapped; a tick that lies in two stays counts once.

        For example, stays from tick 0 to 10 and from 5 to 20 are 20 ticks.
        """
        ticks = counted = 0
        for trap in sorted(traps, key=lambda trap: trap.since):
            ticks += max(self._find_end(trap) - max(trap.since, counted), 0)
            counted = max(counted, self._find_end(trap))
        return ticks

    def _describe_trap(self, trap: Trap) -> str:
        step, stay = self._step, trap.stay
        until = f"{self._find_end(trap) * step:g} s"
        until = f"the end ({until})" if trap.until is None else until
        never = trap.unseen_since == NEVER
        unseen = "had never been seen" if never else f"was last seen at {trap.unseen_since * step:g} s"
        suffix = "; then all that it could see elsewhere had been seen" if trap.all_seen else ""
        return (
            f"it stayed within {stay.radius:.1f} m of {_format_place((stay.x, stay.y))} from {trap.since * step:g} s "
            f"to {until}, while {_format_place(trap.point)}, {trap.away:.0f} m away, {unseen}{suffix}"
        )

    # --- fog ---------------------------------------------------------------------------------------------------------

    def _about_fog(self, end: Stalest) -> tuple[str, str]:
        """Return a warning about the fog at the end, or empty, and without one the finding."""
        if self._is_closed_out:
            return "", self._behind_closed_ground()
        never, took_s = self._fog.points - self._fog.seen, self._ticks * self._step
        fresh = "all that can be seen was seen, and nothing was stale for long at the end"
        if not never and end.age_s <= min(0.5 * took_s, SHORTEST_S):
            return "", fresh
        shares = {number: ticks / self._ticks for number, ticks in self._patrolled.items()}
        tour_s = best_tour(self._run.prepared).bound_s(shares)
        if tour_s is None:
            return self._without_tour(never, took_s)
        if not never and end.age_s <= min(0.5 * took_s, max(STALE_TOURS * tour_s, SHORTEST_S)):
            return "", fresh
        least_s = max(TOURS * tour_s, SHORTEST_S)
        if took_s < least_s:
            return "", f"the fog is not judged: the run takes {took_s:g} s, and it would have to take {least_s:.0f} s"
        return self._describe_unseen(never, took_s) if never else self._describe_stalest(end), ""

    def _without_tour(self, never: int, took_s: float) -> tuple[str, str]:
        """Return the same where there is no tour to compare with: only ground that was never seen is judged."""
        if not never:
            return "", "all that can be seen was seen; there is no tour to compare the fog's growth with"
        if took_s < SHORTEST_S:
            return "", f"the fog is not judged: the run takes {took_s:g} s, and it would have to take {SHORTEST_S:g} s"
        before = self._seen[self._ticks // 2 - 1]
        if self._fog.seen - before > NEW_SHARE * before:
            return "", "the fog is not judged: there is no tour to compare with, and new ground was seen to the end"
        return self._describe_unseen(never, took_s), ""

    def _behind_closed_ground(self) -> str:
        """Return the text about the fog where ground was closed out."""
        missing = self._never_seen()
        text = "the fog is not judged, as ground was closed out; mfow_reachable_max_s says how old open ground got"
        if not missing.any():
            return text
        area = self._run.prepared.terrain.point_area
        never, out = (area * np.count_nonzero(points) for points in (missing, missing & self._open_ground.closed_out))
        return f"{text}; {never:.0f} m² were never seen, of which {out:.0f} m² are closed out at the end"

    def _never_seen(self) -> BoolGrid:
        never: BoolGrid = (self._fog.last_seen == NEVER) & (self._fog.patrolled != 0)
        return never

    def _describe_stalest(self, end: Stalest) -> str:
        near = "" if end.nearest is None else f"; {end.nearest} was nearest to it then, {end.nearest_m:.0f} m away"
        phrase = f"was last seen at {end.at_s - end.age_s:g} s, {end.age_s:g} s before the end"
        return f"the fog grew to the end: {_format_place((end.x, end.y))} {phrase}{near}"

    def _describe_unseen(self, never: int, took_s: float) -> str:
        terrain = self._run.prepared.terrain
        labels, count = parts_of(self._never_seen())
        # The largest piece is named, as the one that a policy most likely never went to.
        sizes = np.bincount(labels.reshape(-1), minlength=count + 1)
        # Label 0 is the ground that was seen.
        sizes[0] = 0
        rows, cols = np.nonzero(labels == int(sizes.argmax()))
        # A point of the piece itself, since the middle of a bent piece may lie outside of it.
        middle = np.argmin((rows - rows.mean()) ** 2 + (cols - cols.mean()) ** 2)
        where = _format_place(terrain.centre(int(rows[middle]), int(cols[middle])))
        share = 100.0 * never / self._fog.points
        points = f"{never} point{'s' if never != 1 else ''} ({_format_area(never * terrain.point_area)}, "
        points += f"{share:{'.0f' if share >= 10.0 else '.2g'}} % of what can be seen)"
        largest_m2 = int(sizes.max()) * terrain.point_area
        largest = f"the largest of {count} pieces, {_format_area(largest_m2)}, " if count > 1 else ""
        return f"{points} {'was' if never == 1 else 'were'} never seen in {took_s:g} s: {largest}at {where}"

    def _find_stalest(self, record: TickRecord) -> Stalest:
        """Return the stalest place after a tick that was just taken in."""
        point, step = self._fog.stalest(), self._step
        x, y = self._run.prepared.terrain.centre(*point)
        away = [(math.dist((x, y), (r.x, r.y)), r.number) for r in record.robots if r.status is Status.ALIVE]
        nearest_m, number = min(away, default=(None, 0))
        return Stalest(
            x=x,
            y=y,
            age_s=self._fog.mfow(record.k) * step,
            at_s=record.k * step,
            seen=int(self._fog.last_seen[point]) != NEVER,
            nearest=self._run.names.get(number),
            nearest_m=nearest_m,
        )


def _format_place(place: Place) -> str:
    return f"({place[0]:.1f}, {place[1]:.1f})"


def _format_area(m2: float) -> str:
    return f"{m2:.0f} m²" if m2 >= 10.0 else f"{m2:.2g} m²"


class Recovers(Check):
    """Once the faults are over, every patrolled point is seen again within 5 x the fault-free mean MFoW.

    The time counts from the first tick in which no fault is active any more and the whole fleet is there: the process
    of a robot that the last fault starts may take some ticks to come. It is judged only where that happens, there is a
    fault-free run of the same seed to compare with, and the run goes on for long enough.
    """

    name = "recovery"
    kinds = (Fault,)

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._spares = run.prepared.scenario.spares
        self._healed = run.timeline.healed
        self._ground = run.reading(ClosedGround)
        self._missing = ""
        self._truth: Truth | None = None
        self._whole_at = 0
        self._seen_at: int | None = None
        self._last = -1

    def _tick(self, record: TickRecord) -> None:
        self._last = record.k
        if self._healed is None or record.k < self._healed or self._seen_at is not None:
            return
        if self._truth is None:
            self._missing = ""
            for row in record.robots:
                is_to_join = row.status is Status.ABSENT and row.number in self._spares
                if row.status is not Status.ALIVE and not is_to_join:
                    status = "away" if row.status is Status.LEFT else row.status.name.lower()
                    self._missing = f"{self._name(row.number)} is still {status}"
                    return
            self._whole_at = record.k
            self._truth = Truth(self._ground.footprint, self._run.prepared.patrolled)
        poses = [(row.number, Pose(row.x, row.y, row.heading)) for row in record.robots if row.status is Status.ALIVE]
        self._truth.observe(record.k, poses)
        if self._truth.fog.seen == self._truth.fog.points:
            self._seen_at = record.k

    def _end(self) -> str:
        step = self._step
        took_s = None if self._seen_at is None else (self._seen_at - self._whole_at) * step
        took = "not every point was seen again" if took_s is None else f"every point was seen again in {took_s:g} s"
        limit_s = math.ceil(WITHIN * (self._run.baseline_s or 0.0) / step) * step
        why = self._why_not(took, took_s, limit_s)
        self._unknown = f"not judged: {why}" if why else ""
        detail = f"{took}; at most {limit_s:g} s are allowed"
        if took_s is None or took_s > limit_s:
            self._fail(detail)
        return detail

    def _why_not(self, took: str, took_s: float | None, limit_s: float) -> str:
        """Return why recovery cannot be judged, empty when it can."""
        healed = self._healed
        fault_ticks = [event.k for event in self._run.journal.events if event.kind == FAULT_EVENT]
        why = ""
        if healed is None:
            why = "a fault lasts to the end"
        elif fault_ticks and fault_ticks[-1] > healed:
            why = f"a fault was added at tick {fault_ticks[-1]}"
        elif self._last < healed:
            why = "the run ended before all faults were over"
        elif self._missing:
            why = f"{self._missing} at the end, after all faults"
        elif self._run.baseline_s is None:
            why = f"{took}; there is no fault-free run to compare with"
        elif took_s is None and (self._last - self._whole_at) * self._step < limit_s:
            why = f"the run goes on for less than {limit_s:g} s after the faults, {WITHIN:g} x the fault-free MFoW"
        return why
