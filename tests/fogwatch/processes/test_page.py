"""The page of a fleet of real processes, driven by its buttons in a real browser."""

from collections.abc import Callable
from typing import Any

import pytest

from patrol.journal import Journal, Status, read_journal
from tests.browser import Look, browser_or_skip
from tests.fleets import COARSE
from tests.fogwatch.conftest import Run

pytestmark = [pytest.mark.processes, *browser_or_skip()]

ROBOTS = {"count": 3, "model": "holonomic"}
FLEET: dict[str, Any] = {**COARSE, "point": 0.5, "duration": 20000, "pace": 2.0, "robots": ROBOTS}


def address_of(run: Run) -> str:
    """The address of the page that the launcher prints."""
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


def adds_robots(look: Look, run: Run) -> None:
    """The button brings in the spare robots one by one, each a process that drives, and then says that that is all."""
    look.page.click("#tab-faults")
    for place, name in ((3, "r4"), (4, "r5")):
        listed = f"!document.querySelectorAll('#rows tr')[{place}].hidden"
        row = f"document.querySelectorAll('#rows tr')[{place}].textContent"
        assert not look.evaluate(listed)
        assert "absent" in look.evaluate(row)
        assert name not in run.children()
        look.page.click("#join")
        look.until(f"/patrolling|surrounding/.test({row})")  # there is an intruder, of which it may have heard by now
        assert look.evaluate(listed)
        assert name in run.children()
    look.page.click("#join")
    look.until("document.getElementById('answer').textContent.includes('--spare')")


def keeps_what_is_in_force(look: Look) -> None:
    """After a reload the controls show the faults that are still active, and can end them."""
    set_loss = """() => { const loss = document.getElementById('loss'); loss.value = 35;
        loss.dispatchEvent(new Event('input', {bubbles: true})); }"""
    pressed = "document.getElementById('silence').getAttribute('aria-pressed') === '%s'"
    loss = "document.getElementById('lossvalue').textContent === '%s %%'"
    look.page.select_option("#who", "2")
    look.page.click("#silence")
    look.evaluate(set_loss)
    look.until("document.getElementById('answer').textContent.includes('loss')")
    look.page.reload()
    look.until("document.body.dataset.frames > 0")
    look.page.click("#tab-faults")
    look.page.select_option("#who", "2")
    look.until(pressed % "true")
    look.until(loss % 35)
    look.page.select_option("#who", "0")
    look.until(pressed % "false")
    look.page.select_option("#who", "2")
    look.page.click("#silence")
    look.until(pressed % "false")
    look.evaluate("document.getElementById('answer').textContent = ''")
    look.evaluate(set_loss.replace("35", "0"))
    look.until("document.getElementById('answer').textContent !== ''")
    look.page.reload()
    look.until("document.body.dataset.frames > 0")
    look.until(loss % 0)
    look.page.click("#tab-faults")
    look.page.select_option("#who", "2")
    look.until(pressed % "false")


def places_an_intruder_by_keys(look: Look) -> None:
    """The cross begins in the middle and goes where the arrows send it; Enter places."""
    said = "document.getElementById('answer').textContent"
    look.press("i")
    look.until("document.activeElement.id === 'canvas'")
    tip = "document.getElementById('tip').textContent"
    look.until(f"{tip} !== ''")
    x0, y0 = (float(part) for part in look.evaluate(tip).partition(" m")[0].split(","))
    for key in ("ArrowRight", "ArrowRight", "Shift+ArrowUp"):
        look.press(key)
    look.press("Enter")
    look.until(f"/intruder[0-9]+ at/.test({said})")
    x, y = (float(part) for part in look.evaluate(said).partition("(")[2].partition(")")[0].split(","))
    # 12 pixels to the right and 60 up; the tip rounds to 0.1 m.
    assert x > x0 + 0.5
    assert abs((y - y0) - 5.0 * (x - x0)) < 0.5


def places_and_removes_an_intruder(look: Look) -> None:
    look.page.click("#intruder")
    look.page.click("#canvas", position={"x": 455, "y": 300})
    look.until("document.getElementById('answer').textContent.includes('intruder1 at')")
    look.until("document.getElementById('which').value === 'intruder1'")
    look.page.click("#remove")
    look.until("document.getElementById('there').hidden")


def stops_and_releases_all_robots(look: Look) -> None:
    disabled = "document.getElementById('%s').disabled"
    look.page.click("#tab-faults")
    look.page.click("#stopall")
    look.until(f"{disabled % 'stopall'} && !({disabled % 'releaseall'})")
    look.page.click("#releaseall")
    look.until(f"!({disabled % 'stopall'}) && {disabled % 'releaseall'}")


def ended(run: Run) -> tuple[Journal, list[str]]:
    """The journal of a run that is interrupted, which is valid, and what operators asked of it."""
    run.interrupt()
    assert run.summary()["verdict"]["valid"]
    journal = read_journal(run.folder / "journal")
    return journal, [event.detail for event in journal.events if event.kind == "operator"]


@pytest.mark.kind("page")
def test_a_button_kills_a_robot_and_the_journal_knows_who_did_it(chromium: Any, start: Callable[..., Run]) -> None:
    run = start(FLEET, "--page")
    with Look(chromium, address_of(run)) as look:
        look.until("document.getElementById('mode').textContent === 'live'")
        assert "r2" in run.children()
        look.page.click("#tab-faults")
        look.page.select_option("#who", "1")
        look.page.click("#kill")
        look.until("document.querySelectorAll('#rows tr')[1].textContent.includes('dead')")
        assert "r2" not in run.children()
    journal, asked = ended(run)
    assert list(journal.ticks)[-1].robots[1].status is Status.DEAD
    assert any("kill" in detail for detail in asked), asked


def test_buttons_do_what_they_say_and_the_journal_knows_who_did_it(chromium: Any, start: Callable[..., Run]) -> None:
    run = start(FLEET, "--page")
    with Look(chromium, address_of(run)) as look:
        look.until("document.querySelectorAll('#chart .scatterlayer .trace').length === 2")
        points = "document.querySelector('#chart .scatterlayer .trace path').getAttribute('d').length"
        before = look.evaluate(points)
        look.until(f"{points} > {before}")
        look.page.click("#tab-faults")
        places_and_removes_an_intruder(look)

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
        for _ in range(3000):
            if share(look) < 0.9:
                break
            look.page.wait_for_timeout(100)
        else:
            pytest.fail("the loss shows nowhere")

        adds_robots(look, run)
        keeps_what_is_in_force(look)
        places_an_intruder_by_keys(look)
        stops_and_releases_all_robots(look)

        look.page.click("#play")
        look.until("document.getElementById('mode').textContent === 'paused'")
        tick = look.evaluate("document.getElementById('clock').title")
        look.press(".")
        look.until(f"document.getElementById('clock').title !== {tick!r}")
        look.page.click("#play")
        look.until("document.getElementById('mode').textContent === 'live'")
        held = run.ticks()
        run.until(lambda: run.ticks() > held)  # the journal has what was asked for once a tick has followed
    _, asked = ended(run)
    for word in ("join", "silence", "loss", "intruder", "pause", "step", "go"):
        assert any(word in detail for detail in asked), word
    assert (run.folder / "timeline.yaml").exists()
