"""The commands in the documents: each has a parser that takes its options and arguments."""

import re
import shlex
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from agent.process import simulated_parser
from fogwatch.cli.app import app
from fogwatch.router import router_parser
from ros2.robot.options import ros2_parser
from ros2.sim.options import parser as sim_parser
from worldsim.process import world_parser

ROOT = Path(__file__).parents[2]
DOCUMENTS = ("README.md", "CONTRIBUTING.md", "deploy/README.md", "docs/**/*.md")
MODULES = {"worldsim": world_parser}
"""Processes that documents start by ``python -m``."""

COMMANDS: Any = get_command(app)


def command_lines(path: Path) -> list[str]:
    """Return the lines of code that begin with a command of ours, in their order, joined and expanded as by a shell."""
    text = path.read_text(encoding="utf-8").replace("\\\n    ", "")
    variables = dict(re.findall(r"^ {4,}(?:export )?([A-Z]+)=[\"']?([^\"'\n]*)[\"']?$", text, flags=re.MULTILINE))
    lines = re.findall(r"^ {4,}((?:fogwatch|python -m [\w.]+) [^ \n].*)", text, flags=re.MULTILINE)
    expanded = (re.sub(r"\$([A-Z]+)", lambda match: variables[match[1]], line) for line in lines)
    return list(dict.fromkeys(" ".join(re.sub(r"\s#.*", "", line).split()) for line in expanded))


def check(line: str) -> None:
    """Fail unless the command's own parser takes the line's options, and all of its arguments."""
    words = shlex.split(line)
    ends = [k for k, word in enumerate(words) if word in {"|", ">", "&", "&&"}]
    words = words[1 : ends[0] if ends else None]
    if line.startswith("python"):
        if words[1] in MODULES:
            MODULES[words[1]]().parse_args(words[2:])
        return
    helped = words[-1] == "--help"
    words = words[: len(words) - helped]
    if words and words[0] in {"agent", "robot-sim", "router"}:
        others = {"robot-sim": sim_parser, "router": router_parser}
        made = others.get(words[0], ros2_parser if {"ros2", "rclpy"} & set(words) else simulated_parser)()
        if not helped:
            made.parse_args(words[1:])
        return
    command = COMMANDS
    while words and hasattr(command, "commands"):
        command = command.commands[words.pop(0)]
    given, rest, _ = command.make_parser(command.context_class(command)).parse_args(words)
    assert rest in ([], ["..."]), f"{line}: {rest}"
    needed = {param.name for param in command.params if param.param_type_name == "argument" and param.required}
    assert helped or needed <= {name for name, value in given.items() if value not in (None, ())}, line


@pytest.mark.parametrize(
    "name", sorted(str(path.relative_to(ROOT)) for pattern in DOCUMENTS for path in ROOT.glob(pattern))
)
def test_every_command_in_a_document_parses(name: str) -> None:
    for line in command_lines(ROOT / name):
        check(line)


def test_there_are_many() -> None:
    assert sum(len(command_lines(path)) for pattern in DOCUMENTS for path in ROOT.glob(pattern)) > 150


@pytest.mark.parametrize(
    "line", ["fogwatch run", "fogwatch run yards --sped 2", "fogwatch run yards 3", "fogwatch agent"]
)
def test_a_command_that_does_not_parse_is_found(line: str) -> None:
    with pytest.raises((Exception, SystemExit)):
        check(line)
