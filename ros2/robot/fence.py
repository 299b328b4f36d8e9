"""The fence: no command may lead off the ground, nor into another robot, within the way that the body needs to stop.

The ground is the map's: where a body of this radius may be without entering a wall, a keep-out area or what lies
beyond the map. A body that is too near to a wall already may only move away from it; one whose centre is off the ground
stands. Other robots are taken to go on as they went; a body that is too near to one may only move away from it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from patrol.ground.swept_path import advance, path_is_free
from patrol.ground.terrain import Terrain
from patrol.pose import Command, Pose, Twist, scaled
from patrol.radio.peers import Peer

CARRIED_S = 1.0
"""For how long a robot is taken to go on as it went, s; after that it is taken to stand where that led."""

MOST_TICKS = 4
"""Most ticks between two positions from which a velocity follows."""


@dataclass(frozen=True, slots=True)
class Other:
    """Another robot."""

    x: float  # m, `since_s` ago
    y: float  # m
    vx: float  # m/s, on the map
    vy: float  # m/s
    radius: float  # of its body, m
    since_s: float

    @property
    def speed(self) -> float:
        """m/s."""
        return math.hypot(self.vx, self.vy)

    def distance(self, x: float, y: float, ahead_s: float) -> float:
        """Return the distance in m of the robot's centre from a place, `ahead_s` from now.

        For example, a robot at x = 3 m that drives at -1 m/s is 2.5 m from x = 0 in 0.5 s if it was heard just now.
        """
        # Bounded: an old velocity says little about where a robot is by now.
        gone_s = min(self.since_s + ahead_s, CARRIED_S)
        return math.hypot(self.x + self.vx * gone_s - x, self.y + self.vy * gone_s - y)


@dataclass(slots=True)
class _Seen:
    peer: Peer
    vx: float
    vy: float
    at_s: float


class Others:
    """Follows the other robots, heard in `peers`, which goes on to change.

    Radii are in m, `step` is in s per tick. `foreseen` returns where the others should be that many ticks from now; it
    is None where the fleet's robots do not predict each other. Robots that do are silent while the others foresee them
    well enough.
    """

    def __init__(
        self,
        peers: Mapping[int, Peer],
        radii: Mapping[int, float],
        step: float,
        foreseen: Callable[[int], Mapping[int, Peer]] | None = None,
    ) -> None:
        self._peers = peers
        self._radii = radii
        self._step = step
        self._foreseen = foreseen
        self._seen: dict[int, _Seen] = {}

    def look(self, now_s: float) -> None:
        """Take in the positions heard for this tick."""
        if self._foreseen is not None:
            after = self._foreseen(1)
            for number, peer in self._foreseen(0).items():
                vx, vy = _mean_velocity(peer, after[number], self._step)
                self._seen[number] = _Seen(peer, vx, vy, now_s)
            return
        for number, peer in self._peers.items():
            last = self._seen.get(number)
            ticks = 0 if last is None else peer.sequence - last.peer.sequence
            # The same frame again says nothing about the velocity.
            if last is not None and ticks == 0:
                continue
            vx = vy = 0.0
            if last is not None and 0 < ticks <= MOST_TICKS:
                vx, vy = _mean_velocity(last.peer, peer, ticks * self._step)
            self._seen[number] = _Seen(peer, vx, vy, now_s)

    def around(self, now_s: float) -> tuple[Other, ...]:
        """Return all other robots that were heard."""
        return tuple(
            Other(
                track.peer.pose.x,
                track.peer.pose.y,
                track.vx,
                track.vy,
                self._radii[number],
                max(0.0, now_s - track.at_s),
            )
            for number, track in self._seen.items()
        )


def _mean_velocity(before: Peer, after: Peer, time_s: float) -> tuple[float, float]:
    return (after.pose.x - before.pose.x) / time_s, (after.pose.y - before.pose.y) / time_s


SHARES = tuple(eighth / 8.0 for eighth in range(8, 0, -1))
"""Shares of a command's speed that are tried, the whole first."""

THEIRS_S = 0.3
"""Time that another robot takes longer to stop than this one, s: it hears of this one once a tick."""

LOOKS = (0.25, 0.5, 0.75, 1.0)
"""Shares of the time until it stands at which a body's distance from another is looked at."""


@dataclass(frozen=True, slots=True)
class Fence:
    """The fence of one body."""

    terrain: Terrain
    radius: float  # of the body and what is kept clear around it, m
    reaction_s: float  # for which the body goes on before it begins to brake
    braking: float  # how hard it brakes, m/s²

    def allowed(self, pose: Pose, command: Command, others: Sequence[Other] = ()) -> Command:
        """Return the command for the same path, as fast as it may be driven; a halt if not at all.

        A differential drive that is on the ground may still turn on the spot.
        """
        if not self.on_ground(pose):
            return scaled(command, 0.0)
        # Fastest first, so the first share that is safe is the answer.
        for share in SHARES:
            slower = scaled(command, share)
            stands_s = self._until_it_stands(slower)
            free = path_is_free(self.terrain, pose, slower, stands_s, self.radius)
            if free and all(self._keeps_off(pose, slower, stands_s + THEIRS_S, robot) for robot in others):
                return slower
        return Twist(0.0, command.turn_rate) if isinstance(command, Twist) else scaled(command, 0.0)

    def on_ground(self, pose: Pose) -> bool:
        """Return True if a body's centre is where a body may be."""
        cell = self.terrain.point_at(pose.x, pose.y) if self.terrain.contains(pose.x, pose.y) else None
        return cell is not None and bool(self.terrain.free[cell])

    def _until_it_stands(self, command: Command) -> float:
        """For how long the body may not leave the ground at its present speed, s: as far as it goes while it brakes.

        For example, 0.7 s at 1 m/s with a reaction of 0.2 s and a braking of 1 m/s²: braking takes 1 s and leads 0.5 m
        on.
        """
        return self.reaction_s + command.speed_mps / (2.0 * self.braking)

    def _keeps_off(self, pose: Pose, command: Command, time_s: float, other: Other) -> bool:
        """Return True if a body comes no nearer to another than both are wide, or goes away from it."""
        wide = self.radius + other.radius
        now = other.distance(pose.x, pose.y, 0.0)
        # Too far off to meet even head-on: most others need no closer look.
        if now - (command.speed_mps + other.speed) * time_s >= wide:
            return True
        for share in LOOKS:
            end = advance(pose, command, share * time_s)
            then = other.distance(end.x, end.y, share * time_s)
            # One that is too near already may go away from it.
            if then < wide and then < now:
                return False
        return True
