"""The frames that all robots of a fleet hear in one tick, held once, and which robot hears which."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import compress

import numpy as np
from numpy.typing import NDArray


class Heard(Mapping[int, list[bytes]]):
    """The frames that reach each receiver, by its number, in their order.

    `frames` holds all of them, by sender and sequence, forged ones first; `receivers` is ascending; and `reaches`, bool
    (receivers, frames), says which receiver hears which frame.
    """

    def __init__(self, frames: Sequence[bytes], receivers: Sequence[int], reaches: NDArray[np.bool_]) -> None:
        self.frames = tuple(frames)
        self.receivers = tuple(receivers)
        self.reaches = reaches
        self._row = {number: row for row, number in enumerate(self.receivers)}

    def __getitem__(self, number: int) -> list[bytes]:
        return list(compress(self.frames, self.reaches[self._row[number]].tolist()))

    def __iter__(self) -> Iterator[int]:
        return iter(self.receivers)

    def __len__(self) -> int:
        return len(self.receivers)


def heard_by(receivers: Sequence[int], heard: Mapping[int, Sequence[bytes]]) -> Mapping[int, Sequence[bytes]]:
    """Return the frames that some receivers hear; the receivers' numbers are ascending."""
    if not isinstance(heard, Heard):
        return {number: heard[number] for number in receivers}
    if heard.receivers == tuple(receivers):
        return heard
    return Heard(heard.frames, receivers, heard.reaches[np.isin(heard.receivers, receivers)])
