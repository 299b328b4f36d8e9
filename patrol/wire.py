"""Messages and records from bytes of unknown origin, checked against one declaration each.

A message is a dataclass. Its fields' annotations hold their types and limits, from which pydantic makes what checks
them. A plain dataclass is a map by field names; readers skip fields that they do not know. One that derives from `Row`
is an array of its fields in order, without names:

    @dataclass(frozen=True, slots=True)
    class Ping(Row):
        k: Annotated[int, Field(strict=True, ge=0, le=9)]
        who: Text

    read(Ping, msgpack.packb([3, "r1"]))     Ping(k=3, who="r1")
    read(Ping, msgpack.packb([10, "r1"]))    Malformed: k: Input should be less than or equal to 9

Fields are strict one by one, because a message that is strict as a whole takes no lists for tuples.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, make_dataclass
from functools import cache
from operator import attrgetter
from typing import Annotated, Any, Self, TypeVar, get_type_hints

import msgpack
from pydantic import AfterValidator, Field, GetCoreSchemaHandler, GetPydanticSchema, TypeAdapter, ValidationError
from pydantic_core import CoreSchema
from pydantic_core import core_schema as schemas

from patrol.errors import Malformed, printable

__all__ = [
    "FAIL_FAST",
    "FAIL_FAST_MAP",
    "NO_WHOLE",
    "PRINTABLE",
    "Bytes",
    "Finite",
    "Flag",
    "Real",
    "Row",
    "Text",
    "check",
    "read",
    "read_sparingly",
    "unpack",
]

T = TypeVar("T")

_ERRORS = (ValueError, TypeError, OverflowError, RecursionError, msgpack.UnpackException)

# The first bytes of what holds other values: small maps and arrays, extensions, and large arrays and maps.
_HOLDS = frozenset([*range(0x80, 0xA0), 0xC7, 0xC8, 0xC9, *range(0xD4, 0xD9), 0xDC, 0xDD, 0xDE, 0xDF])
_SINGLE = {"type": "any"}
_MAX_FIELDS = 64
"""Fields of a map that is read sparingly, with room for those of later versions."""
_LONGEST_NAME = 60
_MAX_ENTRIES = 1 << 17
"""Entries of any map: a message has one for each robot at most, and a few more."""


def _check_printable(text: str) -> str:
    if not text.isprintable():
        raise ValueError("is not printable")
    return text


Flag = Annotated[bool, Field(strict=True)]
Bytes = Annotated[bytes, Field(strict=True)]
Text = Annotated[str, Field(strict=True)]
PRINTABLE = AfterValidator(_check_printable)
"""Check of a text that is shown. It and `NO_WHOLE` come last: limits behind them are checked in Python, not in Rust."""
NO_WHOLE = GetPydanticSchema(lambda kind, of: schemas.chain_schema([schemas.is_instance_schema(float), of(kind)]))
"""Check of a float in whose place no whole number may stand; for example 1.0 passes, and 1 does not."""
Real = Annotated[float, Field(strict=True), NO_WHOLE]
Finite = Annotated[float, Field(strict=True, allow_inf_nan=False), NO_WHOLE]
FAIL_FAST = Field(fail_fast=True)
"""Setting of each array: the first wrong value ends the reading, or millions of them would make millions of errors."""
FAIL_FAST_MAP = GetPydanticSchema(lambda kind, of: {**of(kind), "fail_fast": True})
"""The same for each ``dict``, for which `Field` has it only in later versions of pydantic."""
_adapters: dict[Any, TypeAdapter[Any]] = {}


class Row:
    """Base of a message that is an array. What it is on the wire may differ from its fields: override all three."""

    __slots__ = ()

    @classmethod
    def columns(cls) -> Mapping[str, Any]:
        """Return the names and annotated types of its values.

        For example, those of ``Ping`` are named "k" and "who".
        """
        kind: Any = cls
        return _type_hints(kind)

    @classmethod
    def from_values(cls, *values: Any) -> Self:
        """Make a message of checked values.

        For example, ``Ping.from_values(3, "r1")`` is ``Ping(k=3, who="r1")``.

        Args:
            values: One for each column.

        Raises:
            ValueError: They do not go together.
        """
        return cls(*values)

    def to_values(self) -> tuple[Any, ...]:
        """Return the values to send.

        For example, those of ``Ping(k=3, who="r1")`` are ``(3, "r1")``.
        """
        kind: Any = type(self)
        values: tuple[Any, ...] = _values_of(kind)(self)
        return values

    @classmethod
    def __get_pydantic_core_schema__(cls, _source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        columns = cls.columns()
        items = [handler.generate_schema(column) for column in columns.values()]
        row = schemas.tuple_schema(items, metadata={"names": tuple(columns)})
        return schemas.no_info_after_validator_function(_row_maker(cls), row)


def _row_maker(kind: type[Row]) -> Callable[[tuple[Any, ...]], Row]:
    """Return a function that makes a row of its checked values.

    A frozen constructor sets each field by a call, which takes twice as long as all checks of a row together, and a
    report reads millions. So a row that is made of its fields is filled in by a class that is not frozen.
    """
    if kind.__bases__ != (Row,) or {"from_values", "__post_init__"} & vars(kind).keys():
        return lambda values: kind.from_values(*values)
    unfrozen = make_dataclass(kind.__name__, list(kind.columns()), bases=(Row,), slots=True)

    def fill(values: tuple[Any, ...]) -> Row:
        row: Any = unfrozen(*values)
        row.__class__ = kind
        filled: Row = row
        return filled

    return fill


def unpack(
    payload: bytes,
    use_list: bool = False,
    strict_map_key: bool = True,
    object_hook: Callable[[dict[Any, Any]], object] | None = None,
    list_hook: Callable[[list[Any]], object] | None = None,
) -> Any:
    """Unpack the values in a payload; small ones take many times the bytes that they are packed in.

    For example, ``unpack(msgpack.packb([1, 2, 3]))`` gives ``(1, 2, 3)``.

    Args:
        payload: Any bytes, not more than may be turned into objects.
        use_list: Whether arrays become lists and not tuples.
        strict_map_key: Whether all keys are text or bytes.
        object_hook: Takes each map.
        list_hook: Takes each array.

    Raises:
        Malformed: The bytes are not msgpack, or a hook raises it.
    """
    try:
        return msgpack.unpackb(
            payload,
            use_list=use_list,
            strict_map_key=strict_map_key,
            object_hook=object_hook,
            list_hook=list_hook,
            ext_hook=_refuse_extension,
            max_map_len=_MAX_ENTRIES,
        )
    except Malformed:
        raise
    except _ERRORS as error:
        raise Malformed(f"not msgpack ({type(error).__name__})") from None


def check(kind: type[T], value: object) -> T:
    """Make a message of values, if they fit its declaration.

    For example, ``check(Ping, [3, "r1"])`` gives ``Ping(k=3, who="r1")``.

    Args:
        kind: Its class.
        value: The unpacked value.

    Raises:
        Malformed: It is no such message; the text names the field.
    """
    adapter = _adapter_of(kind)
    try:
        message: T = adapter.validate_python(value)
    except ValidationError as error:
        raise Malformed(_first_problem(error, adapter.core_schema)) from None
    except RecursionError:
        raise Malformed("nested too deeply") from None
    return message


def read(kind: type[T], payload: bytes) -> T:
    """Read the message in a payload.

    Args:
        kind: Its class.
        payload: Any bytes, not more than may be turned into objects.

    Raises:
        Malformed: It is no such message.
    """
    return check(kind, unpack(payload))


def read_sparingly(kind: type[T], payload: bytes) -> T:
    """Read the message in a long payload, making no more objects than the message's declaration allows.

    A payload of 33 MB can hold 33 million empty maps, which take 2 GB as Python objects. Fields that are not known may
    hold single values only.

    Args:
        kind: Its class.
        payload: Any bytes.

    Raises:
        Malformed: It is no such message.
    """
    sparing = _Sparing(payload)
    value = sparing.take(_adapter_of(kind).core_schema)
    sparing.end()
    return check(kind, value)


class _Sparing:
    """The values of a payload, one after the other."""

    def __init__(self, payload: bytes) -> None:
        self._payload = payload
        self._unpacker = msgpack.Unpacker(None, max_buffer_size=max(len(payload), 1))
        self._unpacker.feed(payload)

    def take(self, schema: Any) -> Any:
        """Take the value that is next, in the shape that its schema has."""
        schema = _strip_schema(schema)
        if schema["type"] == "dataclass-args":
            schemas_by_name = {field["name"]: field["schema"] for field in schema["fields"]}
            names = (self._take_value() for _ in range(self._take_length("map", _MAX_FIELDS)))
            return {name: self.take(schemas_by_name.get(name, _SINGLE)) for name in names}
        if schema["type"] != "tuple":
            return self._take_value()
        items = schema["items_schema"]
        if "variadic_item_index" not in schema:
            return [self.take(item) for item in items[: self._take_length("array", len(items))]]
        slots = range(self._take_length("array", schema["max_length"]))
        return (
            [self.take(items[0]) for _ in slots]
            if _strip_schema(items[0])["type"] == "tuple"
            else [self._take_value() for _ in slots]
        )

    def end(self) -> None:
        """Check that nothing follows."""
        if self._unpacker.tell() != len(self._payload):
            raise Malformed("more than is expected")

    def _take_value(self) -> Any:
        """Take the number, text, bytes, truth value or None that is next."""
        offset = self._unpacker.tell()
        if offset >= len(self._payload) or self._payload[offset] in _HOLDS:
            raise Malformed("not a single value")
        try:
            return self._unpacker.unpack()
        except _ERRORS as error:
            raise Malformed(f"not msgpack ({type(error).__name__})") from None

    def _take_length(self, what: str, most: int) -> int:
        try:
            length = int(getattr(self._unpacker, f"read_{what}_header")())
        except _ERRORS as error:
            raise Malformed(f"no {what} ({type(error).__name__})") from None
        if length > most:
            raise Malformed(f"{what} of {length}, at most {most} are allowed")
        return length


def _adapter_of(kind: Any) -> TypeAdapter[Any]:
    """Return the validator of a kind of message, made when the first one comes, which takes about a millisecond."""
    adapter = _adapters.get(kind)
    if adapter is None:
        adapter = _adapters[kind] = TypeAdapter(kind)
    return adapter


@cache
def _type_hints(kind: type) -> Mapping[str, Any]:
    hints = get_type_hints(kind, include_extras=True)
    return {field.name: hints[field.name] for field in fields(kind)}


@cache
def _values_of(kind: type) -> Callable[[object], Any]:
    return attrgetter(*_type_hints(kind))


def _strip_schema(schema: Any) -> Any:
    """Strip what is done with a value from its schema: what is left is that of an array, a map or a single value."""
    while schema["type"] not in ("tuple", "dataclass-args") and "schema" in schema:
        schema = schema["schema"]
    return schema


def _first_problem(error: ValidationError, schema: Any) -> str:
    """Give the first error in one line, without the value, which may be long."""
    first = error.errors(include_url=False, include_context=False, include_input=False)[0]
    path = []
    for part in first["loc"]:
        schema, name = _strip_schema(schema), part
        if schema["type"] == "tuple" and isinstance(part, int):
            name = schema.get("metadata", {}).get("names", {part: part})[part]
            schema = schema["items_schema"][0 if "variadic_item_index" in schema else part]
        else:
            schemas_by_name = {field["name"]: field["schema"] for field in schema.get("fields", ())}
            schema = schemas_by_name.get(part, _SINGLE)
        path.append(printable(str(name))[:_LONGEST_NAME])
    return ": ".join(filter(None, (".".join(path), first["msg"].removeprefix("Value error, "))))


def _refuse_extension(code: int, _data: bytes) -> object:
    raise Malformed(f"an extension of type {code}")
