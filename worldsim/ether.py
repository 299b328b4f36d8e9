"""The ether: whether a position frame reaches each of the other robots, decided for each directed pair by itself."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field

from patrol.message import MAX_FRAME

OVERSIZED = "oversized"
RECEIVER_DEAD = "receiver dead"

Rule = Callable[[int, int, int], str | None]
"""(source, destination, sequence) -> why that frame is lost on that link, or None when it is not.

A rule keeps no state. Where it draws, it draws from (seed, Purpose.ETHER, fault, source, destination, sequence), so
that what befalls one frame does not depend on any other.
"""


@dataclass(slots=True)
class LinkCount:
    """What became of the frames of one directed pair: sent = delivered + all that were dropped, by cause."""

    sent: int = 0
    delivered: int = 0
    dropped: dict[str, int] = field(default_factory=dict)


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

    It never looks inside a frame; a frame's sequence is the tick in which the world took it.
    """

    def __init__(self, numbers: Sequence[int], rules: Sequence[Rule] = ()) -> None:
        self._rules = tuple(rules)
        self.links = {(i, j): LinkCount() for i in numbers for j in numbers if i != j}

    def carry(
        self, tick: int, frames: Mapping[int, bytes | None], present: Collection[int], living: Collection[int]
    ) -> Delivery:
        """Send each robot's frame (None: it is silent) to all others present; only the living hear."""
        receivers = sorted(present)
        heard: dict[int, list[bytes]] = {number: [] for number in sorted(living)}
        arrived, dropped = [], []
        for source, frame in sorted(frames.items()):
            if frame is None:
                continue
            for destination in receivers:
                if destination == source:
                    continue
                link = self.links[source, destination]
                link.sent += 1
                cause = self._loss(source, destination, tick, frame, destination in heard)
                if cause is None:
                    link.delivered += 1
                    heard[destination].append(frame)
                    arrived.append((source, destination, tick))
                else:
                    link.dropped[cause] = link.dropped.get(cause, 0) + 1
                    dropped.append((source, destination, tick, cause))
        return Delivery(heard, tuple(arrived), tuple(dropped))

    def _loss(self, source: int, destination: int, sequence: int, frame: bytes, listens: bool) -> str | None:
        if len(frame) > MAX_FRAME:
            return OVERSIZED
        if not listens:
            return RECEIVER_DEAD
        return next((cause for rule in self._rules if (cause := rule(source, destination, sequence)) is not None), None)
