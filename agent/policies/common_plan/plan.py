"""The common plan: the patrol of a simulated fleet, which every robot works out, and in which it takes its own part.

Ground, roster, speeds, key and time are known to all, so all find the same plan without a message. What is heard does
not change it, and what is lost does not part it. Its robots draw their stations as true ones do
(`agent.policies.common_plan.drawing`), from where they are and what they have seen.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.policies.common_plan.drawing import SPELL, Drawing
from agent.policies.common_plan.robots import PlannedRobot
from agent.policies.common_plan.stations import StationAges
from agent.policies.gaze import look_from
from patrol.ground.fog import Fog
from patrol.pose import Pose, command_of, facing_of
from patrol.radio.message import as_received
from patrol.radio.peers import Peer
from patrol.zones.ground import SpeedLimits
from patrol.zones.spec import zones_in_force

if TYPE_CHECKING:
    from collections.abc import Sequence

    from agent.policies.common_plan.drawing import Leads, Part
    from agent.policies.common_plan.stations import Ages, KnownStations
    from agent.ports import PolicySetup
    from patrol.ground.footprint import View as Seen
    from patrol.pose import Command
    from patrol.scenario import RobotSpec

MEMORY = 3.0
"""Time for which poses are remembered, in times between two robots on the tour. Of these one is ahead."""


FACES = 0.05
"""A robot faces a direction where it is at most so far beside it, rad."""


class CommonPlan:
    """The patrol of some robots on a round, as all of them simulate it from a tick on.

    At tick 0 robots begin where the scenario has them start, and later spread over the round, as if they had followed
    it.
    """

    def __init__(self, setup: PolicySetup, known: KnownStations, robots: Sequence[RobotSpec], origin: int) -> None:
        """Draw the first stations; ``origin`` is the first tick."""
        prepared, self.step = setup.ground.prepared, setup.fleet.step
        self._terrain, self._known = prepared.terrain, known
        self.origin = self.tick = origin  # the tick up to which it has been worked out
        self._chance = setup.fleet.chance
        self._drawing = Drawing(setup, known, robots)
        self.interval_s = self._drawing.interval_s  # between two robots on the tour
        self._zones = prepared.scenario.zones
        self._speed_limits = SpeedLimits(self._zones, prepared.terrain)
        self._sight = setup.ground.sight
        self._counted = np.zeros(prepared.terrain.shape, dtype=np.bool_)
        self._counted.flat[known.points] = True
        self._fog, self._ages = Fog(self._counted), StationAges(known, self.step)
        self.last_seen = self._fog.last_seen  # in the plan, ticks; below 0 for never
        self._seen_last_by = np.full(self._counted.size, -1, dtype=np.int16)  # row of a robot
        self.robots = robots
        self.rows = {spec.number: row for row, spec in enumerate(robots)}
        poses = [prepared.starts[spec.number - 1] for spec in robots]
        if origin > 0:
            poses = self._spread_over_round(robots)
        self._robots = [PlannedRobot(setup, spec, pose, origin) for spec, pose in zip(robots, poses, strict=True)]
        size = math.ceil(MEMORY * self.interval_s / self.step) + 1
        self._poses, self._commands = np.zeros((size, len(robots), 3)), np.zeros((size, len(robots), 3))
        self._note()
        self._begin()

    @property
    def since(self) -> int:
        """The first tick that is remembered."""
        return max(self.origin, self.tick - len(self._poses) + 1)

    def seen_by_others(self, number: int, points: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return which points a robot other than that one has seen last, by flat indices."""
        return np.asarray(self._seen_last_by[points] != self.rows[number])

    def poses(self, number: int, first: int, until: int) -> NDArray[np.float64]:
        """Return a robot's poses at some ticks in a row, float64 (n, 3), x and y in m, and the heading in rad."""
        return np.asarray(self._poses[np.arange(first, until) % len(self._poses), self.rows[number]])

    def places(self, tick: int) -> NDArray[np.float64]:
        """Return the places of all robots at a tick, float64 (robots, 2), m."""
        return np.asarray(self._poses[tick % len(self._poses), :, :2])

    def seen_by(self, number: int, tick: int) -> NDArray[np.int64]:
        """Return the points of the round that a robot sees at a tick, flat indices."""
        pose = as_received(Pose(*self._poses[tick % len(self._poses), self.rows[number]].tolist()))
        return self._points_in(self._sight.visible(pose))

    def _points_in(self, view: Seen) -> NDArray[np.int64]:
        """Return the points of the round that are in view, flat indices."""
        rows, cols = np.nonzero(view.mask)
        rows, cols = rows + view.row0, cols + view.col0
        height, width = self._counted.shape
        inside = (rows >= 0) & (rows < height) & (cols >= 0) & (cols < width)
        points = rows[inside] * width + cols[inside]
        return np.asarray(points[self._counted.reshape(-1)[points]], dtype=np.int64)

    def command(self, number: int, tick: int) -> Command:
        """Return what a robot does from a tick to the next one, which has been worked out."""
        row = self.rows[number]
        first, second, facing = self._commands[tick % len(self._commands), row].tolist()
        return command_of(self._robots[row].spec.model, first, second, None if math.isnan(facing) else facing)

    def advance_to(self, tick: int) -> None:
        """Work the plan out up to a tick, unless it has been."""
        while self.tick < tick:
            self._advance()

    def _advance(self) -> None:
        """Go on by a tick."""
        peers = {robot.spec.number: Peer(self.tick, robot.heard, self.tick) for robot in self._robots}
        zones = zones_in_force(self._zones, self.tick * self.step)
        for robot in self._robots:
            others = {number: peer for number, peer in peers.items() if number != robot.spec.number}
            robot.look = self._find_look(robot)
            robot.choose(self.tick, others, self._speed_limits, zones)
        self._commands[self.tick % len(self._commands)] = [
            (*robot.command.numbers, math.nan if (facing := facing_of(robot.command)) is None else facing)
            for robot in self._robots
        ]
        self.tick += 1
        for robot in self._robots:
            robot.move()
        self._note()
        if (self.tick - self.origin) % round(self._drawing.period_s / self.step) == 0:
            self._begin()
            return
        arrived = [robot for robot in self._robots if self._is_done(robot, self._parts.each[robot.spec.number])]
        if arrived:
            numbers = [robot.spec.number for robot in arrived]
            idle = [number for number, part in self._parts.each.items() if not part.route]
            drawing = sorted([*numbers, *idle])
            self._drawing.draw(self._parts, drawing, numbers, self.tick, self._oldest_s(), self._leads_s(), self._draw)
            for robot in self._robots:
                if robot.spec.number in drawing:
                    self._send(robot)

    def _begin(self) -> None:
        """Draw the stations of all robots anew."""
        self._parts = self._drawing.begin(self.tick, self._oldest_s(), self._leads_s(), self._draw)
        for robot in self._robots:
            self._send(robot)

    def _note(self) -> None:
        """Note where the robots are, and what they see."""
        poses = [(robot.pose.x, robot.pose.y, robot.pose.heading) for robot in self._robots]
        self._poses[self.tick % len(self._poses)] = poses
        for row, robot in enumerate(self._robots):
            view = self._sight.visible(robot.heard)
            self._fog.observe(view, self.tick)
            self._seen_last_by[self._points_in(view)] = row

    def _spread_over_round(self, robots: Sequence[RobotSpec]) -> list[Pose]:
        """Put robots on the round, whose points were seen as they would have passed them."""
        known, turn = self._known, len(self._known.points)
        passed = np.cumsum([0.0, *(spec.speed for spec in robots)])
        heads = [known.span(int(share * len(known))).start for share in (passed[:-1] / passed[-1]).tolist()]
        for head, end in zip(heads, [*heads[1:], turn], strict=True):
            ahead = np.arange(head, end)
            # What lies right before the next robot was seen last by that one, and so is freshest.
            shares = (end - ahead) / max(end - head, 1)
            ticks = self.tick - np.ceil(shares * self.interval_s / self.step).astype(np.int64)
            self.last_seen.flat[known.points[ahead]] = np.maximum(ticks, 0)
        spots = [self._terrain.centre(*divmod(int(known.stands[head]), self._terrain.width)) for head in heads]
        return [Pose(x, y, 0.0) for x, y in spots]

    def _send(self, robot: PlannedRobot) -> None:
        """Send a robot to the oldest point of its station; without one it stands still."""
        part = self._parts.each[robot.spec.number]
        if not part.route:
            robot.stand = -1
            return
        span = self._known.span(part.route[0])
        part.oldest = span.start + int(self._ages_s(span).argmax())
        robot.stand = int(self._known.stands[part.oldest])

    def _find_look(self, robot: PlannedRobot) -> float | None:
        """Return where a robot faces next, rad; None for any heading."""
        part = self._parts.each[robot.spec.number]
        if self._sight.all_round or not part.route:
            return None
        if robot.spec.model == "holonomic" and not robot.is_there:
            point = divmod(int(self._known.points[part.oldest]), self._terrain.width)
            spot = robot.heard.x, robot.heard.y
            return look_from(self._sight, spot, point, self.tick, self._counted, self.last_seen)
        heading = self._known.heading_of(part.oldest, robot.stand)
        if heading is not None:
            return heading
        (x, y), (to_x, to_y) = (
            self._terrain.centre(*divmod(place, self._terrain.width))
            for place in (robot.stand, int(self._known.points[part.oldest]))
        )
        return math.atan2(to_y - y, to_x - x) if (x, y) != (to_x, to_y) else None

    def _is_done(self, robot: PlannedRobot, part: Part) -> bool:
        """Return True if a robot's station has been seen; send it on to where another part of it is seen from."""
        if not part.route:
            return False
        known = self._known
        span, is_there = known.span(part.route[0]), robot.is_there
        if is_there and (look := self._find_look(robot)) is not None:
            is_there = abs(math.remainder(look - robot.heard.heading, math.tau)) < FACES
        if self.tick >= part.until:
            self.last_seen.flat[known.points[span]] = self.tick
            self._seen_last_by[known.points[span]] = self.rows[robot.spec.number]
            return True
        if is_there:
            # So each stand of the station is gone to once at most.
            shown = known.points[span][known.stands[span] == robot.stand]
            if not self._sight.all_round:
                shown = known.points[part.oldest : part.oldest + 1]
            self.last_seen.flat[shown], self._seen_last_by[shown] = self.tick, self.rows[robot.spec.number]
        if self._drawing.is_done(self._parts, part, self._ages_s):
            return True
        if is_there:
            robot.stand = int(known.stands[part.oldest])
        return False

    def _leads_s(self) -> Leads:
        return self._drawing.leads_s(self._poses[self.tick % len(self._poses)])

    def _ages_s(self, some: slice) -> Ages:
        return self._ages.of_points(some, self.tick, self._counted, self.last_seen)

    def _oldest_s(self) -> Ages:
        return self._ages.of_stations(self.tick, self._counted, self.last_seen)

    def _draw(self, number: int, choice: int) -> float:
        spell = int(self.tick * self.step / (SPELL * self.interval_s))
        return self._chance(self.origin, spell, number, choice)
