"""From a target to a command, for a body with two driven wheels.

Such a body drives arcs and turns on the spot, so wherever a straight line leads, turning first and driving then gets it
there. It drives an arc instead where that saves the turn.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from agent.bodies.setup import BARELY
from agent.bodies.steering import Footing, HolonomicSteering
from agent.routes.ground import Ground, Spot
from patrol.ground.swept_path import advance, line_is_free, path_is_free
from patrol.ground.terrain import Terrain
from patrol.pose import Pose, Twist, wrap
from patrol.scenario import RobotSpec

ASKEW = 0.8
"""A larger misalignment is turned away at once, rad: a little more than one of eight sectors."""

GENTLY = 0.3
"""Share of a smaller misalignment that one step turns away, so that a body whose goal swings drives in between."""

ALIGNED = 1e-12
"""A smaller misalignment is rounding, rad: a step in this direction is straight."""

WORTH_DRIVING = 0.05
"""The body turns on the spot where an arc would leave less than this share of its speed."""

EASIER = (1.0, 0.5, 0.25, 0.125)
"""Shares of a step, tried in turn where the whole step does not fit."""


def smaller_turn(heading: float, direction: float) -> tuple[float, float]:
    """The turn after which a body drives in a direction, forward or in reverse.

    Args:
        heading: The body's, rad.
        direction: rad.

    Returns:
        The turn in rad, at most a quarter circle, and 1.0 for forward or -1.0 for reverse.
    """
    askew = wrap(direction - heading)
    return (askew, 1.0) if abs(askew) <= 0.5 * math.pi else (wrap(askew + math.pi), -1.0)


class WheelSteering:
    """Steering of a robot that drives forward and backward, and turns, also on the spot.

    A step is possible where the body touches no wall, and a straight drive leads from its end to the ground that routes
    run over. So the body can always come back from where it goes. One that is off that ground takes any step.

    Attributes:
        stride: Longest way in one step, m.
    """

    def __init__(self, spec: RobotSpec, terrain: Terrain, ground: Ground, step: float) -> None:
        """Compute nothing yet.

        Args:
            spec: The robot's speed (m/s) and radius (m).
            terrain: The map.
            ground: Where the robot's centre may be.
            step: s per tick.
        """
        self._spec = spec
        self._terrain = terrain
        self._step = step
        self._straight = HolonomicSteering(spec, terrain, step)
        self._footing = Footing(terrain, ground, spec.radius)
        self._most = spec.speed / spec.radius * step
        self.stride = spec.speed * step

    def reach(self, pose: Pose, target: Spot) -> float:
        """How far the body gets towards a target in one straight step, whichever way it faces.

        Args:
            pose: The robot's own.
            target: x and y in m.

        Returns:
            The length of the step in m; 0 where none is possible.
        """
        _, way = self._straight.towards(pose, target)
        bearing = math.atan2(target[1] - pose.y, target[0] - pose.x)
        for share in EASIER:
            part = share * way
            if self._footing.may_end(pose, pose.x + part * math.cos(bearing), pose.y + part * math.sin(bearing)):
                return part
        return 0.0

    def towards(self, pose: Pose, target: Spot) -> Twist:
        """A step towards a target: an arc, a turn on the spot or a straight drive. It never goes beyond the target.

        An arc swings out. Where no straight line leads from its end to the target, beside a door for example, the next
        way would lead back to where it began, so the body turns on the spot there.

        Args:
            pose: The robot's own.
            target: x and y in m, with a `reach` of more than 0.

        Returns:
            Zero at the target.
        """
        distance = math.dist((pose.x, pose.y), target)
        if distance < BARELY:
            return Twist(0.0, 0.0)
        askew = wrap(math.atan2(target[1] - pose.y, target[0] - pose.x) - pose.heading)
        if abs(askew) <= ALIGNED:
            return self.straight(pose, self.reach(pose, target))
        for arc in self._arcs(distance, askew):
            if self.is_possible(pose, arc) and self._leads_on(advance(pose, arc, self._step), target):
                return arc
        return self.on_the_spot(askew)

    def straight(self, pose: Pose, way: float) -> Twist:
        """A straight drive, shortened where the body does not quite fit.

        Args:
            pose: The robot's own.
            way: m; negative for reverse.

        Returns:
            Zero where not even an eighth of the way is possible.
        """
        for share in EASIER:
            drive = Twist(share * way / self._step, 0.0)
            if way != 0.0 and self.is_possible(pose, drive):
                return drive
        return Twist(0.0, 0.0)

    def on_the_spot(self, turn: float) -> Twist:
        """A turn on the spot, as far as one step allows.

        Args:
            turn: rad; positive to the left.
        """
        return Twist(0.0, max(-self._most, min(self._most, turn)) / self._step)

    def turning(self, pose: Pose, direction: float) -> Twist:
        """Turn towards a direction, and drive with the wheels' speed that is left.

        Args:
            pose: The robot's own.
            direction: rad.
        """
        askew, sense = smaller_turn(pose.heading, direction)
        turn = self.on_the_spot(askew).turn_rate
        left = sense * max(0.0, self._spec.speed - abs(turn) * self._spec.radius)
        for share in EASIER:
            arc = Twist(share * left, turn)
            if self.is_possible(pose, arc):
                return arc
        return Twist(0.0, turn)

    def is_possible(self, pose: Pose, twist: Twist) -> bool:
        """Whether the next step of ``twist`` touches no wall and ends where routes lead on."""
        end = advance(pose, twist, self._step)
        return self.is_free(pose, twist) and self._footing.may_end(pose, end.x, end.y)

    def is_free(self, pose: Pose, twist: Twist) -> bool:
        """Whether the next step of ``twist`` touches no wall."""
        return path_is_free(self._terrain, pose, twist, self._step, self._spec.radius)

    def _leads_on(self, end: Pose, target: Spot) -> bool:
        """Whether the body gets from the end of an arc straight to where the arc leads."""
        return line_is_free(self._terrain, (end.x, end.y), target, self._spec.radius)

    def _arcs(self, distance: float, askew: float) -> Iterator[Twist]:
        """The arcs towards a target that the wheels are fast enough for, best first.

        Args:
            distance: To the target, m.
            askew: From the body's heading to the target, rad.
        """
        if abs(askew) <= ASKEW:
            landing = Twist(distance * askew / math.sin(askew) / self._step, 2.0 * askew / self._step)
            if landing.is_within(self._spec.limits):
                yield landing
        if distance > self.stride:
            for share in (GENTLY, 1.0) if abs(askew) <= ASKEW else (1.0,):
                turn = self.on_the_spot(share * askew).turn_rate
                speed = self._spec.speed - abs(turn) * self._spec.radius
                if speed > WORTH_DRIVING * self._spec.speed:
                    yield Twist(speed, turn)
