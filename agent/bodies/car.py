"""A body that drives arcs of at least its turning radius, forward and in reverse.

On its way to a place a car drives the arcs that a search has found (`agent.bodies.manoeuvre`), and parks where the
place is near, with nothing in between. Otherwise it drives towards the goal ahead, turning as tightly as needed (paper,
"nonholonomic robots"). Where no step towards the goal is free it turns out of the dead end (`Unstuck`). In the same way
it turns at a place where it is to face a direction.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from itertools import chain
from typing import TYPE_CHECKING

from agent.bodies.base import CLEAR_SHARE, BodyBase, way_of
from agent.bodies.manoeuvre import Manoeuvres, car_moves
from agent.bodies.setup import BodySetup
from agent.bodies.standoff import Moves
from agent.bodies.steering import EASIER, CarSteering
from agent.ports import Bearing, Choice, Goal, Intent, Place, State, Stay, Steer
from patrol.ground.swept_path import advance
from patrol.pose import Drive, is_halt, wrap

if TYPE_CHECKING:
    from agent.routes.ground import Spot
    from agent.view import View
    from patrol.pose import Command, Pose

ORIENTED = math.pi / 8
"""Largest deviation from the desired heading that counts as oriented, rad: half of one of eight sectors."""


class Unstuck:
    """Backs out of a dead end, turning towards the direction in which most forces pulled when the robot got stuck.

    Where the robot can back no further it drives forward, still turning; where it can drive forward no further it backs
    again; and it stops as soon as it faces the desired direction (paper, "unstuck"). The first step back is taken in
    any case, because the paper backs before it asks which way the robot faces.
    """

    def __init__(self, steering: CarSteering, speed: float) -> None:
        """Start outside of any dead end; `speed` is the top speed in m/s."""
        self.active = False
        self._steering = steering
        self._speed = speed
        self._desired = 0.0
        self._backing = True
        self._has_backed = False

    def begin(self, desired: float) -> None:
        """Start to leave a dead end, towards the heading `desired` in rad."""
        self.active = True
        self._desired = desired
        self._backing = True
        self._has_backed = False

    def step(self, pose: Pose, bumped: bool) -> Drive | None:
        """Return the next command on the way out; None when the robot has left the dead end."""
        # It has hit something on its way out, so it tries the other gear.
        if bumped:
            self._backing = not self._backing
        if self._has_backed and abs(wrap(self._desired - pose.heading)) <= ORIENTED:
            self.active = False
            return None
        self._has_backed = True
        # Once in each gear.
        for _ in range(2):
            for share in EASIER:
                speed = share * (-self._speed if self._backing else self._speed)
                drive = self._steering.turning(pose, self._desired, speed)
                if self._steering.is_free(pose, drive):
                    return drive
            self._backing = not self._backing
        return Drive(0.0, 0.0)


class CarBody(BodyBase):
    """Drives towards the goal ahead, and gets itself out of dead ends (paper, "unstuck")."""

    command = Drive

    def __init__(self, setup: BodySetup) -> None:
        is_as_printed = "plain-unstuck" in setup.patrol.paper_rules
        super().__init__(setup, Moves.AS_PRINTED if is_as_printed else Moves.ALONG_ARCS)
        self._steering = CarSteering(setup.spec, setup.ground.terrain, setup.step)
        self._step = setup.step
        self._unstuck = Unstuck(self._steering, setup.spec.speed)
        self._turned_at: Spot | None = None  # the place at which it has begun to turn to where the place says
        self._is_turning = False  # it gets unstuck only to do so
        self._parking = max(self.stride, 2.0 * setup.spec.turning_radius)
        if setup.patrol.manoeuvres:
            point, sees_all_round = setup.ground.terrain.point, setup.sees_all_round
            moves = car_moves(setup.spec, setup.step, point, sees_all_round=sees_all_round)
            self.manoeuvres = Manoeuvres(moves, setup.spec, setup.ground.terrain, self._steering.is_free, setup.step)
            self._parking = self.manoeuvres.parking

    def _carry_out(self, intent: Intent, view: View) -> Choice:
        if view.bumped and self.manoeuvres is not None:
            self.manoeuvres.drop()
        if self._turned_at is not None and not (isinstance(intent, Place) and (intent.x, intent.y) == self._turned_at):
            # The place is another one: what it turned to see has been seen, or given up.
            self._forget_way()
        if isinstance(intent, Bearing) and (aside := self._step_at_random(intent, view)) is not None:
            return aside
        if self._unstuck.active and not isinstance(intent, Steer):
            return self._go_on_leaving(intent, view)
        return super()._carry_out(intent, view)

    def _step_at_random(self, intent: Bearing, view: View) -> Choice | None:
        """Return a random step, forward or else in reverse; None if there is none, or neither is free.

        The paper has them at every step, so also in a dead end and after a bump, where a car could repeat itself.
        """
        if intent.wander is None or view.start is None:
            return None
        state = State.DEAD_END if self._unstuck.active and not self._is_turning else intent.state
        for speed in (self.spec.speed, -self.spec.speed):
            drive = self._steering.turning(view.pose, intent.wander, speed)
            if self._steering.is_free(view.pose, drive):
                return Choice(drive, state, intent.wander)
        return None

    def _go_on_leaving(self, intent: Bearing | Place | Stay, view: View) -> Choice:
        """Take the next step out of a dead end, or once it has been left, one to where an intent leads."""
        bearing, goal = None, None
        if isinstance(intent, Bearing):
            bearing, goal = self._find_direction(intent, view)
        elif isinstance(intent, Place) and (way := way_of(intent, view)) is not None:
            bearing, goal = _aim_at(way, view)
        drive = self._unstuck.step(view.pose, view.bumped)
        if drive is None:
            # It has faced about since the bump, so the bump says nothing of the next step.
            choice = self._drive_ahead(view, bearing, goal, intent.state, bumped=False)
        else:
            out = self._leave_dead_end(view) if is_halt(drive) else None
            choice = out or Choice(drive, intent.state if self._is_turning else State.DEAD_END, None, goal)
        return replace(choice, bearing=bearing, goal=goal) if isinstance(intent, Place) else choice

    def _take_bearing(self, intent: Bearing, view: View) -> Choice:
        bearing, goal = self._find_direction(intent, view)
        if view.start is None:
            return self._proceed_on_manoeuvre(intent.state, view) or self._come_back(view)
        return self._drive_ahead(view, bearing, goal, intent.state, bumped=view.bumped)

    def _find_direction(self, intent: Bearing, view: View) -> tuple[float | None, Goal | None]:
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
        if intent.bend is not None and self.stand_off.keeps_happening(view.tick):
            across, up = (corner - here for corner, here in zip(intent.bend, centre, strict=True))
            bearings = chain((math.atan2(up, across),), bearings)
        strongest: tuple[float, Goal] | None = None
        for bearing in bearings:
            goal = self.goals.along(bearing, *start)
            if math.dist(goal.goal, centre) >= CLEAR_SHARE * self.stride:
                return bearing, goal
            strongest = strongest or (bearing, goal)
        assert strongest is not None
        return strongest

    def _approach_place(self, place: Place, view: View) -> Choice:
        """Return the way to a place, and parking there."""
        way = way_of(place, view)
        if way is None:
            return self._proceed_on_manoeuvre(place.state, view) or self._come_back(view)
        spot, bend = way
        pose = view.pose
        if place.wander is not None and not view.bumped:
            aside = self._steering.turning(pose, place.wander, self.spec.speed)
            end = advance(pose, aside, self._step)
            # The step must also end where routes lead on.
            if self._steering.is_free(pose, aside) and self.footing.may_end(pose, end.x, end.y):
                return Choice(aside, place.state, place.wander)
        bearing, goal = _aim_at(way, view)
        exact = place.exact and self.manoeuvres is not None
        near = bend == spot and math.dist((pose.x, pose.y), spot) < self._parking
        if near and not exact and not view.bumped:
            return Choice(self._steering.park(pose, spot), place.state, bearing, goal)
        if self.manoeuvres is not None:
            arcs = self.manoeuvres
            drive = self._drive_onto(arcs, place, spot, view) if exact else arcs.next(view, spot)
            if drive is not None:
                return Choice(drive, place.state, bearing, goal)
        choice = self._drive_ahead(view, bearing, goal, place.state, bumped=view.bumped)
        return replace(choice, bearing=bearing, goal=goal)

    def _drive_onto(self, arcs: Manoeuvres, place: Place, spot: Spot, view: View) -> Command | None:
        """Return the next step to the point of a place; a halt there, once the car faces where the place says.

        A car that does not face there turns, in reverse and forward, and then comes back facing there.
        """
        pose, heading = view.pose, place.heading
        is_there = view.point_of((view.reported.x, view.reported.y)) == view.point_of(spot)
        if is_there and (heading is None or abs(wrap(heading - pose.heading)) <= ORIENTED):
            return Drive(0.0, 0.0)
        if self._turned_at is not None:
            if (drive := arcs.next(view, spot, exact=True, facing=heading)) is not None:
                return drive
            self._turned_at = None
        if not is_there or heading is None:
            return arcs.next(view, spot, exact=True)
        self._turned_at, self._is_turning = (place.x, place.y), True
        self._unstuck.begin(heading)
        return self._unstuck.step(pose, bumped=False)

    def _drive_ahead(self, view: View, bearing: float | None, goal: Goal | None, state: str, *, bumped: bool) -> Choice:
        """Drive towards the goal ahead in direction ``bearing`` (rad), or begin to leave a dead end."""
        if goal is None or bearing is None:
            return self._make_halt(State.HOLDING)
        drive = self._steering.towards(view.pose, goal.refined)
        if not bumped and self._steering.is_free(view.pose, drive):
            return Choice(drive, state, bearing, goal)
        if (back := self._leave_dead_end(view)) is not None:
            return back
        self._is_turning = False
        self._unstuck.begin(bearing)
        out = self._unstuck.step(view.pose, bumped=False)
        return Choice(out or Drive(0.0, 0.0), State.DEAD_END, bearing, goal)

    def _forget_way(self) -> None:
        super()._forget_way()
        self._turned_at, self._unstuck.active = None, False

    def _step_to(self, pose: Pose, spot: Spot) -> Drive:
        self._unstuck.active = False
        return self._steering.park(pose, spot)

    def _limit_command(self, pose: Pose, wanted: Drive) -> Drive | None:
        return wanted if self._steering.is_free(pose, wanted) else None


def _aim_at(way: tuple[Spot, Spot], view: View) -> tuple[float, Goal]:
    """Return the direction of the first bend of a way, rad, and the goal."""
    spot, bend = way
    return math.atan2(bend[1] - view.pose.y, bend[0] - view.pose.x), Goal(spot, bend)
