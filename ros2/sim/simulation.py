"""Simulated ROS 2 robots on one terrain: they move together, and their patrol is measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from patrol.pose import Pose
from ros2.sim.bodies import Bodies
from ros2.sim.node import RobotNode
from ros2.wire.frames import apart, composed
from worldsim.truth import Truth

STEP_S = 0.02
"""A step of the bodies, s."""


class Simulation:
    """Robots that move by their commands.

    The bodies' fog is measured by `truth`, once in `look_s`, a tick of the fleet.

    `time_s` is the robots' time since the beginning, which is `epoch_s` since the epoch. `late_s` is by how much a step
    came too late, at most, in wall time; the process sets it. `note` is called at each look with the time since all
    robots are driven, s, and the true poses by name.
    """

    def __init__(
        self,
        nodes: Mapping[str, RobotNode],
        bodies: Bodies,
        truth: Truth,
        look_s: float,
        epoch_s: float,
        note: Callable[[float, Mapping[str, Pose]], None] | None = None,
    ) -> None:
        self.nodes = nodes
        self.time_s = 0.0
        self.late_s = 0.0
        self._bodies = bodies
        self._truth = truth
        self._look_s = look_s
        self._epoch_s = epoch_s
        self._note = note
        self._steps = 0
        self._begun_s: float | None = None
        self._mfow: list[int] = []
        # wall times in s, by name: when a robot's odometry has stopped, and when the robot stood after that
        self._unplugged_s: dict[str, float] = {}
        self._stood_s: dict[str, float] = {}

    @property
    def patrolled_s(self) -> float:
        """For how long all robots have been driven, s: nothing is measured before."""
        return 0.0 if self._begun_s is None else self.time_s - self._begun_s

    @property
    def ticks(self) -> int:
        """Ticks of the fleet in which was looked around."""
        return len(self._mfow)

    @property
    def mfow_s(self) -> float | None:
        """Age of the stalest point in the newest of them, s; None before the first."""
        return self._mfow[-1] * self._look_s if self._mfow else None

    def step(self, wall_s: float) -> None:
        """Do one step of all robots: they hear, move, and say where they are."""
        now_s = self._epoch_s + self.time_s
        robots = [node.robot for node in self.nodes.values()]
        for node in self.nodes.values():
            node.hear(now_s)
        if self._begun_s is None and all(robot.commands for robot in robots):
            self._begun_s = self.time_s
        self._look_around()
        for robot in robots:
            robot.begin(now_s, STEP_S)
        for robot, moved in zip(robots, self._bodies.move(robots, STEP_S), strict=True):
            robot.end(moved, STEP_S)
        self._steps += 1
        self.time_s = self._steps * STEP_S
        for node in self.nodes.values():
            node.say(self._epoch_s + self.time_s)
        for name in self._unplugged_s:
            if self.nodes[name].robot.stands:
                self._stood_s.setdefault(name, wall_s)

    def unplug(self, name: str, wall_s: float) -> None:
        """Stop a robot's odometry."""
        self.nodes[name].plugged = False
        self._unplugged_s[name] = wall_s

    def summary(self) -> dict[str, Any]:
        """Return the measured times and ways, in s and m."""
        return {
            "simulated_s": self.time_s,
            "patrolled_s": self.patrolled_s,
            "late_max_s": self.late_s,
            "mfow_mean_s": self._mean_age_s(self._mfow),
            "mfow_late_mean_s": self._mean_age_s(self._mfow[len(self._mfow) // 2 :]),
            "mfow_max_s": max(self._mfow) * self._look_s if self._mfow else None,
            "robots": {name: self._robot_summary(name, node) for name, node in self.nodes.items()},
        }

    def _look_around(self) -> None:
        """Look around once in each tick since all robots are driven."""
        tick = len(self._mfow)
        if self._begun_s is None or self.time_s - self._begun_s < tick * self._look_s - 0.5 * STEP_S:
            return
        poses = [(node.robot.build.spec.number, node.robot.pose) for node in self.nodes.values()]
        for node in self.nodes.values():
            node.robot.end_tick() if tick else node.robot.begin_tick()
        if self._note is not None:
            self._note(tick * self._look_s, {name: node.robot.pose for name, node in self.nodes.items()})
        self._truth.observe(tick, poses)
        self._mfow.append(self._truth.fog.mfow(tick))

    def _mean_age_s(self, ticks: Sequence[int]) -> float | None:
        return float(np.mean(ticks)) * self._look_s if ticks else None

    def _robot_summary(self, name: str, node: RobotNode) -> dict[str, Any]:
        robot, strayed_m = node.robot, node.robot.strayed_m
        counted = composed(robot.build.start, robot.odometry.counted)
        unplugged = {}
        if name in self._unplugged_s:
            stood_s = self._stood_s.get(name)
            unplugged["stood_after_s"] = None if stood_s is None else stood_s - self._unplugged_s[name]
        return {
            "walls_touched": robot.walls_touched,
            "robots_touched": robot.robots_touched,
            "distance_m": robot.body.distance_m,
            "strayed_mean_m": sum(strayed_m) / len(strayed_m) if strayed_m else None,
            "strayed_max_m": max(strayed_m, default=0.0),
            "odometry_off_m": apart(robot.pose, counted)[0],
            "commands": robot.commands,
            "messages": node.said,
            "watchdog_stops": robot.watchdog_stops,
            **unplugged,
        }
