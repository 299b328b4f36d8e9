"""Hunt for tests that depend on speed, order or neighbours: `make test-hard`.

Each round runs pytest in an order drawn from a seed, with examples of its own for property tests, beside busy loops
that take the processors, and beside this process, which stops one process of the tests after the other for a moment: a
fleet's, a browser's, a worker of pytest.
What failed stands in ``build/hard/failures.csv`` with its seed and its log, for all hunts so far.

A process is stopped by ptrace(2) and not by SIGSTOP, for two reasons. Faults and tests send SIGSTOP and SIGCONT
themselves, and a robot that the world has paused has to stay paused whatever is done here. And the kernel lets a traced
process go on when its tracer ends, so nothing stays stopped, however this process ends.
"""

import argparse
import contextlib
import csv
import ctypes
import json
import os
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from patrol.random import draw

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "build" / "hard"
COLUMNS = ("seed", "test", "log")

MARK = "FOGWATCH_TEST_HUNT"
"""Environment variable by which the processes of a hunt are found, whoever their parent is."""

INTERRUPTIONS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that end a hunt."""
LEAVE_S = 120.0
"""How long an interrupted pytest may take to end what its tests have started, s."""

LONGEST_STOP_S = 1.5
LONGEST_GAP_S = 1.0
"""The longest time for which a process is stopped, and the longest until the next one is."""

BUSY = "import os\nparent = os.getppid()\nwhile os.getppid() == parent: sum(range(100_000))"
"""Program that takes a processor until its parent ends."""

SEIZE, INTERRUPT, DETACH = 0x4206, 0x4207, 17
WALL = 0x40000000
"""Requests of ptrace(2), and the flag with which waitpid(2) waits for threads too."""

_libc = ctypes.CDLL(None, use_errno=True)
_libc.ptrace.argtypes = (ctypes.c_long, ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p)
_libc.ptrace.restype = ctypes.c_long


@dataclass(frozen=True, slots=True)
class Failure:
    """A test that failed in a round; an empty name stands for pytest itself."""

    seed: int
    test: str
    log: str


def trace(request: int, thread: int, data: int = 0) -> bool:
    """Call ptrace(2); return False when the thread has ended or may not be traced."""
    return bool(_libc.ptrace(request, thread, None, data) == 0)


def threads_of(process: int) -> set[int]:
    """Thread ids of a process, none when it has ended."""
    with contextlib.suppress(OSError):
        return {int(entry.name) for entry in Path(f"/proc/{process}/task").iterdir()}
    return set()


def await_stop(thread: int) -> int | None:
    """Wait until a traced thread stands still.

    Returns:
        The signal that it was about to receive, which it gets when it goes on, 0 for none; None when it has ended.
    """
    try:
        status = os.waitpid(thread, WALL)[1]
    except ChildProcessError:
        return None
    if not os.WIFSTOPPED(status):
        return None
    return 0 if status >> 16 else os.WSTOPSIG(status)


def let_go(thread: int, number: int) -> None:
    """Trace a thread no more, so that it goes on with the signal that it was about to receive."""
    if not trace(DETACH, thread, number) and (late := await_stop(thread)) is not None:
        trace(DETACH, thread, late)


@contextlib.contextmanager
def stopped(process: int) -> Iterator[bool]:
    """Have every thread of a process stand still meanwhile, as far as it may be traced; yield whether one does.

    The main thread is the first to be stopped and the last to go on: its end is reported after that of all others.
    """
    seized: dict[int, int] = {}
    ended: set[int] = set()
    try:
        while new := threads_of(process) - seized.keys() - ended:  # until no thread is left that could start others
            for thread in sorted(new, key=lambda thread: thread != process):
                if not trace(SEIZE, thread):
                    ended.add(thread)
                    continue
                seized[thread] = 0
                if trace(INTERRUPT, thread):
                    seized[thread] = await_stop(thread) or 0
        yield bool(seized)
    finally:
        for thread in sorted(seized, key=lambda thread: thread == process):
            let_go(thread, seized[thread])


def victims(mark: str) -> list[int]:
    """Processes that inherited a mark and are not stopped already, oldest first."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # it ended meanwhile, or is somebody else's
            state = (folder / "stat").read_text(errors="replace").rpartition(")")[2].split()[0]
            if state not in "TtZX" and mark.encode() in (folder / "environ").read_bytes():
                found.append(int(folder.name))
    return sorted(found)


def disturb(pytest: subprocess.Popen[bytes], mark: str, seed: int) -> int:
    """Stop one process after the other until pytest ends; the seed decides which, when and for how long.

    Not pytest's first process: its end is to be reported to `subprocess` alone, and its workers run the tests.

    Returns:
        The number of stops.
    """
    stops = 0
    for turn in range(sys.maxsize):
        with contextlib.suppress(subprocess.TimeoutExpired):
            pytest.wait(LONGEST_GAP_S * draw(seed, turn, 0))
            return stops
        if processes := [process for process in victims(mark) if process != pytest.pid]:
            with stopped(processes[int(draw(seed, turn, 1) * len(processes))]) as stands:
                stops += stands
                time.sleep(LONGEST_STOP_S * draw(seed, turn, 2))
    return stops


@contextlib.contextmanager
def busy_loops(count: int) -> Iterator[None]:
    """Have as many processes as wanted take the processors meanwhile."""
    loops = [subprocess.Popen([sys.executable, "-I", "-c", BUSY]) for _ in range(count)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


def hunt(seed: int, folder: Path, loops: int, arguments: list[str], found: list[Failure]) -> None:
    """Run pytest once.

    Args:
        seed: Of the order and of what is stopped when.
        folder: Takes the log, and pytest's record of what failed.
        loops: The number of busy loops beside it.
        arguments: Further arguments for pytest.
        found: Takes what failed, also when this is interrupted.
    """
    log = folder / f"{seed}.log"
    cache = folder / f"{seed}.cache"
    number = uuid.uuid4().hex
    command = [sys.executable, "-m", "pytest", f"--shuffle={seed}", f"--hypothesis-seed={seed}"]
    command += ["--hypothesis-profile=free"]
    command += ["-o", f"cache_dir={cache}", *arguments]
    # AddressSanitizer looks for leaks by tracing its own process, which fails while that is traced from here.
    environment = {**os.environ, MARK: number, "ASAN_OPTIONS": "detect_leaks=0"}
    with log.open("wb") as output, busy_loops(loops):
        pytest = subprocess.Popen(
            command, cwd=ROOT, env=environment, stdout=output, stderr=subprocess.STDOUT, start_new_session=True
        )
        try:
            stops = disturb(pytest, f"{MARK}={number}", seed)
        finally:
            interrupted = pytest.poll() is None
            if interrupted:
                end(pytest, f"{MARK}={number}")
            failures = failures_of(cache, seed, log)
            if pytest.returncode and not failures and not interrupted:
                failures = [Failure(seed, "", str(log.relative_to(ROOT)))]
            found += failures
            keep(failures)
    lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
    if not stops:
        raise SystemExit("no process could be stopped: allow ptrace(2), without which the hunt shows little")
    print(
        f"seed {seed}: exit code {pytest.returncode}, {stops} stops, {lines[-1].strip('= ') if lines else 'no output'}",
        flush=True,
    )


def end(pytest: subprocess.Popen[bytes], mark: str) -> None:
    """End a round that is interrupted, and all that its tests have started; further interruptions wait for that."""
    before = {number: signal.signal(number, signal.SIG_IGN) for number in INTERRUPTIONS}
    pytest.send_signal(signal.SIGINT)  # it ends what its tests have started
    try:
        pytest.wait(LEAVE_S)
    except subprocess.TimeoutExpired:
        pytest.kill()
        pytest.wait()
    for process in victims(mark):
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)
    for number, handler in before.items():
        signal.signal(number, handler)


def failures_of(cache: Path, seed: int, log: Path) -> list[Failure]:
    """Return what failed in a round that has ended, as pytest's cache has it."""
    try:
        tests = sorted(json.loads((cache / "v" / "cache" / "lastfailed").read_text(encoding="utf-8")))
    except FileNotFoundError:
        tests = []
    return [Failure(seed, test, str(log.relative_to(ROOT))) for test in tests]


def keep(failures: list[Failure]) -> None:
    """Add failures to the table of all hunts."""
    table = RESULTS / "failures.csv"
    new = not table.exists()
    with table.open("a", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        if new:
            writer.writerow(COLUMNS)
        writer.writerows((failure.seed, failure.test, failure.log) for failure in failures)


def main() -> int:
    """Run the rounds; the exit code: 0 when all passed, 1 when something failed, 130 when interrupted."""
    parser = argparse.ArgumentParser(
        prog="tests.hunt", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--times", type=int, default=1, help="rounds, each with the next seed (default 1)")
    parser.add_argument("--seed", type=int, help="of the first round (default: drawn from the clock)")
    parser.add_argument("--loops", type=int, default=6, help="busy loops beside the tests (default 6)")
    parser.add_argument("arguments", nargs="*", help="after --: arguments for pytest (default: all tests)")
    given = parser.parse_args()
    first = int(time.time()) if given.seed is None else given.seed
    folder = RESULTS / time.strftime("%Y%m%d-%H%M%S")
    folder.mkdir(parents=True)
    found: list[Failure] = []
    interrupted = False
    for number in INTERRUPTIONS:  # a shell may have started this in the background, without SIGINT
        signal.signal(number, signal.default_int_handler)
    try:
        for seed in range(first, first + given.times):
            hunt(seed, folder, given.loops, given.arguments, found)
    except KeyboardInterrupt:
        interrupted = True
    for failure in found:
        print(f"{failure.seed}  {failure.test or '(pytest ended without a verdict on a test)'}  {failure.log}")
    print(f"{len(found)} failures; all hunts: {(RESULTS / 'failures.csv').relative_to(ROOT)}")
    return 130 if interrupted else int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
