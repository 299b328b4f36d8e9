"""The step that follows bodies and ground, where a scenario leaves it to ``auto``.

A robot stops turning, notices that a place is seen and gives way at the end of a step only. The paper's step is 0.5 s:
little where its robots drive 2.2 m between walls that are 4 m off, but much where one at 1 m/s passes furniture that is
0.6 m off. So ``auto`` is the longest step in which no robot drives farther than `STRIDE_SHARE` of its body's room, the
median distance from its centre to the nearest obstacle over all ground that it fits on (docs/results/steps.md).

For example, a robot of 0.3 m at 1 m/s has 0.6 m of room in a furnished flat: 0.1 s. At 0.5 m/s it is 0.25 s.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from patrol.errors import BadInput
from patrol.ground.cspace import clearance_levels, needed_level
from patrol.maps.map_file import map_meaning
from patrol.scenario.radio_spec import PathLossRadio, RadioSpec
from patrol.scenario.sections import RobotSpec, TerrainSpec
from patrol.values import digest_of

PAPER_STEP = 0.5
"""The paper's step, s: the longest that ``auto`` chooses, and the one of built-in terrains, which are the paper's."""

STEPS = (PAPER_STEP, 0.25, 0.1)
"""What ``auto`` chooses from, s. Each divides the first, so what happens at its ticks stays at a tick."""

STRIDE_SHARE = 0.4
"""Longest stride, as a share of the room."""


def automatic_step(terrain: TerrainSpec, point: float, roster: Sequence[RobotSpec], radio: RadioSpec) -> float:
    """Return the step for a scenario's bodies and ground, s.

    A stride is not made shorter than a point, and a step not shorter than a frame's time on the air. Robots with a
    direct radio keep the paper's step, since a shorter one costs them frames and computing in real time. So does
    ground that cannot be read: whatever prepares the scenario refuses it.
    """
    if terrain.map is None or radio.via == "direct":
        return PAPER_STEP
    enough = max(spec.speed for spec in roster) * PAPER_STEP / STRIDE_SHARE
    try:
        digest = digest_of(map_meaning(Path(terrain.map)))
        rooms = {spec.radius: room_of(terrain, digest, point, spec.radius, enough) for spec in roster}
    except BadInput:
        return PAPER_STEP
    longest = min(max(STRIDE_SHARE * rooms[spec.radius], point) / spec.speed for spec in roster)
    airtime = radio.options.airtime if isinstance(radio, PathLossRadio) else 0.0
    allowed = [step for step in STEPS if step >= airtime] or [PAPER_STEP]
    return next((step for step in allowed if step <= longest), allowed[-1])


@lru_cache(maxsize=64)
def room_of(terrain: TerrainSpec, digest: str, point: float, radius: float, enough: float) -> float:
    """Return a body's room on a map, m, where `enough` (m) or more is not told apart; 0 where the body fits nowhere.

    `digest` is of the map's content, which may change while this process runs.
    """
    from patrol.maps.load import load_terrain  # here: few processes read maps

    del digest
    levels = clearance_levels(load_terrain(terrain, point, Path()).free, math.ceil(enough / point) + 1)
    fits = levels[levels >= needed_level(radius, point)]
    return 0.5 * point * math.sqrt(np.median(fits)) if fits.size else 0.0
