"""The default policy: take one's part in the common plan, in which the order of stations is drawn.

A patrol that follows a tour is the freshest, and an intruder that watches it knows where it will be. This one draws
each next station from good plans for the whole fleet (`agent.policies.plan`). With a fleet key the draws come from the
key, so only the fleet can compute them (`agent.chance`).

No robot says where it is going. Each works out the plan of all, and makes the visits of its own part in order:

- A visit is made once the points that the plan saw in it have been seen, by any robot. The robot drives to the place of
  the visit, and then to the points that it has missed.
- One that is late leaves points out, the fresher ones first, and at last whole visits.
- *Who lives* (`agent.policies.living`) is what is heard. When it changes, all go over to the plan of the robots that
  live, which is the same whoever works it out, since it begins on the hour.

So with nothing heard at all, a fleet that lives keeps the plan. Choices are free where there is no tour
(`patrol.measures.best_tour`), where robots are crowded (`LEAST_STATIONS`), while a plan is worked out up to now, and
for a robot that is ahead of the plan, as where a door has been closed.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING
from weakref import WeakValueDictionary

import numpy as np

from agent.policies.plan import CommonPlan, KnownStations
from agent.policies.pursuit import NO_NEARER_S, Target
from agent.policies.shared_round import RoundStands, SharedRound
from patrol.scenario import StochasticOptions
from patrol.zones.division import KEPT

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from agent.policies.commitment import Choice
    from agent.policies.living import Living
    from agent.policies.plan import Visit
    from agent.policies.pursuit import GivenUp, Pursuit
    from agent.ports import PolicySetup
    from agent.routes.routes import Element, Way
    from agent.view import View
    from patrol.tours.round import Flat, Round
    from patrol.zones.division import Divisions, Group, ZonedGround


HOUR_S = 3600.0
"""Time after which plans begin anew, s: a robot that joins has no more of one to work out."""

CATCH_UP = 20
"""Ticks of a plan that are worked out in a tick, until it has caught up."""

MOST_PLANS = 4
"""Plans that a robot goes on with, such as that of all robots while one is silent."""

LEAST_STATIONS = 3.5
"""Least number of stations for each robot of a plan: with fewer, most of what a robot would plan to see another one
sees before."""

REACH = 0.25
AHEAD = 1000
LATE = 0.6
"""Share of the time between two robots on the tour after which a visit is left out."""

EARLY = 0.25
"""The same by which a robot may be ahead of the plan; before that it chooses freely."""

MOST = 0.5
OLD, OLDER = 0.1, 4.0
"""A point of a visit has to be so old to be missed, in ages that it had when the plan saw it, and in times by which the
robot is late."""


class OnPlan:
    """The choice of one robot's targets by its part in the common plan."""

    def __init__(
        self,
        setup: PolicySetup,
        laid_out: Round,
        known: KnownStations,
        free: Choice,
        living: Living,
        robots: frozenset[int],  # those that share the stations
        since: int,  # tick from which on they do
    ) -> None:
        """Begin without a plan."""
        self._setup, self._known, self._free = setup, known, free
        self._living, self._robots, self._since = living, robots, since
        self._number, self._step = setup.robot.spec.number, setup.fleet.step
        self._stands = RoundStands(setup, laid_out)
        self._made: WeakValueDictionary[tuple[object, ...], CommonPlan] = setup.ground.scratch.setdefault(
            "plans", WeakValueDictionary()
        )
        spec = setup.robot.spec
        stride_m = spec.speed * setup.fleet.step
        self._reach_m = REACH * stride_m if spec.model == "holonomic" else max(stride_m, spec.radius)
        self._looks_ahead = spec.model != "holonomic"
        self._passing_s = setup.ground.sight.range_m / max(spec.speed for spec in setup.fleet.roster)
        self._plans: dict[tuple[object, ...], CommonPlan] = {}  # the latest ones
        self._plan: CommonPlan | None = None
        self._begun = 0  # tick at which this robot has begun to work it out
        self._visit: Visit | None = None  # None until the plan has caught up
        self._index = 0  # of the first place of its trail that the robot has not come to
        self._entered = 0  # tick at which it has begun its visit
        self._came = 0  # tick at which it has come to the one before
        self._missed: Flat | None = None  # numbers in the round of what it has still to see; None for free choices

    def follow_with(self, robots: frozenset[int]) -> None:
        """Share the stations with other robots."""
        self._robots = robots

    def forget(self) -> None:
        """Go on where the plan is now."""
        self._visit = None

    def waits(self, view: View) -> bool:
        """Return True for a robot that is where the plan's robot will be only in a while."""
        visit = self._visit
        if visit is None or self._missed is None:
            return False
        return 0 < self._index < len(visit.trail) and self._index > view.tick - visit.begun

    def note(self, view: View, pursuit: Pursuit) -> bool:
        """Go on with the plan; return True if the robot chooses freely."""
        plan = self._find_plan(view)
        if plan is not None and plan is not self._plan:
            self._visit, self._begun = None, view.tick
        self._plan = plan
        was_free = self._missed is None
        if plan is None or not self._is_caught_up(plan, view.tick) or not self._go_on(plan, view, pursuit):
            self._missed = None
        if was_free != (self._missed is None):
            pursuit.target = None
        return self._missed is None

    def next(self, view: View, start: Element, pursuit: Pursuit) -> Way | None:
        """Commit to the next place of the visit, or to a point that was missed, and return the way there."""
        if self._missed is not None:
            target = self._choose_target(self._missed, view, pursuit.given_up)
            if target is not None and (way := pursuit.go_to(view, start, target)) is not None:
                return way
        # No way leads there now. Another robot may stand in the door, and the two would wait for each other.
        return self._free.next(view, start, pursuit)

    def _find_plan(self, view: View) -> CommonPlan | None:
        """Return the plan of the robots that live; None where they are crowded."""
        robots = tuple(sorted(self._living.note(view) & self._robots))
        if len(self._known) < LEAST_STATIONS * len(robots) and len(robots) > 1:
            return None
        hour = round(HOUR_S / self._step)
        origin = max(view.tick // hour * hour, self._since)
        question = (id(self._known), robots, origin)
        plan = self._plans.pop(question, None) or self._made.get(question)
        if plan is None:
            roster = self._setup.fleet.roster
            plan = CommonPlan(self._setup, self._known, [roster[number - 1] for number in robots], origin)
            self._made[question] = plan
        self._plans[question] = plan
        if len(self._plans) > MOST_PLANS:
            del self._plans[next(iter(self._plans))]
        return plan

    def _is_caught_up(self, plan: CommonPlan, tick: int) -> bool:
        """Work the plan out a little farther, until it has come to this tick."""
        until = plan.origin + CATCH_UP * (tick - self._begun + 1)
        if self._visit is None and until < tick:
            plan.advance_to(until)
            return False
        plan.advance_to(tick)
        if self._visit is None:
            self._visit = plan.visit_at(self._number, tick)
        return True

    def _go_on(self, plan: CommonPlan, view: View, pursuit: Pursuit) -> bool:
        """Go on to the first visit of which something is missed; return False if the robot is ahead of it."""
        visit, tick = self._visit, view.tick
        assert visit is not None
        late, early = (share * plan.interval_s / self._step for share in (LATE, EARLY))
        if visit.ended is not None and tick - visit.ended > late:
            visit = plan.visit_at(self._number, tick)
        while visit.begun <= tick + early:
            ended = plan.finish(visit)
            is_new = visit is not self._visit
            if is_new:
                self._visit, self._index, self._came, self._entered = visit, 0, tick, tick
            self._follow(visit, view)
            behind = max(tick - visit.begun - self._index, 0)
            missed = self._find_missed(view, visit, ended, behind, pursuit.given_up)
            keeps_time = not is_new and self._missed is not None and behind < 2 and self._index < len(visit.trail)
            if missed.size or keeps_time:
                self._missed = missed
                return True
            assert visit.then is not None
            visit = visit.then
        return False

    def _follow(self, visit: Visit, view: View) -> None:
        """Note to which places of a visit's trail the robot has come; give the rest up where it comes no farther."""
        if self._index < len(visit.trail):
            rest = np.array(visit.trail[self._index :])
            away = np.abs(rest - (view.pose.x, view.pose.y))
            near = np.flatnonzero((away**2).sum(axis=1) <= self._reach_m**2)
            if near.size:
                self._index, self._came = self._index + int(near[-1]) + 1, view.tick
            elif (view.tick - self._came) * self._step > NO_NEARER_S:
                self._index = len(visit.trail)

    def _find_missed(self, view: View, visit: Visit, ended: int, behind: int, given_up: GivenUp) -> Flat:
        """Return the numbers in the round of a visit's points that have not been seen lately."""
        points, fog = visit.points, view.fog
        seen = fog.last_seen.reshape(-1)[points]  # -1 for never
        if self._living.silence_s > self._passing_s:
            # What others have seen in the plan counts, since they may pass unheard.
            seen = np.maximum(seen, visit.before)
        ages = OLD * (ended - visit.before)
        threshold = np.minimum(ages + OLDER * behind, np.maximum(ages, MOST * self._plan.interval_s / self._step))
        missed = points[(seen < self._entered) & (max(view.tick, ended) - np.maximum(seen, 0) > threshold) & fog.patrolled.reshape(-1)[points]]
        numbers = self._known.number_of[missed]
        _, usable = self._stands.of(view, given_up, numbers)
        return numbers[usable]

    def _choose_target(self, missed: Flat, view: View, given_up: GivenUp) -> Target | None:
        """Return the next place of the visit as a target, or then the nearest point that was missed."""
        visit, width = self._visit, view.ground.terrain.width
        assert visit is not None
        if self._index < len(visit.trail):
            spot = visit.trail[max(min(self._index, view.tick - visit.begun), 0)]
            if self._looks_ahead:
                spot = visit.trail[min(self._index + AHEAD, len(visit.trail) - 1)]
            return Target(view.point_of(spot), view.point_of(spot), 0, spot=spot)
        if not missed.size:
            return None
        stands, _ = self._stands.of(view, given_up, missed)
        row, col = view.point_of((view.pose.x, view.pose.y))
        nearest = int(((stands // width - row) ** 2 + (stands % width - col) ** 2).argmin())
        point = divmod(int(self._known.points[missed[nearest]]), width)
        age = view.tick - max(int(view.fog.last_seen[point]), 0)
        return Target(point, divmod(int(stands[nearest]), width), max(age, 1))


class Stochastic(SharedRound):
    """Draws its next station."""

    Options = StochasticOptions

    def _begin_round(self, laid_out: Round, robots: frozenset[int], view: View | None) -> Choice:
        if laid_out.stations is None:
            return self._free
        weights = None
        if self.division is not None:
            weights = _with_margin(self.division.divisions.zoned)  # free choices are not bound to the ground of a zone
        known_by_round: dict[tuple[object, ...], KnownStations] = self._setup.ground.scratch.setdefault("stations", {})
        question = (id(laid_out), view.weighing if view is not None else None)
        if question not in known_by_round:
            known_by_round[question] = KnownStations(laid_out, laid_out.stations, weights)
        known = known_by_round[question]
        return OnPlan(self._setup, laid_out, known, self._free, self._living, robots, self._since)

    def _round_of(self, divisions: Divisions, group: Group) -> Round:
        return divisions.zoned.rounds[group.classes]  # what weighs more is visited more often without being there twice


def _with_margin(zoned: ZonedGround) -> NDArray[np.float64]:
    """Return the weights of the ground; greater where an age is wanted, as distances are uneven."""
    weights = zoned.weights.copy()
    for weight, wish in zip(zoned.classes, zoned.wanted, strict=True):
        weights[zoned.weights == weight] *= 1.0 if wish is None else KEPT
    return weights
