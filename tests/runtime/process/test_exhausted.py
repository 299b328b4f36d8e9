import errno
import os
import resource

import pytest

from patrol.errors import BadInput
from runtime.process.failures import allow_files, told


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG, errno.EMFILE, errno.ENFILE])
def test_a_limit_is_named_with_file_and_remedy(number: int) -> None:
    line = told(OSError(number, os.strerror(number), "run/journal"))
    assert line is not None
    assert line.startswith(f"run/journal: {os.strerror(number)}; ")
    assert told(OSError(number, os.strerror(number))) is not None


@pytest.mark.parametrize(
    ("error", "line"),
    [
        ((), "a new process: not now; end other programs, or raise the limit of processes (ulimit -u)"),
        ((0,), "the output: not now; write to a file, or have it read faster"),
    ],
    ids=["no process can be started", "an output is not read fast enough"],
)
def test_what_is_not_possible_now_is_named(error: tuple[int, ...], line: str) -> None:
    assert told(BlockingIOError(errno.EAGAIN, "not now", *error)) == line


def test_a_machine_without_memory_is_one_line_and_other_errors_are_no_limits() -> None:
    assert str(told(MemoryError())).startswith("out of memory; ")
    assert told(KeyError("other")) is None
    assert told(FileNotFoundError(errno.ENOENT, "No such file", "x")) is None
    assert told(OSError("4096 requested and 0 written")) is None


@pytest.fixture
def limits(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int]]:
    """The limits of open files, of which the last ones hold."""
    held = [(24, 60)]
    monkeypatch.setattr(resource, "getrlimit", lambda _what: held[-1])
    monkeypatch.setattr(resource, "setrlimit", lambda _what, pair: held.append(pair))
    return held


@pytest.mark.parametrize(
    ("most", "wanted", "asked"),
    [(60, 24, []), (60, 60, [(60, 60)]), (resource.RLIM_INFINITY, 61, [(61, resource.RLIM_INFINITY)])],
    ids=["enough", "as much as the account may have", "no limit"],
)
def test_as_many_files_as_are_needed_are_asked_for(
    most: int, wanted: int, asked: list[tuple[int, int]], limits: list[tuple[int, int]]
) -> None:
    limits[:] = [(24, most)]
    allow_files(wanted, "this")
    assert limits[1:] == asked


def test_what_it_may_not_have_is_refused_with_the_number(limits: list[tuple[int, int]]) -> None:
    with pytest.raises(BadInput, match=r"^a fleet needs 61 open files, and the limit is 60; raise it: ulimit -n 61$"):
        allow_files(61, "a fleet")
    assert limits == [(24, 60)]
