"""Records of a journal from bytes of unknown origin.

What each may hold is declared with it (`patrol.journal.records`). A record costs memory before it is checked: a byte
can become a container of 88 bytes. So its size is limited by the number of robots, and its containers and links are
counted.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from patrol.errors import Malformed
from patrol.journal.records import End, Event, Header, Record, TickRecord
from patrol.wire import check, unpack

MAX_RECORD = 1 << 28
"""Bytes of the longest record, however many robots there are."""

MOST_CONTAINERS = 250_000
"""Lists and mappings of a record other than a tick."""

_LEAST_RECORD = 1 << 22
_MOST_LINKS = 4_000_000
_LEAST_LINKS = 500_000
_TICK = b"\xa4type\xa4tick"
_LINKS = ("delivered", "dropped", "copies", "delayed")
_KINDS: Mapping[str, type[Record]] = {"header": Header, "tick": TickRecord, "event": Event, "end": End}


def longest_record(robots: int) -> int:
    """Return the bytes of a fleet's longest record: 30 times a record of a tick in which all robots hear each other.

    For example, about 4.2 MB for 10 robots and 13 MB for 1000.
    """
    return min(_LEAST_RECORD + 1024 * robots + 8 * robots * robots, MAX_RECORD)


def is_tick(payload: bytes) -> bool:
    """Return True if a record, as this program writes it, is a tick."""
    # The first byte says how many fields there are; the type is written first.
    return payload[1:11] == _TICK


def decode(payload: bytes, robots: int) -> Record:
    """Decode the record in a payload; raise Malformed for bytes that are no record."""
    if is_tick(payload):
        fields = unpack(payload, object_hook=_one_map)
    else:
        counted = _Counter()
        fields = unpack(payload, use_list=True, strict_map_key=False, object_hook=counted, list_hook=counted)
    # Without its type, the fields alone are left to check.
    if type(fields) is not dict or type(kind := fields.pop("type", None)) is not str or kind not in _KINDS:
        raise Malformed("no record of a known type")
    if kind == "tick":
        _check_links(fields, robots)
    return check(_KINDS[kind], fields)


def _check_links(tick: Mapping[str, Any], robots: int) -> None:
    """Refuse links of other robots, and more links than there can be, each of which takes many times its bytes."""
    # A frame may be delivered, dropped, copied and delayed to each robot; eight such links for each pair is ample.
    links, link_limit, are_known = 0, min(_LEAST_LINKS + 8 * (robots + 1) ** 2, _MOST_LINKS), True
    try:
        for name in _LINKS:
            for source, _, _, destinations in tick.get(name, ()):
                links += len(destinations)
                are_known &= source <= robots
                are_known &= not destinations or 1 <= min(destinations) <= max(destinations) <= robots
    except (TypeError, ValueError):
        raise Malformed("links: expected robot numbers, sequences, causes and destinations") from None
    if not are_known:
        raise Malformed("links of a robot that the header does not have")
    if links > link_limit:
        raise Malformed("more links than the robots can have")


def _one_map(value: dict[str, Any]) -> dict[str, Any]:
    """Read a mapping in a tick, which has no other inside."""
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
