"""Children of the launcher that report their start on a pipe."""

import signal
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from fogwatch.launch.children import TERM_S, Child, Children
from fogwatch.router import CLOSE_S
from runtime.starting.readiness import StartFailure, StartReport

pytestmark = pytest.mark.processes

PATIENCE_S = 300.0


@pytest.fixture
def children() -> Iterator[Children]:
    children = Children(lambda: False)
    yield children
    children.end(list(children.by_name))
    children.close()


def router(children: Children, where: str, folder: Path) -> Child:
    return children.spawn("router", "fogwatch.router", ["--listen", where], folder / "router.log", reports_start=True)


def test_a_router_reports_that_it_listens_and_the_next_one_that_the_port_is_busy(
    children: Children, tmp_path: Path
) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        where = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    first = router(children, where, tmp_path)
    assert first.await_start(PATIENCE_S) == StartReport(where)
    second = children.spawn("second", "fogwatch.router", ["--listen", where], tmp_path / "second", reports_start=True)
    busy = StartReport("", StartFailure.PORT_BUSY, f"{where}: the port is busy; choose another")
    assert second.await_start(PATIENCE_S) == busy
    assert second.process.wait() == 2


def test_a_router_that_cannot_listen_for_another_reason_says_so(children: Children, tmp_path: Path) -> None:
    child = router(children, "nonsense", tmp_path)
    report = child.await_start(PATIENCE_S)
    assert report is not None
    assert report.failure is StartFailure.OTHER
    assert "--listen" in report.detail


@pytest.mark.parametrize("module", ["fogwatch.nothing", "fogwatch.router"])
def test_a_child_that_ends_before_it_is_ready_reports_nothing(module: str, children: Children, tmp_path: Path) -> None:
    child = children.spawn("child", module, [], tmp_path / "log", reports_start=True)
    killed = module == "fogwatch.router"
    if killed:
        child.process.kill()
    assert child.await_start(PATIENCE_S) is None
    child.process.wait()
    assert child.poll() == (-signal.SIGKILL if killed else 1)
    how = "child was killed by SIGKILL" if killed else "child ended with exit code 1"
    assert child.describe_end().startswith(how)
    assert killed or "No module named fogwatch.nothing" in child.describe_end()


def test_a_router_gives_up_closing_before_it_is_killed_for_it() -> None:
    """With a viewer that has stopped reading, closing takes as long as it may; killed, it would fail the verdict."""
    assert CLOSE_S <= TERM_S / 2


def test_a_quoted_log_cannot_disturb_a_terminal(children: Children, tmp_path: Path) -> None:
    child = children.spawn("child", "fogwatch.nothing", [], tmp_path / "log")
    child.process.wait()
    child.poll()
    child.log.write_bytes(b"one\nchild: \x1b[2J\x07tab\there \xff\n\n")
    assert child.log_tail() == "    one\n    child: \\x1b[2J\\x07tab here \N{REPLACEMENT CHARACTER}"
    assert all(line.isprintable() for line in child.describe_end().splitlines())
    child.log.write_bytes(b"one\nchild: \x1b[2Jtwo\n")
    assert child.last_words() == "\\x1b[2Jtwo"
    child.log.unlink()
    assert (child.log_tail(), child.last_words()) == ("", "")
