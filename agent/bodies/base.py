"""The part that all bodies share: the goal along a bearing, and the moves in a stand-off.

A goal lies ahead of the robot, is clipped to the free ground, and refined (paper, step 7). As printed, the goal may lie
behind a wall, and so may the point that refinement chooses (`patrol.scenario.policies`).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from agent.bodies.keeping_right import KeepingRight
from agent.bodies.manoeuvre import Manoeuvres
from agent.bodies.setup import BodySetup
from agent.bodies.standoff import OFTEN, Moves, StandOff
from agent.bodies.steering import Footing, HolonomicSteering
from agent.kernels.goal import free_run, refine
from agent.ports import Bearing, Choice, Goal, Intent, Place, PolicyFailed, State, Stay, Steer
from agent.routes.ground import Disc, Ground
from agent.routes.way_back import WayBack
from patrol.pose import halted, is_halt, slowed
from patrol.scenario import BodyLengths
from patrol.scenario.policies import PaperRule

if TYPE_CHECKING:
    from agent.routes.ground import Spot
    from agent.view import View
    from patrol.pose import Command, Pose
    from patrol.radio.peers import Peer


class GoalFinder:
    """Finds the goal along a direction: the last free point of the ray up to the goal distance, then refined.

    Refinement takes the point with the lowest psi in a square around the goal (paper, "goal refinement"). Candidates
    are the points roughly in the chosen direction that a straight line reaches both from the goal and from the robot,
    since neither leg may cross a wall.
    """

    def __init__(
        self,
        lengths: BodyLengths,
        ground: Ground,
        psi: NDArray[np.float32] | None,
        paper_rules: Collection[PaperRule] = (),
    ) -> None:
        """Convert the distances to points; goals are not refined if `psi` is None.

        `psi` is that of `agent.psi.psi_field`. The paper's lengths are 5.5 m for the goal distance and 2 m
        for the side of the square. Of `paper_rules`, ``far-goal`` clips no goal, and ``whole-square`` refines to any
        point of the square.
        """
        self._clips = "far-goal" not in paper_rules
        self._whole_square = "whole-square" in paper_rules
        self._ground = ground
        self._psi = psi
        self._point = ground.terrain.point
        self._distance = lengths.goal_distance / self._point
        self._side = round(0.5 * lengths.refine_side / self._point)

    def along(self, bearing: float, row: int, col: int) -> Goal:
        """Return the goal in a direction (rad), before and after refinement.

        `row` and `col` are those of the robot's open element in `Ground.state`.
        """
        state = self._ground.state
        up, across = math.sin(bearing), math.cos(bearing)
        run = self._distance
        if self._clips:
            run = float(free_run(state, row + 0.5, col + 0.5, up, across, run))
        goal_row, goal_col = math.floor(row + 0.5 + run * up), math.floor(col + 0.5 + run * across)
        goal = self._ground.centre(goal_row, goal_col)
        if self._psi is None:
            return Goal(goal, goal)
        here, towards = (row + 0.5, col + 0.5), (up, across)
        best = refine(state, self._psi, goal_row, goal_col, *here, *towards, self._side, self._whole_square)
        return Goal(goal, goal if best < 0 else self._ground.centre(*divmod(int(best), state.shape[1])))


CLEAR_SHARE = 0.5
"""A direction is good enough when the robot can make at least this share of a step in it."""

BLOCKED_SHARE = 0.1
"""A robot that can make less than this share of a step in every direction is in a dead end."""

MOST_STOPS, MOST_STOPS_BACKING = 4, 2 * OFTEN
"""So many times in a row a body that moves sideways stops before it would touch another, and one that has to back off,
which by then has tried to twice; after that it drives, for the other's position may be wrong, or forged."""

BARELY = 1e-3
"""A move shorter than this counts as none, m."""


class BodyBase(ABC):
    """The part that all bodies share: goals, the way back, stand-offs, and a policy's own commands.

    `stride` is the longest way in one step, m.
    """

    command: ClassVar[type]
    """The class of the commands that the body obeys."""

    def __init__(self, setup: BodySetup, moves: Moves) -> None:
        spec, ground, step = setup.spec, setup.ground, setup.step
        self.spec = spec
        self.stride = spec.speed * step
        self.goals = GoalFinder(setup.lengths, ground, setup.psi, setup.patrol.paper_rules)
        self.way_back = WayBack(ground, spec.radius, wanted=setup.patrol.manoeuvres)
        self.footing = Footing(ground.terrain, ground, spec.radius, wanted=setup.patrol.manoeuvres)
        self.straight = HolonomicSteering(spec, ground.terrain, step, self.footing)
        self.stand_off = StandOff(setup, moves)
        self._point = ground.terrain.point
        self._keeping_right: KeepingRight | None = None
        if setup.patrol.give_way:
            self._keeping_right = KeepingRight(spec.number, setup.radii, setup.strides, ground, step)
        self.manoeuvres: Manoeuvres | None = None
        self._stops = 0
        self._most_stops = MOST_STOPS if moves is Moves.SIDEWAYS else MOST_STOPS_BACKING

    def obstacles(self, tick: int, pose: Pose, bumped: bool, peers: Mapping[int, Peer]) -> Sequence[Disc]:
        """Return the robots that this one gives way to (`agent.ports.Body.obstacles`)."""
        # A stop before a touch counts as a bump that was avoided.
        return self.stand_off.obstacles(tick, pose, bumped or self._stops > 0, peers)

    def obey(self, intent: Intent, view: View) -> Choice:
        """Return the command that best carries out an intent (`agent.ports.Body.obey`)."""
        bumped = view.bumped
        if self._stops:
            view = replace(view, bumped=True)
        self.way_back.note(view.pose.x, view.pose.y)
        if isinstance(intent, Place) and intent.others is not None:
            view = replace(view, peers=intent.others)
        if self._keeping_right is not None:
            self._keeping_right.note(view)
        if isinstance(intent, Place) and (step := self._take_step(intent, view)) is not None:
            self._stops = 0
            return step
        choice = self._back_off(view) if isinstance(intent, (Bearing, Place)) else None
        choice = choice or self._carry_out(self._replace_intent(intent, view), view)
        right = self._keeping_right
        if right is None or is_halt(choice.command) or not (isinstance(intent, Place) and intent.gives_room):
            self._stops = 0
            return choice
        room = right.room(choice.command, view)
        if room > 0.0:
            self._stops = 0
            command = slowed(choice.command, room * choice.command.speed_mps)
            return choice if command is choice.command else replace(choice, command=command)
        # A real bump shows that the other is there, so the patience with its position begins anew.
        self._stops = 1 if bumped else self._stops + 1
        return choice if self._stops > self._most_stops else replace(choice, command=halted(self.spec.model))

    def _take_step(self, place: Place, view: View) -> Choice | None:
        """Return the step that comes with a place; None without one, or with a wall or another robot in its way."""
        if place.step is None or view.bumped:
            return None
        step = self._limit_command(view.pose, self._of_own_kind(place.step, "Place").limited(self.spec.limits))
        right = self._keeping_right
        if step is None or (right is not None and right.room(step, view) < 1.0):
            return None
        if step.speed_mps < CLEAR_SHARE * place.step.speed_mps:
            return None
        self._forget_way()
        spot = place.x, place.y
        bearing = math.atan2(spot[1] - view.pose.y, spot[0] - view.pose.x)
        return Choice(step, place.state, bearing, Goal(spot, spot))

    def _forget_way(self) -> None:
        """Forget arcs that were found, since the body has gone another way."""
        if self.manoeuvres is not None:
            self.manoeuvres.drop()

    def _replace_intent(self, intent: Intent, view: View) -> Intent:
        """Return the intent, or another one for a robot that has another one before it on its way to a place."""
        led = self.stand_off.lead(intent, view)
        if self._keeping_right is None or self.stand_off.is_settled or not isinstance(led, Place) or not led.gives_room:
            return led
        past = self._keeping_right.past(led, view)
        # A number in place of a place: no short way leads past that robot.
        return self.stand_off.meet(led, past, view) if isinstance(past, int) else past

    def _back_off(self, view: View) -> Choice | None:
        """Return the next step of a robot that backs off; None for any other, and where it can go no farther."""
        spot = self.stand_off.backs_off_to(view, lambda spot: self._room_towards(spot, view))
        if spot is None:
            return None
        command = self._step_to(view.pose, spot)
        if is_halt(command):
            self.stand_off.end()
            return None
        return Choice(command, State.DEAD_END)

    def _leave_dead_end(self, view: View) -> Choice | None:
        """Count a dead end, and return the first step away where that is the role in it."""
        self.stand_off.meet_dead_end(view.tick)
        return self._back_off(view)

    def _room_towards(self, spot: Spot, view: View) -> float:
        """Return how far a straight step towards a spot leads, m, as far as the body's own step touches no robot."""
        share = 1.0 if self._keeping_right is None else self._keeping_right.room(self._step_to(view.pose, spot), view)
        return share * self.straight.reach(view.pose, spot)

    def _proceed_on_manoeuvre(self, state: str, view: View) -> Choice | None:
        """Return the next step of a manoeuvre that leads over places from which no route leads on, to its end."""
        if self.manoeuvres is None or view.bumped:
            return None
        command = self.manoeuvres.proceed(view.pose)
        return None if command is None else Choice(command, state)

    def _come_back(self, view: View) -> Choice:
        """A step of a robot that is off the reachable points, back to them; it holds where no way leads there."""
        pose = view.pose
        spot = self.way_back.spot(pose.x, pose.y) if self.way_back.is_needed(pose.x, pose.y) else None
        if spot is None:
            return self._make_halt(State.HOLDING)
        bearing = math.atan2(spot[1] - pose.y, spot[0] - pose.x)
        command = self._step_to(pose, spot)
        out = self._leave_dead_end(view) if is_halt(command) else None
        return out or Choice(command, State.DEAD_END, bearing, Goal(spot, spot))

    def _carry_out(self, intent: Intent, view: View) -> Choice:
        match intent:
            case Bearing():
                return self._take_bearing(intent, view)
            case Place():
                return self._approach_place(intent, view)
            case Steer(command, state):
                own = self._of_own_kind(command, "Steer")
                allowed = self._limit_command(view.pose, own.limited(self.spec.limits))
                return self._make_halt(State.HOLDING) if allowed is None else Choice(allowed, state)
            case Stay(state):
                return self._make_halt(state)

    def _of_own_kind(self, command: Command, intent: str) -> Command:
        """Return a command that came with an intent, which has to be of the kind that the body obeys."""
        if not isinstance(command, self.command):
            robot = "car" if self.spec.model == "car" else f"{self.spec.model} robot"
            given_name, wanted = type(command).__name__, self.command.__name__
            raise PolicyFailed(f"returned {intent}({given_name}) for a {robot}; give a {wanted}")
        return command

    @abstractmethod
    def _take_bearing(self, intent: Bearing, view: View) -> Choice:
        """Take the first direction of an intent in which the body can move."""

    @abstractmethod
    def _approach_place(self, place: Place, view: View) -> Choice:
        """Take a step towards a place."""

    @abstractmethod
    def _step_to(self, pose: Pose, spot: Spot) -> Command:
        """Return the step, forward or in reverse, that leads nearest to a spot; a halt where none does."""

    @abstractmethod
    def _limit_command(self, pose: Pose, wanted: Any) -> Command | None:
        """Return a policy's own command, as far as it leads into no wall; None if it does from the start."""

    def _make_halt(self, state: str) -> Choice:
        return Choice(halted(self.spec.model), state)


def way_of(place: Place, view: View) -> tuple[Spot, Spot] | None:
    """Return the target of a `Place` intent and the first bend of the way there.

    A place that no way leads to is replaced by the nearest reachable one. The result is None for a robot that is off
    the ground.
    """
    if view.start is None:
        return None
    spot = place.x, place.y
    if place.bend is not None:
        return spot, place.bend
    way = view.way(spot)
    assert way is not None
    exact = view.ground.terrain.point_at(*way.place) == view.ground.terrain.point_at(*spot)
    target = spot if exact else way.place
    # Without a bend the way ends at the target itself, not at the centre of its point.
    return target, target if way.bend == way.place else way.bend
