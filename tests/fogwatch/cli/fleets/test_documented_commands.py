"""The commands of the pages about ROS 2 robots: each has a parser that takes its options."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from typer.main import get_command

from agent.robots.ros2.options import ros2_parser
from fogwatch.cli.app import app
from worldsim.ros2.options import parser

DOCS = Path(__file__).parents[4] / "docs"


def commands() -> list[str]:
    """All commands of ours, each in one line."""
    pages = [DOCS / "ros2.md", *sorted((DOCS / "ros2").glob("*.md"))]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages).replace("\\\n", " ")
    found = re.findall(r"^    (fogwatch [^#\n]+)", text, flags=re.MULTILINE)
    return sorted({" ".join(line.split()) for line in found})


@pytest.mark.parametrize("line", commands())
def test_every_option_exists(line: str) -> None:
    _, *words = shlex.split(line)
    if words[0] in {"agent", "robot-sim"}:
        made = ros2_parser() if words[0] == "agent" else parser()
        assert made.parse_args(words[1:]).connect
        return
    command = get_command(app)
    while hasattr(command, "commands"):
        command = command.commands[words.pop(0)]
    options = {name for parameter in command.params for name in parameter.opts}
    assert {word.partition("=")[0] for word in words if word.startswith("--")} <= options


def test_there_are_many() -> None:
    assert len(commands()) > 10
