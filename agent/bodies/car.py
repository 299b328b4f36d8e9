"""A body that drives arcs of at least its turning radius, forward and in reverse."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import chain

from agent.bodies.setup import CLEAR_SHARE, BodyBase, BodySetup, way_of
from agent.bodies.steering import CarSteering, Footing
from agent.bodies.stuck.manoeuvre import Manoeuvres
from agent.bodies.stuck.retreat import Retreat
from agent.bodies.stuck.unstuck import YIELDS, Unstuck
from agent.ports import Bearing, Choice, Goal, Intent, Place, PolicyFailed, State, Stay, Steer
from agent.view import View
from patrol.ground.swept_path import advance
from patrol.pose import TAU, Drive, halted
from patrol.random import Purpose

OFTEN = 4
"""Number of bumps in a row from which on a car does not search for a manoeuvre but gets itself unstuck."""


class CarBody(BodyBase):
    """Drives towards the goal ahead, and gets itself out of dead ends (paper, "unstuck")."""

    def __init__(self, setup: BodySetup) -> None:
        super().__init__(setup)
        self._steering = CarSteering(setup.spec, setup.ground.terrain, setup.step)
        self._footing = Footing(setup.ground.terrain, setup.ground, setup.spec.radius, wanted=setup.patrol.manoeuvres)
        self._step = setup.step
        chance = setup.chance
        self._unstuck = Unstuck(
            self._steering, setup.spec.speed, setup.step, lambda k, index: chance(k, index, Purpose.UNSTUCK)
        )
        self._parking = max(self.stride, 2.0 * setup.spec.turning_radius)
        self._chance = chance
        self._bumps = 0
        self._manoeuvres: Manoeuvres | None = None
        self._retreat: Retreat | None = None
        if setup.patrol.manoeuvres:
            self._retreat = Retreat(
                self._steering,
                setup.spec.number,
                setup.radii,
                setup.step,
                lambda k: chance(k, 2, Purpose.UNSTUCK),
            )
            self._manoeuvres = Manoeuvres(setup.spec, setup.ground.terrain, self._steering, setup.step)

    def obey(self, intent: Intent, view: View) -> Choice:
        """The command that best carries out an intent (`agent.ports.Body.obey`)."""
        self.way_back.note(view.pose.x, view.pose.y)
        if self._retreat is None:
            return self._obey(intent, view)
        if self._retreat.update(view.tick, view.pose, view.bumped, view.peers):
            self._unstuck.end(view.tick)
        back = self._retreat.next(view.tick, view.pose)
        choice = self._obey(intent, view) if back is None else Choice(back, intent.state)
        assert isinstance(choice.command, Drive)
        self._retreat.told(choice.command)
        return choice

    def _obey(self, intent: Intent, view: View) -> Choice:
        match intent:
            case Bearing():
                return self._bear(intent, view)
            case Place():
                return self._approach(intent, view)
            case Steer(command, state):
                return self._steer(command, state, view)
            case Stay(state):
                return self._drive(view, None, None, state) if self._unstuck.active else self._stand(state)

    def _bear(self, intent: Bearing, view: View) -> Choice:
        bearing, goal = self._ahead(intent, view)
        if view.start is None and (back := self._come_back(view, intent.state)) is not None:
            return back
        if intent.wander is not None and not view.bumped and not self._unstuck.active:
            aside = self._steering.turning(view.pose, intent.wander, self.spec.speed)
            if self._steering.is_free(view.pose, aside):
                return Choice(aside, intent.state, intent.wander)
        return self._drive(view, bearing, goal, intent.state)

    def _ahead(self, intent: Bearing, view: View) -> tuple[float | None, Goal | None]:
        """The strongest direction that leads at least half a step, and its goal; the strongest of all if none does.

        The paper's forces act along first steps of paths, which are free by construction. A bearing rounded to its
        sector's bisector may point into a wall right beside the robot. Where it does so again and again, a car would
        never get away, because its moves are not random. It then takes the exact bearing of the strongest force.
        """
        start = view.start
        if start is None or not intent.bearings:
            return None, None
        bearings: Iterable[float] = intent.bearings
        centre = view.ground.centre(*start)
        if intent.bend is not None and self._unstuck.keeps_happening(view.tick):
            across, up = (there - here for there, here in zip(intent.bend, centre, strict=True))
            bearings = chain((math.atan2(up, across),), bearings)
        strongest: tuple[float, Goal] | None = None
        for bearing in bearings:
            goal = self.goals.along(bearing, *start)
            if math.dist(goal.goal, centre) >= CLEAR_SHARE * self.stride:
                return bearing, goal
            strongest = strongest or (bearing, goal)
        assert strongest is not None
        return strongest

    def _approach(self, place: Place, view: View) -> Choice:
        """The way to a place, and parking there."""
        found = way_of(place, view)
        if found is None:
            return self._come_back(view, place.state) or self._drive(view, None, None, place.state)
        spot, bend = found
        pose = view.pose
        self._bumps = self._bumps + 1 if view.bumped else 0
        if place.wander is not None and not view.bumped and not self._unstuck.active:
            aside = self._steering.turning(pose, place.wander, self.spec.speed)
            end = advance(pose, aside, self._step)
            if self._steering.is_free(pose, aside) and self._footing.may_end(pose, end.x, end.y):
                return Choice(aside, place.state, place.wander)
        bearing, goal = math.atan2(bend[1] - pose.y, bend[0] - pose.x), Goal(spot, bend)
        parking = self._parking if self._manoeuvres is None else self._manoeuvres.parking
        near = bend == spot and math.dist((pose.x, pose.y), spot) < parking
        if near and not view.bumped and not self._unstuck.active:
            return Choice(self._steering.park(pose, spot), place.state, bearing, goal)
        if self._manoeuvres is not None and not self._unstuck.active and self._bumps < OFTEN:
            if view.bumped:
                self._manoeuvres.drop()
                if self._chance(view.tick, 1, Purpose.UNSTUCK) < YIELDS:
                    return Choice(Drive(0.0, 0.0), place.state, bearing, goal)
            drive = self._manoeuvres.next(view, spot)
            if drive is not None:
                return Choice(drive, place.state, bearing, goal)
        choice = self._drive(view, bearing, goal, place.state)
        return Choice(choice.command, choice.state, bearing, goal)

    def _come_back(self, view: View, state: str) -> Choice | None:
        """A step of a car that is off the reachable points, back to them; None where it knows no way there."""
        pose = view.pose
        if self._manoeuvres is None or self._unstuck.active or not self.way_back.is_needed(pose.x, pose.y):
            return None
        # A manoeuvre may lead over places from which no route leads on: it goes on to its end.
        if not view.bumped and (drive := self._manoeuvres.proceed(pose)) is not None:
            return Choice(drive, state)
        left = self.way_back.paths(pose.x, pose.y)
        if left is None:
            return None
        drive = None if view.bumped else self._manoeuvres.back(view, left)
        if drive is not None:
            return Choice(drive, State.DEAD_END)
        self._unstuck.begin(view.tick, TAU * self._chance(view.tick, 0, Purpose.UNSTUCK))
        return self._drive(view, None, None, State.HOLDING)

    def _drive(self, view: View, bearing: float | None, goal: Goal | None, state: str) -> Choice:
        """Towards the goal ahead in direction ``bearing`` (rad), or out of a dead end."""
        tick, pose, bumped = view.tick, view.pose, view.bumped
        if self._unstuck.active:
            drive = self._unstuck.step(tick, pose, bumped)
            if drive is not None:
                return Choice(drive, State.DEAD_END, None, goal)
            bumped = False
        if goal is None or bearing is None:
            return self._stand(State.HOLDING)
        drive = self._steering.towards(pose, goal.refined)
        if not bumped and self._steering.is_free(pose, drive):
            return Choice(drive, state, bearing, goal)
        self._unstuck.begin(tick, bearing)
        out = self._unstuck.step(tick, pose, bumped=False)
        return Choice(out or Drive(0.0, 0.0), State.DEAD_END, bearing, goal)

    def _steer(self, command: object, state: str, view: View) -> Choice:
        """A policy's own command, unless it leads into a wall."""
        if not isinstance(command, Drive):
            raise PolicyFailed(f"returned Steer({type(command).__name__}) for a car; give a Drive")
        wanted = command.limited(self.spec.limits)
        return Choice(wanted, state) if self._steering.is_free(view.pose, wanted) else self._stand(State.HOLDING)

    def _stand(self, state: str) -> Choice:
        return Choice(halted(self.spec.model), state)
