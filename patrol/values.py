"""Sections of a scenario, the types of the values in them, and the errors for anything else.

Numbers are strict and bounded: no boolean or text is taken for one, and neither NaN nor infinity passes.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, Literal, Self, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    Strict,
    Tag,
    ValidationError,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    model_validator,
)
from pydantic_core import PydanticCustomError
from pydantic_core import core_schema as schemas

from patrol.pose import Model
from patrol.radio.message import MAX_FRAME, MAX_TRAIL

if TYPE_CHECKING:
    from patrol.ground.marks import Look, Mark, Moment
    from patrol.ground.terrain import Terrain


class Section(BaseModel):
    """A mapping of the scenario file: frozen, and strict about its keys.

    A section says itself what of it enters a scenario's hash, and which files it names.
    """

    LATER: ClassVar[Mapping[str, Any]] = MappingProxyType({})
    """Fields that came later, and the values with which they do not enter the hash, so that older hashes stay."""

    EXAMPLE: ClassVar[str] = ""
    """An entry, for errors about an empty list of such sections."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    def reduce(self, says: dict[str, Any], files: bool) -> None:
        """Leave only what changes a run in the section's values.

        A file enters by its content, which may be read for that; without `files` only by its presence.
        """
        for name, field in type(self).model_fields.items():
            key, value = name if name in says else field.alias, getattr(self, name)
            if key not in says:
                continue
            if name in self.LATER and value == self.LATER[name]:
                del says[key]
                continue
            entries, parts = (value, says[key]) if isinstance(value, tuple) else ((value,), (says[key],))
            for entry, part in zip(entries, parts, strict=True):
                if isinstance(entry, Section):
                    entry.reduce(part, files)

    def mark(self, terrain: Terrain, number: int) -> Mark | None:
        """Return what maps show of the section, the `number`-th of a list; None for one that they do not show."""
        del terrain, number
        return None

    def look(self, moment: Moment) -> Look | None:
        """Return what its mark looks like at a moment; None for one that never changes."""
        del moment
        return None

    def with_digests(self) -> Self:
        """Add the SHA-256 of the files of classes and networks, where it does not have them yet."""
        return self._with_sections(lambda section: section.with_digests())

    def with_copies(self, folder: Path) -> Self:
        """Copy the files that it names into a folder, and name the copies, relative to that folder."""
        return self._with_sections(lambda section: section.with_copies(folder))

    def _with_sections(self, change: Callable[[Section], Section]) -> Self:
        """Change the sections in it, but for those in lists."""
        values = ((name, getattr(self, name)) for name in type(self).model_fields)
        sections = [(name, value) for name, value in values if isinstance(value, Section)]
        changed = {name: now for name, section in sections if (now := change(section)) is not section}
        return self.model_copy(update=changed) if changed else self


class OneOf(Section):
    """A section of which exactly one field is given; `CHOICE` lists them, for errors."""

    CHOICE: ClassVar[str]

    @model_validator(mode="after")
    def _has_one_field(self) -> Self:
        if sum(getattr(self, name) is not None for name in type(self).model_fields) != 1:
            raise wrong("", f"exactly one is needed: {self.CHOICE}")
        return self


def digest_of(meaning: Mapping[str, Any]) -> str:
    """Return the SHA-256 (hex) of texts and numbers by name, in any order."""
    text = json.dumps(meaning, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def wrong(field: str, problem: str, value: float | None = None) -> PydanticCustomError:
    """Make the error of a check over several fields.

    `field` is the one to change, dotted from the model that checks; empty for the model itself. `problem` also says
    what to do instead. A `value` is shown in the message.
    """
    shown = "" if value is None else f" = {value:g}"
    return PydanticCustomError("crossed", "{problem}", {"field": field, "value": shown, "problem": problem})


def absolute(value: str, info: ValidationInfo) -> str:
    """Resolve a path against the folder that the validation's context names; without one it stays the same."""
    base = info.context.get("base") if isinstance(info.context, dict) else None
    return value if base is None else str((Path(base) / value).absolute())


MAX_ROBOTS = 65_000
MAX_SEED = 2**63 - 1
MAX_CORNERS = 5000
MAX_POLYGONS = 1000
# Larger numbers mean nothing in metres, seconds or points, and overflow the arithmetic of grids.
LARGEST = 1e9

Kind = Model
Builtin = Literal["open", "yards", "clutter", "site"]
BUILTINS: tuple[str, ...] = get_args(Builtin)
Patrolled = Literal["ground", "vertices"]


def expecting(what: str, bare: bool = False) -> WrapValidator:
    """Replace whatever the inner checks say by one message: what was expected.

    With `bare`, `what` says nothing about the field, so the message adds the field's description.
    """

    def check(value: Any, handler: ValidatorFunctionWrapHandler) -> Any:
        try:
            return handler(value)
        except ValidationError:
            raise unexpected(what, bare) from None

    return WrapValidator(check)


def _bare_validator(what: str) -> WrapValidator:
    return expecting(what, bare=True)


def unexpected(what: str, bare: bool = False) -> PydanticCustomError:
    """Make the error of a value in whose place something else was expected; `bare` as for `expecting`."""
    return PydanticCustomError("expected", "{what}", {"what": what, "bare": bare})


@dataclass(frozen=True)
class Items:
    """A bound of the number of items in a list, in its checks and in its schema.

    Too many are refused before any of them is looked at; too few after the items' own checks, so that a wrong item is
    not counted as missing.
    """

    key: Literal["minItems", "maxItems"]
    count: int
    what: str

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> schemas.CoreSchema:
        """Add the check."""
        if self.key == "minItems":
            return schemas.no_info_after_validator_function(self._check, handler(source))
        return schemas.no_info_before_validator_function(self._check, handler(source))

    def __get_pydantic_json_schema__(self, schema: schemas.CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Add the bound."""
        return {**handler(schema), self.key: self.count}

    def _check(self, items: Any) -> Any:
        count = len(items) if isinstance(items, list | tuple) else self.count
        if self.key == "minItems" and count < self.count:
            raise unexpected(f"{self.count} or more {self.what}")
        if self.key == "maxItems" and count > self.count:
            raise unexpected(f"at most {self.count} {self.what}")
        return items


def at_least(count: int, what: str) -> Items:
    """Bound the number of items in a list from below."""
    return Items("minItems", count, what)


def at_most(count: int, what: str) -> Items:
    """Bound the number of items in a list from above."""
    return Items("maxItems", count, what)


Number = Annotated[float, Strict(), Field(ge=-LARGEST, le=LARGEST), _bare_validator("a number from -1e9 to 1e9")]
Positive = Annotated[float, Strict(), Field(gt=0, le=LARGEST), _bare_validator("a number above 0 and at most 1e9")]
NotNegative = Annotated[float, Strict(), Field(ge=0, le=LARGEST), _bare_validator("a number from 0 to 1e9")]
Exponent = Annotated[float, Strict(), Field(gt=0, le=600), _bare_validator("a number above 0 and at most 600")]
AUTO: Final = "auto"
Auto = Literal["auto"]
AutoPositive = Annotated[Auto | Positive, _bare_validator("auto, or a number above 0 and at most 1e9")]
AutoNotNegative = Annotated[Auto | NotNegative, _bare_validator("auto, or a number from 0 to 1e9")]


def _or_auto(schema: dict[str, Any]) -> None:
    """Let a schema take ``auto``, which loading replaces by a number, and make it the default."""
    number = {name: schema.pop(name) for name in ("type", "exclusiveMinimum", "maximum")}
    schema |= {"anyOf": [{"const": AUTO, "type": "string"}, number], "default": AUTO}


Step = Annotated[
    float,
    Strict(),
    Field(gt=0, le=LARGEST, json_schema_extra=_or_auto),
    _bare_validator("auto, or a number above 0 and at most 1e9"),
]
Probability = Annotated[float, Strict(), Field(ge=0, le=1), _bare_validator("a number from 0 to 1")]
Share = Annotated[float, Strict(), Field(gt=0, le=1), _bare_validator("a number above 0 and at most 1")]
Burst = Annotated[float, Strict(), Field(ge=1, le=LARGEST), _bare_validator("a number from 1 to 1e9")]
Growth = Annotated[float, Strict(), Field(gt=-1, le=1), _bare_validator("a number above -1 and at most 1")]
Degrees = Annotated[float, Strict(), Field(gt=0, le=360), _bare_validator("a number above 0 and at most 360")]
Power = Annotated[float, Strict(), Field(ge=-200, le=100), _bare_validator("a number from -200 to 100")]
Decibels = Annotated[float, Strict(), Field(ge=0, le=200), _bare_validator("a number from 0 to 200")]
PathLossExponent = Annotated[float, Strict(), Field(ge=1, le=10), _bare_validator("a number from 1 to 10")]
Tolerance = Annotated[float, Strict(), Field(ge=0, lt=1), _bare_validator("a number from 0 to below 1")]
Seed = Annotated[int, Strict(), Field(ge=0, le=MAX_SEED), _bare_validator("a whole number from 0 to 2^63 - 1")]
Count = Annotated[int, Strict(), Field(ge=1, le=MAX_ROBOTS), _bare_validator(f"a whole number from 1 to {MAX_ROBOTS}")]
Spares = Annotated[int, Strict(), Field(ge=0, le=MAX_ROBOTS), _bare_validator(f"a whole number from 0 to {MAX_ROBOTS}")]
Ticks = Annotated[int, Strict(), Field(ge=1, le=10**9), _bare_validator("a whole number from 1 to 1e9")]
Sectors = Annotated[int, Strict(), Field(ge=3, le=3600), _bare_validator("a whole number from 3 to 3600")]
Trail = Annotated[int, Strict(), Field(ge=0, le=MAX_TRAIL), _bare_validator(f"a whole number from 0 to {MAX_TRAIL}")]
TrailEvery = Annotated[int, Strict(), Field(ge=1, le=15), _bare_validator("a whole number from 1 to 15")]
Overhead = Annotated[int, Strict(), Field(ge=0, le=1000), _bare_validator("a whole number from 0 to 1000")]
FrameBytes = Annotated[
    int, Strict(), Field(ge=1, le=MAX_FRAME), _bare_validator(f"a whole number from 1 to {MAX_FRAME}")
]
Flag = Annotated[bool, Strict(), _bare_validator("true or false")]
PathText = Annotated[
    str, Field(min_length=1, pattern=r"^[^\x00-\x1f]+$"), expecting("the path of a file"), AfterValidator(absolute)
]
ClassText = Annotated[
    str, Field(pattern=r"^([A-Za-z0-9][A-Za-z0-9._-]{0,63}|[^\x00-\x1f:][^\x00-\x1f]*:[A-Za-z_][A-Za-z0-9_]*)$")
]
Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$"), expecting("64 hex digits")]
Name = Annotated[
    str,
    Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$"),
    expecting("text of at most 64 letters, digits, '.', '_' and '-' that begins with a letter or digit"),
]
RobotName = Annotated[
    str,
    Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,31}$"),
    expecting("text of at most 32 letters, digits, '_' and '-' that begins with a letter or digit"),
]
Corner = Annotated[tuple[Number, Number], expecting("[x, y] in m")]
Polygon = Annotated[tuple[Corner, ...], at_least(3, "corners"), at_most(MAX_CORNERS, "corners")]
Polygons = Annotated[tuple[Polygon, ...], at_most(MAX_POLYGONS, "polygons")]
Place = Annotated[
    tuple[Number, Number] | tuple[Number, Number, Number], expecting("[x, y] in m or [x, y, heading] in m and rad")
]
Pace = Annotated[
    Literal["lockstep", "realtime"] | Positive, expecting("lockstep, realtime or a factor of real time above 0")
]


def _value_shape(value: Any) -> str:
    """Tell which of a field's alternatives a value is meant to be."""
    if isinstance(value, list | tuple):
        return "=list"
    return "=mapping" if isinstance(value, Mapping | BaseModel) else "=single"


def by_shape(what: str) -> Discriminator:
    """Choose among alternatives tagged =list, =mapping and =single.

    The equals sign sets the tags apart from field names where an error's location mentions them.
    """
    return Discriminator(_value_shape, "expected", "{what}", {"what": what, "bare": False})


def _check_increasing(points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    if any(later[0] <= earlier[0] for earlier, later in pairwise(points)):
        raise unexpected("distances that increase along the list")
    return points


_RANDOM_OR_PLACE = "random, [x, y] in m or [x, y, heading] in m and rad"
Start = Annotated[
    Annotated[Literal["random"], expecting(_RANDOM_OR_PLACE), Tag("=single")]
    | Annotated[Place, expecting(_RANDOM_OR_PLACE), Tag("=list")],
    by_shape(_RANDOM_OR_PLACE),
]
_RANDOM_OR_PLACES = "random or a list of [x, y] or [x, y, heading]"
Starts = Annotated[
    Annotated[Literal["random"], expecting(_RANDOM_OR_PLACES), Tag("=single")]
    | Annotated[tuple[Place, ...], Tag("=list")],
    by_shape(_RANDOM_OR_PLACES),
]
_SHARE_OR_LIST = "a number above 0 and at most 1, or a list of [distance in m, quality]"
QualityPoint = Annotated[tuple[NotNegative, Share], expecting("[distance in m, quality above 0 and at most 1]")]
Quality = Annotated[
    Annotated[Share, expecting(_SHARE_OR_LIST), Tag("=single")]
    | Annotated[tuple[QualityPoint, ...], at_least(1, "points"), AfterValidator(_check_increasing), Tag("=list")],
    by_shape(_SHARE_OR_LIST),
]
Mechanism = Literal["claims", "artificial-obstacles", "semaphores", "repulsion"]
SEPARATIONS = "none | claims | artificial-obstacles | semaphores | repulsion, or a list"
Separation = Annotated[
    Annotated[Literal["none"] | Mechanism, expecting(SEPARATIONS), Tag("=single")]
    | Annotated[tuple[Annotated[Mechanism, expecting(SEPARATIONS)], ...], Tag("=list")],
    by_shape(SEPARATIONS),
]
