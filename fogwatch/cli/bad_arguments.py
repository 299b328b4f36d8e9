"""Errors about arguments that cannot be used: the option, its value, its unit and the remedy."""

from __future__ import annotations

import re
from collections.abc import Callable
from difflib import get_close_matches
from typing import Any

from typer.core import TyperCommand

from fogwatch.cli.options import FIELDS
from patrol.errors import BadInput, quoted

_LENGTH, _COUNT = ("a number in m", "0.3"), ("a whole number", "5")
_QUANTITIES = {
    "M": _LENGTH,
    "R": _LENGTH,
    "S": ("a number in s", "600"),
    "M/S": ("a number in m/s", "1"),
    "N": _COUNT,
    "N...": _COUNT,
    "K": ("a whole number", "7"),
}
"""The values that an option takes, with an example, by the metavar that the help shows."""

_EXTRA = re.compile(r"Got unexpected extra arguments?(?:\(s\))? \((.*)\)")
"""The parser's error for arguments that no parameter takes."""

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
        if param.metavar not in _QUANTITIES:
            return None
        kind, example = _QUANTITIES[param.metavar]
        if isinstance(param.default, float):
            example = f"{param.default:g}"
        reader = int if kind == "a whole number" else float
        wrong = next((text for text in texts if not _is_readable(text, reader)), None)
        option = f"{name} " if name.startswith("--") else ""
        return wrong and f"{name} {quoted(wrong)[1:-1]}: expected {kind}, such as {option}{example}"

    def _unknown_option(self, option: str) -> str:
        options = [text for param in self.params for text in (*param.opts, *param.secondary_opts) if text[:2] == "--"]
        words = [text[2:] for text in options]
        near = [word for word in words if word.startswith(option[2:])] or get_close_matches(option[2:], words, 1)
        remedy = f"did you mean --{near[0]}?" if near else f"leave it out, or see --help; for example: {self.example}"
        return f"{option}: no such option; {remedy}"


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


def _is_readable(text: str, reader: Callable[[str], object]) -> bool:
    try:
        reader(text)
    except ValueError:
        return False
    return True
