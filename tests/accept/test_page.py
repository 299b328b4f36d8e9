"""The page of a large fleet, watched for ten minutes."""

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

import fogwatch
from tests.browser import Look, browser_or_skip, looking

pytestmark = [pytest.mark.accept, pytest.mark.timeout(1800), *browser_or_skip()]

FLEET: dict[str, Any] = {
    "name": "fifty",
    "terrain": {"builtin": "site"},
    "duration": 120,
    "robots": {"count": 50, "model": "holonomic"},
}
WATCHED_S = 600.0
LAST_S = 60.0
LEAST_FRAMES = 20.0
MOST_MB = 400.0


def memory_mb(pid: int) -> float:
    """Memory of a process, MB."""
    pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def test_fifty_robots_are_shown_smoothly_in_little_memory(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = fogwatch.run(FLEET, out=tmp_path / "fifty")
    command = [sys.executable, "-P", "-m", "monitor", "--replay", str(run.folder)]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert server.stdout is not None
        address = next(line for line in server.stdout if line.startswith("page: ")).removeprefix("page: ").strip()
        with looking() as browser, Look(browser, address) as look:
            look.until("document.body.dataset.frames > 0")
            # Twenty times real time is forty ticks a second, more than are shown; it begins again whenever it is over.
            look.page.select_option("#pace", "20")
            frames, since, end = 0, 0.0, time.monotonic() + WATCHED_S
            while (now := time.monotonic()) < end:
                if look.evaluate("document.getElementById('play').textContent") == "play":
                    look.page.click("#play")
                if not since and now > end - LAST_S:
                    frames, since = int(look.evaluate("document.body.dataset.frames")), now
                time.sleep(0.1)
            rate = (int(look.evaluate("document.body.dataset.frames")) - frames) / (time.monotonic() - since)
            held = memory_mb(server.pid)
        with capsys.disabled():
            print(f"\n{rate:.1f} frames/s, the page's process {held:.0f} MB")
        assert rate >= LEAST_FRAMES
        assert held < MOST_MB
    finally:
        server.terminate()
        server.wait(30)
        if server.stdout is not None:
            server.stdout.close()
