"""The command where its surroundings are bad: no output, no room, few files, no UTF-8, a signal while it loads."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from tests.fogwatch.conftest import PATIENCE_S

pytestmark = pytest.mark.processes

ENDING_S = 20.0
RUN = ("run", "open", "--set", "point=2", "--duration", "2", "--robots", "2", "--no-page", "--no-picture")
QUICK = (*RUN, "--no-recording", "--no-report", "--out", "run")


def started(line: str, *arguments: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a module, ``"$@"`` in a line for the shell."""
    command = ["sh", "-c", line, "sh", sys.executable, "-P", "-m", *arguments]
    how: dict[str, Any] = {"cwd": folder, "env": {**os.environ, **environment}, "timeout": PATIENCE_S}
    return subprocess.run(command, capture_output=True, text=True, check=False, **how)


def shell(line: str, *arguments: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return started(line, "fogwatch", *arguments, folder=folder, **environment)


@pytest.mark.parametrize(
    ("line", "words", "code"),
    [
        ('"$@" >&-', ["scenario", "show", "yards"], 0),
        ('"$@" >&-', ["--help"], 0),
        ('"$@" >&- 2>&- <&-', ["version"], 0),
        ('"$@" 2>&-', ["scenario", "show", "nowhere"], 2),
        ('"$@" >&- 2>&- <&-', ["scenario", "show", "nowhere"], 2),
        ('"$@" 2>/dev/full', ["scenario", "show", "nowhere"], 2),
    ],
)
def test_a_closed_output_changes_no_exit_code(line: str, words: list[str], code: int, tmp_path: Path) -> None:
    done = shell(line, *words, folder=tmp_path)
    assert (done.returncode, done.stderr) == (code, "")


def test_a_run_with_closed_streams_writes_none_of_its_words_into_its_files(tmp_path: Path) -> None:
    """The first file that is opened would take the place of the closed output."""
    done = shell('"$@" >&- 2>&- <&-', *QUICK, "--in-process", folder=tmp_path)
    assert done.returncode == 0
    names = {path.name for path in (tmp_path / "run").iterdir()}
    assert names == {"journal", "scenario.yaml", "summary.json", "ticks.csv"}
    assert not [name for name in names if b"verdict     " in (tmp_path / "run" / name).read_bytes()]


@pytest.mark.parametrize("columns", ["0", "-1", "x"])
def test_a_terminal_of_no_width_is_written_to_all_the_same(columns: str, tmp_path: Path) -> None:
    done = shell(f'COLUMNS={columns} "$@"', "run", "--help", folder=tmp_path)
    assert (done.returncode, "--in-process" in done.stdout) == (0, True)


@pytest.mark.parametrize("words", [["version"], ["scenario", "show", "yards"]])
def test_an_output_without_room_is_one_line(words: list[str], tmp_path: Path) -> None:
    done = shell('"$@" >/dev/full', *words, folder=tmp_path)
    assert done.returncode == 2
    said = "fogwatch: the output, or a file: No space left on device; free some space, or write elsewhere\n"
    assert done.stderr == said


def test_a_current_folder_that_is_gone_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "gone").mkdir()
    done = shell('cd gone && rmdir ../gone && "$@"', *QUICK, folder=tmp_path)
    assert done.returncode == 2
    assert done.stderr == "fogwatch: the current folder has been removed; change to one that is there\n"


def test_a_reader_that_leaves_the_help_is_no_error(tmp_path: Path) -> None:
    """Enough help that the reader leaves before its end, whatever a pipe holds."""
    done = shell('{ "$@"; echo "$?" >&2; } | true', "run", "--help", folder=tmp_path)
    assert done.stderr == "0\n"


def test_a_locale_without_utf_8_costs_characters_and_no_run(tmp_path: Path) -> None:
    ascii_only = {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
    done = shell('"$@"', *QUICK, "--in-process", folder=tmp_path, **ascii_only)
    assert done.returncode == 0
    assert "Traceback" not in done.stderr
    assert r"8800 m\xb2 to patrol" in done.stdout


def test_few_files_are_refused_with_the_number_that_is_needed(tmp_path: Path) -> None:
    done = shell('ulimit -n 24; exec "$@"', *QUICK, folder=tmp_path)
    assert done.returncode == 2
    assert done.stderr == (
        "fogwatch: a fleet of 2 robots as processes needs 44 open files, and the limit is 24; raise it: ulimit -n 44\n"
    )
    assert not (tmp_path / "run").exists()
    done = started('ulimit -n 24; exec "$@"', "fogwatch.router", folder=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "this process needs 40 open files, and the limit is 24; raise it: ulimit -n 40\n"


def test_a_ground_that_there_is_no_room_for_is_one_line(tmp_path: Path) -> None:
    """A limit of each file's size stands for a full disk."""
    done = shell('ulimit -f 64; exec "$@"', *QUICK, "--quiet", "--set", "point=0.25", folder=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith(f"fogwatch: {tmp_path}/run: the ground cannot be written for the processes (")
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "run").exists()


def test_a_journal_that_there_is_no_room_for_ends_the_run_in_one_line(tmp_path: Path) -> None:
    long = [*QUICK, "--quiet", "--in-process", "--duration", "2000"]
    done = shell('ulimit -f 64; exec "$@"', *long, folder=tmp_path)
    assert done.returncode == 3
    assert done.stderr == (
        f"fogwatch: {tmp_path}/run: the run cannot be recorded any more (File too large), so it ends here; make room, "
        "and run it again\n"
    )


STALLED = """
import sys, time

class Stalls:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            print("loading", flush=True)
            time.sleep(600)

sys.meta_path.insert(0, Stalls())
sys.argv = ["fogwatch", *{words!r}]
from fogwatch.cli.main import main
sys.exit(main())
"""


@pytest.mark.parametrize(
    ("module", "words"),
    [
        ("typer", ["version"]),
        ("fogwatch.cli.app", ["version"]),
        ("rich.console", ["run", "open"]),
        ("patrol.prepare", ["scenario", "check", "open"]),
    ],
)
def test_ctrl_c_while_it_loads_is_one_line(module: str, words: list[str], tmp_path: Path) -> None:
    program = STALLED.format(module=module, words=words)
    how: dict[str, Any] = {"cwd": tmp_path, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen([sys.executable, "-P", "-c", program], **how)
    assert process.stdout is not None
    assert process.stdout.readline() == "loading\n"
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, said) == (130, "fogwatch: interrupted\n")


def test_a_folder_is_named_without_what_a_terminal_would_act_on(tmp_path: Path) -> None:
    done = shell('"$@"', *QUICK[:-1], "run\x1b[31m", "--in-process", folder=tmp_path)
    assert done.returncode == 0
    assert r"run folder " + str(tmp_path) + r"/run\x1b[31m" in done.stderr
    assert r"files       " + str(tmp_path) + r"/run\x1b[31m: " in done.stdout
    assert "\x1b" not in done.stdout + done.stderr


@pytest.mark.parametrize("way", ["--in-process", "--no-page"])
def test_a_run_whose_output_nobody_reads_ends_when_asked_at_most_twice(way: str, tmp_path: Path) -> None:
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    with suppress(BlockingIOError):
        while True:
            os.write(writing, b"x" * 4096)
    os.set_blocking(writing, True)
    words = ["run", "open", "--robots", "2", "--model", "holonomic", "--point", "1", "--duration", "100000", way]
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "fogwatch", *words], stdout=writing, stderr=writing, cwd=tmp_path
    )
    try:
        blocked = Path(f"/proc/{process.pid}/wchan")
        until = time.monotonic() + PATIENCE_S
        while "pipe_write" not in blocked.read_text(encoding="ascii"):
            assert time.monotonic() < until
            time.sleep(0.05)
        for _ in range(2):
            process.send_signal(signal.SIGINT)
            with suppress(subprocess.TimeoutExpired):  # two signals at once would count as one
                process.wait(ENDING_S)
                break
        assert process.wait(PATIENCE_S) == 130
    finally:
        process.kill()
        for end in (reading, writing):
            os.close(end)


@pytest.mark.skipif(os.geteuid() != 0, reason="needs root")
def test_without_a_loopback_interface_a_run_says_so_at_once(tmp_path: Path) -> None:
    done = shell('unshare -n "$@"', *QUICK, folder=tmp_path)
    assert done.returncode == 2
    why = "the processes of a run cannot reach each other at 127.0.0.1 (Network is unreachable)"
    assert f"fogwatch: {why}; switch its interface on: ip link set lo up\n" in done.stderr


LEAVES = """
from os import _exit
import fogwatch

class Leaves:
    def __init__(self, setup):
        pass

    def decide(self, view):
        if view.tick == 3:
            _exit(0)
        return fogwatch.Stay()
"""


@pytest.mark.parametrize("way", ["--in-process", "--no-page"])
def test_a_policy_that_ends_its_process_loses_its_robot_and_the_run_is_judged(way: str, tmp_path: Path) -> None:
    (tmp_path / "leaves.py").write_text(LEAVES, encoding="utf-8")
    done = shell('"$@"', *QUICK, way, "--set", "patrol.policy=leaves.py:Leaves", folder=tmp_path)
    assert done.returncode == 1, done.stderr
    assert "verdict     invalid" in done.stdout


@pytest.mark.skipif(os.geteuid() != 0, reason="needs root")
@pytest.mark.parametrize("way", ["--in-process", "--no-page"])
def test_a_run_on_a_disk_that_is_full_cannot_be_judged(way: str, tmp_path: Path) -> None:
    """A small file system in a namespace of its own; the journal fills it."""
    mount = f"mount -t tmpfs -o size=600k none {tmp_path}; cd {tmp_path}"
    done = shell(
        f'unshare -m sh -c \'{mount}; exec "$@"\' sh "$@"', *QUICK, way, "--duration", "20000", folder=tmp_path
    )
    assert done.returncode == 3, done.stderr
    assert "the run cannot be recorded any more (No space left on device)" in done.stderr
