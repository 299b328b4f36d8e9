"""Keeping right: how robots that are about to meet pass each other before they touch, from positions alone.

Each robot takes the others to be where it last heard them, and to go on as they moved before that. Two that go on like
that, and would touch within a few steps, both keep right:

    -----------------------------
           _____.--> 2   <           1 sees 2 coming. It closes, for itself and for this tick, the place where 2 will be
      1 >      x x x                 when they meet, and a barrier from there to its own left (x). So its way leads past
    -----------------------------    on its right. That of 2 leads past on the right of 2, which is the other side.

- *Right of both* says the same to both robots, so they need not agree on anything else.
- At first each tries to leave the other all the room that it needs; where walls do not allow that, half of it, so that
  two robots fit through a corridor of little more than two bodies.
- A robot that stands still is gone round on either side.
- Where no way leads past, or only a long one, the robots settle at once which of them goes back
  (`agent.bodies.standoff`).

Each step keeps to the robot's own side of a line between it and each other robot that is near. Both find the same line
from the last movements of both, so two robots that do so never touch, whatever each does next:

    1 >  .  |   < 2      1 and 2 come towards each other with a gap of 0.6 m between their bodies, each 0.5 m a tick.
                         There is no room for both to go on, so each may come nearer by half of the gap, 0.3 m.

A step that would lead farther is shortened. Where nothing of it is left, the body stands, and acts as after a bump.
After a few such stops in a row it drives, because positions that are wrong or forged must not hold it for good; a bump
shows that the other robot is there, and it stops again.

All this is only as good as the positions that are heard. In lockstep, on a channel without delay or loss, where all
robots send in each tick, a robot decides on where the others are now. With delay or loss, and where the fleet saves on
its radio (`radio.adaptive`, `radio.budget`), it decides on older places, or on predicted ones. Two that hear each
other equally late still find the same line, because each takes itself to be where the other one predicts it. But it may
be elsewhere by now, so it may keep right late or not at all, and bump. Then the rules of `agent.bodies.standoff` are
left.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from agent.belief.obstacles import HEARD_M
from agent.bodies.standoff import STILL, disc_round
from agent.kernels.motions import MOTION, note_motions
from agent.routes.ground import Ground
from agent.routes.routes import Routes
from patrol.ground.swept_path import advance
from patrol.pose import Pose
from patrol.radio.message import SPAN
from patrol.radio.peers import Columns, columns_of, go_on

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from agent.ports import Place
    from agent.routes.ground import Disc, Spot
    from agent.view import View
    from patrol.pose import Command

LOOK_AHEAD = 6.0
LOOK_AHEAD_BODIES = 2.0
"""How far ahead robots look for others: `LOOK_AHEAD` ticks, and `LOOK_AHEAD_BODIES` times the ticks that they need to
drive the width of both bodies."""

MARGIN = 0.5
"""Least gap between two bodies that pass, points: ways run over the centres of points."""

FASTEST = 2.0
"""A robot that has moved by more than so many of its own strides in a tick is one whose position was wrong."""

BARRIER = 3
BARRIER_GAP = 1.5
"""Number of discs of a barrier, and the distance between their centres, in radii."""

LONGER = 2.0
"""A way past another robot may be longer than the direct one by so many times the width of a body."""

SAMPLES = 8
"""Number of moments of a step at which a body is looked at."""


@dataclass(frozen=True, slots=True)
class Meeting:
    """Two robots that would touch if both went on."""

    ticks: float  # from now, until they would be nearest to each other
    other: int  # the other robot's number
    here: Spot  # place of this robot then
    there: Spot  # place of the other one then
    comes: bool  # the other one drives towards this robot


@dataclass(frozen=True, slots=True)
class Motion:
    """A robot's place and movement, as far as they were heard."""

    place: Spot
    moved: Spot  # in a tick; (0, 0) for a robot heard once, or one whose position was wrong


class Motions:
    """The motions of one robot and the others, from note to note. A robot that is not in a note is forgotten.

    For example, a robot that is at (0, 0) in tick 3, and then heard at (1, 0) in tick 5, moves by (0.5, 0) in a tick.
    """

    def __init__(self, number: int, fastest: NDArray[np.float64], reach: NDArray[np.float64]) -> None:
        """Start without robots.

        `fastest`, float64 (m,), is the longest movement in a tick that can be true, m, by number. Of robots that are
        heard at once, only those within `reach` are told of, float64 (m,), m.
        """
        self._number = number
        self._fastest = fastest
        self._reach = reach
        self._table = np.zeros(fastest.size, dtype=MOTION)
        self._found = np.empty(fastest.size, dtype=np.int64)
        self._notes = 1

    def expect(self, number: int, sequence: int, place: Spot) -> None:
        """Take a robot that was not in the last note to have been at a place (m) with some sequence."""
        if self._table["noted"][number] != self._notes:
            self._table[number] = sequence, sequence, *place, 0.0, 0.0, self._notes

    def note(self, robots: Columns, tick: int, here: Spot) -> dict[int, Motion]:
        """Take note of where other robots are, and of this one; return motions by number, ascending, its own last."""
        self._notes += 1
        limits, table = (self._fastest, self._reach), (self._notes, self._table, self._found)
        numbers = self._found[: note_motions(*robots, *limits, self._number, tick, *here, *table)]
        rows = {number: self._table[number].item() for number in numbers.tolist()}
        return {number: Motion(row[2:4], row[4:6]) for number, row in rows.items()}


class KeepingRight:
    """One robot's way past others that it hears. Call `note` once a tick before all else."""

    def __init__(
        self, number: int, radii: Mapping[int, float], strides: Mapping[int, float], ground: Ground, step: float
    ) -> None:
        """Start without having heard of others; `radii` and `strides` are in m, `step` is in s per tick.

        `strides` holds the longest way of each robot in one step.
        """
        self._number = number
        self._radii = radii
        self._ground = ground
        self._margin = MARGIN * ground.terrain.point
        self._step = step
        self._strides = strides
        self._stride = strides[number]
        numbers = list(strides)
        fastest, both = np.zeros((2, 1 + max(numbers)))
        fastest[numbers] = FASTEST * np.array(list(strides.values()))
        both[numbers] = radii[number] + np.array([radii[other] for other in numbers])
        # As far as both can get in the ticks looked ahead, and half a point more, which is more than rounding.
        ticks = LOOK_AHEAD + LOOK_AHEAD_BODIES * both / self._stride
        reach = both + 2.0 * self._margin + ticks * (self._stride + fastest)
        self._fastest = fastest
        self._motions = Motions(number, fastest, reach)
        self._motions.expect(number, 0, (0.0, 0.0))
        self._others: dict[int, Motion] = {}  # those that may be met, by number
        self._own = Motion((0.0, 0.0), (0.0, 0.0))
        self._past: dict[int, Spot] = {}  # own places by tick
        # Own motion as robots that are heard late predict it, by their numbers; None where nobody is heard late.
        self._predictions: Motions | None = None
        self._predicted: dict[int, Motion] = {}
        self._expected: int | None = None

    def note(self, view: View) -> None:
        """Take note of where the others are, and of how each has moved since it was last heard."""
        here = view.reported.x, view.reported.y
        self._past[view.tick] = here
        self._past.pop(view.tick - SPAN, None)
        robots = columns_of(view.peers)
        self._others = self._motions.note(robots, view.tick, here)
        self._own = self._others.pop(self._number)
        late = robots.ticks - robots.sequences
        if not np.count_nonzero(late > 0):  # faster than `any`
            self._predicted, self._predictions = {}, None
            return
        if self._predictions is None:
            own = np.full_like(self._fastest, self._fastest[self._number])
            self._predictions = Motions(self._number, own, np.full_like(own, np.inf))
        ends = {ticks: self._predict_own(view.tick - ticks, ticks) for ticks in set(late.tolist()) if ticks > 0}
        known = [row for row, ticks in enumerate(late.tolist()) if ends.get(ticks)]
        sent = view.tick - late[known]
        places = np.array([ends[ticks] for ticks in late[known].tolist()], dtype=np.float64).reshape(-1, 2)
        for number, tick in zip(robots.numbers[known].tolist(), sent.tolist(), strict=True):
            self._predictions.expect(number, tick, self._past[tick])
        self._predicted = self._predictions.note(Columns(robots.numbers[known], sent, sent, places), view.tick, here)

    def _predict_own(self, sent: int, late: int) -> Spot | None:
        """Predict where this robot is, as a robot does that hears it `late` ticks late; None at the beginning."""
        place, before = self._past.get(sent), self._past.get(sent - 1)
        if place is None or before is None:
            return None
        end = go_on(self._ground.terrain, Pose(*place, 0.0), (place[0] - before[0], place[1] - before[1]), late)
        return end.x, end.y

    def room(self, command: Command, view: View) -> float:
        """Return the share of a step that stays on this robot's side of a line between it and each other one.

        Both robots find the same line, so two that do so never touch, whatever each of them does next.
        """
        free, x, y = SAMPLES, view.pose.x, view.pose.y
        for number, neighbour in self._others.items():
            own = self._predicted.get(number, self._own)
            # Too far apart to touch within a step, whatever both do.
            near = self._sum_radii(number) + self._stride + self._strides[number]
            if own is not self._own:
                near += 2.0 * math.dist(own.place, self._own.place)
            if math.dist((x, y), neighbour.place) >= near:
                continue
            across, up, limit = self._find_side(number, own, neighbour)
            # Only as far as the robots before have left free.
            for sample in range(1, free + 1):
                end = advance(view.pose, command, sample / SAMPLES * self._step)
                if (end.x - x) * across + (end.y - y) * up > limit:
                    free = sample - 1
                    break
        for across, up, reach in view.obstacles:
            apart = math.dist((x, y), (across, up))
            for sample in range(1, free + 1) if apart < reach + self._stride else ():
                end = advance(view.pose, command, sample / SAMPLES * self._step)
                # One that is inside already may leave.
                if math.dist((end.x, end.y), (across, up)) < min(reach, apart):
                    free = sample - 1
                    break
        return free / SAMPLES

    def _find_side(self, number: int, own_motion: Motion, other: Motion) -> tuple[float, float, float]:
        """Return the direction (x, y) to the line between this robot and another, and how far it may go there, m.

        The line is square to where the robots would be nearest to each other in the next step if both went on, or to
        where they are if they would touch. Each may go on as before if there is room for both, and half of the rest.
        """
        # Positions were rounded when they were sent, so the gap may be smaller by that much.
        radii = self._sum_radii(number) + HEARD_M
        x, y = other.place[0] - own_motion.place[0], other.place[1] - own_motion.place[1]
        right, up = other.moved[0] - own_motion.moved[0], other.moved[1] - own_motion.moved[1]
        speed = right**2 + up**2
        when = min(max(-(x * right + y * up) / speed, 0.0), 1.0) if speed > 0.0 else 0.0
        across, along = x + when * right, y + when * up
        # The direction between bodies that overlap says little, so that of now counts.
        if math.hypot(across, along) < radii:
            across, along = x, y
        length = math.hypot(across, along)
        # At the same place there is no side to keep to: a limit along no direction shortens nothing.
        if length == 0.0:
            return 0.0, 0.0, 0.0
        across, along = across / length, along / length
        gap = max(0.0, x * across + y * along - radii)
        mine = max(0.0, own_motion.moved[0] * across + own_motion.moved[1] * along)
        their_share = max(0.0, -other.moved[0] * across - other.moved[1] * along)
        spare = gap - mine - their_share
        # Never 0 / 0: spare is below 0 only where one of them comes nearer.
        limit = mine + 0.5 * spare if spare >= 0.0 else gap * mine / (mine + their_share)
        ahead_x, ahead_y = own_motion.place[0] - self._own.place[0], own_motion.place[1] - self._own.place[1]
        # A robot that is not where it is predicted may have crossed the line: it goes no farther.
        return across, along, max(limit + ahead_x * across + ahead_y * along, 0.0)

    def past(self, place: Place, view: View) -> Place | int:
        """Return a place with the way to it that leads past a robot which comes towards this one.

        Where no short way leads past it, the result is that robot's number. Where no robot is about to be met, or one
        that does not come, it is the same place. What keeps the way on the right is closed on the view's ground.
        """
        meeting = self._next_meeting(place, view)
        if meeting is None or view.start is None:
            return place
        ground, point = view.ground, self._ground.terrain.point
        row, col = ground.terrain.nearest_point(place.x, place.y)
        target, radii = (row + 1, col + 1), self._sum_radii(meeting.other)
        direct = view.routes.way(view.start, target, self._expected)
        longest = direct.length + LONGER * radii
        self._expected = math.ceil(100.0 * (longest + self._stride) / point)
        # Both must lead to the place itself: a way that ends before it may be short as well.
        barriers = self._list_barriers(meeting, (view.pose.x, view.pose.y))
        for discs in barriers if direct.place == ground.centre(*target) else ():
            closed = ground.over(discs)
            start = closed.join(view.pose.x, view.pose.y)
            if start is None:
                continue
            way = Routes(closed).way_within(start, target, self._expected)
            if way is not None and way.length <= longest:
                ground.close(discs)
                return replace(place, bend=way.bend)
        return meeting.other if meeting.comes else place

    def _next_meeting(self, place: Place, view: View) -> Meeting | None:
        """Return the robot that would be met first on the way to a place; None for none."""
        x, y = view.pose.x, view.pose.y
        bend = place.bend or (place.x, place.y)
        ahead = math.dist((x, y), bend)
        if ahead == 0.0:
            return None
        # At top speed along its way, since the last step may have been shortened or a turn.
        across, up = ((corner - here) / ahead * self._stride for here, corner in zip((x, y), bend, strict=True))
        meetings = []
        for number, neighbour in sorted(self._others.items()):
            (other_x, other_y), (moved_x, moved_y) = neighbour.place, neighbour.moved
            apart_x, apart_y = other_x - x, other_y - y
            closer_x, closer_y = moved_x - across, moved_y - up
            radii, speed = self._sum_radii(number), closer_x**2 + closer_y**2
            ticks = -(apart_x * closer_x + apart_y * closer_y) / speed if speed > 0.0 else 0.0
            # Not above 0 where they move apart.
            if not 0.0 < ticks <= LOOK_AHEAD + LOOK_AHEAD_BODIES * radii / self._stride:
                continue
            if math.hypot(apart_x + ticks * closer_x, apart_y + ticks * closer_y) < radii + self._margin:
                here, corner = (
                    (x + ticks * across, y + ticks * up),
                    (other_x + ticks * moved_x, other_y + ticks * moved_y),
                )
                comes = apart_x * moved_x + apart_y * moved_y < 0.0
                meetings.append(Meeting(ticks, number, here, corner, comes))
        return min(meetings, key=lambda meeting: meeting.ticks, default=None)

    def _list_barriers(self, meeting: Meeting, here: Spot) -> Iterator[list[Disc]]:
        """Yield the discs to close so that the way leads past another robot, best first."""
        point, radii = self._ground.terrain.point, self._sum_radii(meeting.other)
        neighbour = self._others[meeting.other]
        now = neighbour.place
        apart = math.dist(here, now)
        if math.hypot(*neighbour.moved) <= STILL * self._strides[meeting.other] or apart == 0.0:
            yield [disc_round(now, here, radii, point)]
            return
        left = -(now[1] - here[1]) / apart, (now[0] - here[0]) / apart
        half = 0.5 * (meeting.here[0] + meeting.there[0]), 0.5 * (meeting.here[1] + meeting.there[1])
        for (x, y), radius in ((meeting.there, radii), (half, self._radii[self._number])):
            shift = BARRIER_GAP * (radius + self._margin)
            centres = ((x + number * shift * left[0], y + number * shift * left[1]) for number in range(BARRIER))
            yield [disc_round(centre, here, radius, point) for centre in centres]

    def _sum_radii(self, other: int) -> float:
        """Return the radii of this robot and another together, m."""
        return self._radii[self._number] + self._radii[other]
