"""Forged positions: frames that a stranger, or a robot of the fleet, sends in others' names.

A stranger has no key; where the fleet uses one, its tags are wrong, but for frames that it only repeats. All robots
whose radios receive hear it. A robot that forges has the key and its own radio, with all faults that act on it, and
forges only while it is alive.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from patrol.errors import BadInput
from patrol.faults.kinds import Forgery, Spoof
from patrol.journal.records import Status
from patrol.pose import Pose
from patrol.radio.message import MAX_ROBOT, Position, encode
from patrol.random import Purpose, draw, mix
from runtime.security.private_files import fleet_key
from worldsim.radio.fates import STRANGER, Forged

if TYPE_CHECKING:
    from patrol.ground.terrain import Terrain
    from patrol.scenario import Scenario
    from worldsim.faults import Entry, Timeline
    from worldsim.robots.senses import Senses

_WRONG_KEY = -1

MEMORY = 600
"""Ticks whose frames are kept where an operator may ask for a replay."""


class Forger:
    """Makes the forged frames of each tick, in the order of the faults and their victims."""

    def __init__(
        self,
        scenario: Scenario,
        timeline: Timeline,
        terrain: Terrain,
        senses: Senses,
        key: bytes | None,
        memory: int = 0,
    ) -> None:
        """Forge by a timeline's spoofs.

        `key` is the fleet's, for the robots among the forgers; None where there is none, or no robot forges yet. The
        frames of at least `memory` ticks are kept, for a replay that operators may add.
        """
        self.timeline = timeline
        self._scenario = scenario
        self._seed = scenario.seed
        self._step = scenario.step
        self._robots = len(scenario.roster)
        self._spares = scenario.spares
        self._bounds = terrain.bounds
        self._senses = senses
        self._key = key
        self._tags = scenario.radio.key is not None
        self._depth = max((memory, *(self._frame_age(entry) for entry in timeline.entries)))
        self._sent: deque[Mapping[int, Sequence[bytes]]] = deque(maxlen=self._depth + 1)
        self._frozen: dict[tuple[int, int], Pose] = {}

    def follow(self, timeline: Timeline) -> None:
        """Go on with another timeline; refuse one with a replay older than the frames kept."""
        spoofs = [entry for entry in timeline.entries if isinstance(entry.fault, Spoof)]
        if any(self._frame_age(entry) > self._depth for entry in spoofs):
            kept_s = self._depth * self._step
            raise BadInput(f"control: fault.payload.replay: at most {kept_s:g} s are kept; choose a smaller number")
        if self._key is None and any(entry.sources[0] != STRANGER for entry in spoofs):
            self._key = fleet_key(self._scenario.radio.key)
        self.timeline = timeline

    def forge(
        self, k: int, frames: Mapping[int, Sequence[bytes]], statuses: Mapping[int, Status], poses: Mapping[int, Pose]
    ) -> list[Forged]:
        """Forge the frames of a tick; to be called for each tick in turn.

        No frame is forged in the name of a spare robot that has not joined yet.
        """
        # Before anything is forged: index -1 is this tick, and a replay of age n is at -1 - n.
        self._sent.append(frames)
        unknown = {number for number in self._spares if statuses[number] is Status.ABSENT}
        forged: list[Forged] = []
        for entry in self.timeline.at(k):
            if not isinstance(entry.fault, Spoof):
                continue
            origin = entry.sources[0]
            if origin == STRANGER or statuses[origin] is Status.ALIVE:
                forged += (
                    Forged(origin, entry.id, frame)
                    for frame in self._forge_frames(entry, entry.fault, k, poses, unknown)
                )
        return forged

    def _forge_frames(
        self, entry: Entry, fault: Spoof, k: int, poses: Mapping[int, Pose], unknown: Collection[int]
    ) -> Iterator[bytes]:
        payload = fault.payload
        if isinstance(payload, Forgery) and payload.invented is not None:
            last = min(self._robots + payload.invented, MAX_ROBOT)
            for number in range(self._robots + 1, last + 1):
                yield self._sign_frame(entry, Position.of(number, k, k * self._step, self._draw_pose(entry, number, k)))
            return
        for victim in entry.who:
            if victim in unknown:
                continue
            if isinstance(payload, Forgery) and payload.replay is not None:
                yield from self._repeat_frames(self._frame_age(entry), victim)
                continue
            pose = self._claimed_pose(entry, fault, victim, k, poses)
            if pose is not None:
                ahead = (isinstance(payload, Forgery) and payload.ahead) or 0
                yield self._sign_frame(entry, Position.of(victim, k + ahead, self._senses.clock(victim, k), pose))

    def _claimed_pose(self, entry: Entry, fault: Spoof, victim: int, k: int, poses: Mapping[int, Pose]) -> Pose | None:
        """Return the pose that a forged frame claims for the victim; None while it is nowhere."""
        if fault.payload == "random":
            return self._draw_pose(entry, victim, k)
        true = poses.get(victim)
        if isinstance(fault.payload, Forgery):
            if true is None:
                return None
            dx, dy = fault.payload.offset or (0.0, 0.0)
            reported = self._senses.pose(victim, k, true)
            return Pose(reported.x + dx, reported.y + dy, reported.heading)
        key = (entry.index, victim)
        # The place is frozen at the first tick of the fault in which the victim is there.
        if key not in self._frozen and true is not None:
            self._frozen[key] = self._senses.pose(victim, k, true)
        return self._frozen.get(key)

    def _repeat_frames(self, ago: int, victim: int) -> Iterator[bytes]:
        """Yield the position that the victim sent `ago` ticks before, byte by byte; nothing if it sent none."""
        if ago < len(self._sent):
            yield from self._sent[-1 - ago].get(victim, ())[:1]

    def _draw_pose(self, entry: Entry, number: int, k: int) -> Pose:
        x_min, y_min, x_max, y_max = self._bounds
        across, up = (draw(self._seed, Purpose.SPOOF, entry.index, number, k, axis) for axis in (0, 1))
        return Pose(x_min + across * (x_max - x_min), y_min + up * (y_max - y_min), 0.0)

    def _sign_frame(self, entry: Entry, position: Position) -> bytes:
        if entry.sources[0] != STRANGER:
            return encode(position, self._key)
        if not self._tags:
            return encode(position)
        # A tag as long as a true one, made with a key that is none.
        guess = mix(self._seed, Purpose.SPOOF, entry.index, _WRONG_KEY)
        return encode(position, guess.to_bytes(8, "little"))

    def _frame_age(self, entry: Entry) -> int:
        """Return the age of the frames that a fault sends again, ticks; 0 when it does not.

        For example, 3 for a replay of 1.2 s with steps of 0.5 s.
        """
        payload = entry.fault.payload if isinstance(entry.fault, Spoof) else None
        if not isinstance(payload, Forgery) or payload.replay is None:
            return 0
        return max(1, math.ceil(payload.replay / self._step - 1e-9))
