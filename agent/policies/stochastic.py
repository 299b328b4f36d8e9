"""The default policy: take one's part in the common plan, in which the order of stations is drawn.

A patrol that follows a tour is the freshest, and an intruder that watches it knows where it will be. This one draws
each next station from good plans for the whole fleet (`agent.policies.common_plan`). With a fleet key the draws come
from the key, so only the fleet can compute them (`agent.chance`).

No robot says where it is going. Each works out the plan of all, and makes the visits of its own part in order:

- It drives from place to place as the plan's robot does, and stands where that one is later.
- A visit is over once all of its points have been seen, by any robot. What is missed on the way is gone to after it.
- A robot that is late drives straight to where something is to be seen. It leaves points out, the fresher ones first,
  and at last whole visits.
- *Who lives* (`agent.policies.living`) is what is heard. When it changes, all go over to the plan of the robots that
  live, which is the same for all that work it out, since it begins on the hour.

So with nothing heard at all, a fleet that lives keeps the plan. Choices are free where there is no round
(`patrol.measures.best_tour`), where robots are crowded (`LEAST_STATIONS`), while a plan is worked out up to now, while
no way leads on, and for a robot that is ahead of the plan, as where a door has been closed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakValueDictionary

import numpy as np

from agent.policies.common_plan.plan import CommonPlan
from agent.policies.common_plan.stations import Groups, KnownStations
from agent.policies.pursuit import NO_NEARER_S, Target
from agent.policies.shared_round import RoundStands, SharedRound
from patrol.scenario import StochasticOptions
from patrol.zones.division import KEPT

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from agent.policies.commitment import Choice
    from agent.policies.common_plan.robots import Visit
    from agent.policies.living import Living
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

LEAST_STATIONS = 5.0
"""Least number of stations for each robot that is not spare: with fewer, another robot sees most of what one would plan
to see before it."""

REACH = 0.25
"""Distance from a place of the trail at which a robot has come to it, in strides; a car turns beside it."""

BEHIND = 1
"""Ticks by which a robot that keeps to the trail may be behind."""

HELD_UP_S = 1.0
"""Time without a further place after which a robot drives to the end of the trail, so around what is in its way, s."""

LATE, EARLY = 0.6, 0.25
"""How late a visit is left out, and how far ahead of the plan a robot chooses freely, in times between two robots."""

OLD, OLDER, OLDEST = 0.1, 4.0, 0.5
"""A point that a robot has not seen is missed from this age on: `OLD` times the age that it had when the plan saw it,
or `OLDER` times the time by which the robot is late, which counts up to `OLDEST` times the time between two robots."""


class OnPlan:
    """The choice of one robot's targets by its part in the common plan."""

    def __init__(
        self,
        setup: PolicySetup,
        laid_out: Round,
        groups: Groups,
        free: Choice,
        living: Living,
        robots: frozenset[int],  # those that share the stations
        since: int,  # tick from which on they do
    ) -> None:
        """Begin without a plan."""
        self._setup, self._groups, self._free = setup, groups, free
        self._living, self._robots, self._since = living, robots, since
        spec, self._step = setup.robot.spec, setup.fleet.step
        self._number = spec.number
        self._regular = frozenset(spec.number for spec in setup.fleet.roster if not spec.spare)
        self._stands = RoundStands(setup, laid_out)
        self._made: WeakValueDictionary[tuple[object, ...], CommonPlan] = setup.ground.scratch.setdefault(
            "plans", WeakValueDictionary()
        )
        stride_m = spec.speed * self._step
        self._is_exact = spec.model == "holonomic"
        self._reach_m = REACH * stride_m if self._is_exact else max(stride_m, spec.radius)
        self._passing_s = setup.ground.sight.range_m / max(spec.speed for spec in setup.fleet.roster)
        self._plans: dict[tuple[object, ...], CommonPlan] = {}  # the latest ones
        self._plan: CommonPlan | None = None
        self._begun = 0  # tick at which this robot has begun to work it out
        self._visit: Visit | None = None  # None until the plan has caught up
        self._entered = 0  # tick at which it has begun its visit
        self._index = 0  # of the first place of its trail that the robot has not come to
        self._came = 0  # tick at which it has come to the one before
        self._aim = 0  # index of the place to which it drives; that after the last one where it needs none any more
        self._is_missed: NDArray[np.bool_] = np.zeros(0, dtype=np.bool_)  # of the visit's points
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
        self._missed = None if plan is None else self._go_on(plan, view, pursuit.given_up)
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
        living = self._living.note(view) & self._robots
        team = len(self._regular & self._robots)
        if team > 1 and len(self._groups.known) < LEAST_STATIONS * team:
            return None
        group = self._groups.find(self._number, self._robots, living)
        known, robots = group.known, tuple(sorted(group.robots))
        if not len(known):
            return None
        hour = round(HOUR_S / self._step)
        origin = max(view.tick // hour * hour, self._since)
        question = (id(known), robots, origin)
        plan = self._plans.pop(question, None) or self._made.get(question)
        if plan is None:
            roster = self._setup.fleet.roster
            plan = CommonPlan(self._setup, known, [roster[number - 1] for number in robots], origin)
            self._made[question] = plan
        self._plans[question] = plan
        if len(self._plans) > MOST_PLANS:
            del self._plans[next(iter(self._plans))]
        return plan

    def _go_on(self, plan: CommonPlan, view: View, given_up: GivenUp) -> Flat | None:
        """Go on to the first visit of which something is missed, and return what is.

        None if the plan has not caught up, or if the robot is ahead of it.
        """
        tick = view.tick
        until = plan.origin + CATCH_UP * (tick - self._begun + 1)
        if self._visit is None and until < tick:
            plan.advance_to(until)
            return None
        plan.advance_to(tick)
        late, early = (share * plan.interval_s / self._step for share in (LATE, EARLY))
        visit = self._visit
        if visit is None or (visit.ended is not None and tick - visit.ended > late):
            visit = plan.visit_at(self._number, tick)
        while visit.begun <= tick + early:
            ended = plan.finish(visit)
            if is_new := visit is not self._visit:
                self._visit, self._entered, self._index, self._aim, self._came = visit, tick, 0, 0, tick
                self._is_missed = np.ones(len(visit.points), dtype=np.bool_)
            self._follow(visit, view)
            behind = max(tick - visit.begun - self._index, 0)
            missed = self._find_missed(plan, visit, view, max(ended, self._entered), behind, given_up)
            if missed.size:
                return missed
            if not is_new and self._missed is not None and behind <= BEHIND and self._index < len(visit.trail):
                self._aim = self._index
                return missed
            assert visit.then is not None
            visit = visit.then
        return None

    def _follow(self, visit: Visit, view: View) -> None:
        """Note to which places of a visit's trail the robot has come; give the rest up where it comes no farther."""
        # What lies beyond the aim may be near as well, where the trail turns back.
        places = np.array(visit.trail[self._index : None if self._is_held_up(view.tick) else self._aim + 1])
        if not places.size:
            return
        near = np.flatnonzero(((places - (view.pose.x, view.pose.y)) ** 2).sum(axis=1) <= self._reach_m**2)
        if near.size:
            self._index, self._came = self._index + int(near[-1]) + 1, view.tick
        elif (view.tick - self._came) * self._step > NO_NEARER_S:
            self._index = len(visit.trail)

    def _is_held_up(self, tick: int) -> bool:
        """Return True for a robot on a trail that has come to no further place of it for long, and does not wait."""
        visit = self._visit
        assert visit is not None
        return self._index > 0 and (tick - max(self._came, visit.begun + self._index)) * self._step > HELD_UP_S

    def _find_missed(self, plan: CommonPlan, visit: Visit, view: View, by: int, behind: int, given_up: GivenUp) -> Flat:
        """Return the numbers in the round of a visit's points that are missed at a tick, and aim at where to see them.

        ``behind`` says by how many ticks the robot is late.
        """
        fog, points, last = view.fog, visit.points, len(visit.trail)
        seen = fog.last_seen.reshape(-1)[points]  # -1 for never
        if self._living.silence_s > self._passing_s:
            # What others have seen in the plan counts, since they may pass unheard.
            seen = np.maximum(seen, visit.seen_before)
        missed_from = np.maximum(
            OLD * ((visit.ended or by) - visit.seen_before), min(OLDER * behind, OLDEST * plan.interval_s / self._step)
        )
        # What was not missed when the robot came to its place is not missed later, as it gets older.
        is_missed = (self._is_missed | (visit.places >= self._index)) & (seen < max(self._entered, 1))
        is_missed &= (by - np.maximum(seen, 0) > missed_from) & fog.patrolled.reshape(-1)[points]
        self._is_missed = is_missed
        numbers = self._groups.known.number_of[points[is_missed]]
        _, usable = self._stands.of(view, given_up, numbers)
        places = visit.places[is_missed][usable]
        places = places[places >= self._index]
        if not places.size:
            self._aim = last
        elif not self._is_exact:
            self._aim = int(places.max())
        else:
            self._aim = self._index if self._index > 0 and behind <= BEHIND else int(places.min())
        still_missed: Flat = numbers[usable]
        return still_missed

    def _choose_target(self, missed: Flat, view: View, given_up: GivenUp) -> Target | None:
        """Return the next place of the visit as a target, or then the nearest point that was missed."""
        visit, width = self._visit, view.ground.terrain.width
        assert visit is not None
        if self._aim < len(visit.trail):
            spot = visit.trail[-1 if self._is_held_up(view.tick) else self._aim]
            return Target(view.point_of(spot), view.point_of(spot), 0, spot=spot)
        if not missed.size:
            return None
        # It is seen on the way to itself, as the robot has just missed it.
        stands, _ = self._stands.of(view, given_up, missed, by_itself=True)
        row, col = view.point_of((view.pose.x, view.pose.y))
        nearest = int(((stands // width - row) ** 2 + (stands % width - col) ** 2).argmin())
        point = divmod(int(self._groups.known.points[missed[nearest]]), width)
        age = view.tick - max(int(view.fog.last_seen[point]), 0)
        return Target(point, divmod(int(stands[nearest]), width), max(age, 1))


class Stochastic(SharedRound):
    """Draws its next station."""

    Options = StochasticOptions

    def _begin_round(self, laid_out: Round, robots: frozenset[int], view: View | None) -> Choice:
        weights = None
        if self.division is not None:
            weights = _with_margin(self.division.divisions.zoned)  # free choices are not bound to the ground of a zone
        else:
            laid_out, robots = _share(self._setup, laid_out, robots)
        if laid_out.stations is None:
            return self._free
        groups_by_round: dict[tuple[object, ...], Groups] = self._setup.ground.scratch.setdefault("groups", {})
        question = (id(laid_out), view.weighing if view is not None else None)
        if question not in groups_by_round:
            prepared = self._setup.ground.prepared
            known = KnownStations(laid_out, weights)
            groups_by_round[question] = Groups(known, self._setup.fleet.roster, prepared.starts, prepared.terrain)
        return OnPlan(self._setup, laid_out, groups_by_round[question], self._free, self._living, robots, self._since)

    def _round_of(self, divisions: Divisions, group: Group) -> Round:
        return divisions.zoned.rounds[group.classes]  # what weighs more is visited more often without being there twice


def _share(setup: PolicySetup, laid_out: Round, robots: frozenset[int]) -> tuple[Round, frozenset[int]]:
    """Return the round that a robot shares, and with which of some robots: all whose rounds show the same points.

    Of several radii, that of the widest robot, which all the others can follow.
    """
    all_rounds = setup.ground.prepared.rounds
    rounds = {number: laid for number in sorted(robots) if (laid := all_rounds[number]) is not None}
    distinct = {id(shared): shared for shared in rounds.values()}
    points = np.sort(laid_out.points)
    alike = {key for key, other in distinct.items() if np.array_equal(np.sort(other.points), points)}
    sharing = frozenset(number for number, own in rounds.items() if id(own) in alike)
    widest = max(sorted(sharing), key=lambda number: setup.fleet.radii[number])
    return rounds[widest], sharing


def _with_margin(zoned: ZonedGround) -> NDArray[np.float64]:
    """Return the weights of the ground; greater where an age is wanted, as distances are uneven."""
    weights = zoned.weights.copy()
    for weight, wish in zip(zoned.classes, zoned.wanted, strict=True):
        weights[zoned.weights == weight] *= 1.0 if wish is None else KEPT
    return weights
