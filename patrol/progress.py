"""Progress: which robots stay in one place although there is stale ground elsewhere that they could go and see.

A robot *stays* while all its positions fit into one circle. A robot is *trapped* when it has stayed for `TRAPPED_S`
while a point outside of that circle, which its body could go and see, has been seen by nobody. It is trapped until it
leaves the circle, or until all such points have been seen; in the second case its time counts anew from then on.
Positions and fog are given by the caller, true or believed, live or from a journal.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.ground.terrain import BoolGrid, Terrain
from patrol.journal.records import SURROUNDING, Status, TickRecord
from patrol.own_ground import OwnGround, own_grounds

if TYPE_CHECKING:
    from patrol.prepare import Prepared
    from patrol.scenario import RobotSpec

TRAPPED_S = 180.0
"""How long a robot stays before it counts as trapped, s."""

ROAMING = 4.0
"""Radius of the circle of a stay, in radii and strides of the body."""

SAMPLE_S = 1.0
"""Simulated time between two positions that are looked at, s."""

LOOK_S = 5.0
"""Simulated time between two looks at the fog for a robot that stays, s."""

Place = tuple[float, float]
"""x and y, m."""


def roaming_radius(spec: RobotSpec, step: float) -> float:
    """The radius of the circle that a robot leaves unless it stays: four times its radius and its stride together.

    Args:
        spec: The robot.
        step: Length of a tick, s.

    Returns:
        The radius, m.
    """
    return ROAMING * (spec.radius + spec.speed * step)


def _ticks_of(seconds: float, step: float) -> int:
    """The smallest number of ticks that last a time.

    Args:
        seconds: The time, s.
        step: Length of a tick, s.
    """
    return math.ceil(seconds / step - 1e-9)


# --- stays -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Stay:
    """A robot's stay: since a tick, all its positions lie in one circle.

    Attributes:
        since: The tick in which the robot came.
        x: Of the circle's centre, m.
        y: Of the circle's centre, m.
        radius: Of the circle, m.
    """

    since: int
    x: float
    y: float
    radius: float


class _Box:
    """The bounding box of positions."""

    __slots__ = ("bottom", "left", "right", "top")

    def __init__(self, places: Iterable[Place]) -> None:
        """Take in positions, at least one."""
        xs, ys = zip(*places, strict=True)
        self.left, self.right = min(xs), max(xs)
        self.bottom, self.top = min(ys), max(ys)

    def add(self, x: float, y: float) -> None:
        """Take in one more position."""
        self.left, self.right = min(self.left, x), max(self.right, x)
        self.bottom, self.top = min(self.bottom, y), max(self.top, y)

    @property
    def centre(self) -> Place:
        """x and y, m."""
        return 0.5 * (self.left + self.right), 0.5 * (self.bottom + self.top)

    def within(self, radius: float) -> bool:
        """Whether a circle around the centre holds the whole box."""
        return math.hypot(0.5 * (self.right - self.left), 0.5 * (self.top - self.bottom)) <= radius

    def fits(self, radius: float, places: Iterable[Place]) -> bool:
        """Whether a circle around the centre holds the positions, which are those of this box."""
        if self.within(radius):
            return True
        if max(self.right - self.left, self.top - self.bottom) > 2.0 * radius:
            return False
        centre = self.centre
        return all(math.dist(centre, place) <= radius for place in places)


class _Track:
    """The latest positions of one robot, and its stay."""

    def __init__(self, radius: float, ticks: int) -> None:
        """Start without positions.

        Args:
            radius: Of the circle, m.
            ticks: Of the window: a stay that lasts this long is fixed to its circle.
        """
        self.radius = radius
        self._ticks = ticks
        self._places: deque[tuple[int, Place]] = deque()
        self._box: _Box | None = None
        self.since = 0
        self._circle: Place | None = None

    def add(self, k: int, x: float, y: float) -> None:
        """Take in the next position."""
        places = self._places
        places.append((k, (x, y)))
        if self._box is None:
            self._box, self.since = _Box([(x, y)]), k
        self._box.add(x, y)
        if self._circle is not None:
            while places[0][0] < k - self._ticks:
                places.popleft()
        if self._circle is not None and math.dist(self._circle, (x, y)) > self.radius:
            # All since the stay began may still fit into a circle beside the first one.
            if self._box.within(self.radius):
                self._circle = self._box.centre
            else:
                self._circle, self._box = None, _Box(place for _, place in places)
        if self._circle is not None:
            return
        while not self._box.fits(self.radius, (place for _, place in places)):
            places.popleft()
            self._box = _Box(place for _, place in places)
        self.since = places[0][0]
        if k - self.since >= self._ticks:
            self._circle = self._box.centre

    @property
    def stay(self) -> Stay | None:
        """The stay so far; None before the first position."""
        if self._box is None:
            return None
        return Stay(self.since, *(self._circle or self._box.centre), self.radius)


class Stays:
    """Says for each robot since when it has stayed where it is, from its positions tick after tick.

    Until a stay has lasted `TRAPPED_S`, it holds the latest positions that fit into one circle of the robot's radius,
    around the centre of their bounding box. From then on the circle stands, and the stay goes on until the robot leaves
    it. So the window slides, and a robot that swings from side to side stays as well as one that stands. About one
    position a second is looked at.
    """

    def __init__(self, radii: Mapping[int, float], step: float) -> None:
        """Start without positions.

        Args:
            radii: Radius of the circle in m by robot number (`roaming_radius`).
            step: Length of a tick, s.
        """
        self._radii = dict(radii)
        self._every = max(round(SAMPLE_S / step), 1)
        self._ticks = _ticks_of(TRAPPED_S, step)
        self._tracks: dict[int, _Track] = {}

    def tick(self, k: int, places: Mapping[int, Place], free: Collection[int] = ()) -> None:
        """Take in the robots' positions.

        Args:
            k: The tick.
            places: x and y in m by robot number.
            free: Numbers of the robots that may stay where they are: their stays end. So do those of robots without a
                place.
        """
        for number in [number for number in self._tracks if number in free or number not in places]:
            del self._tracks[number]
        if k % self._every:
            return
        for number, (x, y) in places.items():
            if number in free:
                continue
            track = self._tracks.get(number)
            if track is None:
                track = self._tracks[number] = _Track(self._radii[number], self._ticks)
            track.add(k, x, y)

    def stay(self, number: int) -> Stay | None:
        """The present stay of a robot, however short.

        Args:
            number: Of the robot.

        Returns:
            The stay; None for a robot that is free, or that has no place.
        """
        track = self._tracks.get(number)
        return None if track is None else track.stay

    def long(self, k: int) -> dict[int, Stay]:
        """The stays that have lasted `TRAPPED_S`.

        Args:
            k: The tick.

        Returns:
            The stays by robot number.
        """
        long = {}
        for number, track in self._tracks.items():
            if k - track.since >= self._ticks and (stay := track.stay) is not None:
                long[number] = stay
        return long


# --- traps -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Trap:
    """A robot that is trapped, or was.

    Attributes:
        robot: Its number.
        stay: Where it has stayed.
        since: The tick from which on it has been trapped: that in which the stay began, or in which all points outside
            of the circle had been seen during the stay.
        point: A point that it could go and see, the stalest outside of the circle when the trap was found; x and y of
            its centre, m.
        unseen_since: The tick in which anybody last saw that point; -1 when nobody had seen it.
        until: The tick in which the robot was found to have left the circle, or all points outside to have been seen;
            None while it is trapped.
        all_seen: Whether it was over because all points outside had been seen, and not because the robot left.
    """

    robot: int
    stay: Stay
    since: int
    point: Place
    unseen_since: int
    until: int | None = None
    all_seen: bool = False

    @property
    def away(self) -> float:
        """The straight distance from the circle's centre to the point, m."""
        return math.dist((self.stay.x, self.stay.y), self.point)

    def told(self, step: float, before: str = "") -> str:
        """What the terminal and the page say after "r1 trapped" and after "r1 no longer trapped".

        Args:
            step: Length of a tick, s.
            before: "before ", where the robot may have been trapped for longer than is known.
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

    Attributes:
        stays: The stays that it follows.
        open: The robots that are trapped now, by number.
    """

    def __init__(self, prepared: Prepared) -> None:
        """Start before the first tick.

        Args:
            prepared: The scenario, its terrain and the bodies' static fields.
        """
        scenario = prepared.scenario
        roster = scenario.roster
        self.stays = Stays({spec.number: roaming_radius(spec, scenario.step) for spec in roster}, scenario.step)
        self.open: dict[int, Trap] = {}
        self._prepared = prepared
        self._every = max(round(LOOK_S / scenario.step), 1)
        self._ticks = _ticks_of(TRAPPED_S, scenario.step)
        self._all_seen: dict[tuple[int, int], int] = {}
        """By robot and first tick of its stay, the last look that found nothing stale outside of its circle."""
        self._grounds: dict[int, OwnGround] | None = None

    def tick(self, record: TickRecord, last_seen: Callable[[], NDArray[np.int32]]) -> list[Trap]:
        """Take in a tick.

        Args:
            record: Of the tick.
            last_seen: Gives the tick in which each point was last seen, int32 (height, width), -1 where never, after
                this tick's observations. It is called only when it is needed.

        Returns:
            The traps that were found in this tick (``until`` is None), and those that are over.
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
            grid = last_seen()
            at = stalest_outside(replace(stay, since=since), terrain, self._ground(number), grid)
            if at is None:
                self._all_seen[number, stay.since] = k
                if number in self.open:
                    news.append(replace(self.open.pop(number), until=k, all_seen=True))
            elif number not in self.open:
                self.open[number] = Trap(number, stay, since, terrain.centre(*at), int(grid[at]))
                news.append(self.open[number])
        return news

    def needs_fog(self, k: int) -> bool:
        """Whether `tick` may ask for the fog of a tick.

        Args:
            k: The tick, the next to be taken in.
        """
        return k % self._every == 0 and bool(self._to_look_at(k))

    def _to_look_at(self, k: int) -> dict[int, tuple[Stay, int]]:
        """By number, the robots that are trapped or may be: their stays, and from when on these count."""
        found = {}
        for number, stay in self.stays.long(k).items():
            since = self._all_seen.get((number, stay.since), stay.since)
            if number in self.open or k - since >= self._ticks:
                found[number] = stay, since
        return found

    def _ground(self, number: int) -> BoolGrid:
        if self._grounds is None:
            self._grounds = own_grounds(self._prepared)
        return self._grounds[number].patrolled


def judged_places(record: TickRecord) -> tuple[dict[int, Place], list[int]]:
    """The places of the robots in a tick, and who is free to stay there.

    A robot that does not take part is free (paused, dead, lost, absent, left), and so is one that surrounds an
    intruder. A robot that nobody hears, or whose senses are wrong, is not: it patrols, and it should get on.

    Args:
        record: Of the tick.

    Returns:
        x and y in m by robot number, and the numbers of the robots that are free.
    """
    places = {row.number: (row.x, row.y) for row in record.robots}
    free = [row.number for row in record.robots if row.status is not Status.ALIVE or row.state == SURROUNDING]
    return places, free


def stalest_outside(
    stay: Stay, terrain: Terrain, ground: BoolGrid, last_seen: NDArray[np.int32]
) -> tuple[int, int] | None:
    """The stalest point outside of a stay's circle that nobody has seen since the stay began.

    Args:
        stay: The stay.
        terrain: The ground.
        ground: bool (height, width), the points that the robot could go and see.
        last_seen: int32 (height, width), ticks; -1 where never.

    Returns:
        (row, col), the nearest to the circle of several; None where there is no such point.
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
    at = int(stale[oldest][np.argmin(square[oldest])])
    return at // terrain.width, at % terrain.width
