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
- Where no way leads past, or only a long one, robots go on, and settle it as in `agent.bodies.passing`.

A step that would touch another robot, if that goes on as before, is not taken. The body then does what it does after
a bump. So robots that cannot pass, or whose guess was wrong, mostly stop before they touch. After a few such stops in a
row it drives, because positions that are wrong or forged must not hold it for good.

All this is as good as what is heard. In lockstep, on a channel without delay or loss, where all robots send in each
tick, a robot decides on where the others are now. With delay or loss, and where the fleet saves on its radio
(`radio.adaptive`, `radio.budget`), it decides on older places, or on predicted ones. So it may keep right late or not
at all, and bump. Then the rules of `agent.bodies.giveway` and `agent.bodies.passing` are left.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from agent.bodies.giveway import disc_round
from agent.routes.ground import Ground
from agent.routes.routes import Routes
from patrol.ground.swept_path import advance
from patrol.pose import is_halt

if TYPE_CHECKING:
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

STILL = 0.1
"""A robot stands still if it moves by no more than this share of its own stride in a tick."""

FASTEST = 2.0
"""A robot that has moved by more than so many of its own strides in a tick is one whose position was wrong."""

BARRIER = 3
BARRIER_GAP = 1.5
"""Number of discs of a barrier, and the distance between their centres, in radii."""

LONGER = 2.0
"""A way past another robot may be longer than the direct one by so many times the width of a body."""

SAMPLES = 8
"""Number of moments of a step at which two bodies are looked at."""


@dataclass(frozen=True, slots=True)
class Meeting:
    """Two robots that would touch if both went on.

    Attributes:
        ticks: When they would be nearest to each other, ticks from now.
        other: The other robot's number.
        here: Where this robot would be then, x and y in m.
        there: Where the other one would be.
    """

    ticks: float
    other: int
    here: Spot
    there: Spot


@dataclass(frozen=True, slots=True)
class Motion:
    """Another robot's place and movement, as far as they were heard.

    Attributes:
        sequence: Of its newest position.
        tick: At which it was at its place.
        place: x and y in m.
        moved: The same in a tick; (0, 0) for a robot that was heard once, or whose position was wrong.
    """

    sequence: int
    tick: int
    place: Spot
    moved: Spot = (0.0, 0.0)

    def after(self, sequence: int, place: Spot, stride: float) -> Motion:
        """Return the motion a tick later; the same where nothing was heard and no place was predicted.

        Args:
            sequence: Of the newest position then.
            place: Its place, or the one that is predicted for then.
            stride: Longest way of the robot in a step, m.
        """
        if sequence == self.sequence and place == self.place:
            return self
        tick = self.tick + 1 if sequence == self.sequence else max(sequence, self.tick + 1)
        ticks = tick - self.tick
        moved = (place[0] - self.place[0]) / ticks, (place[1] - self.place[1]) / ticks
        return Motion(sequence, tick, place, moved if math.hypot(*moved) <= FASTEST * stride else (0.0, 0.0))


class KeepingRight:
    """One robot's way past others that it hears. Call `note` once a tick before all else."""

    def __init__(
        self, number: int, radii: Mapping[int, float], strides: Mapping[int, float], ground: Ground, step: float
    ) -> None:
        """Start without having heard of others.

        Args:
            number: The robot's.
            radii: Radius in m of each robot of the fleet, by number.
            strides: Longest way in m of each in one step, likewise.
            ground: Where the robot's centre may be.
            step: s per tick.
        """
        self._number = number
        self._radii = radii
        self._ground = ground
        self._margin = MARGIN * ground.terrain.point
        self._step = step
        self._strides = strides
        self._stride = strides[number]
        self._others: dict[int, Motion] = {}
        self._expected: int | None = None

    def note(self, view: View) -> None:
        """Take note of where the others are, and of how each has moved since it was last heard.

        Args:
            view: Of this tick.
        """
        before, self._others = self._others, {}
        for number, peer in view.peers.items():
            place = peer.pose.x, peer.pose.y
            was = before.get(number) or Motion(peer.sequence, peer.sequence, place)
            self._others[number] = was.after(peer.sequence, place, self._strides[number])

    def touches(self, command: Command, view: View) -> bool:
        """Return True if a command would bring the body into another one that goes on as before.

        Args:
            command: For the next step.
            view: Of this tick.
        """
        if is_halt(command):
            return False
        for number, other in self._others.items():
            both, (x, y), (right, up) = self._both(number), other.place, other.moved
            reach = both + self._stride + math.hypot(right, up)
            if math.dist((view.pose.x, view.pose.y), (x, y)) > reach:
                continue
            for sample in range(1, SAMPLES + 1):
                share = sample / SAMPLES
                end = advance(view.pose, command, share * self._step)
                if math.dist((end.x, end.y), (x + share * right, y + share * up)) < both:
                    return True
        return False

    def past(self, place: Place, view: View) -> Place:
        """Return a place with the way to it that leads past a robot which comes towards this one.

        Args:
            place: Where to go.
            view: Of this tick. What keeps the way on the right is closed on its ground.

        Returns:
            The same place where no robot is about to be met, or no short way leads past.
        """
        meeting = self._next_meeting(place, view)
        if meeting is None or view.start is None:
            return place
        ground, point = view.ground, self._ground.terrain.point
        row, col = ground.terrain.nearest_point(place.x, place.y)
        target, both = (row + 1, col + 1), self._both(meeting.other)
        direct = view.routes.way(view.start, target, self._expected)
        longest = direct.length + LONGER * both
        self._expected = math.ceil(100.0 * (longest + self._stride) / point)
        for discs in self._barriers(meeting, (view.pose.x, view.pose.y)):
            closed = Ground(self._ground.terrain, ground.open_now, ground)
            closed.begin(discs)
            start = closed.join(view.pose.x, view.pose.y)
            if start is None:
                continue
            way = Routes(closed).way(start, target, self._expected)
            if way.place == direct.place == ground.centre(*target) and way.length <= longest:
                ground.close(discs)
                return replace(place, bend=way.bend)
        return place

    def _next_meeting(self, place: Place, view: View) -> Meeting | None:
        """Return the robot that would be met first on the way to a place; None for none."""
        x, y = view.pose.x, view.pose.y
        bend = place.bend or (place.x, place.y)
        ahead = math.dist((x, y), bend)
        if ahead == 0.0:
            return None
        across, up = ((there - here) / ahead * self._stride for here, there in zip((x, y), bend, strict=True))
        meetings = []
        for number, other in sorted(self._others.items()):
            (other_x, other_y), (moved_x, moved_y) = other.place, other.moved
            apart_x, apart_y = other_x - x, other_y - y
            closer_x, closer_y = moved_x - across, moved_y - up
            both, speed = self._both(number), closer_x**2 + closer_y**2
            ticks = -(apart_x * closer_x + apart_y * closer_y) / speed if speed > 0.0 else 0.0
            if not 0.0 < ticks <= LOOK_AHEAD + LOOK_AHEAD_BODIES * both / self._stride:
                continue
            if math.hypot(apart_x + ticks * closer_x, apart_y + ticks * closer_y) < both + self._margin:
                here, there = (
                    (x + ticks * across, y + ticks * up),
                    (other_x + ticks * moved_x, other_y + ticks * moved_y),
                )
                meetings.append(Meeting(ticks, number, here, there))
        return min(meetings, key=lambda meeting: meeting.ticks, default=None)

    def _barriers(self, meeting: Meeting, here: Spot) -> Iterator[list[Disc]]:
        """Give what to close so that the way leads past another robot, best first."""
        point, both = self._ground.terrain.point, self._both(meeting.other)
        other = self._others[meeting.other]
        now = other.place
        apart = math.dist(here, now)
        if math.hypot(*other.moved) <= STILL * self._strides[meeting.other] or apart == 0.0:
            yield [disc_round(now, here, both, point)]
            return
        left = -(now[1] - here[1]) / apart, (now[0] - here[0]) / apart
        half = 0.5 * (meeting.here[0] + meeting.there[0]), 0.5 * (meeting.here[1] + meeting.there[1])
        for (x, y), radius in ((meeting.there, both), (half, self._radii[self._number])):
            shift = BARRIER_GAP * (radius + self._margin)
            centres = ((x + number * shift * left[0], y + number * shift * left[1]) for number in range(BARRIER))
            yield [disc_round(centre, here, radius, point) for centre in centres]

    def _both(self, other: int) -> float:
        """Return the radii of this robot and another together, m."""
        return self._radii[self._number] + self._radii[other]
