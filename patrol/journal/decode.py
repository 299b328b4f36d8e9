"""Records of a journal from bytes that anybody may have written.

Types, finiteness and ranges are checked here, so that whoever reads a journal need not. A record costs memory before
it is checked: a byte can become a container of 88 bytes. So its size is limited by the number of robots, and its
containers and links are counted.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from typing import Any

import msgpack

from patrol.journal.records import (
    End,
    Event,
    Header,
    Record,
    RobotFacts,
    RobotTick,
    Status,
    TerrainFacts,
    TickRecord,
)
from patrol.pose import MODELS

MAX_RECORD = 1 << 28
"""Bytes of the longest record, however many robots there are."""

FARTHEST = 21_474_836.0
"""The largest coordinate of a robot, m: a position message holds no larger one."""

MOST_POINTS = 50_000_000
"""Points of the largest terrain (`patrol.ground.terrain.MAX_POINTS`)."""

MOST_CONTAINERS = 250_000
"""Lists and mappings of a record other than a tick."""

_LEAST_RECORD = 1 << 22
_MOST_LINKS = 4_000_000
_LEAST_LINKS = 500_000
_LARGEST = 1e12
_MAX_K = 2**31
_MOST_POINT_TICKS = 2**53
_MOST_COUNT = 2**63 - 1
_MAX_ROBOT = 0xFFFF
_MAX_SEQUENCE = 2**63 - 1
_NAME = 64
_PATH = 4096
_TICK = b"\xa4type\xa4tick"


class Malformed(ValueError):
    """A record whose fields are not those of its kind; the text names the field."""


def longest_record(robots: int) -> int:
    """Bytes of the longest record of a fleet: 30 times what a tick of it takes in which everybody hears everybody.

    Args:
        robots: How many there are.
    """
    return min(_LEAST_RECORD + 1024 * robots + 8 * robots * robots, MAX_RECORD)


def is_tick(payload: bytes) -> bool:
    """Return whether a record, as this program writes it, is a tick.

    Args:
        payload: Of any record.
    """
    return payload[1:11] == _TICK


def decode(payload: bytes, robots: int) -> Record:
    """The record in a payload.

    Args:
        payload: Any bytes.
        robots: How many the fleet has.

    Raises:
        Malformed: For anything but a record.
    """
    try:
        if is_tick(payload):
            return _tick(msgpack.unpackb(payload, use_list=False, object_hook=_one_map, ext_hook=_no_extension), robots)
        counted = _Counter()
        value = msgpack.unpackb(
            payload, strict_map_key=False, object_hook=counted, list_hook=counted, ext_hook=_no_extension
        )
        kind = value.pop("type")
        if kind == "tick":  # by another writer, whose keys have another order
            return _tick(msgpack.unpackb(payload, use_list=False, ext_hook=_no_extension), robots)
        return _KINDS[kind](value)
    except Malformed:
        raise
    except (
        ValueError,
        TypeError,
        LookupError,
        AttributeError,
        OverflowError,
        RecursionError,
        msgpack.UnpackException,
    ) as error:
        raise Malformed(type(error).__name__) from None


def _one_map(value: dict[str, Any]) -> dict[str, Any]:
    """A mapping in a tick, which has no other inside."""
    if "robots" not in value:
        raise Malformed("a mapping inside of a tick")
    return value


class _Counter:
    """Takes each container as it is completed, up to a number."""

    def __init__(self) -> None:
        self._count = 0

    def __call__(self, value: Any) -> Any:
        self._count += 1
        if self._count > MOST_CONTAINERS:
            raise Malformed(f"more than {MOST_CONTAINERS} lists and mappings")
        return value


def _no_extension(code: int, _data: bytes) -> object:
    raise Malformed(f"an extension of type {code}")


# --- ticks -----------------------------------------------------------------------------------------------------------


def _tick(value: dict[str, Any], robots: int) -> TickRecord:
    k, mfow, fog_mean, seen = value["k"], value["mfow"], value["fog_mean"], value["seen"]
    _whole(k, "k", 0, _MAX_K)
    _whole(mfow, "mfow", 0, _MOST_POINT_TICKS)
    _whole(seen, "seen", 0, _MOST_POINT_TICKS)
    _number(fog_mean, "fog_mean", 0.0)
    frames = value["frames"]
    for source, frame in frames:
        if type(source) is not int or type(frame) is not bytes or not 0 <= source <= _MAX_ROBOT:
            raise Malformed("frames: expected robot numbers and bytes")
    delivered, dropped = value["delivered"], value["dropped"]
    copies, delayed, forged = value.get("copies", ()), value.get("delayed", ()), value.get("forged", ())
    most = min(_LEAST_LINKS + 8 * (robots + 1) ** 2, _MOST_LINKS)
    for groups in (delivered, dropped, copies, delayed):
        if groups:
            most = _check_links(groups, most)
    if not all(type(one) is str for one in forged):
        raise Malformed("forged: expected texts")
    return TickRecord(
        k,
        tuple([_robot(row) for row in value["robots"]]),
        frames,
        tuple([(source, to, sequence) for source, sequence, _, tos in delivered for to in tos]),
        _links(dropped),
        mfow,
        fog_mean,
        seen,
        _links(copies),
        _links(delayed),
        tuple(forged),
    )


def _check_links(groups: Iterable[Any], most: int) -> int:
    """Check links as the writer drew them together: (source, sequence, cause, destinations).

    Args:
        groups: Of one tick.
        most: How many links the tick may still have.

    Returns:
        How many it may still have then.
    """
    for source, sequence, cause, destinations in groups:
        if not (
            type(source) is type(sequence) is int
            and type(cause) is str
            and 0 <= source <= _MAX_ROBOT
            and 0 <= sequence <= _MAX_SEQUENCE
        ):
            raise Malformed("links: expected robot numbers, sequences and causes")
        array("H", destinations)  # raises for anything but numbers from 0 to 65535
        most -= len(destinations)
        if most < 0:
            raise Malformed("more links than the robots can have")
    return most


def _links(groups: Iterable[Any]) -> tuple[tuple[int, int, int, str], ...]:
    """Return the links that the writer had grouped by destination, one by one."""
    if not groups:
        return ()
    return tuple([(source, to, sequence, why) for source, sequence, why, tos in groups for to in tos])


_STATUS = {int(status): status for status in Status}
_NUMBER = frozenset({int, float})
_NONE = frozenset({type(None)})
_TEXT, _FLAG, _WHOLE, _PAIR = (frozenset({kind}) for kind in (str, bool, int, tuple))
_COLUMNS = (
    ("number", _WHOLE),
    ("status", _WHOLE),
    *((name, _NUMBER) for name in ("x", "y", "heading", "c0", "c1")),
    ("bumped", _FLAG),
    ("state", _TEXT),
    ("goal", _PAIR | _NONE),
    ("decision_ms", _NUMBER | _NONE),
    ("rejected", _WHOLE | _NONE),
    ("refused", _FLAG),
)
_known_types: set[tuple[type, ...]] = set()
"""Types of rows that were checked one by one already; there are less than a thousand that pass."""


class _Row:
    """A row, checked and filled in before it becomes a `RobotTick`; reports read millions of them.

    The frozen constructor of `RobotTick` sets each field by a call, which takes longer than all checks of a row
    together.
    """

    __slots__ = tuple(field.name for field in fields(RobotTick))

    def __init__(
        self,
        number: int,
        status: int,
        x: float,
        y: float,
        heading: float,
        c0: float,
        c1: float,
        bumped: bool,
        state: str,
        goal: tuple[float, float] | None,
        decision_ms: float | None,
        rejected: int | None,
        refused: bool,
    ) -> None:
        # A comparison with NaN is false.
        if not (
            -FARTHEST <= x <= FARTHEST
            and -FARTHEST <= y <= FARTHEST
            and -_LARGEST <= heading <= _LARGEST
            and -_LARGEST <= c0 <= _LARGEST
            and -_LARGEST <= c1 <= _LARGEST
            and 1 <= number <= _MAX_ROBOT
            and (rejected is None or 0 <= rejected <= _MOST_COUNT)
            and (decision_ms is None or -_LARGEST <= decision_ms <= _LARGEST)
        ):
            raise Malformed(f"robots: robot {number} has a number out of range, or one that is not finite")
        if goal is not None:
            goal_x, goal_y = goal
            if not (math.isfinite(goal_x) and math.isfinite(goal_y)):
                raise Malformed(f"robots: robot {number} has a goal that is not finite")
        self.number = number
        self.status = _STATUS[status]
        self.x = x
        self.y = y
        self.heading = heading
        self.c0 = c0
        self.c1 = c1
        self.bumped = bumped
        self.state = state
        self.goal = goal
        self.decision_ms = decision_ms
        self.rejected = rejected
        self.refused = refused


def _robot(row: tuple[Any, ...]) -> RobotTick:
    if (types := (*map(type, row),)) not in _known_types:
        for (name, allowed), kind in zip(_COLUMNS, types, strict=True):
            if kind not in allowed:
                raise Malformed(f"robots: {name} is of type {kind.__name__}")
        _known_types.add(types)
    filled: Any = _Row(*row)
    filled.__class__ = RobotTick
    one: RobotTick = filled
    return one


# --- the other records -----------------------------------------------------------------------------------------------


def _event(value: Mapping[str, Any]) -> Event:
    event = Event(**value)
    _whole(event.k, "k", 0, _MAX_K)
    _text(event.kind, "kind", _NAME)
    if event.robot is not None:
        _whole(event.robot, "robot", 0, _MAX_ROBOT)
    _text(event.detail, "detail")
    return event


def _end(value: Mapping[str, Any]) -> End:
    end = End(**value)
    _text(end.reason, "reason")
    _text(end.trace_hash, "trace_hash")
    for name, note in _mapping(end.notes, "notes").items():
        if name in _SECONDS:
            _number(note, f"notes.{name}", _SHORTEST_S if name == "wall_s" else 0.0)
        elif name in _BY_ROBOT:
            for robot, count in _mapping(note, f"notes.{name}").items():
                _whole(robot, f"notes.{name}", 1, _MAX_ROBOT)
                _whole(count, f"notes.{name}", 0, _MOST_COUNT)
        elif name == "refused":
            _counts(note, "notes.refused")
        elif name == "direct":
            _direct(note)
    return end


_SHORTEST_S = 1e-6
"""No run takes less wall time, s."""

_SECONDS = frozenset({"wall_s", "slipped_s", "held_up_s", "longest_held_up_s", "router_silent_s"})
_BY_ROBOT = frozenset({"late_frames", "too_late", "late_commands"})
"""Notes in s of wall time, and counts by robot number. What else notes may hold, its reader checks."""


def _direct(value: object) -> None:
    """Check the note of a direct radio (`worldsim.radio.listener.Listener.notes`)."""
    direct = _mapping(value, "notes.direct")
    _counts(direct.get("missed", {}), "notes.direct.missed")
    for says in _mapping(direct.get("said", {}), "notes.direct.said").values():
        counts = _mapping(says, "notes.direct.said")
        _counts(counts["heard"], "notes.direct.said.heard")
        for name in ("sent", "refused"):
            _whole(counts[name], f"notes.direct.said.{name}", 0, _MOST_COUNT)
        if type(counts["final"]) is not bool:
            raise Malformed("notes.direct.said.final: expected true or false")


def _mapping(value: object, name: str) -> dict[Any, Any]:
    if type(value) is not dict:
        raise Malformed(f"{name}: expected a mapping")
    return value


def _counts(value: object, name: str) -> None:
    for key, count in _mapping(value, name).items():
        _text(key, name, _NAME)
        _whole(count, name, 0, _MOST_COUNT)


def _header(value: dict[str, Any]) -> Header:
    robots = tuple(RobotFacts(**facts) for facts in value.pop("robots"))
    terrain = value.pop("terrain")
    x, y = terrain.pop("origin")
    facts = TerrainFacts(**terrain, origin=(_number(x, "terrain.origin"), _number(y, "terrain.origin")))
    header = Header(robots=robots, terrain=facts, **value)
    for robot in robots:
        _whole(robot.number, "robots.number", 1, _MAX_ROBOT)
        if not _text(robot.name, "robots.name", _NAME):
            raise Malformed("robots.name: is empty")
        if _text(robot.model, "robots.model") not in MODELS:
            raise Malformed(f"robots.model: expected one of {', '.join(MODELS)}")
        _positive(robot.radius, "robots.radius")
    _text(facts.name, "terrain.name", _PATH)
    for name in ("width", "height"):
        _whole(getattr(facts, name), f"terrain.{name}", 1, MOST_POINTS)
    if facts.width * facts.height > MOST_POINTS:
        raise Malformed(f"terrain: more than {MOST_POINTS} points")
    _positive(facts.point, "terrain.point")
    for name in ("software", "scenario_hash"):
        _text(getattr(header, name), name, 4 * _NAME)
    if header.started is not None:
        _text(header.started, "started", _NAME)
    for name in ("patrolled_area_m2", "bound_s"):
        _number(getattr(header, name), name, 0.0)
    if type(header.scenario) is not dict:
        raise Malformed("scenario: expected a mapping")
    _plain(header.scenario, "scenario")
    return header


_KINDS: Mapping[str, Callable[[dict[str, Any]], Record]] = {"header": _header, "event": _event, "end": _end}


def _plain(value: Any, name: str) -> None:
    """Check that a value has a JSON form; msgpack itself limits how deep it is."""
    if isinstance(value, dict):
        for key, inner in value.items():
            if type(key) is not str and type(key) is not int:
                raise Malformed(f"{name}: holds a key of type {type(key).__name__}")
            _plain(inner, name)
    elif isinstance(value, list):
        for inner in value:
            _plain(inner, name)
    elif isinstance(value, float):
        if not math.isfinite(value):
            raise Malformed(f"{name}: holds a number that is not finite")
    elif value is not None and not isinstance(value, (str, int)):
        raise Malformed(f"{name}: holds a value of type {type(value).__name__}")


def _whole(value: object, name: str, least: int, most: int) -> int:
    if type(value) is not int or not least <= value <= most:
        raise Malformed(f"{name}: expected a whole number from {least} to {most}")
    return value


def _number(value: object, name: str, least: float = -_LARGEST) -> float:
    if (type(value) is not float and type(value) is not int) or not least <= value <= _LARGEST:
        raise Malformed(f"{name}: expected a finite number from {least:g} to {_LARGEST:g}")
    return float(value)


def _positive(value: object, name: str) -> float:
    if _number(value, name) <= 0.0:
        raise Malformed(f"{name}: expected a number above 0")
    return float(value)  # type: ignore[arg-type]


def _text(value: object, name: str, most: int | None = None) -> str:
    if type(value) is not str or (most is not None and len(value) > most):
        raise Malformed(f"{name}: expected text" + ("" if most is None else f" of at most {most} characters"))
    return value
