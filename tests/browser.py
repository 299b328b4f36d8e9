"""A real browser for tests, which notes whatever a page should not do."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlsplit

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
PATIENCE_S = 180.0
NOWHERE = "--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE localhost , EXCLUDE 127.0.0.1"


def browser_or_skip() -> list[pytest.MarkDecorator]:
    """The marks of a module that needs a browser. In CI a missing browser is a failure, elsewhere a reason to skip."""
    return [
        pytest.mark.browser,
        pytest.mark.skipif(
            CHROMIUM is None and not os.environ.get("CI"), reason="there is no Chromium; `make browser` installs one"
        ),
    ]


@contextmanager
def looking() -> Iterator[Any]:
    """A browser that finds nobody but this machine."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=CHROMIUM, args=[NOWHERE], timeout=PATIENCE_S * 1000)
        try:
            yield running
        finally:
            running.close()


class Look:
    """One look at an address. Leaving it fails when the page complained, or asked anybody but its own server."""

    def __init__(self, browser: Any, address: str, width: int = 1280, height: int = 720, scheme: str = "light") -> None:
        self._context = browser.new_context(color_scheme=scheme, viewport={"width": width, "height": height})
        self._host = urlsplit(address).netloc
        self.asked: list[str] = []
        self._complaints: list[str] = []
        self._context.on("request", lambda request: self.asked.append(request.url))
        self.page = self._context.new_page()
        self.page.set_default_timeout(PATIENCE_S * 1000)
        self.page.on("websocket", lambda socket: self.asked.append(socket.url))
        self.page.on("console", lambda message: self._complaints.append(message.text))
        self.page.on("pageerror", lambda error: self._complaints.append(str(error)))
        self.page.goto(address, wait_until="domcontentloaded")

    def __enter__(self) -> Look:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        self._context.close()
        if kind is None:
            assert not self._complaints, self._complaints
            asked = {urlsplit(url).netloc for url in self.asked if not url.startswith(("data:", "blob:"))}
            assert asked == {self._host}, asked

    def evaluate(self, script: str) -> Any:
        """Return the value of a script in the page."""
        return self.page.evaluate(script)

    def press(self, key: str) -> None:
        """A key."""
        self.page.keyboard.press(key)

    def picture(self, selector: str) -> bytes:
        """A part of the page as PNG."""
        image: bytes = self.page.locator(selector).screenshot()
        return image

    def seek(self, k: int) -> None:
        """Have a replay's page show a tick, and wait until the map is drawn, one frame after the numbers above it."""
        shown = f"document.getElementById('clock').title === 'tick {k}'"
        if self.evaluate(shown):
            return
        drawn = self.evaluate("Number(document.body.dataset.frames ?? 0)")
        self.slide(k)
        self.until(f"{shown} && Number(document.body.dataset.frames) > {drawn}")

    def slide(self, k: int) -> None:
        """Move a replay's slider to a tick."""
        script = "const s = document.getElementById('seek'); s.value = %d; s.dispatchEvent(new Event('input'));"
        self.evaluate(f"() => {{ {script % k} }}")

    def until(self, script: str, limit_s: float = PATIENCE_S) -> None:
        """Wait until a script says yes; the page's policy forbids Playwright's own way of waiting."""
        end = time.monotonic() + limit_s
        while not self.evaluate(script):
            assert time.monotonic() < end, f"never: {script}"
            time.sleep(0.05)
