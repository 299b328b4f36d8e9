"""The commands: their order in the help, and what each one's help says, an example and exit codes, alike for all."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import typer
from typer.core import TyperGroup

from fogwatch.cli.bad_arguments import HelpfulCommand
from fogwatch.cli.ending import renew_words
from fogwatch.cli.options import spread
from patrol.errors import BadInput, did_you_mean

F = TypeVar("F", bound=Callable[..., Any])

PANELS = {
    "Run a fleet": "demo run map plan scenario fleet doctor router agent robot-sim",
    "Running fleets": "status monitor control record",
    "Finished runs": "replay report animate export compare intruder judge",
    "Many runs": "sweep benchmark reproduce",
    "Other": "version",
}
"""The commands in the order in which the help lists them, by panel: as a newcomer meets them."""

PANEL_OF = {name: panel for panel, names in PANELS.items() for name in names.split()}


class OrderedGroup(TyperGroup):
    """A group of commands that lists them in the order of `PANELS`."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of the commands, in the order in which the help shows them."""
        return sorted(super().list_commands(ctx), key=list(PANEL_OF).index)

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """Find the command that the arguments name."""
        if ctx.resilient_parsing:  # a shell completes the line, and shows an error in the middle of it
            return super().resolve_command(ctx, renew_words(args))
        if args[0] not in self.commands and not args[0].startswith("-"):
            raise BadInput(f"{args[0]}: no such command; {did_you_mean(args[0], list(PANEL_OF))}")
        return super().resolve_command(ctx, args)


app = typer.Typer(
    cls=OrderedGroup,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Decentralised patrolling: robots that exchange nothing but their positions, and go where nobody has looked "
    "for longest.",
    epilog="Example:\n  fogwatch run yards --robots 5 --duration 600\n\n"
    "Each command has its own help, with an example: fogwatch run --help",
)
"""The command `fogwatch`; `fogwatch.cli.app` imports the modules whose commands it has."""


def group(name: str, text: str, kind: type[TyperGroup] = TyperGroup) -> typer.Typer:
    """Add a group of commands, such as ``fogwatch map``, whose help is `text`."""
    subgroup = typer.Typer(cls=kind, help=text, no_args_is_help=True)
    app.add_typer(subgroup, name=name, rich_help_panel=PANEL_OF[name])
    return subgroup


def command(
    group: typer.Typer = app,
    name: str | None = None,
    *,
    examples: Sequence[str],
    exit_codes: str = "0 done, 2 bad input",
    kind: type[HelpfulCommand] = HelpfulCommand,
    **more: Any,
) -> Callable[[F], F]:
    """Return a decorator that registers a function as a command, and returns it as it is.

    The function's docstring is the help text; `examples` are command lines, at least one. Without `name`, the command
    has the function's. `kind` decides how its arguments are read, and has the attributes `more`.
    """

    def register(function: F) -> F:
        title = "Example" if len(examples) == 1 else "Examples"
        lines = [f"{title}:", *(f"  {example}" for example in examples), "", f"Exit codes: {exit_codes}."]
        word = name or function.__name__.replace("_", "-")
        panel = PANEL_OF[word] if group is app else None
        helpful = type("Command", (kind,), {"example": examples[0], **more})
        add = group.command(word, cls=helpful, help=reflowed(function), epilog="\n".join(lines), rich_help_panel=panel)
        add(spread(function))
        return function

    return register


def reflowed(function: Callable[..., Any]) -> str:
    """Join each paragraph of a docstring to one line, so that it fits a terminal of any width."""
    paragraphs = (inspect.getdoc(function) or "No help: Python runs with PYTHONOPTIMIZE=2.").split("\n\n")
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)
