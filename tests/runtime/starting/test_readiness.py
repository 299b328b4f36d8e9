import os
import subprocess
import sys

import pytest

from runtime.starting.readiness import StartFailure, StartPipe, StartReport, report_start

CHILD = "import sys; from runtime.starting.readiness import *; "


def spawn(pipe: StartPipe, code: str) -> subprocess.Popen[bytes]:
    child = subprocess.Popen([sys.executable, "-c", CHILD + code, str(pipe.child_end)], pass_fds=[pipe.child_end])
    pipe.spawned()
    return child


def test_a_child_that_is_ready_says_where_it_listens() -> None:
    pipe = StartPipe()
    child = spawn(pipe, "report_start(int(sys.argv[1]), StartReport('tcp/127.0.0.1:7447'))")
    assert pipe.report(60.0) == StartReport("tcp/127.0.0.1:7447")
    assert child.wait() == 0
    assert pipe.report() == StartReport("tcp/127.0.0.1:7447"), "it stays known after the child's end"
    pipe.close()


def test_a_failure_has_a_reason_to_act_on_and_one_for_people() -> None:
    pipe = StartPipe()
    report_start(pipe.child_end, StartReport("", StartFailure.PORT_BUSY, "ready? no: the port is busy"))
    pipe.child_end = -1
    report = pipe.report()
    assert report == StartReport("", StartFailure.PORT_BUSY, "ready? no: the port is busy")
    assert not report.ready
    pipe.close()


def test_a_child_that_dies_before_it_can_report_ends_the_pipe() -> None:
    pipe = StartPipe()
    child = spawn(
        pipe, "import os, signal; os.write(int(sys.argv[1]), b'{\"addr'); os.kill(os.getpid(), signal.SIGKILL)"
    )
    while not pipe.ended:
        assert pipe.report(60.0) is None
    assert child.wait() == -9
    assert pipe.report() is None
    pipe.close()


def test_a_parent_that_has_died_or_never_waited_is_no_error(capfd: pytest.CaptureFixture[str]) -> None:
    report_start(None, StartReport("nowhere"))
    pipe = StartPipe()
    end = os.dup(pipe.child_end)
    pipe.close()
    report_start(end, StartReport("nowhere"))
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(end)
    assert capfd.readouterr() == ("", "")
