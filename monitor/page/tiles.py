"""A map as a page is sent it: only the tiles that changed since what the page has, as runs of equal values.

A packet, little-endian: int32 layer, tick, since, tiles m, runs n; int32 tile numbers (m,), runs of each tile (m,),
values (n,); uint16 lengths (n,). A layer is `TERRAIN`, or a fog: `TRUTH`, `HEARD`, or a robot's number. tick: of which
the map is. since: the tick before which it knows nothing (`monitor.source.Source.since`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from monitor.kernels.tiles import KEEP, compare, pack, take_over
from monitor.source import Layer

SIDE = 64
"""Points along a tile's side."""

TRUTH, HEARD, TERRAIN = 0, -1, -2
PASSABLE, COUNTED = 1, 2
"""What the values of the terrain's layer add up from."""


def layer_number(layer: Layer) -> int:
    """The number that stands for a fog in packets."""
    if isinstance(layer, int):
        return layer
    return TRUTH if layer == "truth" else HEARD


class TileBook:
    """One map, and in which version each of its tiles last changed."""

    def __init__(self, number: int, shape: tuple[int, int]) -> None:
        """number: of the layer. shape: of the map, (h, w)."""
        self._number = number
        self._shown: NDArray[np.int32] = np.full(shape, KEEP, dtype=np.int32)
        tiles = -(-shape[0] // SIDE) * -(-shape[1] // SIDE)
        self._versions: NDArray[np.int32] = np.zeros(tiles, dtype=np.int32)
        self._packets: dict[int, bytes] = {}
        self.version = 0
        self.tick = -1
        """Of which the map is; -1 before there is one."""

    def take(self, now: NDArray[np.int32], tick: int) -> None:
        """The map as it is at a tick; a new version if it differs. Read before this returns, never kept."""
        self.tick = tick
        if compare(now, self._shown, self._versions, SIDE, self.version + 1) == 0:
            return
        self.version += 1
        changed = np.flatnonzero(self._versions == self.version).astype(np.int32)
        # Whoever has the version before is sent the difference; it is made now, while both are known.
        self._packets = {self.version - 1: self._pack(now, changed, whole=False)}
        take_over(now, self._shown, self._versions, SIDE, self.version)

    def packet(self, version: int, since: int = 0) -> bytes:
        """What brings a page from a version (0: from nothing) to this one, and to its tick."""
        if version not in self._packets:
            tiles = np.flatnonzero(self._versions > version).astype(np.int32)
            self._packets[version] = self._pack(self._shown, tiles, whole=True)
        return np.array([self._number, self.tick, since], dtype="<i4").tobytes() + self._packets[version]

    def _pack(self, now: NDArray[np.int32], tiles: NDArray[np.int32], *, whole: bool) -> bytes:
        """A packet from its number of tiles on."""
        counts = np.empty(tiles.size, dtype=np.int32)
        room = tiles.size * SIDE * SIDE
        values, lengths = np.empty(room, dtype=np.int32), np.empty(room, dtype=np.uint16)
        runs = pack(now, self._shown, whole, tiles, SIDE, counts, values, lengths)
        head = np.array([tiles.size, runs], dtype=np.int32)
        parts = (head, tiles, counts, values[:runs], lengths[:runs])
        return b"".join(part.astype(part.dtype.newbyteorder("<"), copy=False).tobytes() for part in parts)


def terrain_packet(passable: NDArray[np.bool_], patrolled: NDArray[np.bool_]) -> bytes:
    """The terrain, which a page is sent once."""
    book = TileBook(TERRAIN, passable.shape)
    book.take((passable * PASSABLE + patrolled * COUNTED).astype(np.int32), 0)
    if book.version == 0:
        raise ValueError("a map without points")
    return book.packet(0)
