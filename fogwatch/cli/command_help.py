"""The help texts of the commands: what a command does, an example, and its exit codes, the same way for all."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import typer
from typer.core import TyperGroup

from fogwatch.cli.bad_arguments import HelpfulCommand
from patrol.errors import BadInput, did_you_mean

F = TypeVar("F", bound=Callable[..., Any])

ORDER = (
    "demo",
    "run",
    "map",
    "plan",
    "scenario",
    "key",
    "fleet",
    "doctor",
    "router",
    "agent",
    "robot-sim",
    "status",
    "monitor",
    "control",
    "record",
    "replay",
    "report",
    "animate",
    "export",
    "compare",
    "intruder",
    "judge",
    "recording",
    "sweep",
    "benchmark",
    "experiment",
    "paper",
    "reproduce",
    "version",
)
"""The order in which the help lists the commands: as a newcomer meets them."""

START, RUNNING, FINISHED, MANY, OTHER = (
    "Run a fleet",
    "Running fleets",
    "Finished runs",
    "Many runs",
    "Other",
)
"""The panels that the help groups the commands in."""


class OrderedGroup(TyperGroup):
    """A group of commands that lists them in the order of `ORDER`."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of the commands, in the order in which the help shows them."""
        return sorted(super().list_commands(ctx), key=ORDER.index)

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """Find the command that the arguments name."""
        if args[0] not in self.commands and not args[0].startswith("-"):
            raise BadInput(f"{args[0]}: no such command; {did_you_mean(args[0], ORDER)}")
        return super().resolve_command(ctx, args)


def command(
    app: typer.Typer,
    name: str | None = None,
    *,
    examples: Sequence[str],
    exit_codes: str = "0 done, 2 bad input",
    panel: str | None = None,
    kind: type[HelpfulCommand] = HelpfulCommand,
) -> Callable[[F], F]:
    """Return a decorator that registers a function as a command, and returns it as it is.

    The function's docstring is the help text; `examples` are command lines, at least one. Without `name`, the command
    has the function's. `kind` decides how its arguments are read.
    """

    def register(function: F) -> F:
        title = "Example" if len(examples) == 1 else "Examples"
        lines = [f"{title}:", *(f"  {example}" for example in examples), "", f"Exit codes: {exit_codes}."]
        epilog = "\n".join(lines)
        helpful = type("Command", (kind,), {"example": examples[0]})
        app.command(name, cls=helpful, help=reflowed(function), epilog=epilog, rich_help_panel=panel)(function)
        return function

    return register


def reflowed(function: Callable[..., Any]) -> str:
    """Join each paragraph of a docstring to one line, so that it fits a terminal of any width."""
    paragraphs = (inspect.getdoc(function) or "").split("\n\n")
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)
