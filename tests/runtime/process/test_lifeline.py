import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from runtime.process.failures import CRASHED, INTERRUPTED
from runtime.process.lifeline import Ending, ending_children

CHILD = """
import sys, threading
from runtime.process.lifeline import heed, run_process

def main():
    ending = heed(int(sys.argv[1]) if sys.argv[1:2] != ["-"] else None)
    print("ready", flush=True)
    {work}
    print(ending.reason, ending.times, flush=True)
    return {code}

run_process(main)
"""


def child(work: str = "ending.wait(600)", code: str = "0", lifeline: str = "-") -> subprocess.Popen[str]:
    program = CHILD.format(work=work, code=code)
    fds = [] if lifeline == "-" else [int(lifeline)]
    command, out = [sys.executable, "-P", "-c", program, lifeline], subprocess.PIPE
    process = subprocess.Popen(command, stdout=out, stderr=out, text=True, pass_fds=fds)
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    return process


def orphan(work: str = "ending.wait(600)") -> subprocess.Popen[str]:
    """A process whose launcher has died."""
    reading, writing = os.pipe()
    process = child(work, lifeline=str(reading))
    os.close(reading)
    os.close(writing)
    return process


@pytest.mark.processes
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGQUIT])
def test_a_signal_asks_to_leave(number: signal.Signals) -> None:
    process = child(code="7")
    process.send_signal(number)
    assert process.communicate(timeout=300)[0] == f"told to by {number.name} 1\n"
    assert process.returncode == 7


@pytest.mark.processes
def test_a_signal_in_generated_code_leaves_the_exit_code_alone(tmp_path: Path) -> None:
    """Libraries `exec` source texts while they are imported; `-m` as for the command."""
    (tmp_path / "asked.py").write_text(
        "import os, sys\n"
        "from runtime.process.lifeline import heed\n"
        "heed(None, patience=0)\n"
        "try:\n"
        "    exec('import os, signal; os.kill(os.getpid(), signal.SIGTERM)')\n"
        "except KeyboardInterrupt:\n"
        "    sys.exit(130)\n"
    )
    path = os.pathsep.join([str(tmp_path), *sys.path])
    asked = subprocess.run([sys.executable, "-P", "-m", "asked"], env={**os.environ, "PYTHONPATH": path}, check=False)
    assert asked.returncode == 130


LOADED = """
import llvmlite.binding as llvm

def load(_module):
    be_told()

llvm.initialize_native_target()
llvm.initialize_native_asmprinter()
module = llvm.parse_assembly("define i32 @f() { ret i32 7 }")
engine = llvm.create_mcjit_compiler(module, llvm.Target.from_default_triple().create_target_machine())
engine.set_object_cache(lambda _module, _code: None, load)
where_it_is_lost = engine.finalize_object
"""

IMPORTED = """
def where_it_is_lost():
    import imported
"""

DELETED = """
class Told:
    def __del__(self):
        be_told()

where_it_is_lost = Told
"""

ENDED = """
import time

class Slow:
    def __del__(self, sleep=time.sleep):
        sleep(0.5)

def where_it_is_lost():
    import imported
    sys.exit(7)

slow = Slow()
"""

TOLD = """
import os, signal, sys
from runtime.process.lifeline import heed

def be_told():
    os.kill(os.getpid(), signal.SIGTERM)
    print("told", flush=True)
{place}
heed(None, patience=0)
try:
    where_it_is_lost()
    while True:
        signal.pause()
except KeyboardInterrupt:
    sys.exit(130)
"""


def tell_at(place: str, folder: Path, last: str) -> subprocess.CompletedProcess[str]:
    """Run a process that is told to leave at a place; a module that it may import ends with a line."""
    (folder / "imported.py").write_text(f"from __main__ import be_told\nbe_told()\n{last}\n")
    command = [sys.executable, "-P", "-c", TOLD.format(place=place)]
    path = os.pathsep.join([str(folder), *sys.path])
    env = {**os.environ, "PYTHONPATH": path}
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=300, env=env)


@pytest.mark.processes
@pytest.mark.parametrize(("place", "output"), [(LOADED, "told\n"), (IMPORTED, "told\nloaded\n"), (DELETED, "")])
def test_an_interrupt_comes_later_where_it_would_do_harm_or_be_lost(place: str, output: str, tmp_path: Path) -> None:
    told = tell_at(place, tmp_path, "print('loaded', flush=True)")
    assert (told.returncode, told.stdout, told.stderr) == (130, output, "")


@pytest.mark.processes
@pytest.mark.parametrize(
    ("place", "last", "code"),
    [(IMPORTED, "import time; time.sleep(600)", 130), (ENDED, "", 7)],
    ids=["an import without end is interrupted", "after all is done the exit code stays"],
)
def test_an_interrupt_is_not_put_off_for_ever(place: str, last: str, code: int, tmp_path: Path) -> None:
    """The interpreter takes its time to put itself away, longer than the interrupt is put off."""
    told = tell_at(place, tmp_path, last)
    assert (told.returncode, told.stdout, told.stderr) == (code, "told\n", "")


@pytest.mark.processes
def test_the_end_of_the_lifeline_asks_to_leave() -> None:
    process = orphan()
    assert process.communicate(timeout=300)[0] == "its launcher has died 1\n"
    assert process.returncode == 0


@pytest.mark.processes
def test_who_does_not_leave_in_time_is_made_to() -> None:
    process = orphan(work="threading.Event().wait()")
    process.communicate(timeout=300)
    assert process.returncode == INTERRUPTED


@pytest.mark.processes
def test_a_stopped_process_notices_too() -> None:
    """Its parent dies while it is stopped: the system continues it, and then it reads the lifeline's end."""
    program = CHILD.format(work="ending.wait(600)", code="0")
    parent = (
        "import os, subprocess, sys\n"
        "reading, writing = os.pipe()\n"
        f"child = subprocess.Popen([sys.executable, '-P', '-c', {program!r}, str(reading)], pass_fds=[reading],\n"
        "    start_new_session=True)\n"
        "print(child.pid, flush=True)\n"
        "sys.stdin.read()\n"
    )
    command, pipe = [sys.executable, "-P", "-c", parent], subprocess.PIPE
    process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)
    assert process.stdout is not None
    lines = {process.stdout.readline().strip(), process.stdout.readline().strip()}
    pid = int(next(line for line in lines if line != "ready"))
    os.kill(pid, signal.SIGSTOP)
    process.kill()
    assert process.communicate(timeout=300)[0] == "its launcher has died 1\n"


@pytest.mark.processes
def test_who_is_paused_comes_to_rest_before_and_goes_on_after() -> None:
    say = "lambda: print('{}', flush=True)"
    work = f"""
    from runtime.process.lifeline import rest_before_pause
    rest_before_pause({say.format("rests")}, {say.format("goes on")})
    print("may be paused", flush=True)
    ending.wait(600)"""
    process = child(work)
    assert process.stdout is not None
    assert process.stdout.readline() == "may be paused\n"
    process.send_signal(signal.SIGTSTP)
    os.waitid(os.P_PID, process.pid, os.WSTOPPED)
    assert process.stdout.readline() == "rests\n"
    process.send_signal(signal.SIGCONT)
    assert process.stdout.readline() == "goes on\n"
    process.send_signal(signal.SIGTERM)
    assert process.communicate(timeout=300)[0] == "told to by SIGTERM 1\n"


@pytest.mark.processes
def test_a_crash_is_printed_and_has_a_code_of_its_own() -> None:
    process = child(work="raise RuntimeError('no')")
    assert "RuntimeError: no" in process.communicate(timeout=300)[1]
    assert process.returncode == CRASHED


@pytest.mark.processes
def test_threads_that_never_end_do_not_hold_up_the_end() -> None:
    process = child(work="threading.Thread(target=threading.Event().wait).start()", code="3")
    process.communicate(timeout=300)
    assert process.returncode == 3


@pytest.mark.processes
def test_children_that_were_started_in_between_are_ended_whatever_they_ignore() -> None:
    def start(ignored: str) -> subprocess.Popen[str]:
        program = f"import signal; signal.signal(signal.{ignored}, signal.SIG_IGN); print(flush=True); signal.pause()"
        process = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
        assert process.stdout is not None
        process.stdout.readline()
        return process

    before = start("SIGUSR1")
    with ending_children():
        stubborn = start("SIGTERM")
    assert before.poll() is None
    before.kill()
    for process in (before, stubborn):
        process.communicate(timeout=300)
        assert process.returncode == -signal.SIGKILL


def test_a_thread_that_ends_while_its_children_are_listed_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Path, "glob", lambda *_: [tmp_path / "ended"])
    with ending_children():
        pass


def test_the_first_reason_counts_and_ends_the_wait_for_a_path(tmp_path: Path) -> None:
    ending = Ending()
    assert not ending
    assert not ending.wait(0.0)
    ending.ask("one")
    ending.ask("two")
    assert ending
    assert (ending.reason, ending.times) == ("one", 2)
    ending = Ending()
    assert ending.wait_for(tmp_path, 0.0)
    assert not ending.wait_for(tmp_path / "none", 0.05)
    ending.ask("now")
    assert not ending.wait_for(tmp_path / "none", 60.0)
