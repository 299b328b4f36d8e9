"""A body with two driven wheels: it drives arcs, forward and in reverse, and turns on the spot."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain

from agent.bodies.giveway import nearest
from agent.bodies.setup import BARELY, BLOCKED_SHARE, CLEAR_SHARE, BodyBase, BodySetup, way_of
from agent.bodies.stuck.back_off import BackOff
from agent.bodies.wheel_steering import WheelSteering
from agent.ports import Bearing, Choice, Goal, Intent, Place, PolicyFailed, State, Stay, Steer
from agent.routes.ground import Spot
from agent.view import View
from patrol.pose import Command, Pose, Twist, halted
from patrol.random import Purpose


@dataclass(frozen=True, slots=True)
class _Option:
    """Something to head for.

    Attributes:
        target: x and y in m.
        enough: Length of a step that makes it good enough, m.
        bearing: rad, to be reported.
        goal: To be reported.
    """

    target: Spot
    enough: float
    bearing: float
    goal: Goal


class DifferentialBody(BodyBase):
    """Takes the strongest direction in which it can make at least half a step, after a turn if need be.

    It turns on the spot, so it can stop at every pose and leave every pose that a straight line leads away from.
    """

    def __init__(self, setup: BodySetup) -> None:
        super().__init__(setup)
        self._steering = WheelSteering(setup.spec, setup.ground.terrain, setup.ground, setup.step)
        chance = setup.chance
        self._back_off = BackOff(self._steering, setup.step, lambda k, index: chance(k, index, Purpose.UNSTUCK))
        self._near = 2.0 * self.stride
        self._turns_to: float | None = None

    def obey(self, intent: Intent, view: View) -> Choice:
        """The command that best carries out an intent (`agent.ports.Body.obey`)."""
        self.way_back.note(view.pose.x, view.pose.y)
        match intent:
            case Bearing():
                return self._bear(intent, view)
            case Place():
                return self._approach(intent, view)
            case Steer(command, state):
                return self._steer(command, state, view.pose)
            case Stay(state):
                self._back_off.end()
                return self._stand(state)

    def _bear(self, intent: Bearing, view: View) -> Choice:
        if (back := self._backing_off(intent.state, view)) is not None:
            return back
        if intent.wander is not None:
            return Choice(self._steering.turning(view.pose, intent.wander), intent.state, intent.wander)
        start = view.start
        if start is None:
            return self._come_back(view)
        if not intent.bearings:
            return self._stand(State.HOLDING)
        return self._take(self._options(intent, view, start), intent.state, view)

    def _options(self, intent: Bearing, view: View, start: tuple[int, int]) -> Iterator[_Option]:
        """What a `Bearing` leads to, best first."""
        centre = view.ground.centre(*start)
        if intent.near is not None:
            to_near = self._option(intent.near, view.pose, intent.bearings[0], Goal(intent.near, intent.near))
            yield to_near
            if self._steering.reach(Pose(*centre, 0.0), intent.near) >= to_near.enough > BARELY:
                # The way is free from the centre of the robot's point, but not quite from where it stands on it.
                yield self._option(centre, view.pose, intent.bearings[0], to_near.goal)
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
                yield self._option(spot, view.pose, bearing, Goal(spot, spot))

    def _approach(self, place: Place, view: View) -> Choice:
        """A step towards a place, round others that are in the way."""
        pose, start, found = view.pose, view.start, way_of(place, view)
        if found is None or start is None:
            return self._backing_off(place.state, view) or self._come_back(view)
        spot, bend = found
        bearing, goal = math.atan2(bend[1] - pose.y, bend[0] - pose.x), Goal(spot, bend)
        if math.dist((pose.x, pose.y), spot) < BARELY:
            self._back_off.end()
            return Choice(halted(self.spec.model), place.state, bearing, goal)
        if (back := self._backing_off(place.state, view)) is not None:
            return Choice(back.command, back.state, bearing, goal)
        if place.wander is not None:
            return Choice(self._steering.turning(pose, place.wander), place.state, place.wander)
        enough = CLEAR_SHARE * min(self.stride, math.dist((pose.x, pose.y), bend))
        targets = [bend, view.ground.centre(*start)]
        if place.lean is not None:
            targets = [place.lean, *targets]
        options = (
            _Option(target, min(enough, self._option(target, pose, bearing, goal).enough), bearing, goal)
            for target in targets
        )
        return self._take(options, place.state, view)

    def _come_back(self, view: View) -> Choice:
        """A step of a robot that is off the reachable points, back to them; it holds where no way leads there."""
        pose = view.pose
        spot = self.way_back.spot(pose.x, pose.y) if self.way_back.is_needed(pose.x, pose.y) else None
        if spot is None:
            return self._stand(State.HOLDING)
        bearing = math.atan2(spot[1] - pose.y, spot[0] - pose.x)
        return self._take(iter([self._option(spot, pose, bearing, Goal(spot, spot))]), State.DEAD_END, view)

    def _take(self, options: Iterator[_Option], state: str, view: View) -> Choice:
        """The first option that is good enough, else the one that leads farthest, else a way out of the dead end."""
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
            if farthest < BLOCKED_SHARE * self.stride:
                self._back_off.begin(view.tick, pose, self._neighbour(view), stuck=True)
                out = self._back_off.next(view.tick, pose, bumped=False)
                return Choice(out or halted(self.spec.model), State.DEAD_END)
        assert best is not None
        twist = self._steering.towards(pose, best.target)
        self._turns_to = best.bearing if twist.speed == 0.0 else None
        return Choice(twist, state, best.bearing, best.goal)

    def _backing_off(self, state: str, view: View) -> Choice | None:
        """The next step of a robot that backs off or has to begin; None for any other."""
        tick, pose = view.tick, view.pose
        if self._back_off.count(tick, view.bumped):
            self._back_off.begin(tick, pose, self._neighbour(view), stuck=False)
            twist = self._back_off.next(tick, pose, bumped=False)
        else:
            twist = self._back_off.next(tick, pose, view.bumped)
        if twist is None:
            return None
        self._turns_to = None
        return Choice(twist, State.DEAD_END if self._back_off.stuck else state)

    def _neighbour(self, view: View) -> Spot | None:
        """Where the nearest other robot is, x and y in m; None where nobody is close."""
        pose = view.pose
        gap, number = nearest(pose, view.peers, view.radii)
        near = gap <= self.spec.radius + self._near
        return (view.peers[number].pose.x, view.peers[number].pose.y) if near else None

    def _option(self, target: Spot, pose: Pose, bearing: float, goal: Goal) -> _Option:
        """A target that may lie within a step."""
        enough = CLEAR_SHARE * min(self.stride, math.dist((pose.x, pose.y), target))
        return _Option(target, enough, bearing, goal)

    def _steer(self, command: Command, state: str, pose: Pose) -> Choice:
        """A policy's own command, unless it leads into a wall."""
        if not isinstance(command, Twist):
            raise PolicyFailed(f"returned Steer({type(command).__name__}) for a differential robot; give a Twist")
        wanted = command.limited(self.spec.limits)
        return Choice(wanted, state) if self._steering.is_free(pose, wanted) else self._stand(State.HOLDING)

    def _stand(self, state: str) -> Choice:
        return Choice(halted(self.spec.model), state)
