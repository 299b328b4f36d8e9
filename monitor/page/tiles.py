"""A map as a page is sent it: only the tiles that changed since what the page has, as runs of equal values.

A packet, little-endian: int32 layer, tick, since, tiles m, runs n; int32 tile numbers (m,), runs of each tile (m,),
values (n,); uint16 lengths (n,). A layer is `TERRAIN`, or a fog: `TRUTH`, `HEARD`, or a robot's number. tick: of which
the map is. since: the tick before which it knows nothing (`monitor.source.Source.since`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from monitor.page.kernels.tiles import KEEP, pack, take_over
from monitor.source import Layer

SIDE = 128
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
        tiles, counts = (np.empty(self._versions.size, dtype=np.int32) for _ in range(2))
        values, lengths = _room(now.size)
        news = (tiles, counts, values, lengths)
        changed, runs = take_over(now, self._shown, self._versions, SIDE, self.version + 1, *news)
        if changed:
            self.version += 1
            # Whoever has the version before is sent the difference, which is known now alone.
            self._packets = {
                self.version - 1: _packed(tiles[:changed], counts[:changed], values[:runs], lengths[:runs])
            }

    def packet(self, version: int, since: int = 0) -> bytes:
        """What brings a page from a version (0: from nothing) to this one, and to its tick."""
        if version not in self._packets:
            tiles = np.flatnonzero(self._versions > version).astype(np.int32)
            counts = np.empty(tiles.size, dtype=np.int32)
            values, lengths = _room(tiles.size * SIDE * SIDE)
            runs = pack(self._shown, tiles, SIDE, counts, values, lengths)
            self._packets[version] = _packed(tiles, counts, values[:runs], lengths[:runs])
        return np.array([self._number, self.tick, since], dtype="<i4").tobytes() + self._packets[version]


def _room(points: int) -> tuple[NDArray[np.int32], NDArray[np.uint16]]:
    """For values and lengths of as many runs as there can be; what is not written costs nothing."""
    return np.empty(points, dtype=np.int32), np.empty(points, dtype=np.uint16)


def _packed(
    tiles: NDArray[np.int32], counts: NDArray[np.int32], values: NDArray[np.int32], lengths: NDArray[np.uint16]
) -> bytes:
    """A packet from its number of tiles on."""
    head = np.array([tiles.size, values.size], dtype=np.int32)
    parts = (head, tiles, counts, values, lengths)
    return b"".join(part.astype(part.dtype.newbyteorder("<"), copy=False).tobytes() for part in parts)


def terrain_packet(passable: NDArray[np.bool_], patrolled: NDArray[np.bool_]) -> bytes:
    """The terrain, which a page is sent once."""
    book = TileBook(TERRAIN, passable.shape)
    book.take((passable * PASSABLE + patrolled * COUNTED).astype(np.int32), 0)
    if book.version == 0:
        raise ValueError("a map without points")
    return book.packet(0)
