"""The exchange between a robot's body and its mind in each tick: the body's senses, and the mind's reply.

The same two values serve the world, the messages between processes, fleets in one process and robots of one's own.
"""

from __future__ import annotations

from dataclasses import dataclass

from patrol.pose import Command, Pose

__all__ = ["Reply", "Sensed"]

MOST_BLOCKED = 4096
"""Points that a robot is shown blocked in a tick, at most."""

LEAST_WEIGHT, MOST_WEIGHT = 0.001, 1000.0
"""Bounds of a zone's weight."""

MOST_ZONES = 64
"""Zones of a scenario, at most."""

FIRST_INCARNATION = 1
"""The number of a robot's first process; each that is started in its place has the next."""


@dataclass(frozen=True, slots=True)
class Sensed:
    """A robot's senses at the beginning of a tick.

    Attributes:
        k: The fleet's tick. Receivers judge a position's tick by their own, so all robots must count alike.
        pose: Where the robot takes itself to be (m, rad).
        bumped: Whether its last move was cancelled by a collision.
        contacts: The intruders in its view, x and y in m.
        clock_s: What its own clock shows, s.
        charge: Share of its battery's capacity that is left; None for a robot without a battery.
        blocked: The points that it sees or bumps into blocked although the map says that they are free: flat indices
            of the terrain's grid, ascending.
        zones: The numbers, from 0, of the scenario's zones that are in force, once an operator has switched one or
            changed its weight; None: by their times.
        weights: The numbers of zones whose weights change in the course of the run, and their weights now; for robots
            that learn of `zones`.
    """

    k: int
    pose: Pose
    bumped: bool = False
    contacts: tuple[tuple[float, float], ...] = ()
    clock_s: float = 0.0
    charge: float | None = None
    blocked: tuple[int, ...] = ()
    zones: tuple[int, ...] | None = None
    weights: tuple[tuple[int, float], ...] = ()


@dataclass(frozen=True, slots=True)
class Reply:
    """A mind's answer to a tick: the command, and diagnostics that change nothing.

    Attributes:
        command: What the body is to do for the next step.
        state: What the robot is doing, one short word.
        goal: Where it is heading, x and y in m, or None.
        decision_ms: Wall time that the decision took, ms.
        rejected: Frames that its inbox has refused so far.
    """

    command: Command
    state: str
    goal: tuple[float, float] | None
    decision_ms: float
    rejected: int
