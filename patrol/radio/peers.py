"""The other robots, as they were heard."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from patrol.pose import Pose

SPAN = 64
"""Number of a sender's last sequences that a listener remembers, with the newest (as RFC 4303, 3.4.3, for IPsec)."""


@dataclass(frozen=True, slots=True)
class Peer:
    """Another robot."""

    sequence: int  # its newest
    pose: Pose  # at that sequence, m and rad
    tick: int  # at which that was heard


def places_of(peers: Mapping[int, Peer]) -> NDArray[np.float64]:
    """Return the places of some robots, float64 (n, 2), x and y in m, ascending by number.

    A mapping that has them as the column `places` gives them faster.
    """
    columns: NDArray[np.float64] | None = getattr(peers, "places", None)
    if columns is not None:
        return columns
    places = [(peer.pose.x, peer.pose.y) for _, peer in sorted(peers.items())]
    return np.array(places, dtype=np.float64).reshape(-1, 2)


def ticks_of(peers: Mapping[int, Peer]) -> NDArray[np.int64]:
    """Return the ticks at which some robots were heard last, int64 (n,), ascending by number.

    The array is the caller's own. A mapping that has them as the column `ticks` gives them faster.
    """
    column: NDArray[np.int64] | None = getattr(peers, "ticks", None)
    if column is not None:
        return column
    return np.array([peer.tick for _, peer in sorted(peers.items())], dtype=np.int64)
