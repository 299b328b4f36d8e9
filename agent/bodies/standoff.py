"""Stand-offs: the way out for a robot that does not get on, from positions alone.

Theory of operation
===================

A robot does not get on where its move was cancelled (a *bump*), where it stopped before it would have touched another
robot, or where no step leads on (a *dead end*). It counts these; those within `CALM_S` of each other add up. Its
`Situation` says which robot is in its way, and how often. Its `Role` follows from the situation and from the moves that
its body has: `ROLES` is the table. For example, a car that bumps into a robot with a lower number gives way.

In a corridor that is too narrow for two, one of two robots has to go back to where the other gets past it:

      +------+              +------+
      |      +--------------+      |        1 and 2 have met in the corridor. 2 has less far to go back to a place
      |              1 > < 2     R |        where it blocks no other robot (R), so it goes there (GOES_BACK). 1 follows
      |      +--------------+      |        it, and drives past it as soon as there is room (GOES_FIRST).
      +------+              +------+

A place is a *refuge* where a robot that stands there parts the ground around it into no two pieces: not in a corridor
or a doorway, but at the side of a room, in a corner, or at a dead end. Both robots know the ground and both positions,
so both find nearly the same refuges for both of them, and mostly take roles that fit. Where they do not, they bump
again, and settle anew: within `AGAIN_S` the numbers decide.

These rules always hold:

- A robot has one role at a time. Besides, it may give way to several others, each for a time of its own, and it goes on
  in its role after it has backed off.
- Of a pair one robot gives way or goes back, and the other does not, as long as both hear each other.
- Each role ends by itself: after a time, or when the other robot has gone, or stood still for `STILL_S`. So a position
  that is wrong or forged holds no robot for good.
- Times and directions are drawn where two robots in step would block each other for ever.
- Only the nearest other robot is considered: a third one behind the one that goes back is not. If it is in the way,
  they bump, until one backs off.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from agent.ports import Intent, Place
from agent.routes.ground import Ground
from agent.routes.routes import Routes
from agent.routes.waiting import parts_around
from patrol.pose import TAU
from patrol.radio.peers import places_of
from patrol.random import Purpose

if TYPE_CHECKING:
    from agent.bodies.setup import BodySetup
    from agent.routes.ground import Disc, Spot
    from agent.view import View
    from patrol.pose import Pose
    from patrol.radio.peers import Peer

CALM_S = 3.0
"""Bumps and dead ends further apart than this do not add up, s: time to drive a few lengths of a body."""

AGAIN = 2
"""Number of bumps after which a robot no longer expects the other to move: it drives round it."""

OFTEN = 3
"""Bumps or dead ends after which a robot leaves the place: one more than two robots may need to agree."""

GIVES_WAY_S = 3.0, 10.0
"""Bounds of how long a robot gives way, s: as long as two need to pass each other, or to find another way."""

BACKS_OFF_S = 3.0
"""A robot backs off by at most so much, s at top speed: far enough for another to get past; or by less, because a short
step leads out where a full one always bumps."""

TRIES = 8
"""Number of places drawn to back off to, of which the first with room for half a step is taken."""

FARTHEST_M = 40.0
"""Longest way back to a refuge, m."""

STILL_S = 4.0
"""After the other robot has stood still for so long, a robot goes on its own way again, s; and one that has bumped in
each tick for so long gives way itself."""

STILL = 0.1
"""A robot stands still if it moves by less than this share of a stride in a tick."""

LONGEST_S = 60.0
"""Longest time without a new bump for which a robot goes back or goes first, s: more than `FARTHEST_M` takes."""

AGAIN_S = 20.0
"""Two robots that block each other again within this time let their numbers decide, s."""

PAST = 4.0
"""A robot that goes first has got past the other once they are so many strides apart, besides their bodies."""

AROUND = 3
"""Thickness of the ground around a robot in a refuge that must hold together, points."""

ROUNDING_M = 1e-6
"""Largest error of a distance that was computed in arrays, m."""

# --- situations, moves and roles -------------------------------------------------------------------------------------

Situation = Enum("Situation", "LOWER HIGHER UNMOVED AGAIN OWN_REFUGE OTHERS_REFUGE NO_REFUGE DEAD_END OFTEN")
Moves = Enum("Moves", "SIDEWAYS ON_THE_SPOT ALONG_ARCS AS_PRINTED")
Role = Enum("Role", "GOES_ON GIVES_WAY GOES_FIRST GOES_BACK BACKS_OFF TURNS_OUT")


def _read_roles(table: str) -> Mapping[tuple[Situation, Moves], Role]:
    """Read a table: a row for each situation, a column for each kind of moves."""
    head, *rows = [line.split() for line in table.strip().splitlines()]
    columns = list(enumerate(head, 1))
    return {(Situation[row[0]], Moves[moves]): Role[row[column]] for row in rows for column, moves in columns}


ROLES = _read_roles(
    """
                   SIDEWAYS    ON_THE_SPOT ALONG_ARCS  AS_PRINTED
    LOWER          GIVES_WAY   GIVES_WAY   GIVES_WAY   GIVES_WAY    a way leads round a robot with a lower number
    HIGHER         GOES_ON     GOES_ON     GOES_ON     GOES_ON      round one with a higher number, which gives way
    UNMOVED        GIVES_WAY   GIVES_WAY   GIVES_WAY   GIVES_WAY    the same, but it has not got out of the way for long
    AGAIN          GOES_FIRST  GOES_FIRST  GOES_FIRST  GOES_FIRST   round another, which is in the way again
    OWN_REFUGE     GOES_BACK   GOES_BACK   GOES_BACK   GOES_BACK    no way leads round, and the own refuge is nearer
    OTHERS_REFUGE  GOES_FIRST  GOES_FIRST  GOES_FIRST  GOES_FIRST   no way leads round, and the other's is nearer
    NO_REFUGE      GOES_ON     GOES_ON     GOES_ON     GOES_ON      no way leads round, and neither has a refuge
    DEAD_END       GOES_ON     BACKS_OFF   TURNS_OUT   TURNS_OUT    no step leads on
    OFTEN          GOES_ON     BACKS_OFF   BACKS_OFF   TURNS_OUT    bumps and dead ends follow each other
    """
)
"""The role in each situation. A body that moves sideways takes random steps after bumps, and so backs off by itself;
one that turns on the spot leaves a dead end as it likes; a car has to turn out of it, as in the paper."""


class StandOff:
    """One robot's way out when it does not get on. Call `obstacles` first in each tick."""

    def __init__(self, setup: BodySetup, moves: Moves) -> None:
        self.role = Role.GOES_ON
        self.count = 0  # of bumps and dead ends that follow each other
        self._number = setup.spec.number
        self._radii = setup.radii
        self._speed = setup.spec.speed
        self._stride = setup.spec.speed * setup.step
        self._step = setup.step
        self._ground = setup.ground
        self._chance = setup.chance
        self._considers_others = setup.patrol.give_way
        self._moves = moves
        self._counted_at = 0
        self._bumps_since = 0  # without a break
        self._gives_way_until: dict[int, int] = {}
        self._settled: dict[int, tuple[int, Situation]] = {}  # by the other robot: when last, and how
        self._place: Place | None = None
        self._other = 0
        self._away: Spot | None = None  # to where the robot backs off
        self._left = -1  # the tick in which it began to
        self._refuge: Spot = (0.0, 0.0)
        self._begun = 0
        self._seen: Spot = (0.0, 0.0)  # where the other robot was when it last moved
        self._moved_at = 0
        self._expected: int | None = None

    # --- what a body tells and asks ----------------------------------------------------------------------------------

    def obstacles(self, tick: int, pose: Pose, bumped: bool, peers: Mapping[int, Peer]) -> list[Disc]:
        """Take in whether the last move was cancelled; return the discs of the robots that this one gives way to."""
        # The earliest tick in which a row of bumps can begin.
        if not bumped:
            self._bumps_since = tick + 1
        else:
            self._count_event(tick)
            if self._considers_others:
                self._give_way(tick, pose, peers)
            # It has bumped on its way back: the same spot would not be reached either.
            self._away = None
            if self.count % OFTEN == 0:
                self._begin_leaving(Situation.OFTEN, tick)
        giving_way = sorted(other for other, until in self._gives_way_until.items() if tick < until)
        return [self._make_disc(pose, peers[other].pose, other) for other in giving_way]

    def lead(self, intent: Intent, view: View) -> Intent:
        """Return where to go instead of a place, or the intent itself where no robot is in the way."""
        self._place = target = intent if isinstance(intent, Place) and view.start is not None else None
        if target is None or not self._considers_others:
            return intent
        # Before a bump is judged: a role that is over must not decide what to do about it.
        if self.is_settled and self._is_over(view):
            self.role = Role.GOES_ON
        # A bump on the way back changes nothing about which refuge is nearer, so the role stays.
        if view.bumped and self.role is not Role.GOES_BACK:
            self._settle_role(target, view, self._in_reach(view.pose, view.peers))
        return self._act_in_role(target, view)

    def meet(self, place: Place, other: int, view: View) -> Place:
        """Settle with a robot that comes towards this one where they cannot pass, and return where to go."""
        self._settle_role(place, view, other)
        return self._act_in_role(place, view)

    def meet_dead_end(self, tick: int) -> Role:
        """Count a dead end, and return the role in it."""
        self._count_event(tick)
        return self._begin_leaving(Situation.OFTEN if self.count % OFTEN == 0 else Situation.DEAD_END, tick)

    def backs_off_to(self, view: View, room: Callable[[Spot], float]) -> Spot | None:
        """Return where to a robot backs off that does so; None for any other.

        `room` returns how far the body gets in its next step towards a spot, m.
        """
        if self._away is None and self._left == view.tick:
            self._away = self._draw_spot(view, room)
        elif self._away is not None and view.tick - self._left >= BACKS_OFF_S / self._step:
            self._away = None
        return self._away

    def end(self) -> None:
        """Go on: the robot can back off no farther."""
        self._away = None

    @property
    def is_settled(self) -> bool:
        """True if the robot has settled with another one which of them goes first."""
        return self.role in (Role.GOES_FIRST, Role.GOES_BACK)

    def keeps_happening(self, tick: int) -> bool:
        """Return True if bumps and dead ends have lately followed each other."""
        return self.count > 1 and tick - self._counted_at <= CALM_S / self._step

    # --- bumps and dead ends -----------------------------------------------------------------------------------------

    def _count_event(self, tick: int) -> None:
        self.count = self.count + 1 if tick - self._counted_at <= CALM_S / self._step else 1
        self._counted_at = tick

    def _begin_leaving(self, situation: Situation, tick: int) -> Role:
        """Begin to back off where that is the role; return the role."""
        role = ROLES[situation, self._moves]
        if role is Role.BACKS_OFF:
            self._away, self._left = None, tick
        return role

    def _draw_spot(self, view: View, room: Callable[[Spot], float]) -> Spot:
        """Return where to back off to, away from a robot that is near."""
        pose, tick = view.pose, view.tick
        other = self._in_reach(pose, view.peers)
        best, heading = -1.0, 0.0
        for index in range(TRIES):
            share = self._chance(Purpose.UNSTUCK, tick, index)
            direction = TAU * share
            if other is not None:
                other_pose = view.peers[other].pose
                # Within a quarter circle of straight away from it, so never towards it.
                direction = math.atan2(pose.y - other_pose.y, pose.x - other_pose.x) + (share - 0.5) * math.pi
            across, up = self._stride * math.cos(direction), self._stride * math.sin(direction)
            free = room((pose.x + across, pose.y + up))
            if free > best:
                best, heading = free, direction
            if free >= 0.5 * self._stride:
                break
        # The indices below have drawn the directions.
        way = BACKS_OFF_S * self._speed * self._chance(Purpose.UNSTUCK, tick, TRIES)
        return pose.x + way * math.cos(heading), pose.y + way * math.sin(heading)

    # --- other robots ------------------------------------------------------------------------------------------------

    def _give_way(self, tick: int, pose: Pose, peers: Mapping[int, Peer]) -> None:
        """Give way for a time to a robot that is near, or no longer where no way leads round it."""
        other = self._in_reach(pose, peers)
        if other is None:
            return
        if self._place is not None and self._is_blocked(self._place, pose, peers[other].pose, other):
            # No way leads round it, so to close the ground around it would leave no way at all.
            self._gives_way_until.pop(other, None)
            self._bumps_since = tick + 1
            return
        if ROLES[self._find_situation(tick, other), self._moves] is Role.GIVES_WAY:
            shortest_s, longest_s = GIVES_WAY_S
            # Drawn, so that two robots that give way do not come back in step.
            spell_s = shortest_s + (longest_s - shortest_s) * self._chance(Purpose.GIVE_WAY, tick)
            self._gives_way_until[other] = tick + round(spell_s / self._step)

    def _find_situation(self, tick: int, other: int) -> Situation:
        """Return the situation of a robot that has bumped into another one which a way leads round."""
        if other < self._number:
            return Situation.LOWER
        # It should have given way by now: it does not hear this robot, or has no room.
        return Situation.UNMOVED if tick - self._bumps_since >= STILL_S / self._step else Situation.HIGHER

    def _act_in_role(self, place: Place, view: View) -> Place:
        """Return where to go in the role that the robot has."""
        if not self.is_settled:
            return place
        other_pose = view.peers[self._other].pose
        if self.role is Role.GOES_BACK:
            if self._is_blocked(place, view.pose, other_pose, self._other):
                x, y = self._refuge
                # Bend, lean and wander belong to the way to the policy's own place.
                return replace(place, x=x, y=y, bend=None, lean=None, wander=None, exact=True)
            # A way leads round the other again, so this robot takes it.
            self.role = Role.GOES_FIRST
        # The disc closes the old way, so the bend has to be found anew.
        view.ground.close([self._make_disc(view.pose, other_pose, self._other)])
        return replace(place, bend=None, lean=None, wander=None)

    def _is_over(self, view: View) -> bool:
        """Return True if the other robot has gone, or has stood still for long."""
        if self._other not in view.peers or view.tick - self._begun > LONGEST_S / self._step:
            return True
        other_pose, here = view.peers[self._other].pose, view.pose
        spot = other_pose.x, other_pose.y
        # The other may have to wait until this robot is out of its way, so that it stands still means nothing yet.
        on_the_way = self.role is Role.GOES_BACK and math.dist((here.x, here.y), self._refuge) > self._stride
        if on_the_way or math.dist(spot, self._seen) > STILL * self._stride:
            self._moved_at = view.tick
        self._seen = spot
        farthest = FARTHEST_M if self.role is Role.GOES_BACK else PAST * self._stride
        if (
            math.dist(spot, (here.x, here.y))
            > self._sum_radii(self._other) + 0.5 * self._ground.terrain.point + farthest
        ):
            return True
        return view.tick - self._moved_at > STILL_S / self._step

    def _settle_role(self, place: Place, view: View, other: int | None) -> None:
        """Take the role that follows from another robot on the way to a place."""
        if other is None:
            return
        other_pose = view.peers[other].pose
        if self._is_blocked(place, view.pose, other_pose, other):
            # A robot not met before was settled with infinitely long ago.
            last, situation = self._settled.get(other, (-math.inf, Situation.HIGHER))
            lately = view.tick - last <= AGAIN_S / self._step
            # Two searches would find once more that neither has a refuge.
            if lately and situation is Situation.NO_REFUGE:
                return
            # The pose that others heard, not the true one, so that both robots compare the same two places.
            situation = self._compare_refuges(
                (view.reported.x, view.reported.y), (other_pose.x, other_pose.y), other, lately
            )
            self._settled[other] = view.tick, situation
        elif self.count >= AGAIN:
            situation = Situation.AGAIN
        else:
            self.role = Role.GOES_ON  # a robot that gives way has closed the ground around the other already
            return
        self.role = ROLES[situation, self._moves]
        self._other, self._seen = other, (other_pose.x, other_pose.y)
        self._begun = self._moved_at = view.tick

    def _compare_refuges(self, here: Spot, there: Spot, other: int, by_number: bool) -> Situation:
        """Find which of two robots has less far to a refuge, or by number where both have one; keep the own one."""
        own_way, other_way = self._way_to_refuge(here, there, other), self._way_to_refuge(there, here, other)
        # A number helps no robot that has nowhere to go back to.
        if own_way is None or other_way is None:
            by_number = False
        if own_way is not None:
            self._refuge = own_way[1]
        # Equal lengths leave it to the numbers below.
        lengths = [math.inf if way is None else 0.0 if by_number else way[0] for way in (own_way, other_way)]
        if lengths == [math.inf, math.inf]:
            return Situation.NO_REFUGE
        # The other robot compares the same pairs the other way round, so exactly one of the two goes back.
        is_own = (lengths[0], other) < (lengths[1], self._number)
        return Situation.OWN_REFUGE if is_own else Situation.OTHERS_REFUGE

    def _in_reach(self, pose: Pose, peers: Mapping[int, Peer]) -> int | None:
        """Return the number of the nearest robot if two strides lead into it."""
        gap, other = nearest(pose, peers, self._radii)
        return other if gap <= self._radii[self._number] + 2.0 * self._stride else None

    def _is_blocked(self, place: Place, pose: Pose, there: Pose, other: int) -> bool:
        """Return True if no way leads to a place round another robot."""
        row, col = self._ground.terrain.nearest_point(place.x, place.y)
        # Where no body can ever stand, it is not the other robot that is in the way.
        if not self._ground.static.open_now[row, col]:
            return False
        ground = self._close_disc(self._make_disc(pose, there, other))
        start = ground.join(pose.x, pose.y)
        if start is None:
            return True
        target = row + 1, col + 1
        way = Routes(ground).way(start, target, self._expected)
        # How far the next search has to look, with room for one more stride of each.
        self._expected = round(100.0 * (way.length + 2.0 * self._stride) / ground.terrain.point)
        # Where no way leads to the target, the result leads somewhere else.
        return way.place != ground.centre(*target)

    def _way_to_refuge(self, here: Spot, there: Spot, other: int) -> tuple[float, Spot] | None:
        """Return the length of the way to the nearest refuge, m, and its place; None where there is none.

        `here` is the robot that goes back, `there` the one that it lets through.
        """
        point, radii = self._ground.terrain.point, self._sum_radii(other)
        ground = self._close_disc(disc_round(there, here, radii, point))
        lengths = Routes(ground).lengths(here, FARTHEST_M)
        rows, cols = np.nonzero(np.isfinite(lengths))
        # Stable: points at the same length keep their order, on which the trace depends.
        order = np.argsort(lengths[rows, cols], kind="stable")
        rows, cols = rows[order], cols[order]
        # The nearest place of each square of a quarter of a radius stands for the square.
        side = max(1, round(0.25 * self._radii[self._number] / point))
        _, nearest_ones = np.unique(rows // side * lengths.shape[1] + cols // side, return_index=True)
        wide = radii / point + 1.5
        # Nearest first again: `unique` sorts by square.
        for index in np.sort(nearest_ones):
            row, col = int(rows[index]), int(cols[index])
            if len(parts_around(self._ground.static.open_now, (row, col), wide, math.ceil(wide) + AROUND)) == 1:
                return float(lengths[row, col]), ground.terrain.centre(row, col)
        return None

    def _close_disc(self, disc: Disc) -> Ground:
        """Return the ground with nothing closed but a disc."""
        return self._ground.static.over([disc])

    def _make_disc(self, here: Pose, there: Pose, other: int) -> Disc:
        return disc_round((there.x, there.y), (here.x, here.y), self._sum_radii(other), self._ground.terrain.point)

    def _sum_radii(self, other: int) -> float:
        """Return the radii of this robot and another together, m."""
        return self._radii[other] + self._radii[self._number]


# --- other robots' bodies --------------------------------------------------------------------------------------------


def nearest(pose: Pose, peers: Mapping[int, Peer], radii: Mapping[int, float]) -> tuple[float, int]:
    """Return the distance from the robot's centre to the nearest other body, m, and that robot's number.

    They are infinity and 0 where there is none. For example, 3 m from the centre of robot 2, which has a radius of
    0.5 m, they are 2.5 and 2.
    """
    if not peers:
        return math.inf, 0
    numbers, places = sorted(peers), places_of(peers)
    gaps = np.hypot(places[:, 0] - pose.x, places[:, 1] - pose.y) - [radii[number] for number in numbers]
    # Arrays round in ways of their own, so they only tell which robots are worth a closer look.
    # Negated, so that a gap which is not a number is kept; `fmin` passes it over.
    worth = np.flatnonzero(~(gaps > np.fmin.reduce(gaps) + ROUNDING_M))
    near = [(numbers[index], peers[numbers[index]].pose) for index in worth]
    return min(
        (math.hypot(other_pose.x - pose.x, other_pose.y - pose.y) - radii[number], number)
        for number, other_pose in near
    )


def disc_round(there: Spot, here: Spot, radii: float, point: float) -> Disc:
    """Return the disc around one robot, at `there`, that is closed to the centre of another, at `here`.

    It is as wide as both bodies together, but never covers the other robot's own point. For example, with `radii` of
    2 m and a `point` of 0.5 m it has a radius of 2.25 m where the robots are 10 m apart, and of 1.5 m where they are
    2 m apart. `radii` is the sum of both radii, `point` the side of the terrain's points, both in m.
    """
    # Short of the robot's own point, or it would stand on closed ground and find no way.
    apart = math.hypot(there[0] - here[0], there[1] - here[1]) - point
    return *there, max(0.0, min(radii + 0.5 * point, apart))
