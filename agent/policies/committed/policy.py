"""The default policy: a robot follows a round, and goes on when what it went to see has been seen.

The paper's robot chooses its direction anew at each tick, from sums over directions that may hardly differ. Between two
rooms with equally stale points it turns round again and again, and sees neither. A committed robot goes to one point,
its target:

- *On the round*: the first stale point ahead on a short closed tour that shows all of the ground
  (`agent.policies.committed.rounds`). All robots follow the same tour, evenly spaced
  (`agent.policies.committed.spacing`).
- *Free choice*: the point with the greatest age squared per way (`agent.policies.committed.choice`). A point to which
  another robot has the shorter way counts a tenth.
- *Commitment*: it keeps the target until half of its age or more has gone, because a robot has seen it.
- *Giving up*: a target that comes no nearer for a while is left out for some time, with what lies around it.
- *Blocked*: while no way leads on along the round, choices are free; after a while the robot goes on from there.

The option `unpredictability` and the experience with the round decide how much of the time choices are free
(`agent.policies.committed.periods`). Where there is no round, because the ground is too large for a tour or the sensor
does not look all around, each choice is free.

On ground with zones there are several rounds, and robots are divided between them
(`agent.policies.committed.division`); free choices count the age times the weight. Rounds, division and weights follow
the zones that are in force.

For example, for a free choice a point not seen for 60 s at the end of a way of 9 m counts 60^2 / (9 + 3) = 300; one not
seen for 90 s, 27 m away, 270. The first one is the target.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from agent.policies.committed.choice import TargetChoice
from agent.policies.committed.division import Division
from agent.policies.committed.given_up import GivenUp
from agent.policies.committed.periods import INTERVALS, Periods
from agent.policies.committed.rounds import RoundAhead
from agent.policies.committed.spacing import ZONE_SLACK, Spacing
from agent.policies.random_steps import RandomSteps
from agent.policies.separation import Separation
from agent.ports import Bearing, Intent, Place, State, Stay
from patrol.scenario import CommittedOptions

if TYPE_CHECKING:
    from agent.policies.committed.choice import Point
    from agent.ports import PolicySetup
    from agent.routes.routes import Element, Way
    from agent.view import View
    from patrol.ground.tour.round import Round
    from patrol.ground.tour.zoned import ZonedGround

NO_NEARER_S = 15.0
"""A robot that has come no nearer to its target for so long gives it up, s."""

AT_HAND_S = 3.0
"""The same for a robot that is less than a stride away from where it wanted to be, s; at least `AT_HAND_STEPS`."""

AT_HAND_STEPS = 3

TRIES = 3
"""Number of targets that are tried in one tick, where no way leads to the first ones."""

NEARER = 0.1
"""Least share of a stride by which a way must get shorter to count as progress."""

STILL_STALE = 0.5
"""A target counts as seen once its age is below this share of what it was when it was chosen."""

SHORTEST_PERIOD_S = 60.0
"""Shortest period on ground with zones, s: a small zone has a short round."""

PROMPT_TICKS = 4
"""Ticks after the begin of a period, or after other zones have come into force, in which a robot still begins the round
together with the others."""


@dataclass(frozen=True, slots=True)
class Target:
    """A place that a robot goes to see.

    Attributes:
        point: Row and column of the point to be seen.
        stand: Row and column of the point to go to: the point itself, or its post where no body fits.
        age: Of the point when it was chosen, ticks.
    """

    point: Point
    stand: Point
    age: int


class Committed:
    """Chooses a target and keeps to it.

    Attributes:
        target: Where it is going; None for nowhere.
        given_up: The places that it leaves out for a while.
        ahead: The round ahead of it; None where each choice is free.
        spacing: The robots on the round; None likewise.
        periods: When the robots follow the round; None likewise.
        division: Which robots follow which round; None where there is at most one.
    """

    Options = CommittedOptions

    def __init__(self, setup: PolicySetup) -> None:
        """Start without a target."""
        spec, terrain, options = setup.spec, setup.terrain, setup.options
        self._step = setup.step
        self._point = terrain.point
        self._separation = Separation(setup)
        self._random_steps = RandomSteps(setup)
        self._choice = TargetChoice(setup)
        self.given_up = GivenUp(spec.radius, terrain.point, setup.step)
        self._nearer = NEARER * spec.speed * setup.step
        self._at_hand_s = max(AT_HAND_S, AT_HAND_STEPS * setup.step)
        self._sees_all_round = setup.sight.all_round and not setup.sight.leaves_age
        self.target: Target | None = None
        self.ahead: RoundAhead | None = None
        self.spacing: Spacing | None = None
        self.periods: Periods | None = None
        self.division: Division | None = None
        self._setup = setup
        self._weighing = setup.weighing
        self._round: Round | None = None
        if setup.zoned is None and options.unpredictability < 1.0 and (laid_out := setup.round()) is not None:
            followers = setup.followers()
            self._follow(laid_out, followers, len(followers) / len(setup.radii) * setup.team, 0)
        if setup.zoned is not None:
            self._take_zones(setup.zoned(setup.weighing))
        self._rounds_since = 0
        self._expected = 0
        self._shortest = math.inf
        self._least_age = 0
        self._progress_at = 0
        self._on_round = False
        self._blocked_since: int | None = None
        self._was_at: tuple[float, float] | None = None
        self._may_be_away = bool(setup.docks)
        self._left_out_at: int | None = None
        self._decided_at = 0

    def _follow(self, laid_out: Round, followers: frozenset[int], team: float, tick: int) -> None:
        """Follow a round from a tick on, with other robots."""
        setup = self._setup
        stride = max(setup.spec.speed * setup.step, setup.terrain.point)
        self.ahead = RoundAhead(setup, laid_out)
        whole = max(1, round(team))
        most_slack = math.inf if self.division is None else ZONE_SLACK
        self.spacing = Spacing.on(
            laid_out, setup.spec.number, followers, whole, stride, setup.sight.range_m, setup.terrain, most_slack
        )
        self._begin_periods(team, tick)

    def _begin_periods(self, team: float, tick: int) -> None:
        setup = self._setup
        assert self.ahead is not None
        least = 1 if self.division is None else round(SHORTEST_PERIOD_S / setup.step)
        length = max(1, least, round(INTERVALS * self.ahead.interval(team)))
        self.periods = Periods(length, setup.options.unpredictability, setup.fleet_chance, tick)

    def _take_zones(self, zoned: ZonedGround) -> None:
        """Go by the zones that are in force now: divide the robots between their rounds."""
        self._round, setup = None, self._setup
        if not zoned.rounds or setup.options.unpredictability == 1.0:
            self.division = self.ahead = self.spacing = self.periods = None
        elif self.division is None:
            robots = frozenset(setup.radii)
            self.division = Division(zoned, setup.spec.number, robots, setup.team, setup.step)
        else:
            self.division.divide(zoned)

    def _join_crew(self, view: View, division: Division) -> None:
        """Follow the round that the robots which are heard leave to this one, together with those that share it."""
        crew = division.crew(view)
        robots, laid_out = crew.robots, division.zoned.round_of(crew.group)
        if laid_out is not self._round:
            is_first = self._round is None
            self._round, self.target = laid_out, None
            self._follow(laid_out, robots, len(robots), view.tick)
            if not is_first and self.ahead is not None and self.spacing is not None:
                self.ahead.go_to(self.spacing.along_m(self.spacing.nearest((view.reported.x, view.reported.y))))
        elif self.spacing is not None and robots != self.spacing.followers:
            self.spacing.follow_with(robots)
            self._begin_periods(len(robots), view.tick)

    def decide(self, view: View) -> Intent:
        """Return the way to the target, or to a new one; now and then a random step."""
        goes_on = view.tick <= self._decided_at + 1
        if self._may_be_away and not goes_on:
            self._forget()
        self._decided_at = view.tick
        if self._setup.zoned is not None and view.weighing != self._weighing:
            self._weighing = view.weighing
            self._take_zones(self._setup.zoned(view.weighing))
            self._rounds_since = view.tick if goes_on else 0
        self._separation.keep_apart(view)
        self._on_round = self._is_on_round(view)
        start, wander = view.start, None if self._on_round else self._random_steps.draw(view)
        if start is None:
            # The body has to find its way back to the reachable ground first.
            return Bearing((), wander=wander)
        if self._on_round and self.spacing is not None and self.spacing.waits(view):
            self._progress_at, self._was_at = view.tick, None
            return Stay(state=State.PATROLLING, figures={"way_m": 0.0, "age_s": 0.0})
        way = self._kept(view, start) or self._chosen(view, start)
        target = self.target
        if way is None or target is None:
            return Stay()
        figures = {"way_m": way.length, "age_s": self._age(view, target.point) * self._step}
        if way.length == 0.0 and not self._sees_all_round:
            # It stands where it should, so it only has to turn.
            across, up = (there - here for there, here in zip(view.place_of(target.point), way.place, strict=True))
            if across != 0.0 or up != 0.0:
                return Bearing((math.atan2(up, across),), wander=wander, figures=figures)
        return Place(*way.place, bend=way.bend, wander=wander, exact=target.age > 0, gives_room=True, figures=figures)

    def _kept(self, view: View, start: Element) -> Way | None:
        """Return the way to the present target; None without a target, or if it is time for another."""
        target = self.target
        if target is None:
            return None
        age = self._age(view, target.point)
        if target.age == 0 or age < STILL_STALE * target.age:
            self.given_up.forgive(target.stand)
            return None
        way = self._way_to(view, start, target.stand)
        if way is None:
            return None
        if way.length < self._shortest - self._nearer or age < self._least_age:
            # A look that leaves some of a point's age is progress as well.
            self._shortest, self._progress_at = min(self._shortest, way.length), view.tick
        self._least_age = age
        stood_s = (view.tick - self._progress_at) * self._step
        if stood_s > (self._at_hand_s if way.length <= view.stride else NO_NEARER_S):
            self.given_up.add(view.tick, target.stand)
            return None
        return way

    def _forget(self) -> None:
        """Begin anew, as after a restart: the robot was away to charge, and the others have closed up."""
        self.target = None
        if self.ahead is not None and self.spacing is not None:
            self.ahead.cursor = None
            self.spacing.robots.clear()
            self.spacing.heard.clear()

    def _is_on_round(self, view: View) -> bool:
        """Return True in a period in which the robots follow the round; take note of where they are on it."""
        if self.division is not None:
            self._join_crew(view, self.division)
        if self.ahead is None or self.spacing is None or self.periods is None:
            return False
        # A robot that charges learns nothing meanwhile, and all robots have to choose the same. One that has seen
        # ground blocked learns nothing either; others may, since fleets without experience stay on bad rounds.
        certain = self.spacing.listen(view) and not self._may_be_away and not self._was_shut_out(view)
        team = self.spacing.team
        mfow = view.mfow if self.division is None else self.ahead.mfow(view)
        if not self.periods.update(view.tick, mfow, team, self.ahead.interval(team), certain=certain):
            self.ahead.cursor = None
            self.spacing.robots.clear()
            return False
        since = min(view.tick % self.periods.length, view.tick - self._rounds_since)
        if self.ahead.cursor is None and since <= PROMPT_TICKS:
            self.ahead.go_to(self.spacing.along_m(self.spacing.begin(view)))
            self.target = None
        if self.ahead.cursor is not None:
            self.spacing.note(view)
        return True

    def _was_shut_out(self, view: View) -> bool:
        """Return True if ground was left out in the last period: then the fog says little about the round."""
        if view.fog.left_out is not None:
            self._left_out_at = view.tick
        at, periods = self._left_out_at, self.periods
        return at is not None and periods is not None and view.tick - at <= periods.length

    def _chosen(self, view: View, start: Element) -> Way | None:
        """Commit to the next target, and return the way there; None where there is none that a way leads to."""
        self.target = None
        ahead, spacing = self.ahead, self.spacing
        if not self._on_round or ahead is None or spacing is None:
            return self._free_choice(view, start)
        if ahead.cursor is not None:
            way = self._next_on_round(view, start, ahead, spacing)
            if way is not None:
                self._blocked_since = None
                return way
            if self._blocked_since is None:
                self._blocked_since = view.tick
        # A robot that joins the others on the round begins where most is to be seen. So does one that has found the
        # round ahead blocked for long, for example by a robot that has died there. Robots that meet part before.
        way = self._free_choice(view, start)
        if self.target is not None and (ahead.cursor is None or self._is_blocked_for_long(view)):
            ahead.go_to(spacing.along_m(spacing.nearest(view.place_of(self.target.stand))))
        return way

    def _is_blocked_for_long(self, view: View) -> bool:
        """Return True if no way has led on along the round for a while."""
        return self._blocked_since is not None and (view.tick - self._blocked_since) * self._step >= NO_NEARER_S

    def _next_on_round(self, view: View, start: Element, ahead: RoundAhead, spacing: Spacing) -> Way | None:
        """Commit to the first stale point ahead on the round, and return the way there; None where none leads there."""
        for _ in range(TRIES):
            stop = ahead.next(view, spacing.team, self.given_up.now(view.tick))
            self._expected = 0
            way = self._way_to(view, start, stop.stand)
            if way is None:
                if not self._is_blocked_for_long(view):
                    return None
                self.given_up.add(view.tick, stop.stand)
                continue
            # A car comes no nearer to where it parks. It goes on from there, because nothing is stale.
            parked, self._was_at = self._was_at, (view.pose.x, view.pose.y)
            arrived = way.length == 0.0 or (way.length <= view.stride and parked == self._was_at)
            if stop.age > 0 or arrived:
                ahead.cursor = stop.place
            else:
                ahead.come_to(spacing.along_m(spacing.own_place))
            self._commit(view, Target(stop.point, stop.stand, stop.age))
            return way
        # Robots on a short round may stand in each other's way for good, with nothing stale on it.
        return None if self.division is None else self._free_choice(view, start)

    def _free_choice(self, view: View, start: Element) -> Way | None:
        """Commit to the best point of all, and return the way there."""
        rivals = self._separation.rivals(view)
        for _ in range(TRIES):
            best = self._choice.best(view, start, rivals, self.given_up)
            if best is None:
                return None
            self._expected = best.length
            way = self._way_to(view, start, best.stand)
            if way is not None:
                self._commit(view, Target(best.point, best.stand, self._age(view, best.point)))
                return way
            self.given_up.add(view.tick, best.stand)
        return None

    def _commit(self, view: View, target: Target) -> None:
        self.target = target
        self._shortest, self._least_age, self._progress_at = math.inf, target.age, view.tick

    def _way_to(self, view: View, start: Element, stand: Point) -> Way | None:
        """Return the shortest way to a point of the terrain; None if no way leads there now."""
        way = view.routes.way(start, (stand[0] + 1, stand[1] + 1), self._expected)
        if way.place != view.place_of(stand):
            return None
        self._expected = round(100.0 * (way.length + 2.0 * view.stride) / self._point)
        return way

    @staticmethod
    def _age(view: View, point: Point) -> int:
        return view.tick - max(view.fog.last_seen.item(point), 0)
