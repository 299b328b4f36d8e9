"""The setup of every body, and what all bodies share: the goal along a bearing, and giving way."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from agent.bodies.giveway import GiveWay
from agent.bodies.goal import GoalFinder
from agent.bodies.keeping_right import KeepingRight
from agent.bodies.passing import Passing
from agent.ports import Bearing, Choice, Intent, Place, PolicyFailed, State, Stay, Steer
from agent.routes.ground import Disc, Ground
from agent.routes.way_back import WayBack
from patrol.pose import halted, is_halt, slowed
from patrol.random import Purpose

if TYPE_CHECKING:
    from agent.chance import Draw
    from agent.routes.ground import Spot
    from agent.view import View
    from patrol.pose import Command, Pose
    from patrol.radio.peers import Peer
    from patrol.scenario import BodyLengths, PatrolSpec, RobotSpec

CLEAR_SHARE = 0.5
"""A direction is good enough when the robot can make at least this share of a step in it."""

BLOCKED_SHARE = 0.1
"""A robot that can make less than this share of a step in every direction is in a dead end."""

MOST_STOPS = 4
"""So many times in a row a body stops before it would touch another; the other's position may be wrong, or forged."""

BARELY = 1e-3
"""A move shorter than this counts as none, m."""


@dataclass(frozen=True, slots=True)
class BodySetup:
    """The inputs from which a body is built."""

    spec: RobotSpec
    radii: Mapping[int, float]  # by robot number, of the whole fleet, m
    strides: Mapping[int, float]  # longest way in one step, likewise, m
    step: float  # s per tick
    patrol: PatrolSpec
    lengths: BodyLengths
    ground: Ground
    psi: NDArray[np.float32] | None  # float32 (h, w) of `psi_field`; None for no refinement of goals
    chance: Draw
    sees_all_round: bool  # the sensor sees the same whichever way the body faces


class BodyBase(ABC):
    """The part that all bodies share: goals, the way back, giving way, and a policy's own commands.

    `stride` is the longest way in one step, m.
    """

    command: ClassVar[type]
    """The class of the commands that the body obeys."""

    def __init__(self, setup: BodySetup) -> None:
        self.spec = setup.spec
        self.stride = setup.spec.speed * setup.step
        self.goals = GoalFinder(setup.lengths, setup.ground, setup.psi, setup.patrol.paper_rules)
        self.way_back = WayBack(setup.ground, setup.spec.radius, wanted=setup.patrol.manoeuvres)
        self._point = setup.ground.terrain.point
        gives = setup.patrol.give_way
        self._give_way: GiveWay | None = None
        self._passing: Passing | None = None
        self._keeping_right: KeepingRight | None = None
        if gives:
            number, radii, ground, step = setup.spec.number, setup.radii, setup.ground, setup.step
            self._give_way = GiveWay(number, partial(setup.chance, Purpose.GIVE_WAY), radii, step)
            self._passing = Passing(number, radii, ground, step, self.stride)
            self._keeping_right = KeepingRight(number, radii, setup.strides, ground, step)
        self._stops = 0

    def obstacles(self, tick: int, pose: Pose, bumped: bool, peers: Mapping[int, Peer]) -> Sequence[Disc]:
        """Return the robots that this one gives way to (`agent.ports.Body.obstacles`)."""
        if self._give_way is None or self._passing is None:
            return ()
        bumped = bumped or self._stops > 0
        blocker = self._passing.blocker(pose, peers) if bumped else None
        if blocker is None:
            self._give_way.update(tick, pose, bumped, peers, 2.0 * self.stride)
        else:
            self._give_way.stop(blocker)
        return self._give_way.discs(tick, pose, peers, self._point)

    def obey(self, intent: Intent, view: View) -> Choice:
        """Return the command that best carries out an intent (`agent.ports.Body.obey`)."""
        bumped = view.bumped
        if self._stops:
            view = replace(view, bumped=True)
        self.way_back.note(view.pose.x, view.pose.y)
        if self._keeping_right is not None:
            self._keeping_right.note(view)
        choice = self._choose(self._led(intent, view), view)
        right = self._keeping_right
        if right is None or is_halt(choice.command) or not (isinstance(intent, Place) and intent.gives_room):
            self._stops = 0
            return choice
        room = right.room(choice.command, view)
        if room > 0.0:
            self._stops = 0
            return replace(choice, command=slowed(choice.command, room * choice.command.speed_mps))
        self._stops = 1 if bumped else self._stops + 1
        return choice if self._stops > MOST_STOPS else replace(choice, command=halted(self.spec.model))

    def _choose(self, intent: Intent, view: View) -> Choice:
        """Return the command for an intent that has been led past others."""
        return self._carry_out(intent, view)

    def _led(self, intent: Intent, view: View) -> Intent:
        """Return the intent, or another one for a robot that has another one before it on its way to a place."""
        if self._passing is None or self._keeping_right is None:
            return intent
        led = self._passing.lead(intent, view)
        if self._passing.role is not None or not isinstance(led, Place) or not led.gives_room:
            return led
        past = self._keeping_right.past(led, view)
        return self._passing.meet(led, past, view) if isinstance(past, int) else past

    def _carry_out(self, intent: Intent, view: View) -> Choice:
        match intent:
            case Bearing():
                return self._bear(intent, view)
            case Place():
                return self._approach(intent, view)
            case Steer(command, state):
                if not isinstance(command, self.command):
                    robot = "car" if self.spec.model == "car" else f"{self.spec.model} robot"
                    given, wanted = type(command).__name__, self.command.__name__
                    raise PolicyFailed(f"returned Steer({given}) for a {robot}; give a {wanted}")
                allowed = self._allowed(view.pose, command.limited(self.spec.limits))
                return self._stand(State.HOLDING) if allowed is None else Choice(allowed, state)
            case Stay(state):
                return self._stay(state, view)

    @abstractmethod
    def _bear(self, intent: Bearing, view: View) -> Choice:
        """Take the first direction of an intent in which the body can move."""

    @abstractmethod
    def _approach(self, place: Place, view: View) -> Choice:
        """Take a step towards a place."""

    @abstractmethod
    def _allowed(self, pose: Pose, wanted: Any) -> Command | None:
        """Return a policy's own command, as far as it leads into no wall; None if it does from the start."""

    def _stay(self, state: str, view: View) -> Choice:
        """Stand still, in a state that the policy gives."""
        del view
        return self._stand(state)

    def _stand(self, state: str) -> Choice:
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
    return target, target if way.bend == way.place else way.bend
