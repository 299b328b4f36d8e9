"""Completion of a command line by the shell."""

import pytest
from typer.testing import CliRunner

from fogwatch.cli.app import app


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("fogwatch re", {"record", "replay", "report", "reproduce"}),
        ("fogwatch run --se", {"--seed", "--sensor-range", "--set"}),
        ("fogwatch map ch", {"check"}),
        ("fogwatch reproduce ta", {"table"}),
        ("fogwatch paper ta", {"table"}),
        ("fogwatch key new --h", {"--help"}),
    ],
)
def test_commands_and_options_are_completed(words: str, offered: set[str]) -> None:
    asked = {"_FOGWATCH_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(words.count(" "))}
    answer = CliRunner().invoke(app, [], env=asked, prog_name="fogwatch")
    assert answer.exit_code == 0, answer.output
    assert set(answer.output.split()) == offered


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_there_is_a_script_for_each_shell(shell: str) -> None:
    answer = CliRunner().invoke(app, [], env={"_FOGWATCH_COMPLETE": f"source_{shell}"}, prog_name="fogwatch")
    assert answer.exit_code == 0, answer.output
    assert f"_FOGWATCH_COMPLETE=complete_{shell}" in answer.output
