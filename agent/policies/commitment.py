"""Commitment: a robot goes to one place, and goes on when what it went to see has been seen.

The paper's robot chooses its direction anew at each tick, from sums over directions that may hardly differ. Between two
rooms with equally stale points it turns round again and again, and sees neither. A committed robot goes to one point,
its target:

- *Commitment*: it keeps the target until half of its age or more has gone, because a robot has seen it.
- *Giving up*: a target that comes no nearer for a while is left out for some time, with what lies around it.
- *Free choice*: the point with the greatest age squared per way (`agent.policies.choice`). A point to which
  another robot has the shorter way counts a tenth. Now and then the robot makes a random step.

Policies say what the next target is: on the tour (`agent.policies.committed`), or drawn from a plan
(`agent.policies.stochastic`). Where they know of none the choice is free.

For example, for a free choice a point not seen for 60 s at the end of a way of 9 m counts 60^2 / (9 + 3) = 300; one not
seen for 90 s, 27 m away, 270. The first one is the target.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.policies.choice import TargetChoice
from agent.policies.separation import RandomSteps, Separation
from agent.ports import Bearing, Intent, Place, State, Stay
from patrol.scenario import CommitmentOptions

if TYPE_CHECKING:
    from collections.abc import Collection

    from agent.ports import PolicySetup
    from agent.routes.routes import Element, Way
    from agent.view import View
    from patrol.tours.round import Round


LEFT_OUT_S = 20.0
"""Time for which a robot leaves out a target's surroundings, s; doubled each time that it gives them up again."""

LONGEST_S = 960.0
"""Upper bound of the same, s; also how long a robot remembers that it left them out."""

AROUND_RADII = 2.0
"""Radius of a place's surroundings, in radii of the robot."""

MOST_PLACES = 64
"""Places that are left out at a time, or remembered."""

NONE: NDArray[np.int64] = np.zeros((0, 3), dtype=np.int64)

Point = tuple[int, int]
"""Row and column of the terrain."""


class GivenUp:
    """The places that one robot leaves out."""

    def __init__(self, radius: float, point: float, step: float) -> None:
        # Row, column, the tick until which it is left out, and for how many ticks.
        self.places: list[tuple[int, int, int, int]] = []
        self._around = math.ceil((AROUND_RADII * max(radius, point) / point) ** 2)
        self._least, self._most = (round(bound / step) for bound in (LEFT_OUT_S, LONGEST_S))

    def add(self, tick: int, point: Point) -> None:
        """Leave a point and its surroundings out from now on."""
        remembered = [place for place in self.places if tick < place[2] + self._most]
        before = max((place[3] for place in remembered if self._is_beside(place, point)), default=0)
        spell = min(max(2 * before, self._least), self._most)
        others = [place for place in remembered if not self._is_beside(place, point)]
        self.places = [*others, (*point, tick + spell, spell)][-MOST_PLACES:]

    def forgive(self, point: Point) -> None:
        """Forget what is around a point."""
        self.places = [place for place in self.places if not self._is_beside(place, point)]

    def clear(self) -> None:
        """Forget everything."""
        self.places = []

    def now(self, tick: int) -> NDArray[np.int64]:
        """Return what is left out at a tick: int64 (n, 3), row, column and squared radius in points."""
        rows = [(row, col, self._around) for row, col, until, _ in self.places if tick < until]
        return np.array(rows, dtype=np.int64).reshape(-1, 3) if rows else NONE

    def covers(self, tick: int, stands: NDArray[np.int64], width: int) -> NDArray[np.bool_]:
        """Return which of some flat indices lie within what is left out at a tick; ``width`` is that of the terrain."""
        rows, cols = stands // width, stands % width
        out = np.zeros(stands.shape, dtype=np.bool_)
        for row, col, squared in self.now(tick).tolist():
            out |= (rows - row) ** 2 + (cols - col) ** 2 <= squared
        return out

    def _is_beside(self, place: tuple[int, int, int, int], point: Point) -> bool:
        """Return True if a point belongs to the surroundings of one that was given up."""
        return (place[0] - point[0]) ** 2 + (place[1] - point[1]) ** 2 <= self._around


LOSSY = 0.05
"""Share of positions that are lost, over about `MEMORY_S`, from which on robots cannot rely on believing the same. They
can again once half as many are."""

MEMORY_S = 300.0
"""Time over which losses are averaged, s."""


class Loss:
    """Notices whether many positions of others are lost. Those that were never sent count as lost."""

    def __init__(self, step: float) -> None:
        self.is_lossy = False
        self._share = 0.0
        self._weight = step / MEMORY_S

    def note(self, view: View, others: Collection[int]) -> None:
        """Take note of which of some robots, all among `View.peers`, were heard in a tick."""
        lost = sum(view.peers[number].tick < view.tick for number in others) / max(len(others), 1)
        self._share += (lost - self._share) * self._weight
        self.is_lossy = self._share > (0.5 * LOSSY if self.is_lossy else LOSSY)


Flat = NDArray[np.int64]


class RoundStands:
    """The stands of one robot for the points of a round.

    A point is seen from its place on the round. Where that is given up, or no way leads there now, it may be seen from
    the point itself, or from its post where no body fits.
    """

    def __init__(self, setup: PolicySetup, laid_out: Round) -> None:
        """Find the point itself, or its post, for each point of the round."""
        points = laid_out.points
        fields = setup.ground.fields
        own = np.where(fields.reach.reshape(-1)[points], points, fields.proxy.reshape(-1)[points])
        self._round = laid_out
        self._own = np.where(own >= 0, own, laid_out.stands)
        self._width = setup.ground.terrain.width

    def of(self, view: View, given_up: GivenUp, span: slice) -> tuple[Flat, NDArray[np.bool_]]:
        """Return the flat indices from which to see some of `Round.points` now, and which of them are usable.

        Usable are those that the robot gets to and has not given up.
        """
        stands, own = self._round.stands[span], self._own[span]
        usable = np.ones(stands.shape, dtype=np.bool_)
        if (now := view.fog.stands) is not None:
            own = now[self._round.points[span]]
            usable = own >= 0
            stands = np.where(now[stands] == stands, stands, own)
        if given_up.now(view.tick).size:
            stands = np.where(given_up.covers(view.tick, stands, self._width), own, stands)
            usable &= ~given_up.covers(view.tick, stands, self._width)
        return stands, usable


RANDOM_MOVE = 0.02
"""Probability of a random step in a tick, where choices are free."""

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


@dataclass(frozen=True, slots=True)
class Target:
    """A place that a robot goes to see."""

    point: Point
    stand: Point  # the point to go to: the same, or its post where no body fits
    age: int  # of the point when it was chosen, ticks


class Commitment:
    """Chooses freely and keeps to the target; the base of policies that say which one is next."""

    Options: type[CommitmentOptions] = CommitmentOptions

    def __init__(self, setup: PolicySetup) -> None:
        spec, terrain, sight = setup.robot.spec, setup.ground.terrain, setup.ground.sight
        step = setup.fleet.step
        self._setup = setup
        self._step = step
        self._point = terrain.point
        self._separation = Separation(setup)
        self._random_steps = RandomSteps(RANDOM_MOVE)
        self._choice = TargetChoice(setup)
        self.given_up = GivenUp(spec.radius, terrain.point, step)
        self._nearer = NEARER * spec.speed * step
        self._at_hand_s = max(AT_HAND_S, AT_HAND_STEPS * step)
        self._sees_all_round = sight.all_round and not sight.leaves_age
        self.target: Target | None = None
        self._expected = 0
        self._shortest = math.inf
        self._least_age = 0
        self._progress_at = 0
        self._was_at: tuple[float, float] | None = None
        self._may_be_away = bool(setup.fleet.docks)
        self._decided_at = 0

    def decide(self, view: View) -> Intent:
        """Return the way to the target, or to a new one; now and then a random step."""
        goes_on = view.tick <= self._decided_at + 1
        if self._may_be_away and not goes_on:
            self._forget()
        self._decided_at = view.tick
        self._separation.keep_apart(view)
        makes_random_steps = self._take_note(view, goes_on)
        start, wander = view.start, self._random_steps.draw(view) if makes_random_steps else None
        if start is None:
            # The body has to find its way back to the reachable ground first.
            return Bearing((), wander=wander)
        if self._waits(view):
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

    def _take_note(self, view: View, goes_on: bool) -> bool:
        """Take note of what has changed; return True if the robot makes random steps now.

        ``goes_on`` is True if the robot decided in the last tick as well.
        """
        del view, goes_on
        return True

    def _waits(self, view: View) -> bool:
        """Return True if the robot should stand still for now."""
        del view
        return False

    def _chosen(self, view: View, start: Element) -> Way | None:
        """Commit to the next target, and return the way there; None where there is none that a way leads to."""
        return self._free_choice(view, start)

    def _forget(self) -> None:
        """Begin anew, as after a restart: the robot was away to charge."""
        self.target = None

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
