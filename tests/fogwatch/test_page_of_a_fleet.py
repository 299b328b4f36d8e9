"""The page of a fleet of real processes, driven by its buttons in a real browser."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import pytest

from patrol.journal import Status, read_journal
from tests.browser import Look, browser_or_skip, looking

if TYPE_CHECKING:
    from tests.fogwatch.conftest import Run

pytestmark = [pytest.mark.processes, *browser_or_skip()]

FLEET: dict[str, Any] = {
    "name": "watched",
    "terrain": {"builtin": "open"},
    "point": 0.5,
    "duration": 20000,
    "pace": 2.0,
    "robots": {"count": 3, "model": "holonomic"},
    "patrol": {"dilatation": 0.0},
}


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with looking() as running:
        yield running


def address_of(run: Run) -> str:
    """What the launcher prints of its page."""
    assert run.process.stderr is not None
    for line in run.process.stderr:
        if line.startswith("page: "):
            return str(line.removeprefix("page: ").strip())
    raise AssertionError("no page")


def share(look: Look) -> float:
    """The delivered share from the first robot to the third, as the page tells it."""
    box = look.page.locator("#matrix").bounding_box()
    look.page.mouse.move(box["x"] + box["width"] * 0.85, box["y"] + box["height"] * 0.25)
    told = look.evaluate("document.getElementById('linktip').textContent")
    if "%" not in told:
        return 1.0
    assert told.startswith("r1 to r3: ")
    return float(told.partition("(")[2].partition(" %")[0]) / 100.0


@pytest.mark.timeout(900)
def test_buttons_break_a_fleet_and_the_journal_knows_who_did_it(chromium: Any, start: Callable[..., Run]) -> None:
    run = start(FLEET, "--page", "--no-report", "--no-recording")
    with Look(chromium, address_of(run)) as look:
        look.until("document.querySelectorAll('#chart .scatterlayer .trace').length === 2")
        points = "document.querySelector('#chart .scatterlayer .trace path').getAttribute('d').length"
        before = look.evaluate(points)
        look.until(f"{points} > {before}")

        assert "r2" in run.children()
        look.page.click("#tab-faults")
        look.page.select_option("#who", "1")
        look.page.click("#kill")
        look.until("document.querySelectorAll('#rows tr')[1].textContent.includes('dead')")
        assert "r2" not in run.children()

        look.page.click("#intruder")
        look.page.click("#canvas", position={"x": 455, "y": 300})
        look.until("document.getElementById('answer').textContent.includes('intruder')")

        look.page.click("#tab-links")
        look.until("document.querySelector('#matrix').height > 100")
        assert share(look) == 1.0
        look.page.click("#tab-faults")
        look.evaluate(
            """() => { const loss = document.getElementById('loss'); loss.value = 80;
                loss.dispatchEvent(new Event('input', {bubbles: true})); }"""
        )
        look.until("document.getElementById('answer').textContent.includes('loss')")
        look.page.click("#tab-links")
        for _ in range(400):
            if share(look) < 0.9:
                break
            look.page.wait_for_timeout(100)
        assert share(look) < 0.9

        look.page.click("#play")
        look.until("document.getElementById('mode').textContent === 'paused'")
        tick = look.evaluate("document.getElementById('clock').title")
        look.press(".")
        look.until(f"document.getElementById('clock').title !== {tick!r}")
        look.page.click("#play")
        look.until("document.getElementById('mode').textContent === 'live'")
    run.process.send_signal(signal.SIGINT)
    assert run.end() == 130, run.errors
    journal = read_journal(run.folder / "journal")
    last = list(journal.ticks)[-1]
    assert last.robots[1].status is Status.DEAD
    asked = [event.detail for event in journal.events if event.kind == "operator"]
    for word in ("kill", "loss", "intruder", "pause", "step", "go"):
        assert any(word in detail for detail in asked), word
    assert run.summary()["verdict"]["valid"]
    assert (run.folder / "timeline.yaml").exists()
