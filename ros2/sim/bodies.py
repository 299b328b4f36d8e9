"""Motion of the robots' bodies: our own, or a class of one's own that ``--bodies`` names.

Such a class is made from the terrain and the robots' builds (`ros2.sim.robot.Build`), and has one method. For
example, bodies without walls, whose wheels count one part in a hundred too much:

    class Ghosts:
        def __init__(self, terrain, builds):
            pass

        def move(self, robots, step_s):
            after = [advance(robot.pose, robot.body.command, step_s) for robot in robots]
            driven = [composed(inverted(robot.pose), pose) for robot, pose in zip(robots, after)]
            return [Moved(pose, Pose(1.01 * way.x, way.y, way.heading)) for pose, way in zip(after, driven)]
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

from patrol.classes.named_class import ClassSort, NamedClass, find, raised
from patrol.ground.swept_path import path_is_free
from patrol.pose import Pose
from ros2.sim.robot import Build, Moved, SimulatedRobot
from worldsim.robots.bodies import move

if TYPE_CHECKING:
    from patrol.ground.terrain import Terrain

__all__ = ["Bodies", "Moved"]

BODIES = ClassSort("bodies", "--bodies", "move(robots, step_s)", "fogwatch.bodies", {})


class Bodies(Protocol):
    """Moves all bodies."""

    def move(self, robots: Sequence[SimulatedRobot], step_s: float) -> Sequence[Moved]:
        """Move the bodies by their commands; return the result of each, in their order.

        Each robot obeys ``body.command`` during the step.
        """
        ...


class OwnBodies:
    """Bodies of our own world, which obey exactly and stop where they would run into something."""

    def __init__(self, terrain: Terrain) -> None:
        self._terrain = terrain

    def move(self, robots: Sequence[SimulatedRobot], step_s: float) -> list[Moved]:
        """Move the bodies as in our own world; those that would touch something stay where they are."""
        before = [robot.pose for robot in robots]
        move([robot.body for robot in robots], self._terrain, step_s)
        return [self._moved_body(robot, pose, step_s) for robot, pose in zip(robots, before, strict=True)]

    def _moved_body(self, robot: SimulatedRobot, before: Pose, step_s: float) -> Moved:
        body, spec = robot.body, robot.build.spec
        turned = before.heading + robot.going.turn_rate * step_s  # a holonomic robot turns only as it is told
        pose = Pose(body.pose.x, body.pose.y, turned if spec.model == "holonomic" else body.pose.heading)
        if not body.bumped:
            return Moved(pose)
        # The move was cancelled; what is not a wall must have been another robot.
        at_wall = not path_is_free(self._terrain, before, body.command, step_s, spec.radius)
        return Moved(pose, at_wall=at_wall, at_robot=not at_wall)


def bodies_named(name: str | None, terrain: Terrain, builds: Sequence[Build]) -> Bodies:
    """Make the robots' bodies of a class, such as ``./mine.py:Mine``; our own bodies if that is None."""
    if name is None:
        return OwnBodies(terrain)
    try:
        bodies: Bodies = find(NamedClass(BODIES, name, None, {}))(terrain, builds)
    except (ArithmeticError, LookupError, RuntimeError, TypeError, ValueError) as error:
        raise raised(f"--bodies = {name}", error) from error
    return bodies
