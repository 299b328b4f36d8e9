"""Makes the pictures of the page that README and site show, `make pictures`: of a run of its own, or one given.

A real browser opens the page as anybody would, in light and in dark. An animation shows the map from the run's begin.
"""

from __future__ import annotations

import argparse
import io
import queue
import shutil
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

from PIL import Image

import fogwatch
from fogwatch.cli.ending import guarded
from monitor.process import serve
from monitor.replay.player import Player
from monitor.replay.run import open_run
from patrol.errors import BadInput
from runtime.process.lifeline import Ending

SCENARIO: dict[str, Any] = {
    "name": "site-eight",
    "terrain": {"builtin": "site"},
    "point": 0.25,
    "duration": 740,
    "seed": 3,
    "robots": {"count": 8, "model": "car"},
    "faults": [
        {"kind": "kill", "who": "r3", "at": 560},
        {"kind": "loss", "rate": 0.5, "at": 600, "for": 80},
        {"kind": "silence", "who": "r5", "at": 715, "for": 20},
    ],
}
AT = 0.97
"""How far into the run the moment is that is shown."""
TRAIL = 120
"""Ticks that are played before, so that robots have trails."""

MOVIE_TICKS = range(0, 480, 8)
"""Ticks that the animation shows, a frame each."""
FRAME_MS = 120
MOVIE_SIZE = (640, 620)
"""The window's size for the animation, pixels."""

VIEWS = (("page-light", 1280, 720, "light"), ("page-dark", 1280, 720, "dark"))


def main(given: Path | None, out: Path) -> None:
    """Write the pictures into a folder. given: a run's folder, or None to do a run."""
    try:
        from playwright.sync_api import sync_playwright
    except ModuleNotFoundError:
        raise BadInput("needs a browser and the library that drives it: make develop browser") from None
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        player = Player(open_run(given or fogwatch.run(SCENARIO, out=Path(folder) / SCENARIO["name"]).folder))
        ending, addresses = Ending(), queue.Queue[str]()
        page = threading.Thread(
            target=lambda: serve(lambda: [player], "127.0.0.1", 0, "", ending, opened=addresses.put)
        )
        page.start()
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium") or shutil.which("chromium-browser")
        )
        try:
            address = addresses.get()
            for name, width, height, scheme in VIEWS:
                context = browser.new_context(
                    viewport={"width": width, "height": height},
                    color_scheme="dark" if scheme == "dark" else "light",
                    device_scale_factor=1.5,
                )
                look(context.new_page(), address, round((player.static().ticks or 1) * AT))
                context.pages[0].screenshot(path=out / f"{name}.png")
                context.close()
            context = browser.new_context(viewport=dict(zip(("width", "height"), MOVIE_SIZE, strict=True)))
            animate(context.new_page(), address, out / "patrol.webp")
            context.close()
        finally:
            browser.close()
            ending.ask("the pictures are made")
            page.join()


def look(page: Any, address: str, moment: int) -> None:
    """Play up to the wanted tick, and wait until everything is drawn."""
    begin(page, address)
    for k in range(max(moment - TRAIL, 0), moment + 1, 2):
        seek(page, k)
    while not page.evaluate("document.querySelectorAll('#chart .scatterlayer .trace').length"):
        time.sleep(0.1)
    time.sleep(1.5)


def animate(page: Any, address: str, out: Path) -> None:
    """Write an animation of the map."""
    begin(page, address)
    frames = []
    for k in MOVIE_TICKS:
        seek(page, k)
        page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        shot = page.locator("#map").screenshot()
        frames.append(Image.open(io.BytesIO(shot)).convert("RGB"))
    frames[0].save(out, save_all=True, append_images=frames[1:], duration=FRAME_MS, loop=0, quality=45, method=6)


def begin(page: Any, address: str) -> None:
    """Open the page, and wait until it shows a tick: before, it could not ask for another."""
    page.goto(address)
    while not page.evaluate("document.getElementById('clock').title"):
        time.sleep(0.02)


def seek(page: Any, k: int) -> None:
    """Have the page show a tick."""
    page.evaluate(
        "(k) => { const s = document.getElementById('seek'); s.value = k; s.dispatchEvent(new Event('input')); }", k
    )
    while page.evaluate("document.getElementById('clock').title") != f"tick {k}":
        time.sleep(0.02)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path, nargs="?", help="folder of a finished run (default: do one)")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, metavar="FOLDER", help="of the pictures")
    arguments = parser.parse_args()
    sys.exit(guarded(lambda: main(arguments.run, arguments.out)))
