"""Maps as a page shows them, and figures of a whole fog: its stalest point, and the share of the ground that was seen.

A map is sent to a page as the tiles that changed since the page's version, in runs of equal values. A packet,
little-endian: int32 layer, tick, since, tiles m, runs n; int32 tile numbers (m,), runs of each tile (m,), values (n,);
uint16 lengths (n,).

    layer    `TERRAIN`, or a fog: `TRUTH`, `HEARD`, or a robot's number
    tick     the tick of the map
    since    the tick from which on the fog is known (`monitor.observation.source.Source.since`)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from monitor.kernels.maps import KEEP, stalest, take_over
from monitor.observation.source import Layer
from patrol.ground.fog import NEVER

SIDE = 128
"""Points along a tile's side; so few that the length of a run fits into its uint16."""

TRUTH, HEARD, TERRAIN = 0, -1, -2
PASSABLE, COUNTED = 1, 2
"""Bits in the values of the terrain's layer."""


def layer_number(layer: Layer) -> int:
    """Return the number of a fog in packets.

    For example, 0 for "truth", -1 for "heard", and 3 for what robot 3 believes.
    """
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
        # Rounded up: tiles at the edge may be smaller.
        tiles = -(-shape[0] // SIDE) * -(-shape[1] // SIDE)
        self._versions: NDArray[np.int32] = np.zeros(tiles, dtype=np.int32)
        self._packets: dict[int, bytes] = {}
        self.version = 0
        self.tick = -1

    def update(self, now: NDArray[np.int32], tick: int) -> None:
        """Set the map, int32 (h, w), which is copied; it makes a new version if it differs."""
        self.tick = tick
        packet, changed = _map_difference(now, self._shown, self._versions, self.version + 1)
        if changed:
            # The difference to the version before is known only now.
            self._packets = {self.version: packet}
            self.version += 1

    def packet(self, version: int, since: int = 0) -> bytes:
        """Return the packet that updates a page from a version that it has, 0 for none.

        `since` is the tick from which on the fog is known.
        """
        if version not in self._packets:
            # As if the tiles that have changed since were all new.
            old = self._shown.copy()
            across = -(-old.shape[1] // SIDE)
            for tile in np.flatnonzero(self._versions > version).tolist():
                row, col = tile // across * SIDE, tile % across * SIDE
                old[row : row + SIDE, col : col + SIDE] = KEEP
            self._packets[version], _ = _map_difference(self._shown, old, self._versions.copy(), self.version)
        return np.array([self._number, self.tick, since], dtype="<i4").tobytes() + self._packets[version]


def _map_difference(
    now: NDArray[np.int32], shown: NDArray[np.int32], versions: NDArray[np.int32], version: int
) -> tuple[bytes, int]:
    """Update a map; return the packet that does so, without its first three numbers, and how many tiles change."""
    tiles, counts = (np.empty(versions.size, dtype=np.int32) for _ in range(2))
    # Room for as many runs as there can be; unused memory costs nothing.
    run_values, lengths = np.empty(now.size, dtype=np.int32), np.empty(now.size, dtype=np.uint16)
    changed, runs = take_over(now, shown, versions, SIDE, version, tiles, counts, run_values, lengths)
    head = np.array([changed, runs], dtype=np.int32)
    parts = (head, tiles[:changed], counts[:changed], run_values[:runs], lengths[:runs])
    return b"".join(part.astype(part.dtype.newbyteorder("<"), copy=False).tobytes() for part in parts), changed


def terrain_packet(passable: NDArray[np.bool_], patrolled: NDArray[np.bool_]) -> bytes:
    """Return the packet with the terrain, which a page receives once."""
    tiled = TiledMap(TERRAIN, passable.shape)
    tiled.update((passable * PASSABLE + patrolled * COUNTED).astype(np.int32), 0)
    if tiled.version == 0:
        raise ValueError("a map without points")
    return tiled.packet(0)


@dataclass(frozen=True, slots=True)
class Survey:
    """A fog at one tick."""

    row: int  # of the stalest patrolled point; of several, the one nearest to their centre
    col: int  # of the same point
    age: int  # of that point, ticks; from tick 0 if it was never seen
    ever_seen: bool  # that point was seen at least once
    seen_share: float  # of the patrolled points, from 0 to 1


def survey_of(last_seen: NDArray[np.int32], patrolled: NDArray[np.bool_], tick: int) -> Survey | None:
    """Survey a fog at a tick; return None if no point counts.

    `last_seen` has ticks and `patrol.ground.fog.NEVER`, `patrolled` the points that count, both (h, w).
    """
    row, col, seen_points, points = stalest(last_seen, patrolled.view(np.uint8))
    if points == 0:
        return None
    last = int(last_seen[row, col])
    return Survey(int(row), int(col), tick - max(last, 0), last != NEVER, seen_points / points)
