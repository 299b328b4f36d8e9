"""The base of every mapping of the scenario file."""

from __future__ import annotations

from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationInfo
from pydantic_core import PydanticCustomError


class Section(BaseModel):
    """A mapping of the scenario file: frozen, and strict about its keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")


def wrong(field: str, problem: str, value: float | None = None) -> PydanticCustomError:
    """Make the error of a check over several fields.

    `field` is the one to change, dotted from the model that checks; empty for the model itself. `problem` also says
    what to do instead. A `value` is shown in the message.
    """
    shown = "" if value is None else f" = {value:g}"
    return PydanticCustomError("crossed", "{problem}", {"field": field, "value": shown, "problem": problem})


def absolute(value: str | None, info: ValidationInfo) -> str | None:
    """Resolve a path against the folder that the validation's context names; without one it stays the same."""
    base = info.context.get("base") if isinstance(info.context, dict) else None
    return value if value is None or base is None else str((Path(base) / value).absolute())
