"""What the launcher and its clerk say to each other: a busy clerk is heard, and a broken one is ended."""

from __future__ import annotations

import signal
import struct
import subprocess
import sys
import threading
from collections.abc import Iterator
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path

import pytest

from fogwatch.clerk import News
from fogwatch.launch.children import clerk_child
from fogwatch.launch.children.children import Child
from fogwatch.launch.children.clerk_child import CLERK, ClerkChild
from fogwatch.launch.children.clerk_messages import JUDGING, REPORT, Progress, ReportWritten, VerdictAsked
from fogwatch.launch.folder.runfolder import RunFolder
from fogwatch.launch.terminal.live_table import SilentDisplay

PATIENCE_S = 300.0


@pytest.fixture
def pair() -> Iterator[tuple[Connection, Connection]]:
    """Both ends of a connection: the launcher's and the clerk's."""
    ours, theirs = Pipe()
    with ours, theirs:
        yield ours, theirs


class Unreadable:
    """Pickles to something that cannot be had back."""

    def __reduce__(self) -> tuple[type[int], tuple[str]]:
        return int, ("no number",)


def test_a_clerk_whose_message_cannot_be_read_is_killed(tmp_path: Path, pair: tuple[Connection, Connection]) -> None:
    """It does not heed SIGTERM, so it would go on to write its files."""
    ours, theirs = pair
    script = "import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); print(flush=True); signal.pause()"
    process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE)
    assert process.stdout is not None
    process.stdout.readline()
    clerk = ClerkChild(RunFolder(tmp_path), SilentDisplay())
    clerk._connection = ours
    clerk._children.by_name[CLERK] = Child(CLERK, process, tmp_path / "log")
    theirs.send(Unreadable())
    assert clerk.report_written() is None
    assert process.poll() == -signal.SIGKILL
    assert not clerk.begin_report()
    clerk.close()
    process.stdout.close()


def test_a_clerk_that_stops_in_the_middle_of_a_message_is_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(clerk_child, "SILENT_S", 1.0)
    clerk = ClerkChild(RunFolder(tmp_path), SilentDisplay())
    clerk._connection, theirs = clerk_child.open_pair()
    with theirs:
        theirs.send(struct.pack("!i", 100) + b"the first part")
        assert clerk.report_written() is None
    clerk.close()


def test_a_busy_clerk_is_heard_from_the_question_to_the_answer(pair: tuple[Connection, Connection]) -> None:
    ours, theirs = pair
    news = News(theirs, 10)
    asleep = threading.Event()
    assert not asleep.wait(0.5)
    assert not ours.poll(), "nobody listens before the question"
    ours.send(VerdictAsked({}))
    assert [heard(ours) for _ in range(2)] == [Progress(JUDGING)] * 2, "it has not even taken the question"
    assert news.question() == VerdictAsked({})
    news(5)
    while heard(ours) != Progress(JUDGING, 0.5):
        pass
    assert heard(ours) == Progress(JUDGING, 0.5), "again, without a call"
    news.answer(ReportWritten(), REPORT)
    while isinstance(message := heard(ours), Progress):
        pass
    assert message == ReportWritten()
    assert not asleep.wait(0.5)
    assert not ours.poll(), "nobody listens after the answer"


def heard(connection: Connection) -> object:
    """The next message."""
    assert connection.poll(PATIENCE_S)
    return connection.recv()
