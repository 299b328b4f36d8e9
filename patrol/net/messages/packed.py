"""Reads msgpack piece by piece, so that a payload makes no more objects than its reader asks for.

A payload of 33 MB can hold 33 million empty maps, which take 2 GB as Python objects. A reader that knows what it
expects refuses the first of them.
"""

from __future__ import annotations

from typing import Any

import msgpack

_ERRORS = (ValueError, TypeError, OverflowError, RecursionError, msgpack.UnpackException)

# The first bytes of what holds other values: small maps and arrays, extensions, and large arrays and maps.
_HOLDS = frozenset([*range(0x80, 0xA0), 0xC7, 0xC8, 0xC9, *range(0xD4, 0xD9), 0xDC, 0xDD, 0xDE, 0xDF])


class Unexpected(ValueError):
    """A payload holds something else than its reader expects."""


class Reader:
    """The values of a payload, one after the other.

    Args:
        payload: Any bytes.
    """

    def __init__(self, payload: bytes) -> None:
        self._payload = payload
        self._unpacker = msgpack.Unpacker(None, max_buffer_size=max(len(payload), 1), raw=False)
        self._unpacker.feed(payload)

    def array(self, most: int) -> int:
        """The length of the array that begins here; its values follow.

        Args:
            most: The greatest length.

        Raises:
            Unexpected: For anything else, and for a longer one.
        """
        return self._length(self._unpacker.read_array_header, most)

    def mapping(self, most: int) -> int:
        """The length of the map that begins here; its keys and values follow in turn.

        Args:
            most: The greatest length.

        Raises:
            Unexpected: For anything else, and for a longer one.
        """
        return self._length(self._unpacker.read_map_header, most)

    def value(self) -> Any:
        """The number, text, bytes, truth value or None that is next.

        Raises:
            Unexpected: For an array or a map, and at the end.
        """
        at = self._unpacker.tell()
        if at >= len(self._payload) or self._payload[at] in _HOLDS:
            raise Unexpected("not a single value")
        try:
            return self._unpacker.unpack()
        except _ERRORS as error:
            raise Unexpected(f"not msgpack ({type(error).__name__})") from None

    def values(self, kind: type, most: int) -> list[Any]:
        """The array of values of one type that is next.

        Args:
            kind: Their exact type.
            most: The greatest length.

        Raises:
            Unexpected: For anything else.
        """
        found = [self.value() for _ in range(self.array(most))]
        if any(type(one) is not kind for one in found):
            raise Unexpected(f"not all are {kind.__name__}")
        return found

    def end(self) -> None:
        """Check that nothing follows.

        Raises:
            Unexpected: When something does.
        """
        if self._unpacker.tell() != len(self._payload):
            raise Unexpected("more than is expected")

    def _length(self, read: Any, most: int) -> int:
        try:
            length = int(read())
        except _ERRORS as error:
            raise Unexpected(f"not an array or a map ({type(error).__name__})") from None
        if length > most:
            raise Unexpected(f"longer than {most}")
        return length
