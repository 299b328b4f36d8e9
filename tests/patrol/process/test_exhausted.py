"""Limits of the machine and of the account become one line, and no traceback."""

from __future__ import annotations

import errno
import os
import resource

import pytest

from patrol.errors import BadInput
from patrol.process.failures import allow_files, told


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG, errno.EMFILE, errno.ENFILE])
def test_a_limit_is_named_with_file_and_remedy(number: int) -> None:
    line = told(OSError(number, os.strerror(number), "run/journal"))
    assert line is not None
    assert line.startswith(f"run/journal: {os.strerror(number)}; ")
    assert told(OSError(number, os.strerror(number))) is not None


def test_a_process_that_cannot_be_started_is_no_file() -> None:
    line = told(BlockingIOError(errno.EAGAIN, "not now"))
    assert line == "a new process: not now; end other programs, or raise the limit of processes (ulimit -u)"


def test_an_output_that_is_not_read_fast_enough_is_no_process() -> None:
    line = told(BlockingIOError(errno.EAGAIN, "not now", 0))
    assert line == "the output: not now; write to a file, or have it read faster"


def test_other_errors_are_no_limits() -> None:
    assert told(FileNotFoundError(errno.ENOENT, "No such file", "x")) is None
    assert told(OSError("4096 requested and 0 written")) is None


@pytest.fixture
def limits(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int]]:
    """The limits of open files, of which the last ones hold."""
    held = [(24, 60)]
    monkeypatch.setattr(resource, "getrlimit", lambda _what: held[-1])
    monkeypatch.setattr(resource, "setrlimit", lambda _what, pair: held.append(pair))
    return held


def test_what_is_allowed_is_left_alone(limits: list[tuple[int, int]]) -> None:
    allow_files(24, "this")
    assert limits == [(24, 60)]


def test_what_the_account_may_have_is_asked_for(limits: list[tuple[int, int]]) -> None:
    allow_files(60, "this")
    assert limits[-1] == (60, 60)


def test_what_it_may_not_have_is_refused_with_the_number(limits: list[tuple[int, int]]) -> None:
    with pytest.raises(BadInput, match=r"^a fleet needs 61 open files, and the limit is 60; raise it: ulimit -n 61$"):
        allow_files(61, "a fleet")
    assert limits == [(24, 60)]


def test_no_limit_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda _what: (24, resource.RLIM_INFINITY))
    asked: list[object] = []
    monkeypatch.setattr(resource, "setrlimit", lambda _what, pair: asked.append(pair))
    allow_files(61, "a fleet")
    assert asked == [(61, resource.RLIM_INFINITY)]


def test_a_machine_without_memory_is_one_line() -> None:
    assert str(told(MemoryError())).startswith("out of memory; ")
    assert told(KeyError("other")) is None
