"""A body that moves in any direction at once."""

from __future__ import annotations

import math
from dataclasses import replace

from agent.bodies.base import BARELY, BLOCKED_SHARE, CLEAR_SHARE, BodyBase, way_of
from agent.bodies.setup import BodySetup
from agent.bodies.standoff import Moves
from agent.ports import Bearing, Choice, Goal, Intent, Place, State
from agent.routes.ground import Spot
from agent.view import View
from patrol.pose import TAU, Pose, Velocity
from patrol.random import Purpose

AFTER_BUMP = 0.5
"""Probability that a robot that bumped on its way to a place takes a random step."""


class HolonomicBody(BodyBase):
    """Takes the strongest direction in which it can make at least half a step."""

    command = Velocity

    def __init__(self, setup: BodySetup) -> None:
        super().__init__(setup, Moves.SIDEWAYS)

    def obey(self, intent: Intent, view: View) -> Choice:
        """Return the command that best carries out an intent; it faces where a place says, whatever way it goes."""
        choice = super().obey(intent, view)
        if not isinstance(intent, Place) or intent.heading is None:
            return choice
        assert isinstance(choice.command, Velocity)
        return replace(choice, command=replace(choice.command, facing=intent.heading))

    def _take_bearing(self, intent: Bearing, view: View) -> Choice:
        pose, start = view.pose, view.start
        if intent.wander is not None:
            return Choice(self.straight.heading(pose, intent.wander)[0], intent.state, intent.wander)
        if start is None:
            return self._come_back(view)
        if not intent.bearings:
            return Choice(Velocity(0.0, 0.0), State.HOLDING)
        if intent.near is not None and (stop := self._stop_at(intent.near, view, start)) is not None:
            return Choice(stop, intent.state, intent.bearings[0], Goal(intent.near, intent.near))
        best: tuple[Velocity, float, float, Goal] | None = None
        for bearing in intent.bearings:
            goal = self.goals.along(bearing, *start)
            velocity, way = self.straight.towards(pose, goal.refined)
            if best is None or way > best[1]:
                best = velocity, way, bearing, goal
            if way >= CLEAR_SHARE * self.stride:
                break
        assert best is not None
        velocity, way, bearing, goal = best
        blocked = way < BLOCKED_SHARE * self.stride
        return Choice(velocity, State.DEAD_END if blocked else intent.state, bearing, goal)

    def _stop_at(self, near: Spot, view: View, start: tuple[int, int]) -> Velocity | None:
        """Return the step towards a place close by; None when no such step is possible."""
        pose = view.pose
        velocity, way = self.straight.towards(pose, near)
        if way < CLEAR_SHARE * min(self.stride, math.dist((pose.x, pose.y), near)):
            # The way is free from the centre of the robot's point, but not quite from where it stands on it.
            velocity, way = self.straight.towards(pose, view.ground.centre(*start))
        return velocity if way > BARELY else None

    def _approach_place(self, place: Place, view: View) -> Choice:
        """Return a step towards a place. The body yields to others on the way, but not on the last step."""
        pose, start, route = view.pose, view.start, way_of(place, view)
        if place.wander is not None and (aside := self._step_aside(pose, place.wander)) is not None:
            return Choice(aside, place.state, place.wander)
        if route is None or start is None:
            return self._come_back(view)
        spot, bend = route
        bend = self._find_farthest_bend(spot, bend, view)
        bearing = math.atan2(bend[1] - pose.y, bend[0] - pose.x)
        if view.bumped and view.draw(0, Purpose.RANDOM_MOVE) < AFTER_BUMP:
            aside = self._step_aside(pose, TAU * view.draw(1, Purpose.RANDOM_MOVE))
            if aside is not None:
                return Choice(aside, place.state, bearing, Goal(spot, bend))
        targets = [bend, view.ground.centre(*start)]
        if place.lean is not None:
            targets = [place.lean, *targets]
        enough = CLEAR_SHARE * min(self.stride, math.dist((pose.x, pose.y), bend))
        velocity, way = self.straight.towards(pose, targets[0])
        for target in targets[1:]:
            if way < enough:
                velocity, way = self.straight.towards(pose, target)
        if way <= BARELY < enough and (out := self.way_back.spot(pose.x, pose.y)) is not None:
            # It stands between points, and no straight line leads to the one that it joins.
            velocity, way = self.straight.towards(pose, out)
        return Choice(velocity, place.state, bearing, Goal(spot, bend))

    def _find_farthest_bend(self, spot: Spot, bend: Spot, view: View) -> Spot:
        """Return the farthest of the bends within a step to which the body gets straight.

        Ways run over the centres of points, so in a slanting slit they bend at each point. The body need not.
        """
        pose, ground = view.pose, view.ground
        here, target = (pose.x, pose.y), view.point_of(spot)
        farthest = goal = bend
        for _ in range(math.ceil(self.stride / self._point)):
            row, col = view.point_of(goal)
            if math.dist(here, goal) >= self.stride or (row, col) == target or not ground.open_now[row, col]:
                break
            expected = round(100.0 * (2.0 * math.dist(goal, spot) + self.stride) / self._point)
            goal = view.routes.way((row + 1, col + 1), (target[0] + 1, target[1] + 1), expected).bend
            gets_there = self.straight.towards(pose, goal)[1] >= min(self.stride, math.dist(here, goal)) - BARELY
            if gets_there and not self._is_closed_to(goal, view):
                farthest = goal
        return farthest

    def _is_closed_to(self, spot: Spot, view: View) -> bool:
        """Return True if something that is closed at this tick lies on the straight line to a spot."""
        pose = view.pose
        samples = math.ceil(2.0 * math.dist((pose.x, pose.y), spot) / self._point)
        for sample in range(1, samples + 1):
            share = sample / samples
            point = view.point_of((pose.x + share * (spot[0] - pose.x), pose.y + share * (spot[1] - pose.y)))
            if view.ground.is_closed(*point):
                return True
        return False

    def _step_aside(self, pose: Pose, bearing: float) -> Velocity | None:
        """Return a step in a direction, in rad; None where no route would lead on from its end."""
        velocity, way = self.straight.heading(pose, bearing)
        end = pose.x + way * math.cos(bearing), pose.y + way * math.sin(bearing)
        return velocity if self.footing.may_end(pose, *end) else None

    def _come_back(self, view: View) -> Choice:
        choice = super()._come_back(view)
        if choice.goal is None or not view.bumped or view.draw(0, Purpose.RANDOM_MOVE) >= AFTER_BUMP:
            return choice
        bearing = TAU * view.draw(1, Purpose.RANDOM_MOVE)
        return replace(choice, command=self.straight.heading(view.pose, bearing)[0], bearing=bearing)

    def _step_to(self, pose: Pose, spot: Spot) -> Velocity:
        return self.straight.towards(pose, spot)[0]

    def _limit_command(self, pose: Pose, wanted: Velocity) -> Velocity:
        return self.straight.along(pose, wanted)
