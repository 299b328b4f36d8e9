"""Parts of all tests: which of them run, how hypothesis searches, and that no process outlives the session."""

import gc
import hashlib
import os
import signal
import sys
import time
import uuid
from collections.abc import Callable, Iterator, Set
from contextlib import suppress
from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage
from typing import Any

import pytest
from hypothesis import settings

from patrol.errors import BadInput
from runtime.starting.warmup import SELDOM, warm

# A slow machine is no failure. Property tests try the same examples in each run; the hunt (`tests.hunt`) tries others.
settings.register_profile("free", deadline=None, print_blob=True)
settings.register_profile("fixed", settings.get_profile("free"), derandomize=True, database=None)
settings.load_profile("fixed")

ONLY_NAMED = ("accept", "network", "ros", "site")
"""Markers of tests that run only where ``-m`` names them."""

SLOW = ("processes", "browser")
"""Markers of tests that `make test` leaves to `make test-all`, unless they are also marked ``kind``."""

TIMES = Path(__file__).with_name("times.tsv")
"""Tests that take long, as `make times` found them: processor time in s, a tab, the test's name."""

WAITING = ("agent/robots", "hostile", "runtime/net", "runtime/process", "ros2")
"""Folders whose tests wait for other processes, threads and routers more than they work."""

KINDS = ("closed fleet", "direct radio", "lockstep", "page", "paced", "ros2")
"""Kinds of real fleets; the quick suite runs one test of each, the one marked ``kind``."""

PACKAGES = ("patrol", "agent", "worldsim", "monitor", "experiments")
"""Packages that have kernels."""

TERMINAL = (
    *("CLICOLOR", "CLICOLOR_FORCE", "COLUMNS", "FORCE_COLOR", "GITHUB_ACTIONS", "LINES", "NO_COLOR", "PY_COLORS"),
    *("TERM", "TTY_COMPATIBLE", "TTY_INTERACTIVE"),
)
"""Environment variables by which rich and typer choose colours and widths."""

HANDLERS: dict[int, Any] = {}
"""What Python does on a signal when the session begins, by signal."""

MARK = "FOGWATCH_TEST_SESSION"
GRACE_S = 60.0
"""How long the last processes may take to leave, on a machine with much else to do."""


def pytest_xdist_auto_num_workers() -> int:
    """Return the number of workers: one more than there are processors, because some tests wait for processes."""
    return len(os.sched_getaffinity(0)) + 1


def pytest_configure(config: pytest.Config) -> None:
    """Have workers heed SIGINT, and compile the kernels before they start, which would compile them side by side.

    A shell starts what runs in the background with SIGINT ignored, and so would be all processes of the tests.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    numbers = (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT, signal.SIGTERM, signal.SIGTSTP)
    HANDLERS.update((number, signal.getsignal(number)) for number in numbers)
    if config.getoption("numprocesses", None) and not config.option.collectonly:
        try:
            warm(PACKAGES, print, SELDOM)
        except BadInput as error:
            raise pytest.UsageError(str(error)) from None


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of `make test`, `make times` and `make test-hard`."""
    parser.addoption(
        "--suite",
        choices=("quick", "rest", "all"),
        default="all",
        help="quick: what `make test` runs; rest: what `make test-all` adds to it; all: both (the default)",
    )
    parser.addoption("--times", metavar="FILE", help="append each test's processor time, with its children's, to FILE")
    parser.addoption("--shuffle", metavar="SEED", help="run files, and the tests of each, in an order drawn from SEED")


def processor_time_s() -> float:
    """Return the processor time of this process and of its children that have ended, s."""
    return sum(time_s for who in (RUSAGE_SELF, RUSAGE_CHILDREN) for time_s in getrusage(who)[:2])


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Measure a test for ``--times``."""
    begin_s = processor_time_s()
    result = yield
    if item.config.option.times:
        with Path(item.config.option.times).open("a", encoding="utf-8") as file:
            file.write(f"{processor_time_s() - begin_s:.1f}\t{item.nodeid}\n")
    return result


def read_slow_tests() -> set[str]:
    """Return the names of the tests listed in `TIMES`."""
    return {line.split("\t", 1)[1] for line in TIMES.read_text(encoding="utf-8").splitlines()}


def is_quick(item: pytest.Item, slow: Set[str]) -> bool:
    """Return whether `make test` runs a test: one of each kind of fleet, and what takes little time in one process."""
    if item.get_closest_marker("kind") is not None:
        return True
    return not any(item.get_closest_marker(name) for name in SLOW) and item.nodeid not in slow


def pytest_sessionstart() -> None:
    """Remove the terminal's environment variables before libraries that read them on import are loaded."""
    for name in TERMINAL:
        os.environ.pop(name, None)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Drop tests of the other suite and those that run only where ``-m`` names their marker; shuffle on demand."""
    unnamed = [name for name in ONLY_NAMED if name not in config.option.markexpr]
    suite, slow = config.option.suite, read_slow_tests()
    kept: list[pytest.Item] = []
    dropped: list[pytest.Item] = []
    for item in items:
        unasked = any(item.get_closest_marker(name) for name in unnamed)
        other_suite = suite != "all" and is_quick(item, slow) != (suite == "quick")
        (dropped if unasked or other_suite else kept).append(item)
    if dropped:
        config.hook.pytest_deselected(items=dropped)
        items[:] = kept
    items[:] = spread(items)
    if (seed := config.option.shuffle) is not None:
        items.sort(key=lambda item: (_shuffled(seed, str(item.path)), _shuffled(seed, item.nodeid)))


def pytest_collection_finish() -> None:
    """Leave what is loaded by now out of garbage collection: going through it takes a tenth of a second each time."""
    gc.collect()
    gc.freeze()


def spread(items: list[pytest.Item]) -> list[pytest.Item]:
    """Return the tests in an order in which no worker idles at the end.

    Checks of all sources and tests that wait come first, on one worker; real fleets are in the middle, on another one.
    """
    first, fleets, rest = list[pytest.Item](), list[pytest.Item](), list[pytest.Item]()
    for item in items:
        if item.path.name == "test_house.py" or item.path.relative_to(TIMES.parent).as_posix().startswith(WAITING):
            first.append(item)
        else:
            (rest if item.get_closest_marker("kind") is None else fleets).append(item)
    middle = len(rest) // 2
    first.sort(key=lambda item: item.path.name != "test_house.py")
    return [*first, *rest[:middle], *fleets, *rest[middle:]]


def _shuffled(seed: str, name: str) -> bytes:
    """Return a sort key that has nothing to do with the order of names."""
    return hashlib.sha256(f"{seed} {name}".encode()).digest()


def marked_processes(mark: str) -> dict[int, str]:
    """Command lines of the living processes that inherited this session's mark, whoever their parent is."""
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        if int(folder.name) == os.getpid():
            continue
        with suppress(OSError):  # it ended meanwhile, or is somebody else's
            if mark.encode() not in (folder / "environ").read_bytes():
                continue
            command = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace").strip()
            if "multiprocessing.resource_tracker" not in command:  # lives as long as the session by design
                found[int(folder.name)] = command
    return found


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    """A browser that finds nobody but this machine."""
    from tests.browser import looking

    with looking() as running:
        yield running


@pytest.fixture
def endpoint() -> Iterator[str]:
    """The address of a router that asks nobody."""
    from tests.routers import routed

    with routed() as where:
        yield where


@pytest.fixture(autouse=True)
def signal_handlers() -> None:
    """Give every test the handlers of the session's beginning; a main function that a test ran has left its own."""
    for number, handler in HANDLERS.items():
        signal.signal(number, handler)


@pytest.fixture(scope="session", autouse=True)
def no_test_changes_the_niceness() -> Iterator[None]:
    """Fail when a test has left this process giving way to others, which holds for all that it starts later."""
    before = os.nice(0)
    yield
    assert os.nice(0) == before, "a test has raised this process's niceness: have it replace os.nice"


@pytest.fixture(scope="session", autouse=True)
def no_process_outlives_the_session() -> Iterator[None]:
    """Fail, and clean up, when a process that a test started is still there soon after the last test."""
    mark = f"{MARK}={uuid.uuid4().hex}"
    os.environ[MARK] = mark.partition("=")[2]
    yield
    deadline = time.monotonic() + GRACE_S
    while (left := marked_processes(mark)) and time.monotonic() < deadline:
        time.sleep(0.05)
    for number in left:
        with suppress(ProcessLookupError):
            os.kill(number, signal.SIGKILL)
    assert not left, f"tests left processes behind: {left}"


@pytest.fixture
def fogwatch(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., int]:
    """The command, in a folder of its own."""
    monkeypatch.chdir(tmp_path)

    def command(*arguments: str | Path) -> int:
        monkeypatch.setattr(sys, "argv", ["fogwatch", *map(str, arguments)])
        from fogwatch.cli.app import main

        return main()

    return command


@pytest.fixture
def command(fogwatch: Callable[..., int]) -> Callable[..., int]:
    """The command, for files in which `fogwatch` is the package."""
    return fogwatch
