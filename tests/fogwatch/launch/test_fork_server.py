"""Agents from the fork server are processes of their own, children of whoever asked, and know nothing of each other."""

import ctypes
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from fogwatch.launch.children import FORK_SERVER, READY_S, Child, Children, Forked, ForkServer
from runtime.process.failures import INTERRUPTED
from runtime.starting.forking import ask_for_fork, can_fork
from runtime.starting.readiness import StartFailure, StartPipe, StartReport

pytestmark = [pytest.mark.processes, pytest.mark.skipif(not can_fork(), reason="this system has no fork server")]

PATIENCE_S = 300.0
SCENARIO = "duration: 10\nterrain: {builtin: open}\npoint: 1.0\nrobots: [{}, {}]\n"


def arguments_of(name: str, folder: Path) -> list[str]:
    given = ["--router", "tcp/127.0.0.1:1", "--fleet", "f", "--scenario", str(folder / "scenario.yaml")]
    return [*given, "--static", str(folder / "never"), "--robot", name]


class Office:
    """A launcher's children and its fork server."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.children = Children(lambda: False)
        self.server = ForkServer(self.children, folder / "server.log", [self.command(folder)])
        (folder / "scenario.yaml").write_text(SCENARIO, encoding="utf-8")

    def command(self, folder: Path) -> list[str]:
        """The longest command line."""
        return self.children.command("agent", arguments_of("r1", folder))

    def make(self, name: str, secret: str = "") -> Child:
        """An agent that waits for static fields that never come, from the server if that can make it."""
        self.server.await_start(lambda: False)
        arguments, environment = arguments_of(name, self.folder), {"SECRET": secret}
        return self.children.spawn(name, "agent", arguments, self.folder / f"{name}.log", environment=environment)

    def made(self, name: str, secret: str = "") -> Child:
        """As `make`, by the server, and it heeds signals."""
        child = self.make(name, secret)
        assert isinstance(child.process, Forked), (self.folder / "server.log").read_text()
        until(lambda: signal.SIGTERM in caught(child.process.pid))
        return child

    def starts_by_itself(self, name: str) -> bool:
        """Return True if the launcher starts an agent without the server."""
        return isinstance(self.make(name).process, subprocess.Popen)

    @property
    def child(self) -> Any:
        """The server's process."""
        return self.children.by_name[FORK_SERVER].process

    @property
    def server_pid(self) -> int:
        return int(self.child.pid)

    def end(self) -> None:
        self.server.close()
        self.children.end(list(self.children.by_name))
        self.children.close()


@pytest.fixture
def office(tmp_path: Path) -> Iterator[Office]:
    """One whose server may end."""
    office = Office(tmp_path)
    yield office
    office.end()


@pytest.fixture(scope="module")
def server_that_lasts(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Office]:
    office = Office(tmp_path_factory.mktemp("office"))
    yield office
    office.end()


@pytest.fixture
def lasting(server_that_lasts: Office) -> Iterator[Office]:
    """One whose server makes the agents of several tests."""
    yield server_that_lasts
    server_that_lasts.children.end([name for name in server_that_lasts.children.by_name if name != FORK_SERVER])


def until(what: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE_S
    while not what():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.01)


def fact(pid: int, name: str) -> str:
    lines = Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines()
    return next(line.partition(":")[2].strip() for line in lines if line.startswith(f"{name}:"))


def caught(pid: int) -> set[int]:
    """The signals that a process has handlers for."""
    mask = int(fact(pid, "SigCgt"), 16)
    return {number for number in range(1, 65) if mask >> (number - 1) & 1}


def descriptors(pid: int) -> dict[int, str]:
    found = {}
    for entry in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(FileNotFoundError):  # closed by now
            found[int(entry.name)] = str(entry.readlink())
    return found


def holds_in_the_end(pid: int, numbers: set[int]) -> None:
    """Waits until a process holds these descriptors and no others: one that starts reads files, each for a moment."""
    until(lambda: descriptors(pid).keys() == numbers)


def held_in_memory(pid: int, secrets: list[bytes]) -> set[bytes]:
    """Those of some secrets that a process's memory holds, anywhere that can be written."""
    found = set()
    with Path(f"/proc/{pid}/mem").open("rb", buffering=0) as memory:
        for line in Path(f"/proc/{pid}/maps").read_text(encoding="utf-8").splitlines():
            span, rights = line.split()[:2]
            first, last = (int(end, 16) for end in span.split("-"))
            if not rights.startswith("rw"):
                continue
            memory.seek(first)
            with suppress(OSError):  # a part that nobody may read
                held = memory.read(last - first)
                found |= {secret for secret in secrets if secret in held}
    return found


def test_an_agent_is_a_process_of_its_own_and_a_child_of_the_launcher(lasting: Office) -> None:
    one, two = lasting.made("r1"), lasting.made("r2")
    pids = {one.process.pid, two.process.pid, lasting.server_pid}
    assert len(pids) == 3
    for name, child in (("r1", one), ("r2", two)):
        pid = child.process.pid
        assert int(fact(pid, "PPid")) == os.getpid()
        assert os.getsid(pid) == pid, "Ctrl-C reaches the launcher alone"
        line = Path(f"/proc/{pid}/cmdline").read_bytes().decode()
        words = line.rstrip("\0").split("\0")
        assert words[:4] == [sys.executable, "-P", "-m", "agent"]
        assert words[words.index("--robot") + 1] == name
        held = descriptors(pid)
        assert held[0] == os.devnull
        assert held[1] == held[2] == str(lasting.folder / f"{name}.log")
        lifeline = int(words[words.index("--lifeline") + 1])
        holds_in_the_end(pid, {0, 1, 2, lifeline})


def test_no_agent_and_no_server_holds_what_is_another_agents(lasting: Office) -> None:
    secrets = [f"secret-{os.urandom(12).hex()}" for _ in range(2)]
    made = [lasting.made(f"r{number}", secret) for number, secret in enumerate(secrets, start=1)]
    searched = [secret.encode() for secret in secrets]
    held = [held_in_memory(pid, searched) for pid in (*(child.process.pid for child in made), lasting.server_pid)]
    assert held == [{searched[0]}, {searched[1]}, set()]


def test_the_launcher_learns_how_each_one_ended(lasting: Office) -> None:
    killed, asked = lasting.made("r1"), lasting.made("r2")
    bad = lasting.make("r3")
    assert (bad.process.wait(), bad.poll()) == (2, 2)
    assert bad.last_words().startswith("--robot 'r3': no robot of scenario")
    assert killed.poll() is None
    killed.process.kill()
    assert (killed.process.wait(), killed.poll()) == (-signal.SIGKILL, -signal.SIGKILL)
    killed.process.send_signal(signal.SIGTERM)  # its number may be another's by now
    asked.process.send_signal(signal.SIGTERM)
    assert asked.process.wait() == INTERRUPTED


def test_agents_leave_when_their_launcher_has_died_and_so_does_the_server(tmp_path: Path) -> None:
    program = (
        "import sys, time\n"
        "from pathlib import Path\n"
        "from tests.fogwatch.launch.test_fork_server import Office\n"
        "office = Office(Path(sys.argv[1]))\n"
        "print(office.made('r1').process.pid, office.made('r2').process.pid, office.server_pid, flush=True)\n"
        "time.sleep(3600)\n"
    )
    command = [sys.executable, "-c", program, str(tmp_path)]
    launcher = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parents[3])
    assert launcher.stdout is not None
    pids = [int(word) for word in launcher.stdout.readline().split()]
    assert len(pids) == 3
    os.kill(pids[1], signal.SIGSTOP)
    os.kill(pids[2], signal.SIGSTOP)
    launcher.kill()
    launcher.communicate(timeout=PATIENCE_S)
    until(lambda: not any(runs(pid) for pid in pids))


@pytest.mark.parametrize("died_before", [False, True])
def test_a_server_that_loads_dies_with_its_launcher(died_before: bool, tmp_path: Path) -> None:
    loads = (
        "import sys, time\n"
        "from pathlib import Path\n"
        "from agent import fork_server\n"
        "def load(_kernels):\n"
        "    Path(sys.argv[-1]).touch()\n"
        "    time.sleep(3600)\n"
        "fork_server._load_modules = load\n"
        "fork_server.main(sys.argv[1:-1])\n"
    )
    launches = (
        "import os, subprocess, sys, time\n"
        "_, program, folder, died_before = sys.argv\n"
        "end, other = os.pipe()\n"
        "if int(died_before):\n"
        "    os.close(other)\n"
        "command = [sys.executable, '-c', program, '--lifeline', str(end), folder + '/loading']\n"
        "print(subprocess.Popen(command, pass_fds=[end]).pid, flush=True)\n"
        "time.sleep(3600)\n"
    )
    command = [sys.executable, "-c", launches, loads, str(tmp_path), str(int(died_before))]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parents[3]) as launcher:
        assert launcher.stdout is not None
        server = int(launcher.stdout.readline())
        if not died_before:
            until((tmp_path / "loading").exists)
            launcher.kill()
        until(lambda: not runs(server))
        launcher.kill()
    assert (tmp_path / "loading").exists() is not died_before


def runs(pid: int) -> bool:
    """Return True if a process lives; a dead one may wait for whoever takes in orphans."""
    try:
        return fact(pid, "State")[0] != "Z"
    except OSError:
        return False


def test_the_end_of_the_server_is_nobody_elses_end(office: Office) -> None:
    agent = office.made("r1")
    os.kill(office.server_pid, signal.SIGKILL)
    assert office.starts_by_itself("r2")
    assert agent.poll() is None
    agent.process.send_signal(signal.SIGTERM)
    assert agent.process.wait() == INTERRUPTED


def test_a_server_that_stands_still_is_given_up(office: Office) -> None:
    office.made("r1")
    office.server.answer_s = 0.2
    office.child.send_signal(signal.SIGSTOP)
    assert office.starts_by_itself("r2")
    assert office.child.wait() == -signal.SIGKILL, "it makes no process later on that nobody knows of"
    assert office.starts_by_itself("r3")


def test_the_time_to_load_counts_from_the_first_wait(office: Office, monkeypatch: pytest.MonkeyPatch) -> None:
    late = time.monotonic() + 2 * READY_S  # so long the launcher has prepared a large ground
    monkeypatch.setattr("runtime.starting.readiness.time", SimpleNamespace(monotonic=lambda: late))
    office.made("r1")


def test_a_server_that_does_not_load_in_time_is_given_up(office: Office, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([0.0, READY_S])
    office.child.send_signal(signal.SIGSTOP)
    monkeypatch.setattr("runtime.starting.readiness.time", SimpleNamespace(monotonic=lambda: next(clock)))
    office.server.await_start(lambda: False)
    assert office.child.wait() == -signal.SIGKILL
    monkeypatch.undo()
    assert office.starts_by_itself("r1")


def test_what_the_server_makes_ends_where_it_is_no_child_of_the_launcher(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mark = os.urandom(12).hex()
    monkeypatch.setenv("FOGWATCH_TEST", mark)
    office = Office(tmp_path)
    first = office.made("r1").process.pid
    # As on a system that lets nobody take in orphans.
    without = SimpleNamespace(prctl=lambda *_: -1)
    monkeypatch.setattr(ctypes, "CDLL", lambda _: without)
    try:
        by_itself = office.make("r2").process
        assert isinstance(by_itself, subprocess.Popen)
        assert office.child.wait() == -signal.SIGKILL
        until(lambda: marked(mark) == {first, by_itself.pid})
    finally:
        office.end()


def test_whoever_asks_takes_in_no_orphans_afterwards(lasting: Office) -> None:
    lasting.made("r1")
    orphans = "import os, time\nif os.fork() == 0:\n    print(os.getpid(), flush=True)\n    time.sleep(3600)\n"
    with subprocess.Popen([sys.executable, "-c", orphans], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        pid = int(parent.stdout.readline())
        assert parent.wait(PATIENCE_S) == 0
        until(lambda: fact(pid, "PPid") != str(parent.pid))
        assert fact(pid, "PPid") != str(os.getpid())
        os.kill(pid, signal.SIGKILL)


def marked(mark: str) -> set[int]:
    """The living processes that were started with a word in their environment."""
    found = set()
    for entry in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if mark.encode() in (entry / "environ").read_bytes() and runs(int(entry.name)):
                found.add(int(entry.name))
    return found


def test_a_process_that_somebody_else_has_waited_for_has_ended() -> None:
    ended = subprocess.Popen([sys.executable, "-c", "raise SystemExit(3)"])
    child = Forked(ended.pid)
    assert ended.wait(PATIENCE_S) == 3
    assert (child.poll(), child.wait()) == (0, 0), "its exit code is lost, as with subprocess"


def test_closing_it_does_not_wait_for_one_that_stands_still(office: Office, monkeypatch: pytest.MonkeyPatch) -> None:
    office.made("r1")
    server = office.child
    server.send_signal(signal.SIGSTOP)
    office.server.answer_s = None
    asking = threading.Event()

    def ask(*of: Any) -> int:
        asking.set()
        return ask_for_fork(*of)

    monkeypatch.setattr("fogwatch.launch.children.ask_for_fork", ask)
    made: list[object] = []
    command = office.command(office.folder)
    asks = threading.Thread(target=lambda: made.append(office.server.make(command, {}, office.folder / "r2.log")))
    asks.start()
    until(asking.is_set)
    closes = threading.Thread(target=office.server.close)
    closes.start()
    try:
        until(lambda: not closes.is_alive())
    finally:
        server.kill()  # whoever still waits for its answer gets none
        asks.join()
    assert made == [None]


def test_a_server_that_cannot_be_started_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def spawn(*_: object, **__: object) -> None:
        raise OSError("no room for another process")

    monkeypatch.setattr(Children, "spawn", spawn)
    tries = 50
    before = len(descriptors(os.getpid()))
    for _ in range(tries):
        children = Children(lambda: False)
        with pytest.raises(OSError, match="no room"):
            ForkServer(children, tmp_path / "log", [["python"]])
        children.close()
    assert len(descriptors(os.getpid())) < before + tries // 2, "other threads of this process hold some of their own"


def test_a_server_that_cannot_load_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/dev/null/none")
    office = Office(tmp_path)
    assert office.starts_by_itself("r1")
    assert office.child.wait() != 0
    office.end()


def test_a_process_of_several_threads_does_not_fork() -> None:
    pipe = StartPipe()
    program = (
        "import sys, threading\n"
        "from agent.fork_server import main\n"
        "threading.Thread(target=threading.Event().wait, daemon=True).start()\n"
        "sys.exit(main(['--ready', sys.argv[1]]))\n"
    )
    command = [sys.executable, "-P", "-c", program, str(pipe.child_end)]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    process = subprocess.Popen(command, pass_fds=[pipe.child_end], env=environment)
    pipe.spawned()
    report = None
    while report is None and not pipe.ended:
        report = pipe.report(PATIENCE_S)
    pipe.close()
    assert report == StartReport("", StartFailure.OTHER, "cannot fork: a library runs threads (2 in all)")
    assert process.wait(timeout=PATIENCE_S) == 1
