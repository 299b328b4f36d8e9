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
from typing import Any

import pytest

from fogwatch.clerk import News
from fogwatch.launch import clerk_child
from fogwatch.launch.children import Child, Children
from fogwatch.launch.clerk_child import ClerkChild
from fogwatch.launch.clerk_messages import JUDGING, REPORT, Progress, ReportWritten, VerdictAsked
from fogwatch.run_folder.runfolder import RunFolder
from fogwatch.terminal.live_table import SilentDisplay

PATIENCE_S = 300.0


@pytest.fixture
def pair() -> Iterator[tuple[Connection, Connection]]:
    """Both ends of a connection: the launcher's and the clerk's."""
    ours, theirs = Pipe()
    with ours, theirs:
        yield ours, theirs


UNREADABLE = b"\x80\x04cbuiltins\nint\n\x8c\x09no number\x85R."
"""Pickled: int("no number")."""


@pytest.mark.parametrize(
    "message",
    [struct.pack("!i", len(UNREADABLE)) + UNREADABLE, struct.pack("!i", 100) + b"the first part"],
    ids=["unreadable", "cut off"],
)
def test_a_clerk_whose_message_cannot_be_read_is_killed(
    message: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It does not heed SIGTERM, so it would go on to write its files."""
    script = "import os, signal, sys; signal.signal(signal.SIGTERM, signal.SIG_IGN)\n"
    script += f"os.write(int(sys.argv[1]), {message!r}); signal.pause()"
    started: list[subprocess.Popen[bytes]] = []

    def spawn(self: Children, name: str, _module: str, _words: list[str], log: Path, **how: Any) -> Child:
        (talk,) = how["inherit"]
        started.append(subprocess.Popen([sys.executable, "-c", script, str(talk)], pass_fds=[talk]))
        return self.by_name.setdefault(name, Child(name, started[0], log))

    monkeypatch.setattr(Children, "spawn", spawn)
    monkeypatch.setattr(clerk_child, "AFTER_S", 0.0)
    monkeypatch.setattr(clerk_child, "SILENT_S", PATIENCE_S if message.endswith(b".") else 5.0)
    clerk = ClerkChild(RunFolder(tmp_path), SilentDisplay())
    clerk.ticking()
    assert clerk.report_written() is None
    assert started[0].poll() == -signal.SIGKILL
    assert not clerk.begin_report()
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
