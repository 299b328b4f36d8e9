"""Repulsive forces between robots."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from patrol.pose import TAU, Pose
from patrol.radio.peers import Peer, places_of
from patrol.scenario import PotentialFieldOptions


def repel(sums: NDArray[np.float64], pose: Pose, peers: Mapping[int, Peer], options: PotentialFieldOptions) -> None:
    """Add repulsive forces from the peers.

    Each peer pushes straight away with ``repulsion`` times the sum of all attraction, times exp(-(d /
    repulsion_reach)^2). The paper gives no formula; this one is relative to the attraction, whatever its scale.

    Args:
        sums: The sums of an `agent.policies.potential_field.pull.field.Pull`; changed in place.
        pose: The robot's own.
        peers: The robots heard so far, by number.
        options: The policy's.
    """
    as_vector = options.direction == "vector"
    total = float(sums[2] if as_vector else sums.sum())
    for x, y in places_of(peers).tolist():
        across, up = pose.x - x, pose.y - y
        distance = math.hypot(across, up)
        if distance == 0.0:
            continue
        force = options.repulsion * total * math.exp(-((distance / options.repulsion_reach) ** 2))
        if as_vector:
            sums[0] += force * across / distance
            sums[1] += force * up / distance
        else:
            sums[round(math.atan2(up, across) / (TAU / sums.size)) % sums.size] += force
