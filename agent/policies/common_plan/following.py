"""Taking part in the common plan: a robot does what its own part of the plan does.

- *On the plan* it repeats the planned robot's steps, and makes up for where it is a little off.
- *Off the plan*, as after it gave way to another one, it drives to the first place of its part where it is in time.
- *Others* that were on the plan when they were heard last are where the plan has them, whatever has been lost since.
- *Who lives* (`agent.policies.living`) is what is heard. When it changes, all go over to the plan of the robots that
  live, which is the same for all that work it out, since it begins on the hour.

So with nothing heard at all, a fleet that lives keeps the plan, and its robots pass each other. Choices are free while
a plan is worked out up to now, while no way leads on, and for a robot that would wait long for the plan, as where a
door has been closed.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING
from weakref import WeakValueDictionary

import numpy as np

from agent.policies.common_plan.missed import Missed
from agent.policies.common_plan.others import Others
from agent.policies.common_plan.plan import CommonPlan
from agent.policies.common_plan.tracking import keep_to
from agent.policies.pursuit import TRIES, Leg, Target
from agent.routes.routes import Way
from patrol.pose import Pose

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from agent.policies.commitment import Choice
    from agent.policies.common_plan.stations import Group
    from agent.policies.pursuit import GivenUp, Pursuit
    from agent.ports import PolicySetup
    from agent.routes.routes import Element
    from agent.view import View
    from patrol.pose import Command
    from patrol.radio.peers import Peer


HOUR_S = 3600.0
"""Time after which plans begin anew, s: a robot that joins has no more of one to work out."""

CATCH_UP = 20
"""Ticks of a plan that are worked out in a tick, until it has caught up."""

MOST_PLANS = 4
"""Plans that a robot goes on with, such as that of all robots while one is silent."""

OFF = 1.0
"""A robot is on the plan where it is at most so many strides away from where the plan has it; on wheels, where the root
of the squared distance in strides and the squared turn in rad is at most that."""

LATE, MEET = 0.4, 0.1
"""How far behind the plan a robot may be while it is on it, and when it comes back to it, in times between two robots
on the tour. At first it comes to it in time."""

FREE = 0.25
"""A robot that would wait for so long for the plan chooses freely meanwhile, in the same."""

STANDS = 1e-3
"""Cost of each tick behind the plan, so that a robot does not stand as long as the plan's robot stood."""

AHEAD = 4
"""Ticks ahead on the plan of the place to which a robot drives that cannot do as planned."""

NEAR = 0.25
"""Distance at which a robot waits for the plan, in strides."""


class OnPlan:
    """The choice of one robot's targets by its part in the common plan."""

    def __init__(self, setup: PolicySetup, free: Choice, since: int) -> None:
        """Begin without a plan; ``since`` is the tick from which on the stations are shared."""
        self._setup, self._free, self._since = setup, free, since
        spec, self._step = setup.robot.spec, setup.fleet.step
        self._number = spec.number
        self._made: WeakValueDictionary[tuple[object, ...], CommonPlan] = setup.ground.scratch.setdefault(
            "plans", WeakValueDictionary()
        )
        self._turns_freely = spec.model == "holonomic"
        self._plans: dict[tuple[object, ...], CommonPlan] = {}  # the latest ones
        self._plan: CommonPlan | None = None
        self._others: Others | None = None
        self._missed: Missed | None = None
        self._done = 0  # the plan's last tick at which the robot was
        self._begun = 0  # tick at which this robot has begun to work it out
        self._at = 0  # the plan's tick at which the robot is, or from which on it may go on
        self._is_on = self._was_on = self.waits = False
        self._target: Target | None = None  # None for free choices

    def forget(self) -> None:
        """Go on where the plan is now."""
        self._plan = self._target = None
        self.waits = False

    def note(self, view: View, pursuit: Pursuit, group: Group) -> bool:
        """Go on with the plan of a group; return True if the robot chooses freely."""
        plan, was_free = self._find_plan(view, group), self._target is None
        if plan is not self._plan:
            self._plan, self._others = plan, Others(plan, self._number)
            self._missed = Missed(self._setup, plan, self._number)
            self._begun, self._at, self._is_on, self._was_on = view.tick, view.tick, False, False
        self.waits = False
        self._target = self._go_on(plan, view, pursuit.given_up)
        target, before = self._target, pursuit.target
        if target is None:
            pursuit.target = None if not was_free else before
        elif target.leg is not None or before is None or before.point != target.point:
            pursuit.target = None
        return self._target is None

    def next(self, view: View, start: Element, pursuit: Pursuit) -> Way | None:
        """Commit to the next place of the plan, and return the way there, or that of a free choice."""
        if (target := self._target) is not None:
            if (leg := target.leg) is not None and leg.step is not None:
                pursuit.target = target
                return Way(leg.spot, leg.spot, math.dist(leg.spot, (view.pose.x, view.pose.y)))
            if (way := pursuit.go_to(view, start, target)) is not None:
                return way
            # No way leads there now, as through a closed door; perhaps one leads to where the plan goes on.
            pursuit.given_up.add(view.tick, target.stand)
            self._at += AHEAD
        return self._free.next(view, start, pursuit)

    def _find_plan(self, view: View, group: Group) -> CommonPlan:
        known, robots = group.known, tuple(sorted(group.robots))
        hour = round(HOUR_S / self._step)
        origin = max(view.tick // hour * hour, self._since)
        question = (id(known), robots, origin)
        plan = self._plans.pop(question, None) or self._made.get(question)
        if plan is None:
            roster = self._setup.fleet.roster
            plan = CommonPlan(self._setup, known, [roster[number - 1] for number in robots], origin)
            self._made[question] = plan
        self._plans[question] = plan
        if len(self._plans) > MOST_PLANS:
            del self._plans[next(iter(self._plans))]
        return plan

    def _go_on(self, plan: CommonPlan, view: View, given_up: GivenUp) -> Target | None:
        """Return where the robot goes by the plan; None if it has not caught up, or the robot is ahead of it."""
        tick = view.tick
        until = plan.origin + CATCH_UP * (tick - self._begun + 1)
        if plan.tick <= tick and until <= tick:
            plan.advance_to(until)
            self._at = tick
            return None
        plan.advance_to(tick + 1)
        assert self._others is not None
        assert self._missed is not None
        others = self._others.note(view)
        late = LATE if self._is_on else MEET if self._was_on else 0.0
        # A tick more, since a robot comes to a place somewhere between two ticks.
        self._at = max(self._at, tick - round(late * plan.interval_s / self._step) - 1, plan.since)
        self._is_on = self._find_place(plan, view)
        if self._is_on:
            if self._was_on:
                self._missed.skip(self._done + 1, self._at, view)
            self._was_on, self._done = True, self._at
        if (missed := self._missed.find(view, given_up)) is not None:
            self._is_on = False
            return missed
        return self._keep_to(plan, view, others) if self._is_on else self._meet(plan, view, others)

    def _find_place(self, plan: CommonPlan, view: View) -> bool:
        """Note at which of the plan's ticks the robot is; return False if it is off the plan."""
        # The plan may pass the same place again, so one that is on it goes on step by step.
        until = min(self._at + 3, view.tick + 1) if self._is_on else view.tick + 1
        poses = plan.poses(self._number, self._at, until)
        if not len(poses):
            return False
        off = ((poses[:, :2] - (view.pose.x, view.pose.y)) ** 2).sum(axis=1) / view.stride**2
        if not self._turns_freely:
            off += ((poses[:, 2] - view.pose.heading + math.pi) % math.tau - math.pi) ** 2
        nearest = int((off + STANDS * np.arange(len(poses))[::-1]).argmin())
        if off[nearest] > OFF**2:
            return False
        self._at += nearest
        after = plan.poses(self._number, self._at + 1, self._at + 2)[0, :2]
        if math.dist(after, (view.pose.x, view.pose.y)) > view.stride and self._at > plan.since:
            # Too far behind for the next place, so it comes to this one first, and sees what is seen from there.
            self._at -= 1
        return True

    def _keep_to(self, plan: CommonPlan, view: View, others: Mapping[int, Peer] | None) -> Target:
        """Return a place of the plan a little ahead, with the step that leads there."""
        poses = plan.poses(self._number, self._at, min(self._at + AHEAD, plan.tick) + 1)
        planned, command = Pose(*poses[0].tolist()), plan.command(self._number, self._at)
        step = keep_to(view.pose, planned, command, view.spec, self._step)
        return _make_target(view, poses[-1], step, others)

    def _meet(self, plan: CommonPlan, view: View, others: Mapping[int, Peer] | None) -> Target | None:
        """Return the first place of the plan to which the robot gets in time; None where it would wait there."""
        plan.advance_to(min(view.tick + round(plan.interval_s / self._step), plan.tick + CATCH_UP))
        poses = plan.poses(self._number, self._at, plan.tick + 1)
        late = MEET * plan.interval_s / self._step if self._was_on else 0.0
        away = np.sqrt(((poses[:, :2] - (view.pose.x, view.pose.y)) ** 2).sum(axis=1)) / view.stride
        early = np.arange(self._at, plan.tick + 1) - view.tick - away  # ticks, if all ways were straight
        first, around = 0, 0.0
        for _ in range(TRIES):
            later = np.flatnonzero(early[first:] >= around - late)
            first = first + int(later[0]) if later.size else len(poses) - 1
            way = view.way((float(poses[first, 0]), float(poses[first, 1])))
            around = 0.0 if way is None else way.length / view.stride - float(away[first])
            if early[first] >= around - late or first == len(poses) - 1:
                break
        if (early[first] - around) * self._step > FREE * plan.interval_s:
            return None
        self.waits = bool(away[first] <= NEAR and early[first] > 0.0)
        return _make_target(view, poses[first], None, others)


def _make_target(
    view: View, pose: NDArray[np.float64], step: Command | None, others: Mapping[int, Peer] | None
) -> Target:
    """Return the place of a pose of the plan as a target."""
    spot = float(pose[0]), float(pose[1])
    return Target(view.point_of(spot), view.point_of(spot), 0, leg=Leg(spot, step, others))
