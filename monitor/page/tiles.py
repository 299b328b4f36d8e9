"""A map as it is sent to a page: only the tiles that changed since the page's version, as runs of equal values.

A packet, little-endian: int32 layer, tick, since, tiles m, runs n; int32 tile numbers (m,), runs of each tile (m,),
values (n,); uint16 lengths (n,).

    layer    `TERRAIN`, or a fog: `TRUTH`, `HEARD`, or a robot's number
    tick     the tick of the map
    since    the tick from which on the fog is known (`monitor.observation.source.Source.since`)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from monitor.kernels.tiles import KEEP, pack, take_over
from monitor.observation.source import Layer

SIDE = 128
"""Points along a tile's side."""

TRUTH, HEARD, TERRAIN = 0, -1, -2
PASSABLE, COUNTED = 1, 2
"""Bits in the values of the terrain's layer."""


def layer_number(layer: Layer) -> int:
    """Return the number of a fog in packets."""
    if isinstance(layer, int):
        return layer
    return TRUTH if layer == "truth" else HEARD


class TiledMap:
    """One map, with the version in which each of its tiles last changed.

    `version` is the number of changes so far, and `tick` that of the map, -1 before there is one.
    """

    def __init__(self, number: int, shape: tuple[int, int]) -> None:
        """Start without a map; `number` is the layer's, and `shape` is (h, w)."""
        self._number = number
        self._shown: NDArray[np.int32] = np.full(shape, KEEP, dtype=np.int32)
        tiles = -(-shape[0] // SIDE) * -(-shape[1] // SIDE)
        self._versions: NDArray[np.int32] = np.zeros(tiles, dtype=np.int32)
        self._packets: dict[int, bytes] = {}
        self.version = 0
        self.tick = -1

    def update(self, now: NDArray[np.int32], tick: int) -> None:
        """Set the map, int32 (h, w), which is copied; it makes a new version if it differs."""
        self.tick = tick
        tiles, counts = (np.empty(self._versions.size, dtype=np.int32) for _ in range(2))
        values, lengths = _buffers(now.size)
        out = (tiles, counts, values, lengths)
        changed, runs = take_over(now, self._shown, self._versions, SIDE, self.version + 1, *out)
        if changed:
            self.version += 1
            # The difference to the version before is known only now.
            self._packets = {
                self.version - 1: _packed(tiles[:changed], counts[:changed], values[:runs], lengths[:runs])
            }

    def packet(self, version: int, since: int = 0) -> bytes:
        """Return the packet that updates a page from a version that it has, 0 for none.

        `since` is the tick from which on the fog is known.
        """
        if version not in self._packets:
            tiles = np.flatnonzero(self._versions > version).astype(np.int32)
            counts = np.empty(tiles.size, dtype=np.int32)
            values, lengths = _buffers(tiles.size * SIDE * SIDE)
            runs = pack(self._shown, tiles, SIDE, counts, values, lengths)
            self._packets[version] = _packed(tiles, counts, values[:runs], lengths[:runs])
        return np.array([self._number, self.tick, since], dtype="<i4").tobytes() + self._packets[version]


def _buffers(points: int) -> tuple[NDArray[np.int32], NDArray[np.uint16]]:
    """Make buffers for the values and lengths of as many runs as there can be; unused memory costs nothing."""
    return np.empty(points, dtype=np.int32), np.empty(points, dtype=np.uint16)


def _packed(
    tiles: NDArray[np.int32], counts: NDArray[np.int32], values: NDArray[np.int32], lengths: NDArray[np.uint16]
) -> bytes:
    """Return a packet without its first three numbers."""
    head = np.array([tiles.size, values.size], dtype=np.int32)
    parts = (head, tiles, counts, values, lengths)
    return b"".join(part.astype(part.dtype.newbyteorder("<"), copy=False).tobytes() for part in parts)


def terrain_packet(passable: NDArray[np.bool_], patrolled: NDArray[np.bool_]) -> bytes:
    """Return the packet with the terrain, which a page receives once."""
    tiled = TiledMap(TERRAIN, passable.shape)
    tiled.update((passable * PASSABLE + patrolled * COUNTED).astype(np.int32), 0)
    if tiled.version == 0:
        raise ValueError("a map without points")
    return tiled.packet(0)
