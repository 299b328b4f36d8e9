"""The tables of a run and their columns, each declared once: for Arrow schemas, files and the documentation.

Names end with their unit, as in summary.json. For example, the first row of `robots` of a run of one robot:

    tick 0, time_s 0.0, robot r1, status alive, x_m 12.0, y_m 40.0, heading_rad 0.0, ...
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

FORGER = "forger"
"""Sender of forged frames in `links`, whatever robot they name, as in summary.json."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a table; for example ``Column("x_m", "number", "centre of the point", "m")``."""

    name: str  # ends with the unit
    kind: Literal["integer", "number", "text", "flag"]  # each value may be null
    meaning: str  # for the documentation
    unit: str = ""  # empty for texts, flags and counts


@dataclass(frozen=True, slots=True)
class TableColumns:
    """A table."""

    name: str  # also of its file
    row: str  # what a row is, such as "a tick"
    columns: tuple[Column, ...]


_TICK = Column("tick", "integer", "number of the tick, from 0")
_TIME = Column("time_s", "number", "its simulated time", "s")
_NO_DIRECT = "null with direct radio"

TICKS = TableColumns(
    "ticks",
    "a tick",
    (
        _TICK,
        _TIME,
        Column("mfow_s", "number", "MFoW after the tick's observations", "s"),
        Column("fog_mean_s", "number", "mean age of a point then", "s"),
        Column("seen_share", "number", "share of the patrolled ground seen so far"),
        Column("alive", "integer", "robots that take part"),
        Column("paused", "integer", "robots that are paused"),
        Column("dead", "integer", "robots that are dead"),
        Column("lost", "integer", "robots that are lost"),
        Column("away", "integer", "robots that are absent or have left"),
        Column("collisions", "integer", "moves cancelled because a body would have touched something"),
        Column("sent", "integer", "robots' frames sent in the tick, counted for each receiver"),
        Column("delivered", "integer", f"robots' frames that arrived in the tick; {_NO_DIRECT}"),
        Column("dropped", "integer", f"robots' frames lost in the tick; {_NO_DIRECT}"),
    ),
)
ROBOTS = TableColumns(
    "robots",
    "a tick and robot",
    (
        _TICK,
        _TIME,
        Column("robot", "text", "name"),
        Column("status", "text", "alive, paused, dead, lost, absent or left"),
        Column("x_m", "number", "true place when the tick began", "m"),
        Column("y_m", "number", "true place when the tick began", "m"),
        Column("heading_rad", "number", "true heading when the tick began", "rad"),
        Column("velocity_x_m_s", "number", "of the command that it obeyed; null unless holonomic", "m/s"),
        Column("velocity_y_m_s", "number", "of the command that it obeyed; null unless holonomic", "m/s"),
        Column("speed_m_s", "number", "of the command that it obeyed, negative in reverse; null if holonomic", "m/s"),
        Column("turn_rate_rad_s", "number", "of the command that it obeyed; null unless differential", "rad/s"),
        Column("curvature_1_m", "number", "of the command that it obeyed; null unless a car", "1/m"),
        Column("driven_m", "number", "way driven in the tick; 0 where the move was cancelled", "m"),
        Column("bumped", "flag", "whether the move was cancelled because the body would have touched something"),
        Column("refused", "flag", "whether the command was invalid, and so not obeyed"),
        Column("state", "text", "what the robot reported to be doing; null without a report"),
        Column("goal_x_m", "number", "where it wanted to go; null without a report", "m"),
        Column("goal_y_m", "number", "where it wanted to go; null without a report", "m"),
        Column("decision_ms", "number", "wall time of the decision; null without one", "ms"),
        Column("frames", "integer", "frames that it sent, each counted once"),
        Column("frame_bytes", "integer", "size of these frames", "byte"),
        Column("rejected", "integer", "frames of others that it reported to have refused since its last report"),
        Column("charge_share", "number", "share of the battery's capacity left after the tick; null without a battery"),
    ),
)
LINKS = TableColumns(
    "links",
    "a tick, sender and receiver between whom frames were sent, arrived or were lost; further causes have further rows",
    (
        _TICK,
        _TIME,
        Column("sender", "text", f"robot, or `{FORGER}` for forged frames"),
        Column("receiver", "text", "robot"),
        Column("sent", "integer", "frames sent in the tick, with copies that a fault made"),
        Column("delivered", "integer", f"frames that arrived in the tick; {_NO_DIRECT}"),
        Column("dropped", "integer", f"frames lost in the tick for `cause`; {_NO_DIRECT}"),
        Column("cause", "text", "why frames were lost, `kind:id` for a fault; null where none was"),
    ),
)
EVENTS = TableColumns(
    "events",
    "an event",
    (
        Column("tick", "integer", "the tick before which it happened"),
        _TIME,
        Column("kind", "text", "what happened"),
        Column("robot", "text", "to which robot; null for the whole run"),
        Column("detail", "text", "more of it, in words"),
    ),
)
VISITS = TableColumns(
    "visits",
    "a visit of a robot to a vertex of `terrain.graph`; no rows without a graph",
    (
        _TICK,
        _TIME,
        Column("robot", "text", "name"),
        Column("vertex", "integer", "number of the vertex, from 0"),
        Column("x_m", "number", "place of the vertex", "m"),
        Column("y_m", "number", "place of the vertex", "m"),
        Column("idle_s", "number", "idleness that the visit ended", "s"),
        Column("first", "flag", "whether it is the vertex's first visit, which measures over visits leave out"),
    ),
)
GROUND = TableColumns(
    "ground",
    "a point of the patrolled ground",
    (
        Column("row", "integer", "row of the grid, from the south"),
        Column("col", "integer", "column of the grid, from the west"),
        Column("x_m", "number", "centre of the point", "m"),
        Column("y_m", "number", "centre of the point", "m"),
        Column("age_mean_s", "number", "mean age over all ticks", "s"),
        Column("age_max_s", "number", "greatest age", "s"),
        Column("age_end_s", "number", "age at the end", "s"),
        Column("seen", "flag", "whether a robot ever saw it"),
    ),
)
TABLES: Mapping[str, TableColumns] = MappingProxyType(
    {table.name: table for table in (TICKS, ROBOTS, LINKS, EVENTS, VISITS, GROUND)}
)
"""All tables of a run, by name."""
