"""The command as a fixture, with what it says."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest


class Said(NamedTuple):
    """A command's exit code, output and errors."""

    code: int
    out: str
    err: str


Command = Callable[..., Said]


@pytest.fixture
def run(fogwatch: Callable[..., int], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Command:
    """The command, in a folder of its own and on a wide terminal."""
    monkeypatch.setenv("COLUMNS", "200")

    def command(*words: str | Path) -> Said:
        capsys.readouterr()
        return Said(fogwatch(*words), *capsys.readouterr())

    return command


def output(said: Said) -> str:
    """The output of a command that has succeeded."""
    assert said.code == 0, said.err
    return said.out


def refuses(said: Said, message: str, at_once: bool = True) -> None:
    """Assert that a command refused its input in one line, and before it said anything else, if that is `at_once`."""
    assert said.code == 2
    assert not (said.out and at_once)
    assert message in said.err
    assert said.err.count("\n") == 1
