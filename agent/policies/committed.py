"""The tour: a robot follows a round, and goes on when its target has been seen.

- *On the round*: the first stale point ahead on a short closed tour that shows all of the ground
  (below). All robots follow the same tour, evenly spaced (`agent.policies.spacing`).
- *Free choice*: `agent.policies.choice`. Commitment and giving up: `agent.policies.pursuit`.
- *Blocked*: while no way leads on along the round, choices are free; after a while the robot goes on from there.

Where there is no round, because the ground is too large for a tour or the sensor does not look all around, each choice
is free. So it is where free choices turn out to be fresher (`Comparison`).

On ground with zones the robots are divided between several rounds (`agent.policies.shared_round`).

Comparison of the round with free choices, made while the robot patrols: the fresher one is kept.

A round promises an MFoW of its length by the speed of all robots together. In small rooms, narrow doors and with bodies
that get into each other's way it may not keep that. Then the next period goes by free choices, and those after it by
what was better. Crowded robots do so even after a round that keeps its promise. Every sixth period begins on the round
again. Periods count from tick 0 and all robots believe nearly the same fog, so they agree; one that joins later does so
at the next beginning at the latest.

    period          0      1      2      3      4      5      6   ...
                    round  free   free   free   free   free   round
    MFoW/promised   1.5    0.9    0.9    1.0    0.9    0.9    1.5

Following a round: always on to the first place from which something stale is to be seen.

A robot on a round keeps a *cursor*, the place of the tour that it has come to. Its next target is the first point after
the cursor that is stale, and it drives to the place to which that point belongs, the shortest way. So it cuts
corners where nothing is left to see, leaves out points that another robot has just seen, and misses nothing.

A point is stale once it has been unseen for half of the time between two robots of an evenly spaced round; one that the
round visits several times, for half of the time between two visits. Where
nothing is stale within one sensor range, or four strides, along the tour, the robot drives that far along.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from agent.policies.pursuit import NO_NEARER_S, TRIES, Target
from agent.policies.shared_round import Loss, RoundStands, SharedRound
from agent.policies.spacing import ZONE_SLACK, Spacing
from patrol.measures.best_tour import most_planned, why_no_tour
from patrol.scenario import CommittedOptions

if TYPE_CHECKING:
    from agent.policies.commitment import Choice
    from agent.policies.pursuit import GivenUp, Pursuit
    from agent.ports import PolicySetup
    from agent.routes.ground import Spot
    from agent.routes.routes import Element, Way
    from agent.view import View
    from patrol.tours.round import Flat, Round


PERIOD_S = 300.0
"""Length of a period, s; at least four times what the round promises."""

BROKEN = 1.3
"""Free choices are tried once MFoW is this many times what the round promises."""

PERIODS = 6
"""Periods after which the robots begin on the round again."""


class Comparison:
    """Compares the two by the MFoW that the robot believes in, in the second half of each period."""

    def __init__(self, step: float, tour_s: float, robots: int, crowded: bool) -> None:
        self.on_round = True  # whether the robots should follow the round now
        self._tour_s = tour_s  # time that one robot takes for the round
        # Crowded robots see most of what lies before another one on the round, which promises too little then.
        self._broken = 0.0 if crowded else BROKEN
        self._step = step
        self._length = max(PERIOD_S, 4.0 * tour_s / robots) / step
        self._period = -1
        self._whole = False  # whether the present period was noted from its beginning
        self._ratios: list[float] = []
        self._means: dict[bool, float] = {}  # by `on_round`: MFoW by what the round promises

    def note(self, view: View, robots: int, is_lossy: bool) -> None:
        """Take note of the fog of a tick, and of how many robots are on the round; decide where a period begins.

        ``is_lossy`` is True where many positions are lost: beliefs say little, so robots keep to the round.
        """
        period, share = divmod(view.tick / self._length, 1.0)
        if period != self._period:
            # A robot that joins during a period has not seen enough to judge it.
            self._whole = share * self._length < 1.0
            self._begin_period(int(period))
        if is_lossy:
            self.on_round, self._whole = True, False
            self._means.clear()
            self._ratios.clear()
        elif self._whole and share >= 0.5:
            self._ratios.append(view.fog.mfow(view.tick) * self._step * robots / self._tour_s)

    def _begin_period(self, period: int) -> None:
        if self._ratios:
            self._means[self.on_round] = sum(self._ratios) / len(self._ratios)
        if period % PERIODS == 0:
            self._means.clear()
        on_round = self._means.get(True, 0.0)
        self.on_round = on_round <= self._means.get(False, 0.0 if on_round > self._broken else math.inf)
        self._period, self._ratios = period, []


STALE = 0.5
"""Share of the time between two robots of an evenly spaced round after which a point is stale."""

AHEAD = 1.0
"""Length of the tour on which the next target is looked for, in sensor ranges."""

AHEAD_STRIDES = 4.0
"""The same in strides at least, so that a robot whose sensor sees no farther than it drives need not slow down."""

OVERDUE, NEAR = 3.0, 2.0
"""A point whose place on the tour cannot be got to is gone to after so many times between two robots, where the way is
no longer than so many times the length on which targets are looked for."""

Point = tuple[int, int]
"""Row and column of the terrain."""


class Stop(NamedTuple):
    """The next stop on a round."""

    point: Point  # to be seen; that of the place itself where nothing is stale
    stand: Point  # where to see it from
    age: int  # of the point, ticks; 0 where nothing is stale
    place: int  # number among the round's places


class RoundAhead:
    """The part of a round that lies ahead of one robot."""

    def __init__(self, setup: PolicySetup, laid_out: Round) -> None:
        speed, ground, step = setup.robot.spec.speed, setup.ground, setup.fleet.step
        self.round = laid_out
        self.cursor: int | None = None  # number of the place that the robot has come to; None before it has begun
        self._width = ground.terrain.width
        self._step = step
        self._speed = speed
        self._ahead_m = max(AHEAD * ground.sight.range_m, AHEAD_STRIDES * speed * step)
        self._firsts = np.searchsorted(laid_out.place_of, np.arange(len(laid_out.places) + 1))
        self._stands = RoundStands(setup, laid_out)
        _, index, times = np.unique(laid_out.points, return_inverse=True, return_counts=True)
        self._times = times[index]

    def interval(self, team: float) -> float:
        """Return the time between two robots of an evenly spaced round, ticks."""
        return self.round.length_m / (team * self._speed * self._step)

    def go_to(self, along_m: float) -> None:
        """Put the cursor to the place at a length along the tour, m."""
        self.cursor = int(np.searchsorted(self.round.along, along_m)) % len(self.round.places)

    def come_to(self, along_m: float) -> None:
        """Move the cursor on with the robot, m along the tour; not farther than stops are looked for."""
        if self.cursor is None or (along_m - self.round.along[self.cursor]) % self.round.length_m < self._ahead_m:
            self.go_to(along_m)

    def next(self, view: View, team: int, given_up: GivenUp) -> Stop:
        """Return the next stop of a robot on a round of ``team`` robots."""
        cursor = self._find_reachable(view, self.cursor or 0)
        end = float(self.round.along[cursor]) + self._ahead_m
        last = int(np.searchsorted(self.round.along, end))
        stretches = [(cursor, last)]
        if end > self.round.length_m:
            stretches.append((0, min(int(np.searchsorted(self.round.along, end - self.round.length_m)), cursor)))
        threshold = max(1.0, min(STALE * self.interval(team), 0.5 * view.mfow))
        overdue = max(threshold, OVERDUE * self.interval(team))
        if (
            view.fog.stands is not None
            and (stop := self._find_orphan(view, cursor, overdue, view.fog.stands)) is not None
        ):
            return stop
        for first, until in stretches:
            if (stop := self._find_first_stale(view, first, until, threshold, given_up)) is not None:
                return stop
        stop_index = self._find_reachable(view, stretches[-1][1] % len(self.round.places))
        spot = divmod(int(self.round.places[stop_index]), self._width)
        return Stop(spot, spot, 0, stop_index)

    def _find_reachable(self, view: View, place: int) -> int:
        """Return the first place that the robot gets to, from ``place`` on; ``place`` where there is none."""
        if view.fog.stands is None:
            return place
        reached = view.fog.stands[self.round.places] == self.round.places
        return (place + int(np.roll(reached, -place).argmax())) % len(reached)

    def _find_orphan(self, view: View, cursor: int, least: float, stands: Flat) -> Stop | None:
        """Return a stop at the nearest point close by whose place on the tour the robot does not get to now.

        The point is ``least`` ticks old or older. The cursor stays where it is.
        """
        reached = stands[self.round.places] == self.round.places
        points = self.round.points[~reached[self.round.place_of]]
        points = points[stands[points] >= 0]
        ages = view.tick - np.maximum(view.fog.last_seen.reshape(-1)[points], 0)
        row, col = view.point_of((view.pose.x, view.pose.y))
        away = np.hypot(stands[points] // self._width - row, stands[points] % self._width - col)
        near = (ages >= least) & (away * view.ground.terrain.point <= NEAR * self._ahead_m)
        near &= view.fog.looked.reshape(-1)[points] != view.tick
        points, ages = points[near], ages[near]
        if not points.size:
            return None
        ways = view.lengths(within=NEAR * self._ahead_m).reshape(-1)[stands[points]]
        nearest = int(ways.argmin())
        if not np.isfinite(ways[nearest]):
            return None
        point = int(points[nearest])
        stand = divmod(int(stands[point]), self._width)
        return Stop(divmod(point, self._width), stand, int(ages[nearest]), cursor)

    def _find_first_stale(self, view: View, first: int, until: int, least: float, given_up: GivenUp) -> Stop | None:
        """Return the first stale point of a stretch of places, in the order of the tour."""
        part = slice(int(self._firsts[first]), int(self._firsts[until]))
        points = self.round.points[part]
        ages = view.tick - np.maximum(view.fog.last_seen.reshape(-1)[points], 0)
        counts = (ages * self._times[part] >= least) & (view.fog.looked.reshape(-1)[points] != view.tick)
        stands, usable = self._stands.of(view, given_up, part)
        counts &= usable
        index = int(counts.argmax()) if counts.size else 0
        if not counts.size or not counts[index]:
            return None
        point, stand = divmod(int(points[index]), self._width), divmod(int(stands[index]), self._width)
        return Stop(point, stand, int(ages[index]), int(self.round.place_of[part][index]))


PROMPT_TICKS = 4
"""Ticks after tick 0, or after other zones have come into force, in which a robot still begins the round together with
the others."""


class OnRound:
    """The choice of one robot's targets on a round that it follows together with others.

    A robot that joins the others on the round begins where most is to be seen. So does one that has found the round
    ahead blocked for long, for example by a robot that has died there. Robots that meet part before.
    """

    def __init__(
        self,
        ahead: RoundAhead,
        spacing: Spacing,
        free: Choice,
        step: float,
        since: int,  # tick from which on robots begin the round
        comparison: Comparison | None,  # None on ground with zones, where ages have several meanings
    ) -> None:
        self.ahead = ahead
        self._spacing = spacing
        self._free = free
        self._step = step
        self._since = since
        self._comparison = comparison
        self._loss = Loss(step)
        self._blocked_since: int | None = None
        self._was_at: Spot | None = None

    def follow_with(self, robots: frozenset[int]) -> None:
        """Follow the round with other robots, if they are others than before."""
        if robots != self._spacing.followers:
            self._spacing.follow_with(robots)

    def forget(self) -> None:
        """Begin the round anew."""
        self.ahead.cursor = None
        self._spacing.robots.clear()
        self._spacing.heard.clear()

    def note(self, view: View, pursuit: Pursuit) -> bool:
        """Take note of where the others are; return True while free choices are better than the round."""
        spacing = self._spacing
        spacing.listen(view)
        if self._comparison is not None:
            was_followed = self._is_followed
            followers = spacing.followers & view.peers.keys()
            self._loss.note(view.tick, [view.peers[number].tick for number in followers])
            self._comparison.note(view, spacing.team, self._loss.is_lossy)
            if not self._is_followed:
                return True
            if not was_followed:
                self.ahead.cursor, self._since = None, view.tick
                spacing.robots.clear()
        if self.ahead.cursor is None and view.tick - self._since <= PROMPT_TICKS:
            self.ahead.go_to(spacing.along_m(spacing.begin(view)))
            pursuit.target = None
        if self.ahead.cursor is not None:
            spacing.note(view)
        return False

    def waits(self, view: View) -> bool:
        """Return True if the robot should stand still, to keep the gaps equal."""
        waits = self._is_followed and self._spacing.waits(view)
        if waits:
            self._was_at = None
        return waits

    def next(self, view: View, start: Element, pursuit: Pursuit) -> Way | None:
        """Commit to the first stale point ahead, and return the way there; choose freely where none leads there."""
        if not self._is_followed:
            return self._free.next(view, start, pursuit)
        is_beginning = self.ahead.cursor is None
        if not is_beginning and (way := self._next_ahead(view, start, pursuit)) is not None:
            self._blocked_since = None
            return way
        if not is_beginning and self._blocked_since is None:
            self._blocked_since = view.tick
        way = self._free.next(view, start, pursuit)
        if pursuit.target is not None and (is_beginning or self._is_blocked_for_long(view)):
            nearest = self._spacing.nearest(view.place_of(pursuit.target.stand))
            self.ahead.go_to(self._spacing.along_m(nearest))
        return way

    @property
    def _is_followed(self) -> bool:
        return self._comparison is None or self._comparison.on_round

    def _is_blocked_for_long(self, view: View) -> bool:
        """Return True if no way has led on along the round for a while."""
        return self._blocked_since is not None and (view.tick - self._blocked_since) * self._step >= NO_NEARER_S

    def _next_ahead(self, view: View, start: Element, pursuit: Pursuit) -> Way | None:
        """Commit to the first stale point ahead on the round, and return the way there; None where none leads there."""
        ahead, spacing = self.ahead, self._spacing
        for _ in range(TRIES):
            stop = ahead.next(view, spacing.team, pursuit.given_up)
            way = pursuit.go_to(view, start, Target(stop.point, stop.stand, stop.age))
            if way is None:
                if not self._is_blocked_for_long(view):
                    return None
                pursuit.given_up.add(view.tick, stop.stand)
                continue
            # A car comes no nearer to where it parks. It goes on from there, because nothing is stale.
            parked, self._was_at = self._was_at, (view.pose.x, view.pose.y)
            arrived = way.length == 0.0 or (way.length <= view.stride and parked == self._was_at)
            if stop.age > 0 or arrived:
                ahead.cursor = stop.place
            else:
                ahead.come_to(spacing.along_m(spacing.own_place))
            return way
        # Robots on a short round may stand in each other's way for good, with nothing stale on it.
        return self._free.next(view, start, pursuit) if self._comparison is None else None


class Committed(SharedRound):
    """Follows the round together with the others."""

    Options = CommittedOptions

    def _begin_round(self, laid_out: Round, robots: frozenset[int], view: View | None) -> Choice:
        if why_no_tour(self._setup.fleet.roster):
            return self._free
        setup, spec, step = self._setup, self._setup.robot.spec, self._setup.fleet.step
        terrain, range_m = setup.ground.terrain, setup.ground.sight.range_m
        stride = max(spec.speed * step, terrain.point)
        team, most_slack, comparison = len(robots), ZONE_SLACK, None
        if self.division is None:
            team, most_slack = max(1, round(len(robots) / len(setup.fleet.roster) * setup.fleet.team)), math.inf
            most_robots = most_planned(len(laid_out.points) * terrain.point_area, range_m)
            comparison = Comparison(step, laid_out.length_m / spec.speed, team, team > most_robots)
        ahead = RoundAhead(setup, laid_out)
        spacing = Spacing(laid_out, spec, robots, team, stride, range_m, terrain, most_slack)
        if view is not None and self._round is not None:
            ahead.go_to(spacing.along_m(spacing.nearest((view.reported.x, view.reported.y))))
        return OnRound(ahead, spacing, self._free, step, self._since, comparison)
