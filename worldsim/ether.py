"""The ether: whether a frame reaches each of the other robots, decided for each directed pair by itself."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

from patrol.message import MAX_FRAME
from patrol.records import frame_sequence

OVERSIZED = "oversized"
RECEIVER_DEAD = "receiver dead"

Rule = Callable[[int, int, int], str | None]
"""(source, destination, sequence) -> why that frame is lost on that link, or None when it is not.

A rule keeps no state. Where it draws, it draws from (seed, Purpose.ETHER, fault, source, destination, sequence), so
that what befalls one frame does not depend on any other.
"""


@dataclass(frozen=True, slots=True)
class Delivery:
    """What the ether did in one tick, ordered by sender, sequence and receiver.

    heard: for each receiver its frames, by sender and sequence. arrived: (source, destination, sequence).
    dropped: (source, destination, sequence, cause).
    """

    heard: dict[int, list[bytes]]
    arrived: tuple[tuple[int, int, int], ...]
    dropped: tuple[tuple[int, int, int, str], ...]


class Ether:
    """The radio between robots: every frame to every other robot within the tick, less what the rules take.

    It never looks inside a frame; a frame's sequence says in which tick the world took it and which of its sender's
    frames it was (`patrol.records.frame_sequence`). It keeps no counts: the journal has every frame's fate.
    """

    def __init__(self, rules: Sequence[Rule] = ()) -> None:
        self._rules = tuple(rules)

    def carry(
        self, tick: int, frames: Mapping[int, Sequence[bytes]], present: Collection[int], listening: Collection[int]
    ) -> Delivery:
        """Send each robot's frames, in their order, to all others present; only those listening hear."""
        receivers = sorted(present)
        heard: dict[int, list[bytes]] = {number: [] for number in sorted(listening)}
        arrived, dropped = [], []
        sent = [(source, place, frame) for source in sorted(frames) for place, frame in enumerate(frames[source])]
        for source, place, frame in sent:
            sequence = frame_sequence(tick, place)
            for destination in receivers:
                if destination == source:
                    continue
                cause = self._loss(source, destination, sequence, frame, destination in heard)
                if cause is None:
                    heard[destination].append(frame)
                    arrived.append((source, destination, sequence))
                else:
                    dropped.append((source, destination, sequence, cause))
        return Delivery(heard, tuple(arrived), tuple(dropped))

    def _loss(self, source: int, destination: int, sequence: int, frame: bytes, listens: bool) -> str | None:
        if len(frame) > MAX_FRAME:
            return OVERSIZED
        if not listens:
            return RECEIVER_DEAD
        return next((cause for rule in self._rules if (cause := rule(source, destination, sequence)) is not None), None)
