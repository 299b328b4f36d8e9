"""What every test shares: which run, how hypothesis searches, and that no process outlives the session."""

from __future__ import annotations

import os
import signal
import time
import uuid
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import settings

from patrol.errors import BadInput
from patrol.process.starting.warmup import warm

# A slow machine is no failure; in CI a run repeats exactly, elsewhere each run searches anew.
settings.register_profile("local", deadline=None, print_blob=True)
settings.register_profile("ci", settings.get_profile("local"), derandomize=True, database=None)
settings.load_profile("ci" if os.environ.get("CI") else "local")

SELDOM = ("accept", "network")
"""Markers of tests that run only where ``-m`` names them."""

PACKAGES = ("patrol", "agent", "worldsim", "monitor")
"""Packages that have kernels."""

MARK = "FOGWATCH_TEST_SESSION"
GRACE_S = 60.0
"""How long the last processes may take to leave, on a machine with much else to do."""


def pytest_xdist_auto_num_workers() -> int:
    """Two workers more than there are processors: many tests wait for processes."""
    return len(os.sched_getaffinity(0)) + 2


def pytest_configure(config: pytest.Config) -> None:
    """Compile the kernels before workers start, which would compile them side by side."""
    if config.getoption("numprocesses", None) and not config.option.collectonly:
        try:
            warm(PACKAGES, print)
        except BadInput as error:
            raise pytest.UsageError(str(error)) from None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what runs seldom, whatever else ``-m`` selects."""
    unnamed = [name for name in SELDOM if name not in config.option.markexpr]
    left_out = [item for item in items if any(item.get_closest_marker(name) for name in unnamed)]
    if left_out:
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item not in left_out]


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
