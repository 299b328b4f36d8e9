"""The reference of the commands, as Markdown, from the definitions that ``--help`` prints."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from typer.main import get_command

from fogwatch.cli.app import app
from fogwatch.commands.processes import PassedOn
from worldsim.process import world_parser

PROCESSES = {"python -m worldsim": world_parser}
"""Processes that are started by hand on other hosts, and have no command of their own."""


def commands() -> str:
    """Return a section for each command and each process, in the order of ``fogwatch --help``."""
    root: Any = get_command(app)
    sections = [*_command_sections("fogwatch", root, 2), *_process_sections()]
    return "\n\n".join(sections)


def _command_sections(name: str, command: Any, level: int) -> Iterator[str]:
    """Yield the sections of a command's own text and of the commands below it."""
    if not hasattr(command, "commands"):
        yield _section(name, command, level)
        return
    if level > 2:
        yield f"{'#' * level} {name}\n\n{command.help}"
    for child in command.list_commands(None):
        yield from _command_sections(f"{name} {child}", command.commands[child], level + (name != "fogwatch"))


def _section(name: str, command: Any, level: int) -> str:
    """Return the section of one command: how it is called, what it does, its options, examples and exit codes."""
    arguments = [parameter for parameter in command.params if parameter.param_type_name == "argument"]
    options = [parameter for parameter in command.params if parameter.param_type_name == "option"]
    words = [f"[{word}]" if not argument.required else word for argument in arguments if (word := _words(argument))]
    usage = " ".join([name, *words, *(["[OPTIONS]"] if options else [])])
    parts = [f"{'#' * level} {name}", f"```text\n{usage}\n```", command.help]
    parts.extend(f"`{_words(argument)}`: {argument.help}" for argument in arguments if argument.help)
    if options:
        parts.append(f"```{{program}} {name}\n```")
        parts.extend(f"```{{option}} {_names(option)}\n{_meaning(option)}\n```" for option in options)
    if isinstance(command, PassedOn):
        parts.append(f"```text\n{type(command).listed().rstrip()}\n```")
    examples, _, exit_codes = command.epilog.partition("\n\n")
    parts.append(f"```text\n{examples}\n```")
    parts.append(exit_codes)
    return "\n\n".join(parts)


def _words(argument: Any) -> str:
    """Return how an argument stands in the usage."""
    return str(argument.metavar or argument.name.upper())


def _names(option: Any) -> str:
    """Return an option's names with its value's, as Sphinx lists them."""
    value = "" if option.is_flag else f" {option.metavar or option.type.name.upper()}"
    return ", ".join(f"{name}{value}" for name in [*option.opts, *option.secondary_opts])


def _meaning(option: Any) -> str:
    """Return an option's text, with its default if it has one that its text leaves out."""
    plain = option.default is None or isinstance(option.default, bool) or "default" in (option.help or "")
    return option.help or "" if plain else f"{option.help} Default: {option.default}."


def _process_sections() -> Iterator[str]:
    """Yield the sections of the processes."""
    for name, parser in PROCESSES.items():
        yield f"## {name}\n\n```text\n{parser().format_help().rstrip()}\n```"
