"""Stays: since when each robot has been in one place, from its positions tick after tick.

A robot *stays* while all its positions fit into one circle. Positions are given by the caller, true or believed, live
or from a journal.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from patrol.faults.roster import tick_of

if TYPE_CHECKING:
    from patrol.scenario import RobotSpec

TRAPPED_S = 180.0
"""Time that a robot stays before it counts as trapped, s."""

ROAMING = 4.0
"""Radius of the circle of a stay, in radii and strides of the body."""

SAMPLE_S = 1.0
"""Simulated time between two positions that are looked at, s."""

Place = tuple[float, float]
"""x and y, m."""


def roaming_radius(spec: RobotSpec, step: float) -> float:
    """Return the radius (m) of the circle of a robot's stay: `ROAMING` times its radius and its stride."""
    return ROAMING * (spec.radius + spec.speed * step)


@dataclass(frozen=True, slots=True)
class Stay:
    """A robot's stay: since a tick, all its positions lie in one circle."""

    since: int  # the tick in which the robot came
    x: float  # of the circle's centre, m
    y: float  # likewise
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
        if x < self.left:
            self.left = x
        elif x > self.right:
            self.right = x
        if y < self.bottom:
            self.bottom = y
        elif y > self.top:
            self.top = y

    @property
    def centre(self) -> Place:
        """x and y, m."""
        return 0.5 * (self.left + self.right), 0.5 * (self.bottom + self.top)

    def within(self, radius: float) -> bool:
        """Return True if a circle around the centre holds the whole box."""
        return math.hypot(0.5 * (self.right - self.left), 0.5 * (self.top - self.bottom)) <= radius

    def fits(self, radius: float, places: Iterable[Place]) -> bool:
        """Return True if a circle around the centre holds the positions, which are those of this box."""
        if self.within(radius):
            return True
        if max(self.right - self.left, self.top - self.bottom) > 2.0 * radius:
            return False
        centre = self.centre
        return all(math.dist(centre, position) <= radius for position in places)


class _Track:
    """The latest positions of one robot, and its stay."""

    def __init__(self, radius: float, ticks: int) -> None:
        """Start without positions; a stay that lasts so many ticks is fixed to its circle."""
        self.radius = radius
        self._ticks = ticks
        self._places: deque[Place] = deque()
        self._seen_at: deque[int] = deque()
        self._box: _Box | None = None
        self.since = 0
        self._circle: Place | None = None

    def add(self, k: int, x: float, y: float) -> None:
        """Take in the next position."""
        places, seen_at = self._places, self._seen_at
        places.append((x, y))
        seen_at.append(k)
        if self._box is None:
            self._box, self.since = _Box([(x, y)]), k
        self._box.add(x, y)
        if self._circle is not None:
            while seen_at[0] < k - self._ticks:
                places.popleft()
                seen_at.popleft()
        if self._circle is not None and math.dist(self._circle, (x, y)) > self.radius:
            # All since the stay began may still fit into a circle beside the first one.
            if self._box.within(self.radius):
                self._circle = self._box.centre
            else:
                self._circle, self._box = None, _Box(places)
        if self._circle is not None:
            return
        while not self._box.fits(self.radius, places):
            places.popleft()
            seen_at.popleft()
            self._box = _Box(places)
        self.since = seen_at[0]
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
        """Start without positions; the circles' radii are in m by robot number (`roaming_radius`)."""
        self._radii = dict(radii)
        self._every = max(round(SAMPLE_S / step), 1)
        self._ticks = tick_of(TRAPPED_S, step)
        self._tracks: dict[int, _Track] = {}

    def tick(self, k: int, places: Mapping[int, Place], free: Collection[int] = ()) -> None:
        """Take in the robots' positions by number.

        The stays of robots without a place end, and of those that are `free` to stay where they are.
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
        """Return the present stay of a robot, however short; None for one that is free or has no place."""
        track = self._tracks.get(number)
        return None if track is None else track.stay

    def since(self, number: int) -> int | None:
        """Return the tick in which a robot's present stay began, which costs less than `stay`; None likewise."""
        track = self._tracks.get(number)
        return None if track is None else track.since

    def long(self, k: int) -> dict[int, Stay]:
        """Return the stays that have lasted `TRAPPED_S`, by robot number."""
        long = {}
        for number, track in self._tracks.items():
            if k - track.since >= self._ticks and (stay := track.stay) is not None:
                long[number] = stay
        return long
