"""A body with two driven wheels: it drives arcs, forward and in reverse, and turns on the spot.

Wherever a straight line leads, turning first and driving then gets it there. It drives an arc instead where that saves
the turn. On its way to a place it drives so on long straight stretches and on the last bit. Elsewhere it searches for
arcs and turns on the spot (`agent.bodies.manoeuvre`), in reverse too unless its sensor looks ahead only. So it gets
through a slanting slit, where the way bends at each point, without a stop at each bend.

Its moves are hardly random, so two such robots that block each other would do so for ever. One that keeps bumping, or
that no step leads on, therefore backs off (`agent.bodies.standoff`), forward or in reverse, whichever needs the smaller
turn.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import chain

from agent.bodies.base import BARELY, BLOCKED_SHARE, CLEAR_SHARE, BodyBase, way_of
from agent.bodies.manoeuvre import Manoeuvres, wheel_moves
from agent.bodies.setup import BodySetup
from agent.bodies.standoff import Moves
from agent.bodies.steering import EASIER, Footing, HolonomicSteering
from agent.ports import Bearing, Choice, Goal, Place, State
from agent.routes.ground import Ground, Spot
from agent.view import View
from patrol.ground.swept_path import advance, line_is_free, path_is_free
from patrol.ground.terrain import Terrain
from patrol.pose import Command, Pose, Twist, halted, wrap
from patrol.scenario import RobotSpec

ASKEW = 0.8
"""A larger misalignment is turned away at once, rad: a little more than one of eight sectors."""

GENTLY = 0.3
"""Share of a smaller misalignment that one step turns away, so that a body whose goal swings drives in between."""

ALIGNED = 1e-12
"""A smaller misalignment is rounding, rad: a step in this direction is straight."""

STRAIGHT_RADII = 5.0
"""A body does without a search where its way leads straight for so many of its radii: arcs would miss the line."""

WORTH_DRIVING = 0.05
"""The body turns on the spot where an arc would leave less than this share of its speed."""


def smaller_turn(heading: float, direction: float) -> tuple[float, float]:
    """Return the turn after which a body drives in a direction, and 1.0 for forward or -1.0 for reverse.

    All angles are in rad; the turn is at most a quarter circle. For example, to drive in direction 3.0 from heading 0,
    a body turns by -0.14 and drives in reverse.
    """
    askew = wrap(direction - heading)
    return (askew, 1.0) if abs(askew) <= 0.5 * math.pi else (wrap(askew + math.pi), -1.0)


class WheelSteering:
    """Steering of a robot that drives forward and backward, and turns, also on the spot.

    A step is possible where the body touches no wall, and a straight drive leads from its end to the ground that routes
    run over, so that the body can come back. One that is off that ground takes any step. Manoeuvres touch no wall
    either, but may lead over places from which no route leads on.

    `stride` is the longest way in one step, m.
    """

    def __init__(self, spec: RobotSpec, terrain: Terrain, ground: Ground, step: float) -> None:
        """Compute nothing yet."""
        self._spec = spec
        self._terrain = terrain
        self._step = step
        self._footing = Footing(terrain, ground, spec.radius)
        self.reach = HolonomicSteering(spec, terrain, step, self._footing).reach
        self._most = spec.speed / spec.radius * step
        self.stride = spec.speed * step

    def towards(self, pose: Pose, target: Spot) -> Twist:
        """Return a step towards a target: an arc, a turn on the spot or a straight drive.

        The step never goes beyond the target, whose `reach` has to be more than 0, and is zero at the target.

        An arc swings out. Where no straight line leads from its end to the target, beside a door for example, the next
        way would lead back to where it began, so the body turns on the spot there.
        """
        distance = math.dist((pose.x, pose.y), target)
        if distance < BARELY:
            return Twist(0.0, 0.0)
        askew = wrap(math.atan2(target[1] - pose.y, target[0] - pose.x) - pose.heading)
        if abs(askew) <= ALIGNED:
            return self.straight(pose, self.reach(pose, target))
        for arc in self._list_arcs(distance, askew):
            if self.is_possible(pose, arc) and self._leads_on(advance(pose, arc, self._step), target):
                return arc
        return self.on_the_spot(askew)

    def straight(self, pose: Pose, way: float) -> Twist:
        """Return a straight drive of `way` metres, negative in reverse, shortened where the body does not quite fit.

        It is zero where not even an eighth of the way is possible.
        """
        for share in EASIER:
            drive = Twist(share * way / self._step, 0.0)
            if way != 0.0 and self.is_possible(pose, drive):
                return drive
        return Twist(0.0, 0.0)

    def on_the_spot(self, turn: float) -> Twist:
        """Return a turn on the spot by `turn` rad, positive to the left, as far as one step allows."""
        return Twist(0.0, max(-self._most, min(self._most, turn)) / self._step)

    def turning(self, pose: Pose, direction: float) -> Twist:
        """Turn towards a direction, and drive with the wheels' speed that is left."""
        askew, sense = smaller_turn(pose.heading, direction)
        turn = self.on_the_spot(askew).turn_rate
        left = sense * max(0.0, self._spec.speed - abs(turn) * self._spec.radius)
        for share in EASIER:
            arc = Twist(share * left, turn)
            if self.is_possible(pose, arc):
                return arc
        return Twist(0.0, turn)

    def is_possible(self, pose: Pose, twist: Twist) -> bool:
        """Return True if the next step of ``twist`` touches no wall and ends where routes lead on."""
        end = advance(pose, twist, self._step)
        return self.is_free(pose, twist) and self._footing.may_end(pose, end.x, end.y)

    def is_free(self, pose: Pose, twist: Twist) -> bool:
        """Return True if the next step of ``twist`` touches no wall."""
        return path_is_free(self._terrain, pose, twist, self._step, self._spec.radius)

    def _leads_on(self, end: Pose, target: Spot) -> bool:
        """Return True if the body gets from the end of an arc straight to where the arc leads."""
        return line_is_free(self._terrain, (end.x, end.y), target, self._spec.radius)

    def _list_arcs(self, distance: float, askew: float) -> Iterator[Twist]:
        """Yield the arcs towards a target that the wheels are fast enough for, best first.

        `distance` is in m; `askew` is the angle from the body's heading to the target, rad.
        """
        if abs(askew) <= ASKEW:
            # An arc turns by twice the angle between its beginning and its chord.
            landing = Twist(distance * askew / math.sin(askew) / self._step, 2.0 * askew / self._step)
            if landing.is_within(self._spec.limits):
                yield landing
        # Within a stride such an arc could lead beyond the target.
        if distance > self.stride:
            for share in (GENTLY, 1.0) if abs(askew) <= ASKEW else (1.0,):
                turn = self.on_the_spot(share * askew).turn_rate
                speed = self._spec.speed - abs(turn) * self._spec.radius
                if speed > WORTH_DRIVING * self._spec.speed:
                    yield Twist(speed, turn)


@dataclass(frozen=True, slots=True)
class _Option:
    """A target that a body may head for."""

    target: Spot
    enough: float  # length of a step that makes it good enough, m
    bearing: float  # rad, to be reported
    goal: Goal  # to be reported


class DifferentialBody(BodyBase):
    """Takes the strongest direction in which it can make at least half a step, after a turn if need be.

    It turns on the spot, so it can stop at every pose and leave every pose that a straight line leads away from.
    """

    command = Twist

    def __init__(self, setup: BodySetup) -> None:
        super().__init__(setup, Moves.ON_THE_SPOT)
        self._steering = WheelSteering(setup.spec, setup.ground.terrain, setup.ground, setup.step)
        self._towards_places = self._either_way if setup.sees_all_round else self._steering.towards
        self._turns_to: float | None = None
        if setup.patrol.manoeuvres:
            moves = wheel_moves(setup.spec, setup.step, reverses=setup.sees_all_round)
            self.manoeuvres = Manoeuvres(moves, setup.spec, setup.ground.terrain, self._steering.is_free, setup.step)

    def _take_bearing(self, intent: Bearing, view: View) -> Choice:
        if intent.wander is not None:
            return Choice(self._steering.turning(view.pose, intent.wander), intent.state, intent.wander)
        start = view.start
        if start is None:
            return self._come_back(view)
        if not intent.bearings:
            return self._make_halt(State.HOLDING)
        return self._take_option(self._list_options(intent, view, start), intent.state, view, self._steering.towards)

    def _list_options(self, intent: Bearing, view: View, start: tuple[int, int]) -> Iterator[_Option]:
        """Give the options of a `Bearing`, best first."""
        centre = view.ground.centre(*start)
        if intent.near is not None:
            to_near = self._make_option(intent.near, view.pose, intent.bearings[0], Goal(intent.near, intent.near))
            yield to_near
            if self._steering.reach(Pose(*centre, 0.0), intent.near) >= to_near.enough > BARELY:
                # The way is free from the centre of the robot's point, but not quite from where it stands on it.
                yield self._make_option(centre, view.pose, intent.bearings[0], to_near.goal)
        bearings: Iterable[float] = intent.bearings
        if self._turns_to is not None and self._turns_to in intent.bearings:
            # A turn on the spot is followed by a step, so that a robot between two equal pulls gets away.
            bearings = chain((self._turns_to,), intent.bearings)
        for bearing in bearings:
            goal = self.goals.along(bearing, *start)
            yield _Option(goal.refined, CLEAR_SHARE * self.stride, bearing, goal)
        # In a slanting slit no bearing of a sector leads on. The way to what pulls hardest does, from the centre.
        for spot in (intent.bend, centre):
            if spot is not None:
                bearing = math.atan2(spot[1] - view.pose.y, spot[0] - view.pose.x)
                yield self._make_option(spot, view.pose, bearing, Goal(spot, spot))

    def _approach_place(self, place: Place, view: View) -> Choice:
        """Return a step towards a place, round others that are in the way."""
        pose, start, way = view.pose, view.start, way_of(place, view)
        if way is None or start is None:
            return self._proceed_on_manoeuvre(place.state, view) or self._come_back(view)
        spot, bend = way
        bearing, goal = math.atan2(bend[1] - pose.y, bend[0] - pose.x), Goal(spot, bend)
        if math.dist((pose.x, pose.y), spot) < BARELY and place.heading is None:
            return Choice(halted(self.spec.model), place.state, bearing, goal)
        if place.wander is not None:
            return Choice(self._steering.turning(pose, place.wander), place.state, place.wander)
        if place.heading is not None and view.point_of((pose.x, pose.y)) == view.point_of(spot):
            # A goal ahead turns a robot too that is told places and not velocities.
            turn = self._steering.on_the_spot(wrap(place.heading - pose.heading))
            return Choice(turn, place.state, place.heading, self.goals.along(place.heading, *start))
        if (command := self._step_along_arcs(place, way, view)) is not None:
            return Choice(command, place.state, bearing, goal)
        enough = CLEAR_SHARE * min(self.stride, math.dist((pose.x, pose.y), bend))
        targets = [bend, view.ground.centre(*start)]
        if place.lean is not None:
            targets = [place.lean, *targets]
        options = (
            _Option(target, min(enough, self._make_option(target, pose, bearing, goal).enough), bearing, goal)
            for target in targets
        )
        return self._take_option(options, place.state, view, self._towards_places)

    def _step_along_arcs(self, place: Place, way: tuple[Spot, Spot], view: View) -> Command | None:
        """Return the next step of arcs to near a place; None where there are none, or the policy leans aside."""
        if self.manoeuvres is None or place.lean is not None:
            return None
        spot, bend = way
        is_near = bend == spot and math.dist((view.pose.x, view.pose.y), spot) < self.manoeuvres.parking
        # After a bump the body is not where the arcs would have put it.
        if view.bumped or is_near or self._leads_straight(bend, view):
            self.manoeuvres.drop()
            return None
        return self.manoeuvres.next(view, spot)

    def _leads_straight(self, bend: Spot, view: View) -> bool:
        """Return True if the way is straight and free of walls for long, up to where it first bends."""
        here, radius = (view.pose.x, view.pose.y), self.spec.radius
        return math.dist(here, bend) >= STRAIGHT_RADII * radius and line_is_free(
            view.ground.terrain, here, bend, radius
        )

    def _take_option(
        self, options: Iterator[_Option], state: str, view: View, towards: Callable[[Pose, Spot], Twist]
    ) -> Choice:
        """Choose the first option that is good enough, else the farthest one, else a way out of the dead end.

        The options come best first; `state` is to be reported.
        """
        pose = view.pose
        best, farthest = None, 0.0
        for option in options:
            way = self._steering.reach(pose, option.target)
            if way > farthest:
                best, farthest = option, way
            if way >= option.enough and way > BARELY:
                best = option
                break
        else:
            # Less than good enough is better than nothing, but not where the body would hardly move.
            if farthest < BLOCKED_SHARE * self.stride:
                return self._leave_dead_end(view) or self._make_halt(State.DEAD_END)
        assert best is not None
        twist = towards(pose, best.target)
        # A body that only turns now drives that way next: see `_list_options`.
        self._turns_to = best.bearing if twist.speed == 0.0 else None
        return Choice(twist, state, best.bearing, best.goal)

    def _either_way(self, pose: Pose, target: Spot) -> Twist:
        """Return a step towards a target, forward or in reverse, whichever needs the smaller turn."""
        _, sense = smaller_turn(pose.heading, math.atan2(target[1] - pose.y, target[0] - pose.x))
        if sense > 0.0:
            return self._steering.towards(pose, target)
        # Reverse is the same arc driven by a body that looks the other way: only the speed changes its sign.
        twist = self._steering.towards(Pose(pose.x, pose.y, wrap(pose.heading + math.pi)), target)
        return Twist(-twist.speed, twist.turn_rate)

    def _make_option(self, target: Spot, pose: Pose, bearing: float, goal: Goal) -> _Option:
        """Return a target that may lie within a step."""
        enough = CLEAR_SHARE * min(self.stride, math.dist((pose.x, pose.y), target))
        return _Option(target, enough, bearing, goal)

    def _step_to(self, pose: Pose, spot: Spot) -> Twist:
        self._turns_to = None
        reach = self._steering.reach(pose, spot)
        turn, sense = smaller_turn(pose.heading, math.atan2(spot[1] - pose.y, spot[0] - pose.x))
        is_turning = reach > 0.0 and abs(turn) > ALIGNED
        return self._steering.on_the_spot(turn) if is_turning else self._steering.straight(pose, sense * reach)

    def _limit_command(self, pose: Pose, wanted: Twist) -> Twist | None:
        return wanted if self._steering.is_free(pose, wanted) else None
