"""Errors about arguments that cannot be used: the option, its value, its unit and the remedy."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any

from typer.core import TyperCommand

from fogwatch.cli.options import FIELDS
from patrol.errors import BadInput, quoted


@dataclass(frozen=True, slots=True)
class _Quantity:
    """The values that an option of a certain metavar takes."""

    unit: str  # empty for a whole number
    example: str
    factors: dict[str, float]  # by other spellings of a unit, how many of `unit` one of it is


_LENGTHS = {"mm": 0.001, "cm": 0.01, "m": 1.0, "km": 1000.0}
_TIMES = {"ms": 0.001, "s": 1.0, "sec": 1.0, "min": 60.0, "h": 3600.0}
_SPEEDS = {"cm/s": 0.01, "m/s": 1.0, "km/h": 1.0 / 3.6}
_QUANTITIES = {
    "M": _Quantity("m", "0.3", _LENGTHS),
    "R": _Quantity("m", "10", _LENGTHS),
    "S": _Quantity("s", "600", _TIMES),
    "M/S": _Quantity("m/s", "1", _SPEEDS),
    "N": _Quantity("", "5", {}),
    "N...": _Quantity("", "5", {}),
    "K": _Quantity("", "7", {}),
}
"""The quantities by the metavar that the help shows."""

_EXTRA = re.compile(r"Got unexpected extra arguments?(?:\(s\))? \((.*)\)")
"""The parser's error for arguments that no parameter takes."""

_NUMBER = re.compile(r"\s*([-+]?[0-9]*[.,]?[0-9]+(?:[eE][-+]?[0-9]+)?)\s*([A-Za-z/]*)\s*")

_FIELD = re.compile(r"(?:(?P<before>^|.*: )override |^)(?P<field>[a-z_]\w*(?:\.\w+)*)(?P<equals> = )?")
"""A field at the beginning of an error, or one that an override gave."""


class HelpfulCommand(TyperCommand):
    """A command whose errors name the argument, the value that was given, and what to give instead."""

    example = ""
    """A command line that shows how the command is used."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the arguments; the parser's errors become BadInput that says what to give instead."""
        typed = list(args)
        try:
            return super().parse_args(ctx, args)
        except Exception as error:
            line = self._explain_error(error, ctx, typed)
            if line is None:
                raise
            raise BadInput(line) from None

    def invoke(self, ctx: Any) -> Any:
        """Run the command; its errors name options in place of the fields that they set."""
        try:
            return super().invoke(ctx)
        except BadInput as error:
            raise BadInput(_as_typed(str(error), self._typed_options(ctx))) from None

    def _typed_options(self, ctx: Any) -> dict[str, str]:
        """Return the options that were given and set fields of a scenario, by field."""
        set_by_name = [text.partition("=")[0].strip() for text in ctx.params.get("settings") or ()]
        options = {
            FIELDS[param.name]: param.opts[0]
            for param in self.params
            if param.name in FIELDS and ctx.get_parameter_source(param.name).name == "COMMANDLINE"
        }
        return options | {field: f"--set {field}" for field in set_by_name}

    def _explain_error(self, error: Exception, ctx: Any, typed: list[str]) -> str | None:
        """Rewrite an error of the parser; None to leave it as it is."""
        if hasattr(error, "possibilities") and hasattr(error, "option_name"):
            return self._unknown_option(str(error.option_name))
        param = getattr(error, "param", None)
        if param is None:
            extra = _EXTRA.match(str(getattr(error, "message", "")))
            return extra and f"{extra[1]}: not expected here; for example: {self.example}"
        if type(error).__name__ == "MissingParameter":
            option = next((f"{text} " for text in param.opts if text.startswith("--")), "")
            name = getattr(param, "metavar", None) or param.name
            return f"{option}{name} is missing; for example: {self.example}"
        values, *_ = self.make_parser(ctx).parse_args(args=typed)
        value = values.get(param.name)
        texts = [value] if isinstance(value, str) else list(value or ())
        name = next((text for text in reversed(param.opts) if text.startswith("--")), param.metavar)
        quantity = _QUANTITIES.get(param.metavar)
        if quantity is None:
            return None
        if isinstance(param.default, float):
            quantity = replace(quantity, example=f"{param.default:g}")
        return _not_a_number(name, texts, quantity, error)

    def _unknown_option(self, option: str) -> str:
        options = [text for param in self.params for text in (*param.opts, *param.secondary_opts) if text[:2] == "--"]
        return f"{option}: no such option; {_nearest_option(option, [*options, '--help'], self.example)}"


def _as_typed(line: str, typed: dict[str, str]) -> str:
    """Name the option in an error, not the field that it set, and ``--set`` instead of "override".

    `typed` holds the options by field.
    """
    match = _FIELD.match(line)
    if match is None:
        return line
    field, before = match["field"], match["before"]
    option = typed.get(re.sub(r"\.\d+", "", field), "")
    if option and not option.startswith("--set"):
        tail = re.sub(r"^(-?\d+)\.0:", r"\1:", line[match.end() :])
        return f"{before or ''}{option}{' ' if match['equals'] else ''}{tail}"
    sections = [f"{name}." for name in typed]
    if before is not None and any(f"{field}.".startswith(name) or name.startswith(f"{field}.") for name in sections):
        return f"{before}--set {line[match.start('field') :]}"
    return line


def _nearest_option(option: str, known: Sequence[str], example: str) -> str:
    """Suggest the known option that an unknown one begins, or else the one most like it."""
    completions = sorted((name for name in known if name.startswith(option)), key=len)
    words = [name[2:] for name in known]
    near = completions[:1] or [f"--{word}" for word in get_close_matches(option[2:], words, n=1, cutoff=0.6)]
    return f"did you mean {near[0]}?" if near else f"leave it out, or see --help; for example: {example}"


def _not_a_number(name: str, texts: Sequence[str], quantity: _Quantity, error: Any) -> str:
    is_whole = not quantity.unit
    wrong = next((text for text in texts if not _is_number(text, is_whole)), None)
    if wrong is None:  # a number, but out of range
        reason = str(getattr(error, "message", error)).rstrip(".").lower()
        bound = re.search(r"(?:greater than or equal to |x>=)(\S+)", reason)
        return f"{name} {' '.join(texts)}: {f'expected {bound[1]} or more' if bound else reason}"
    kind = "a whole number" if is_whole else f"a number in {quantity.unit}"
    option = f"{name} " if name.startswith("--") else ""
    return f"{name} {quoted(wrong)[1:-1]}: expected {kind}, such as {option}{_meant_number(wrong, quantity)}"


def _is_number(text: str, is_whole: bool) -> bool:
    try:
        int(text) if is_whole else float(text)
    except ValueError:
        return False
    return True


def _meant_number(text: str, quantity: _Quantity) -> str:
    """Return the number that a text such as "30cm" or "0,3" means in the quantity's unit, or else the example."""
    match = _NUMBER.fullmatch(text)
    if match is None or not quantity.unit:
        return quantity.example
    factor = quantity.factors.get(match[2].lower(), None) if match[2] else 1.0
    number = math.nan if factor is None else float(match[1].replace(",", ".")) * factor
    return f"{number:g}" if 0.0 < number < math.inf else quantity.example
