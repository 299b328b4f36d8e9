"""The state of a run whose folder is read: still going on, or ended."""

import errno
import fcntl
import os
from pathlib import Path
from typing import Any

import pytest

import fogwatch
from fogwatch.cli.open_run import open_folder
from monitor.replay import run as replay
from monitor.replay.run import Run, open_run
from patrol.journal import JournalWriter, read_journal
from tests.fleets import COARSE

SMALL = {**COARSE, "duration": 5, "robots": {"count": 1, "model": "holonomic"}}


@pytest.fixture
def written(tmp_path: Path) -> tuple[Path, JournalWriter]:
    """The folder of a run, whose journal is written once more and lacks its end yet."""
    folder = fogwatch.run(SMALL, out=tmp_path / "run", picture=False).folder
    whole = read_journal(folder / "journal")
    (folder / "journal").rename(folder / "whole")
    writer = JournalWriter(folder / "journal", whole.header)
    for record in read_journal(folder / "whole").ticks:
        writer.write(record)
    return folder, writer


def is_going_on(folder: Path) -> bool:
    return open_folder(folder, None, lambda _: None)[1]


def test_a_run_that_ends_while_it_is_read_has_ended(
    written: tuple[Path, JournalWriter], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, writer = written
    assert is_going_on(folder)
    end = read_journal(folder / "whole").end
    assert end is not None

    def opened(*of: Any) -> Run:
        run = open_run(*of)
        with writer:
            if run.ended is None:
                writer.write(end)
        return run

    monkeypatch.setattr(replay, "open_run", opened)
    run, going_on = open_folder(folder, None, lambda _: None)
    assert (run.ended is not None, going_on) == (True, False)


def test_a_closed_journal_is_not_locked_by_a_process_that_was_forked(written: tuple[Path, JournalWriter]) -> None:
    folder, writer = written
    inherited = os.dup(writer._file.fileno())
    writer.close()
    assert not is_going_on(folder)
    os.close(inherited)


def test_a_lock_that_somebody_holds_does_not_hold_up_a_run(
    written: tuple[Path, JournalWriter], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, writer = written
    header = read_journal(folder / "journal").header
    asked: list[int] = []
    monkeypatch.setattr(fcntl, "flock", lambda _, how: asked.append(how))
    JournalWriter(folder / "other", header).close()
    assert asked[0] == fcntl.LOCK_EX | fcntl.LOCK_NB
    writer.close()


@pytest.mark.parametrize(("age_s", "going_on"), [(0.0, True), (1e5, False)])
def test_without_locks_the_age_of_the_journal_decides(
    written: tuple[Path, JournalWriter], monkeypatch: pytest.MonkeyPatch, age_s: float, going_on: bool
) -> None:
    def unsupported(*_: Any) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    folder, writer = written
    journal = folder / "journal"
    # Changed an hour ahead, so that a slow machine makes no difference.
    os.utime(journal, (0, journal.stat().st_mtime + 3600 - age_s))
    monkeypatch.setattr(fcntl, "flock", unsupported)
    assert is_going_on(folder) == going_on
    writer.close()
