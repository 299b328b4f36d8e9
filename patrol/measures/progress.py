"""Progress: robots that are in one place for long although there is stale ground elsewhere that they could go and see.

A robot is *trapped* when it has stayed in one circle (`patrol.measures.stays`) for `TRAPPED_S` while no robot has seen
some point outside of that circle, which its body could go and see. It is trapped until it leaves the circle, or until
all such points have been seen; in the second case its time counts anew from then on. Positions and fog are given by the
caller, true or believed, live or from a journal.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.faults.roster import tick_of
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.journal.records import CHARGING, DOCKING, SURROUNDING, Status, TickRecord
from patrol.measures.best_tour import OwnGround, own_grounds
from patrol.measures.stays import TRAPPED_S, Place, Stay, Stays, roaming_radius

if TYPE_CHECKING:
    from patrol.changing.open_ground import OpenGround
    from patrol.prepare import Prepared

LOOK_S = 5.0
"""Simulated time between two looks at the fog for a robot that stays, s."""

_BUSY = (SURROUNDING, DOCKING, CHARGING)
"""States in which a robot has a reason to stay."""


@dataclass(frozen=True, slots=True)
class Trap:
    """A robot that is trapped, or was."""

    robot: int
    stay: Stay
    since: int  # the tick in which the stay began, or in which all points outside had been seen during it
    point: Place  # centre of the stalest point outside that it could go and see, when the trap was found
    unseen_since: int  # the tick in which a robot last saw that point; -1 when none had seen it
    until: int | None = None
    """The tick in which it was found to have left the circle, or all outside to be seen; None while it is trapped."""
    all_seen: bool = False  # over because all points outside had been seen, not because the robot left

    @property
    def away(self) -> float:
        """The straight distance from the circle's centre to the point, m."""
        return math.dist((self.stay.x, self.stay.y), self.point)

    def told(self, step: float, before: str = "") -> str:
        """Return the text that terminal and page show after "r1 trapped" and after "r1 no longer trapped".

        `before` is "before " where the robot may have been trapped for longer than is known.
        """
        where = f"within {self.stay.radius:.1f} m of ({self.stay.x:.1f}, {self.stay.y:.1f})"
        if self.until is None:
            point = f"({self.point[0]:.1f}, {self.point[1]:.1f})"
            return f"{where} since {before}{self.since * step:g} s; nobody has seen {point} in that time"
        why = "; all that it could see elsewhere has been seen" if self.all_seen else ""
        return f"after {(self.until - self.since) * step:g} s {where}{why}"


class Traps:
    """Finds the robots that are trapped, tick after tick.

    It looks every `LOOK_S`, and asks for the fog only while a robot is trapped or has stayed for `TRAPPED_S`, counted
    from the last look that found nothing stale outside of its circle.
    """

    def __init__(self, prepared: Prepared, open_ground: OpenGround) -> None:
        """Start before the first tick.

        The caller keeps `open_ground` up to date in each tick.
        """
        self._open_ground = open_ground
        scenario = prepared.scenario
        roster = scenario.roster
        self.stays = Stays({spec.number: roaming_radius(spec, scenario.step) for spec in roster}, scenario.step)
        self.open: dict[int, Trap] = {}  # now, by robot number
        self._prepared = prepared
        self._every = max(round(LOOK_S / scenario.step), 1)
        self._ticks = tick_of(TRAPPED_S, scenario.step)
        self._all_seen: dict[tuple[int, int], int] = {}
        """By robot and first tick of its stay, the last look that found nothing stale outside of its circle."""
        self._grounds: dict[int, OwnGround] | None = None

    def tick(self, record: TickRecord, last_seen: Callable[[], NDArray[np.int32]]) -> list[Trap]:
        """Take in a tick; return the traps found in it (``until`` is None), and those that are over.

        `last_seen` gives the tick in which each point was last seen after this tick's observations, int32 (height,
        width), -1 where never. It is called only when it is needed.
        """
        k = record.k
        self.stays.tick(k, *judged_places(record))
        if k % self._every:
            return []
        news = []
        for number, trap in list(self.open.items()):
            stay = self.stays.stay(number)
            if stay is None or stay.since != trap.stay.since:
                news.append(replace(self.open.pop(number), until=k))
        terrain = self._prepared.terrain
        for number, (stay, since) in self._to_look_at(k).items():
            grid = self._open_ground.last_seen_or_out(number, k, last_seen())
            stale_point = stalest_outside(replace(stay, since=since), terrain, self._robot_ground(number), grid)
            if stale_point is None:
                self._all_seen[number, stay.since] = k
                if number in self.open:
                    news.append(replace(self.open.pop(number), until=k, all_seen=True))
            elif number not in self.open:
                self.open[number] = Trap(number, stay, since, terrain.centre(*stale_point), int(grid[stale_point]))
                news.append(self.open[number])
        return news

    def needs_fog(self, k: int) -> bool:
        """Return True if `tick` may ask for the fog of tick `k`, the next to be taken in."""
        return k % self._every == 0 and bool(self._to_look_at(k))

    def _to_look_at(self, k: int) -> dict[int, tuple[Stay, int]]:
        """Find the robots that are trapped or may be, by number: their stays, and the ticks from which these count."""
        stays = {}
        for number, stay in self.stays.long(k).items():
            since = self._all_seen.get((number, stay.since), stay.since)
            if number in self.open or k - since >= self._ticks:
                stays[number] = stay, since
        return stays

    def _robot_ground(self, number: int) -> BoolGrid:
        if self._grounds is None:
            self._grounds = own_grounds(self._prepared)
        return self._grounds[number].patrolled


def judged_places(record: TickRecord) -> tuple[dict[int, Place], list[int]]:
    """Return the places of the robots in a tick by number, and the numbers of those that are free to stay there.

    A robot that does not take part is free (paused, dead, lost, absent, left), and so is one that surrounds an
    intruder, charges or waits for a dock. A robot that no other hears, or whose senses are wrong, is not: it patrols,
    and it should get on.
    """
    places = {row.number: (row.x, row.y) for row in record.robots}
    free = [row.number for row in record.robots if row.status is not Status.ALIVE or row.state in _BUSY]
    return places, free


def stalest_outside(
    stay: Stay, terrain: Terrain, ground: BoolGrid, last_seen: NDArray[np.int32]
) -> tuple[int, int] | None:
    """Find the stalest point (row, col) outside of a stay's circle that no robot has seen since the stay began.

    Of equally stale ones the nearest to the circle counts; None where there is none. `ground` marks the points that the
    robot could go and see; `last_seen` is in ticks, -1 where never.
    """
    stale = np.flatnonzero(ground & (last_seen < stay.since))
    if not stale.size:
        return None
    row, col = terrain.point_at(stay.x, stay.y)
    rows, cols = np.divmod(stale, terrain.width)
    square = (rows - row) ** 2 + (cols - col) ** 2
    outside = square > (stay.radius / terrain.point + 1.0) ** 2
    stale, square = stale[outside], square[outside]
    if not stale.size:
        return None
    ages = last_seen.reshape(-1)[stale]
    oldest = ages == ages.min()
    stalest = int(stale[oldest][np.argmin(square[oldest])])
    return stalest // terrain.width, stalest % terrain.width
