"""Taking part in the common plan: a robot does what its own part of the plan does.

- *On the plan* it repeats the planned robot's steps, and makes up for where it is a little off.
- *Off the plan*, as after it gave way to another one, it drives to the first place of its part where it is in time.
- *Others* that were on the plan when they were heard last are where the plan has them, whatever has been lost since.
- *Too slow*: a robot that falls behind again and again chooses freely until the plan begins anew, on the hour.

So with nothing heard at all, more than two robots that live keep the plan, and pass each other. Choices are also free
while a plan is worked out up to now, while no way leads on, and for a robot that would wait long for the plan, as where
a door has been closed. When a spare robot joins, all go over to the plan with it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING
from weakref import WeakValueDictionary

import numpy as np

from agent.policies.common_plan.missed import Missed
from agent.policies.common_plan.others import LATE, Others
from agent.policies.common_plan.plan import CommonPlan
from agent.policies.common_plan.tracking import keep_to
from agent.policies.pursuit import TRIES, Leg, Target
from agent.routes.routes import Way
from patrol.latest import latest
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
"""Ticks of a plan that are worked out in a tick, until it is worked out for a time between two robots ahead."""

MOST_PLANS = 4
"""Plans that a robot goes on with, such as that without a spare robot while it is silent."""

OFF = 1.0
"""A robot is on the plan where it is at most so many strides away from where the plan has it; on wheels, where the root
of the squared distance in strides and the squared turn in rad is at most that."""

MEET = 0.1
"""How far behind the plan a robot that was on it may be when it comes back to it, in times between two robots on the
tour. At first it comes to it in time."""

FREE, LONGEST_WAIT_S = 0.25, 20.0
"""A robot that would wait for so long for the plan chooses freely meanwhile, in the same and in s: others would take it
for stuck."""

STANDS = 1e-3
"""Cost of each tick behind the plan, so that a robot does not stand as long as the plan's robot stood."""

AHEAD = 4
"""Ticks ahead on the plan of the place to which a robot drives that cannot do as planned."""

BEHIND = 2.0
"""A robot that falls behind the plan twice within so many times between two robots on the tour is too slow for it."""

NEAR = 0.25
"""Distance at which a robot waits for the plan, in strides."""


@dataclass(slots=True, eq=False)
class Followed:
    """A plan with which a robot goes on, and where it is on it."""

    plan: CommonPlan
    others: Others
    until: int  # the tick up to which this robot has worked it out, whatever others have
    at: int  # the plan's tick at which the robot is, or from which on it may go on
    done: int = 0  # the last tick of the plan at which the robot was, or which it has noted as missed
    is_on: bool = False
    was_on: bool = False
    fell_behind: int | None = None  # the tick at which it did so last
    is_too_slow: bool = False  # this robot for the plan, so it chooses freely from then on


class OnPlan:
    """The choice of one robot's targets by its part in the common plan."""

    def __init__(self, setup: PolicySetup, free: Choice) -> None:
        """Begin without a plan."""
        self._setup, self._free = setup, free
        spec, self._step = setup.robot.spec, setup.fleet.step
        self._number = spec.number
        self._made: WeakValueDictionary[tuple[object, ...], CommonPlan] = setup.ground.scratch.setdefault(
            "plans", WeakValueDictionary()
        )
        self._missed = Missed(setup)
        self._turns_freely = spec.model == "holonomic"
        self._looks_aside = self._turns_freely and not setup.ground.sight.all_round
        self._plans: dict[tuple[object, ...], Followed] = {}  # the latest ones
        self._followed: Followed | None = None  # the one that the robot takes part in now
        self._target: Target | None = None  # None for free choices
        self.waits = False

    def forget(self) -> None:
        """Go on where the plan is now."""
        self._followed = self._target = None
        self.waits = False

    def note(self, view: View, pursuit: Pursuit, group: Group) -> bool:
        """Go on with the plan of a group; return True if the robot chooses freely."""
        latest_followed, was_free = self._followed, self._target is None
        followed = self._followed = self._find_plan(view, group)
        self.waits = False
        self._target = self._go_on(followed, view, pursuit.given_up, goes_on=followed is latest_followed)
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
            pursuit.given_up.add(view.tick, target.stand)
            if leg is not None and (followed := self._followed) is not None:
                # No way leads there now, as through a closed door; perhaps one leads to where the plan goes on.
                followed.at = min(followed.at + AHEAD, followed.until)
        return self._free.next(view, start, pursuit)

    def _find_plan(self, view: View, group: Group) -> Followed:
        known, robots, hour = group.known, tuple(sorted(group.robots)), round(HOUR_S / self._step)
        origin = view.tick // hour * hour

        def begin() -> Followed:
            plan = self._made.get((known, robots, origin))
            if plan is None:
                roster = self._setup.fleet.roster
                plan = CommonPlan(self._setup, known, [roster[number - 1] for number in robots], origin)
                self._made[known, robots, origin] = plan
            return Followed(plan, Others(plan, self._number), origin, view.tick)

        return latest(self._plans, (known, robots, origin), begin, MOST_PLANS)

    def _go_on(self, followed: Followed, view: View, given_up: GivenUp, *, goes_on: bool) -> Target | None:
        """Return where the robot goes by the plan; None if it has not caught up, or the robot is ahead of it."""
        plan, missed, tick = followed.plan, self._missed, view.tick
        if followed.is_too_slow:
            return None
        missed.take_up(plan, tick)
        interval = round(plan.interval_s / self._step)
        followed.until = min(followed.until + CATCH_UP, tick + interval)
        plan.advance_to(followed.until)
        if followed.until <= tick:
            followed.at = tick
            return None
        others = followed.others.note(view)
        late = LATE if followed.is_on else MEET if followed.was_on else 0.0
        # A tick more, since a robot comes to a place somewhere between two ticks.
        earliest = tick - round(late * interval) - 1
        # A robot that comes back to the plan was not slow meanwhile.
        is_behind = goes_on and followed.is_on and followed.at < earliest
        followed.at = max(followed.at, earliest, plan.origin)
        followed.is_on = self._find_place(followed, view)
        if is_behind and not followed.is_on:
            before, followed.fell_behind = followed.fell_behind, tick
            followed.is_too_slow = before is not None and tick - before <= BEHIND * interval
        if followed.is_on:
            if not followed.was_on:
                followed.done = followed.at
            first = max(followed.done + 1, tick - interval)
            until = min(followed.at, first + CATCH_UP)
            missed.skip(first, until, view)
            followed.done = followed.at if until == followed.at else until - 1
            followed.was_on = True
        # What the plan shows next is known once it has been worked out so far.
        is_worked_out = followed.until == tick + interval
        if is_worked_out and (target := missed.find(view, given_up)) is not None:
            followed.is_on = False
            return target
        return self._keep_to(followed, view, others) if followed.is_on else self._meet(followed, view, others)

    def _find_place(self, followed: Followed, view: View) -> bool:
        """Note at which of the plan's ticks the robot is; return False if it is off the plan."""
        # The plan may pass the same place again, so one that is on it goes on step by step.
        until = min(followed.at + 3, view.tick + 1) if followed.is_on else view.tick + 1
        poses = followed.plan.poses(self._number, followed.at, until)
        if not len(poses):
            return False
        off = ((poses[:, :2] - (view.pose.x, view.pose.y)) ** 2).sum(axis=1) / view.stride**2
        if not self._turns_freely:
            off += ((poses[:, 2] - view.pose.heading + math.pi) % math.tau - math.pi) ** 2
        nearest = int((off + STANDS * np.arange(len(poses))[::-1]).argmin())
        if off[nearest] > OFF**2:
            return False
        followed.at += nearest
        after = followed.plan.poses(self._number, followed.at + 1, followed.at + 2)[0, :2]
        if math.dist(after, (view.pose.x, view.pose.y)) > view.stride and followed.at > followed.plan.origin:
            # Too far behind for the next place, so it comes to this one first, and sees what is seen from there.
            followed.at -= 1
        return True

    def _keep_to(self, followed: Followed, view: View, others: Mapping[int, Peer] | None) -> Target:
        """Return a place of the plan a little ahead, with the step that leads there."""
        plan, at = followed.plan, followed.at
        poses = plan.poses(self._number, at, min(at + AHEAD, followed.until) + 1)
        planned, command = Pose(*poses[0].tolist()), plan.command(self._number, at)
        step = keep_to(view.pose, planned, command, view.spec, self._step)
        heading = float(poses[min(1, len(poses) - 1), 2]) if self._looks_aside else None
        return _make_target(view, poses[-1], step, others, heading)

    def _meet(self, followed: Followed, view: View, others: Mapping[int, Peer] | None) -> Target | None:
        """Return the first place of the plan to which the robot gets in time; None where it would wait there."""
        plan = followed.plan
        poses = plan.poses(self._number, followed.at, followed.until + 1)
        late = MEET * plan.interval_s / self._step if followed.was_on else 0.0
        away = np.sqrt(((poses[:, :2] - (view.pose.x, view.pose.y)) ** 2).sum(axis=1)) / view.stride
        early = np.arange(followed.at, followed.until + 1) - view.tick - away  # ticks, if all ways were straight
        first, around = 0, 0.0
        for _ in range(TRIES):
            later = np.flatnonzero(early[first:] >= around - late)
            first = first + int(later[0]) if later.size else len(poses) - 1
            way = view.way((float(poses[first, 0]), float(poses[first, 1])))
            around = 0.0 if way is None else way.length / view.stride - float(away[first])
            if early[first] >= around - late or first == len(poses) - 1:
                break
        if (early[first] - around) * self._step > min(FREE * plan.interval_s, LONGEST_WAIT_S):
            return None
        self.waits = bool(away[first] <= NEAR and early[first] > 0.0)
        return _make_target(view, poses[first], None, others)


def _make_target(
    view: View,
    pose: NDArray[np.float64],
    step: Command | None,
    others: Mapping[int, Peer] | None,
    heading: float | None = None,
) -> Target:
    """Return the place of a pose of the plan as a target."""
    spot = float(pose[0]), float(pose[1])
    return Target(view.point_of(spot), view.point_of(spot), 0, leg=Leg(spot, step, others, heading))
