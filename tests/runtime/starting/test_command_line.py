import subprocess
import sys
from pathlib import Path

import pytest

from runtime.starting.environment import room_for

pytestmark = pytest.mark.processes

PROGRAM = """
import os, sys
from runtime.starting.environment import show_as
show_as(sys.stdin.readline().split())
sys.stdout.buffer.write(open("/proc/self/cmdline", "rb").read())
sys.stdout.flush()
"""


def shown(words: str, room: str) -> list[str]:
    command = [sys.executable, "-P", "-c", PROGRAM, room]
    line = subprocess.run(command, input=words, capture_output=True, text=True, check=True, timeout=300).stdout
    return line.rstrip("\0").split("\0")


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="the system shows no processes as files")
def test_a_process_is_shown_as_it_wants() -> None:
    assert shown("python -m agent --robot r1", " " * 100) == ["python", "-m", "agent", "--robot", "r1"]


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="the system shows no processes as files")
def test_a_command_line_without_room_is_cut_short() -> None:
    words, room = "x" * 100_000, " " * 4096
    (only,) = shown(words, room)
    assert only == words[: len(only)]
    assert len(room) < len(only) < 2 * len(room)


def test_there_is_room_for_the_longest_command_line() -> None:
    longest = ["python", "-m", "agent", *(f"--{'é' * 100}" for _ in range(10))]
    assert shown(" ".join(longest), room_for([["python"], longest, ["agent"]])) == longest
