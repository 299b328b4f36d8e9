"""The frame of each command: it answers words of 1.0, prints lines, and turns an error into a line and an exit code."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

import typer

from patrol.errors import BadInput, printable, printable_lines
from runtime.process import failures as exhausted
from runtime.process.failures import BAD_INPUT, INTERRUPTED, UNKNOWN
from runtime.process.lifeline import forget_interrupt
from runtime.reporting.logs import crashed

OLD_WORDS = {"key new": "fleet key", "key": "fleet key", "paper all": "reproduce table", "paper": "reproduce"}
"""Words of commands of fogwatch 1.0, and what they are called now; of several that begin alike, the longest first."""

BARE = ("paper", "paper table")
"""Old words that asked for more where nothing followed them; their new words alone would list or run all."""

_MCAP = "the tool mcap does that: mcap doctor FILE inspects a recording, mcap recover FILE -o NEW saves a damaged one"
_FAULTS = "what faults cost is a sweep: fogwatch sweep examples/sweeps/faults.yaml, or fault-kinds.yaml beside it"
GONE = {
    "experiment": f"`fogwatch experiment` is gone; {_FAULTS}",
    "reproduce calibrate": "`fogwatch reproduce calibrate` is gone; fogwatch reproduce table 2 3 --set sensor.range=R "
    "tells how well a range fits",
    **{
        f"reproduce table --{field.replace('.', '-')}": f"`fogwatch reproduce table` has no option for {field} now; "
        f"give --set {field}=NUMBER"
        for field in ("point", "duration", "sensor.range")
    },
    "reproduce faults": f"`fogwatch reproduce faults` is gone; {_FAULTS}",
    "reproduce figure": "`fogwatch reproduce figure` is gone; a clone has the command of each figure in "
    "docs/pictures/figures.json",
    "reproduce check": "`fogwatch reproduce check` is now `python docs/samples.py` in a clone of fogwatch",
    "chaos": "`fogwatch chaos` is now `make chaos` in a clone of fogwatch",
    "recording": f"`fogwatch recording` is gone; {_MCAP}",
    "record --check": f"`fogwatch record --check` is gone; {_MCAP}",
    "record --repair": f"`fogwatch record --repair` is gone; {_MCAP}",
    "run --threads": "`fogwatch run --threads` is gone; give --workers, which makes processes and is faster",
    "map random": "`fogwatch map random` is gone; a clone of fogwatch has such buildings in examples/maps",
    **{
        f"benchmark --{option}": f"`fogwatch benchmark --{option}` is gone; give --terrains FILE.graph+MAP.yaml"
        for option in ("map", "graph")
    },
    **{
        f"intruder {option}": f"`fogwatch intruder {option}` is gone, and so is the learned intruder; leave it out"
        for option in ("--learned", "--horizon", "--trials")
    },
}
"""Commands and options of fogwatch 1 that have gone, and the remedy."""


def find_old_words(words: Sequence[str]) -> str | None:
    """Return the old words with which a command line begins; None where it has none."""
    return next((old for old in OLD_WORDS if list(words[: len(old.split())]) == old.split()), None)


def renew_words(words: Sequence[str]) -> list[str]:
    """Return a command line with new words in place of old ones."""
    old = find_old_words(words)
    return list(words) if old is None else [*OLD_WORDS[old].split(), *words[len(old.split()) :]]


def _translate(words: Sequence[str]) -> list[str]:
    """Return a command line in new words; tell which ones where it has old ones."""
    old = find_old_words(words)
    new = renew_words(words)
    options = {word.partition("=")[0] for word in new}
    for old_words, remedy in GONE.items():
        commands = [word for word in old_words.split() if not word.startswith("-")]
        if new[: len(commands)] == commands and options.issuperset(old_words.split()[len(commands) :]):
            raise BadInput(remedy)
    if new[:1] == ["reproduce"] and len(new) > 1 and new[1] not in ("table", "claim") and not new[1].startswith("-"):
        raise BadInput(GONE["reproduce figure"])
    if old is not None:
        complain(f"`fogwatch {old}` is now `fogwatch {OLD_WORDS[old]}`; the old words go with fogwatch 2")
        if (line := " ".join(words)) in BARE:
            raise BadInput(f"{line}: say which one; see fogwatch reproduce --help")
    return new


def run_app(app: typer.Typer) -> int:
    """Run the command that this process's arguments name, and return the exit code."""

    def run_new() -> Any:
        sys.argv[1:] = _translate(sys.argv[1:])
        return app(standalone_mode=False)

    code = guarded(run_new)
    forget_interrupt()
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError as error:  # else the interpreter finds it while it ends and replaces any exit code by 120
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
            if stream is sys.stdout and not isinstance(error, BrokenPipeError):
                complain(exhausted.told(error) or f"the output: {error.strerror}")
                code = code or BAD_INPUT
    return code


def guarded(call: Callable[[], Any]) -> int:
    """Run a command; an error that the user can mend becomes one line on the standard error.

    Return the exit code: the command's own, 2 for bad input, 3 for a crash, 130 when interrupted.
    """
    try:
        code = call()
    except (KeyboardInterrupt, typer.Abort):
        code = INTERRUPTED
    except SystemExit as asked:
        if not isinstance(asked.__context__, BrokenPipeError):  # typer and rich make that of it
            raise
        code = 0
    except Exception as error:  # noqa: BLE001 - a crash leaves the run unjudged, not invalid
        return _code_of(error)
    if code == INTERRUPTED:  # typer may turn the signal into this code
        complain("interrupted")
    return code if isinstance(code, int) else 0


def _code_of(error: Exception) -> int:
    """Say what a command has raised; the exit code."""
    if isinstance(error, BrokenPipeError):
        return 0
    line: str | None = None
    if isinstance(error, BadInput):
        line = str(error)
    elif isinstance(error, OSError | MemoryError):
        line = exhausted.told(error) or (_missing_folder() if isinstance(error, FileNotFoundError) else None)
    elif hasattr(error, "format_message"):
        line = error.format_message()  # typer's; without one it has printed the help
    if line is None:
        crashed(error)
        return UNKNOWN
    if line:
        complain(line)
    return BAD_INPUT


def _missing_folder() -> str | None:
    """Return the error for a current folder that has been removed; None where it is there."""
    try:
        os.getcwd()  # noqa: PTH109 - the error is what matters
    except FileNotFoundError:
        return "the current folder has been removed; change to one that is there"
    except OSError:
        pass
    return None


def complain(line: str) -> None:
    """Print a line on the standard error, unless it has no reader or there is no room for it."""
    with suppress(OSError):
        print(f"fogwatch: {printable_lines(line)}", file=sys.stderr, flush=True)


def say(line: str, *, err: bool = False) -> None:
    """Print a line; what could disturb a terminal is escaped."""
    typer.echo(printable(line), err=err)


def note(line: str) -> None:
    """Print a line on the standard error."""
    say(line, err=True)
