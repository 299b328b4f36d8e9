"""Equal gaps between robots that follow one closed tour, kept by the positions that are heard.

Robots tell each other where they are, not how far along the tour. Where the tour passes a corridor twice, a position
alone does not say which way the robot is going. So each robot follows all others along the tour: of all ways along it
that fit the positions heard so far, it takes the likeliest (`agent.kernels.track`).

- *Places* lie a step of driving apart: a body with wheels needs longer where the tour turns, so there they are closer.
- *Beginning*: all robots work out the same places, equally far apart on the tour, and which robot goes to which.
- *Waiting*: once all are there, a robot that is nearer to the one ahead than to the one behind stands still until it
  no longer is. So gaps become equal again after a death, and open for a newcomer.

For example, three robots on a tour of 90 m, at 0, 20 and 60 m: the gaps ahead are 20, 40 and 30 m. The first robot has
30 m behind it and 20 m ahead, so it waits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.kernels.track import JUMP, follow

if TYPE_CHECKING:
    from agent.routes.ground import Spot
    from agent.view import View
    from patrol.ground.terrain import Terrain
    from patrol.scenario import RobotSpec
    from patrol.tours.round import Round

SLACK, WHEELS_SLACK = 0.1, 0.2
"""Difference of the gaps, as a share of an equal gap, from which on a robot waits; at least `SLACK_RANGES`. Bodies with
wheels need more time for one turn than for another, so they would wait for each other too often."""

SLACK_RANGES = 0.5
"""The same in sensor ranges: robots gain and lose so much by what they see from afar, and it evens out by itself."""

ZONE_SLACK = 0.15
"""Upper bound of the same on the rounds of zones, as a share of an equal gap: they may be short."""

LEAST_STRIDES = 3.0
"""Lower bound of that bound, in strides: robots that wait for less go by fits and starts."""

TURNING_RADII = 2.0
"""Way that a body which does not move sideways loses for each radian by which the tour turns, in radii of the body."""

TURNING_STRIDES = 2.0
"""Length of the stretches of the tour whose directions are compared for that, in strides."""

OFFSETS = 24
"""Positions of the equally spaced places on the tour that are compared."""

PATIENCE = 0.5
"""Time for which a robot waits on end, as a share of the time between two robots; then it drives for as long."""

LONGEST_WAIT_S = 45.0
"""Upper bound of the same, s."""

LATE_TICKS = 20
"""Ticks of silence at most for which a robot's way is followed on."""

MEMORY = 0.5
"""Time for which a robot that is not heard is expected to go on, as a share of the time between two robots."""

ON_THE_WAY = 2.0
"""Time after a beginning in which no robot waits, in times of the longest straight way to a first place."""

LONG_BUMPED_S = 5.0
"""Time after a bump in which a robot does not wait, so that it does not block others, s."""


class Heard(NamedTuple):
    """The last position of a robot that was heard, and the tick."""

    spot: Spot
    tick: int


@dataclass(slots=True)
class Followed:
    """A robot that is followed along the tour."""

    place: int  # number of the tour's place where it is
    heard: int  # tick at which it was heard last
    spot: Spot  # where it was then
    course: Spot  # direction in which it last drove; (0, 0) before it has
    costs: NDArray[np.float64]  # of each place (`agent.kernels.track.follow`)


class Spacing:
    """The robots on a round, as one of them knows them.

    `tour` is float64 (n, 4): x and y of each place in m, and the direction of the tour there, of length 1. `length_m`
    is the way that a robot could have driven straight in the time that it needs for the tour.
    """

    def __init__(
        self,
        laid_out: Round,
        spec: RobotSpec,  # of the robot itself
        followers: frozenset[int],  # all robots that follow it; those in other parts of the terrain do not count
        whole: int,  # how many of them there are without the spare ones
        stride: float,  # way in a tick, m
        range_m: float,  # of its sensor
        terrain: Terrain,
        most_slack: float = math.inf,  # upper bound of the slack, as a share of an equal gap
    ) -> None:
        """Lay places a stride of driving apart along a round."""
        self.round, self.number, self.stride = laid_out, spec.number, stride
        self.followers, self.whole = followers, whole
        self.robots: dict[int, Followed] = {}  # those that are followed, this one too
        self.heard: dict[int, Heard] = {}  # of this robot and of those heard lately
        self._slack, self._slack_m, self._most_slack = SLACK, SLACK_RANGES * range_m, most_slack
        self._bumped = self._all_there = -(2**30)
        self._waited, self._rests = 0, True
        spots = np.array([terrain.centre(*divmod(int(cell), terrain.width)) for cell in laid_out.places])
        lost = np.zeros(len(spots) + 1)
        if spec.model != "holonomic":
            turns = _find_turns(spots, laid_out, TURNING_STRIDES * stride)
            lost[1:], self._slack = TURNING_RADII * spec.radius * np.cumsum(turns), WHEELS_SLACK
        self.length_m = laid_out.length_m + float(lost[-1])
        count = max(4, min(int(self.length_m / stride), len(laid_out.places)))
        stops = np.searchsorted(laid_out.along + lost[:-1], np.arange(count) * (self.length_m / count))
        stops = np.minimum(stops, len(laid_out.places) - 1)
        spots = spots[stops]
        course = np.roll(spots, -1, axis=0) - np.roll(spots, 1, axis=0)
        length = np.sqrt((course**2).sum(axis=1))[:, None]
        # The course has no length where the tour comes back the way it went.
        self.tour = np.ascontiguousarray(np.hstack([spots, course / np.maximum(length, 1e-9)]))
        self._along, self._scratch = laid_out.along[stops], np.zeros(count)

    def follow_with(self, followers: frozenset[int]) -> None:
        """Follow the round with other robots than before; those of them that are known stay known."""
        self.followers, self.whole = followers, len(followers)
        self.heard = {number: report for number, report in self.heard.items() if number in followers}

    @property
    def count(self) -> int:
        """Number of places."""
        return len(self.tour)

    @property
    def team(self) -> int:
        """Number of robots on the tour: this one and those heard lately."""
        return len(self.heard)

    def listen(self, view: View) -> None:
        """Take note of the positions of the robots on the tour."""
        memory = MEMORY * self.length_m / view.stride / self.whole
        self.heard = {
            number: report
            for number, report in self.heard.items()
            if view.tick - report.tick <= memory and number not in view.charging
        }
        for number in self.followers & view.peers.keys():
            peer = view.peers[number]
            self.heard[number] = Heard((peer.pose.x, peer.pose.y), peer.tick)
        self.heard[self.number] = Heard((view.reported.x, view.reported.y), view.tick)

    def along_m(self, place: int) -> float:
        """Return the length of the tour up to a place, m."""
        return float(self._along[place])

    @property
    def own_place(self) -> int:
        """Number of the place where this robot is."""
        return self.robots[self.number].place

    def nearest(self, spot: Spot) -> int:
        """Return the number of the place that is nearest to x and y in m."""
        return int(((self.tour[:, :2] - np.array(spot)) ** 2).sum(axis=1).argmin())

    def begin(self, view: View) -> int:
        """Spread all robots over the tour, and return the place of this one.

        Of some positions of equally spaced places that one is taken in which the robot with the longest way, as the
        crow flies, has the shortest; pairs that are nearest to each other go first. A robot that hears no other takes
        the place that its number has among those of all robots, and is where the others leave a gap.
        """
        reports = self.heard
        numbers = sorted(reports)
        team = len(numbers)
        here = np.array([reports[number].spot for number in numbers])
        best: tuple[float, float] = (math.inf, math.inf)
        chosen: dict[int, int] = {}
        shifts = [offset / OFFSETS for offset in range(OFFSETS)]
        choices = [[int((slot + shift) * self.count / team) % self.count for slot in range(team)] for shift in shifts]
        if team == 1 and self.whole > 1:
            choices = [[sorted(self.followers).index(self.number) % self.whole * self.count // self.whole]]
        to_all: NDArray[np.float64] = np.sqrt(((here[:, None, :] - self.tour[None, :, :2]) ** 2).sum(axis=2))
        for slots in choices:
            ways = to_all[:, slots]
            pairs = _pair_rows(ways)
            lengths = [float(ways[robot, slot]) for robot, slot in enumerate(pairs)]
            if (max(lengths), sum(lengths)) < best:
                best = max(lengths), sum(lengths)
                chosen = {number: slots[slot] for number, slot in zip(numbers, pairs, strict=True)}
        self._all_there = view.tick + math.ceil(ON_THE_WAY * best[0] / view.stride)
        for number in numbers:
            self._enter_robot(number, reports[number].spot, view.tick, chosen[number])
        return chosen[self.number]

    def note(self, view: View) -> None:
        """Follow the robots to where they were heard."""
        if view.bumped:
            self._bumped = view.tick
        for number in [number for number in self.robots if number not in self.heard]:
            del self.robots[number]
        for number, (spot, tick) in self.heard.items():
            robot = self.robots.get(number)
            if robot is None:
                robot = self._enter_robot(number, spot, tick, None)
            self._follow_robot(robot, spot, tick)

    def _enter_robot(self, number: int, spot: Spot, heard: int, place: int | None) -> Followed:
        costs = np.full(self.count, JUMP if place is not None else 0.0)
        if place is not None:
            costs[place] = 0.0
        self.robots[number] = robot = Followed(
            self.nearest(spot) if place is None else place, heard - 1, spot, (0.0, 0.0), costs
        )
        return robot

    def _follow_robot(self, robot: Followed, spot: Spot, heard: int) -> None:
        if heard <= robot.heard:
            return
        ticks = min(heard - robot.heard, LATE_TICKS)
        across, up = spot[0] - robot.spot[0], spot[1] - robot.spot[1]
        driven = math.hypot(across, up)
        if driven >= 0.5 * self.stride:
            robot.course = across / driven, up / driven
            robot.spot = spot
        robot.heard = heard
        spacing = self.length_m / self.count
        robot.place = follow(robot.costs, self._scratch, self.tour, spacing, ticks, *spot, *robot.course)

    def waits(self, view: View) -> bool:
        """Return True if this robot should stand still, because it is nearer to the one ahead than to the one behind.

        A robot behind that does not come, because it is stuck or has something else to see, is not waited for long.
        """
        tick_s = view.stride / view.spec.speed
        longest = min(PATIENCE * self.length_m / view.stride / max(len(self.robots), 1), LONGEST_WAIT_S / tick_s)
        if self._waited >= longest:
            self._rests = False
        elif self._waited <= 0:
            self._rests = True
        waits = self._rests and self._is_too_near(view)
        self._waited = self._waited + 1 if waits else max(self._waited - 1, 0)
        return waits

    def _is_too_near(self, view: View) -> bool:
        own_robot = self.robots.get(self.number)
        if own_robot is None or len(self.robots) < 2 or view.tick < self._all_there:
            return False
        if view.tick - self._bumped < LONG_BUMPED_S * view.spec.speed / view.stride:
            return False
        ahead = behind = self.count
        for number, robot in self.robots.items():
            if number == self.number:
                continue
            driven = round((view.tick - robot.heard) * view.stride * self.count / self.length_m)
            gap = (robot.place + driven - own_robot.place) % self.count
            if gap == 0 and number > self.number:
                gap = self.count
            ahead, behind = min(ahead, gap), min(behind, self.count - gap)
        equal = self.count / len(self.robots)
        per_m = self.count / self.length_m
        places = min(self._slack_m * per_m, max(self._most_slack * equal, LEAST_STRIDES * self.stride * per_m))
        return ahead < behind - max(self._slack * equal, places)


def _find_turns(spots: NDArray[np.float64], laid_out: Round, stretch_m: float) -> NDArray[np.float64]:
    """Return by how much the tour turns from each of its places to the next, rad.

    Its direction is taken over ``stretch_m`` before and after a place, because a tour on points is jagged.
    """
    along, lap_m = laid_out.along, laid_out.length_m
    ahead = np.searchsorted(along, (along + stretch_m) % lap_m) % len(along)
    behind = np.searchsorted(along, (along - stretch_m) % lap_m) % len(along)
    onward, before = spots[ahead] - spots, spots - spots[behind]
    cross = onward[:, 1] * before[:, 0] - onward[:, 0] * before[:, 1]
    turned = np.array([abs(math.atan2(*sides)) for sides in zip(cross, (onward * before).sum(axis=1), strict=True)])
    steps = np.diff(along, append=lap_m)
    return np.asarray(turned * steps / stretch_m)


def _pair_rows(ways: NDArray[np.float64]) -> list[int]:
    """Give each row a column of its own, those first that are nearest to each other."""
    remaining = ways.copy()
    pairs = [0] * len(ways)
    for _ in range(len(ways)):
        row, column = divmod(int(remaining.argmin()), len(ways))
        pairs[row] = column
        remaining[row, :] = np.inf
        remaining[:, column] = np.inf
    return pairs
