"""The frames of one tick, genuine and forged, and their fates on the way to each receiver."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from patrol.journal.records import FORGED, frame_sequence
from patrol.radio.message import MAX_FRAME

STRANGER = 0
"""The origin of a stranger's frames: no robot's radio, so no robot's links."""


@dataclass(frozen=True, slots=True)
class Forged:
    """A forged frame."""

    origin: int  # number of the robot whose radio sends it, or `STRANGER`
    fault: str  # id of the spoof
    frame: bytes


@dataclass(frozen=True, slots=True)
class Sent:
    """The frames of one tick, forged ones first, then by sender and sequence."""

    frames: list[bytes]
    origin: NDArray[np.int64]  # (f,), the robot from whose radio each comes, or `STRANGER`; not the claimed sender
    source: NDArray[np.int64]  # (f,), each frame's sender in the journal, `patrol.journal.records.FORGED` if forged
    sequence: NDArray[np.int64]  # (f,), each frame's sequence in the journal
    oversized: NDArray[np.bool_]  # (f,), frames that are too long for the radio

    @staticmethod
    def of(tick: int, frames: Mapping[int, Sequence[bytes]], forged: Sequence[Forged]) -> Sent:
        """Put the frames of a tick together."""
        rows = [(forgery.origin, FORGED, frame_sequence(tick, k), forgery.frame) for k, forgery in enumerate(forged)]
        rows += [
            (source, source, frame_sequence(tick, index), frame)
            for source in sorted(frames)
            for index, frame in enumerate(frames[source])
        ]
        origin, source, sequence = (np.array([row[i] for row in rows], dtype=np.int64) for i in range(3))
        sent = [row[3] for row in rows]
        oversized = np.array([len(frame) > MAX_FRAME for frame in sent], dtype=np.bool_)
        return Sent(sent, origin, source, sequence, oversized)


class Fates:
    """The fate of each frame on its way to each receiver; a frame that was stopped is not stopped again.

    `on_the_way`, bool (f, r), marks the frames that nothing has stopped yet. `cause`, int64 (f, r), is the place in
    `causes` of what stopped a frame, -1 for none; `causes` are as the journal names them.
    """

    def __init__(self, reaches: NDArray[np.bool_]) -> None:
        """Begin with all frames on their way, over the links that `reaches`, bool (f, r), marks."""
        self.on_the_way = reaches.copy()
        self.cause = np.full(reaches.shape, -1, dtype=np.int64)
        self.causes: list[str] = []

    def stop(self, hit: NDArray[np.bool_], cause: str) -> None:
        """Stop frames that are on their way; `hit` is bool, of any shape that broadcasts to (f, r).

        For example, a `hit` of (f, 1) stops frames at all receivers, and one of (r,) all frames at some receivers.
        """
        stopped = self.on_the_way & hit
        self.cause[stopped] = len(self.causes)
        # Also where nothing was stopped: a cause's place does not depend on that.
        self.causes.append(cause)
        self.on_the_way &= ~stopped
