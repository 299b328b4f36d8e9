"""What a mind decides in one tick, with the reasons."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from patrol.pose import Command


class State(StrEnum):
    """What a robot is doing."""

    PATROLLING = "patrolling"
    DEAD_END = "dead-end"
    HOLDING = "holding"
    SURROUNDING = "surrounding"


@dataclass(frozen=True, slots=True)
class Decision:
    """One tick's decision and its diagnostics.

    command: what to do for the next step. state: DEAD_END while escaping (car) or blocked on every side (holonomic),
    HOLDING when nothing pulls or the robot is off the reachable ground, SURROUNDING on the way to its place around an
    intruder and in it.
    direction: bearing that was chosen, rad, or None. sector_sums: sum of the moduli in each sector (mode), or the
    vector sum's x and y (vector). goal, refined: (x, y) in m before and after refinement, or None. mfow: believed age
    of the stalest point, ticks. rejected: frames refused so far.
    """

    command: Command
    state: State
    direction: float | None
    sector_sums: tuple[float, ...]
    goal: tuple[float, float] | None
    refined: tuple[float, float] | None
    mfow: int
    rejected: int
