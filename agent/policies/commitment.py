"""Commitment: a robot goes to one place, and goes on when the point that it went to see has been seen.

A robot keeps to its target (`agent.policies.pursuit`). The next one is chosen by a plan, on the ground that it shares
with others (`agent.policies.stochastic`), and freely where it shares none (`agent.policies.choice`). Now and then a
robot that chooses freely makes a random step.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar, Protocol

from agent.policies.choice import FreeChoice
from agent.policies.gaze import look_from
from agent.policies.pursuit import Pursuit, age_of
from agent.policies.separation import RandomSteps, Separation
from agent.ports import Bearing, Intent, Place, State, Stay
from patrol.scenario import CommitmentOptions

if TYPE_CHECKING:
    from agent.policies.pursuit import Leg, Target
    from agent.ports import PolicySetup
    from agent.routes.routes import Element, Way
    from agent.view import View


RANDOM_MOVE = 0.02
"""Probability of a random step in a tick, where choices are free."""


class Choice(Protocol):
    """The choice of a robot's targets, freely or on a round that it shares."""

    def note(self, view: View, pursuit: Pursuit) -> bool:
        """Update the plan or the round, such as its next station; return True if the robot chooses freely now."""
        ...

    @property
    def waits(self) -> bool:
        """True if the robot should stand still for now."""
        ...

    def next(self, view: View, start: Element, pursuit: Pursuit) -> Way | None:
        """Commit to the next target, and return the way there; None where there is none that a way leads to."""
        ...

    def forget(self) -> None:
        """Begin anew, as after a restart: the robot was away to charge."""
        ...


class Commitment:
    """Chooses freely and keeps to the target; the base of policies that choose on a round."""

    Options: type[CommitmentOptions] = CommitmentOptions
    follows_rounds: ClassVar[bool] = False  # so a free choice is nothing to report

    def __init__(self, setup: PolicySetup) -> None:
        self._setup = setup
        self.pursuit = Pursuit(setup)
        self._free = FreeChoice(setup)
        self.choice: Choice = self._free
        self._separation = Separation(setup)
        self._random_steps = RandomSteps(RANDOM_MOVE)
        self._step = setup.fleet.step
        sight = setup.ground.sight
        self._sight, self._sees_all_round = sight, sight.all_round and not sight.leaves_age
        self._looks_freely = not sight.all_round and setup.robot.spec.model == "holonomic"
        self._may_be_away = bool(setup.fleet.docks)
        self._decided_at = 0

    def decide(self, view: View) -> Intent:
        """Return the way to the target, or to a new one; now and then a random step.

        A target that no way leads to is forgotten at once, even if its way is blocked for this one tick only: a robot
        that waited for another one in a door would be in its way. The target may be chosen again in any later tick.
        """
        pursuit, goes_on = self.pursuit, view.tick <= self._decided_at + 1
        self._decided_at = view.tick
        # It was at a dock, and others have seen to its target meanwhile.
        if self._may_be_away and not goes_on:
            pursuit.target = None
            self.choice.forget()
        self._separation.keep_apart(view)
        self._update_zones(view)
        chooses_freely = self.choice.note(view, pursuit)
        start, wander = view.start, self._random_steps.draw(view) if chooses_freely else None
        if start is None:
            # The body has to find its way back to the reachable ground first.
            return Bearing((), wander=wander, state=self._state_of(chooses_freely))
        if self.choice.waits:
            pursuit.rest(view.tick)
            return Stay(state=State.PATROLLING, figures={"way_m": 0.0, "age_s": 0.0})
        way = pursuit.keep(view, start)
        if way is None:
            pursuit.target = None
            way = self.choice.next(view, start, pursuit)
        target = pursuit.target
        if way is None or target is None:
            return Stay()
        # While no way leads on along the round, or to the station, single targets are free.
        state = self._state_of(chooses_freely or target.free)
        figures = {"way_m": way.length, "age_s": age_of(view, target.point) * self._step}
        heading = self._find_heading(view, target, way)
        if way.length == 0.0 and self._sight.all_round and heading is not None:
            # Such a sensor may see more from elsewhere.
            return Bearing((heading,), wander=wander, state=state, figures=figures)
        place = Place(
            *way.place,
            bend=way.bend,
            wander=wander,
            exact=target.age > 0,
            gives_room=True,
            state=state,
            figures=figures,
            heading=heading,
        )
        return place if target.leg is None else _along(place, target.leg)

    def _find_heading(self, view: View, target: Target, way: Way) -> float | None:
        """Return where to look, rad; None for any heading."""
        if self._sees_all_round or (self._sight.all_round and way.length > 0.0):
            return None
        if target.leg is not None and target.leg.heading is not None:
            return target.leg.heading
        if self._looks_freely and way.length > 0.0:
            here = view.pose.x, view.pose.y
            share = min(view.stride / max(math.dist(here, way.bend), view.stride), 1.0)
            next_spot = here[0] + share * (way.bend[0] - here[0]), here[1] + share * (way.bend[1] - here[1])
            return look_from(self._sight, next_spot, target.point, view.tick, view.fog.patrolled, view.fog.last_seen)
        if target.heading is not None:
            return target.heading
        across, up = (end - here for end, here in zip(view.place_of(target.point), way.place, strict=True))
        return math.atan2(up, across) if across != 0.0 or up != 0.0 else None

    def _state_of(self, is_free: bool) -> State:
        """Return the state to report for a robot that goes by a free choice, or by a plan."""
        return State.FREE if is_free and self.follows_rounds else State.PATROLLING

    def _update_zones(self, view: View) -> None:
        """Go by the zones that are in force now."""


def _along(place: Place, leg: Leg) -> Place:
    """Return a place that is reached by a leg of a plan, at whose end it lies."""
    bend = leg.spot if place.bend == (place.x, place.y) else place.bend
    return replace(place, x=leg.spot[0], y=leg.spot[1], bend=bend, step=leg.step, others=leg.others)
