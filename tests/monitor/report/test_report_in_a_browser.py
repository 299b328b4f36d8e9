from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from monitor.report.analysis import analyse
from monitor.report.document import write_report
from tests.browser import PATIENCE_S, browser_or_skip

pytestmark = browser_or_skip()


@pytest.fixture(scope="module")
def report(faulty: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(analyse(faulty.open()), path)
    return path


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 390])
def test_a_report_asks_nobody_fits_and_can_be_read(chromium: Any, report: Path, scheme: str, width: int) -> None:
    context = chromium.new_context(color_scheme=scheme, viewport={"width": width, "height": 720})
    asked, complaints = [], []
    context.on("request", lambda request: asked.append(request.url))
    page = context.new_page()
    page.set_default_timeout(PATIENCE_S * 1000)
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(report.as_uri())
    for details in page.query_selector_all("summary"):
        details.click()
    assert [url for url in asked if not url.startswith("data:image/png")] == [report.as_uri()]
    assert not complaints
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    heights = "[...document.querySelectorAll('figure svg')].map(one => one.getBoundingClientRect().height)"
    assert min(page.evaluate(heights)) > 80
    ink, paper = (page.evaluate(f"getComputedStyle(document.body).{what}") for what in ("color", "backgroundColor"))
    written = page.evaluate("getComputedStyle(document.querySelector('#fog svg text')).fill")
    assert written == ink
    brightness = {what: sum(map(int, tone[4:-1].split(","))) for what, tone in (("ink", ink), ("paper", paper))}
    assert (brightness["ink"] > brightness["paper"]) == (scheme == "dark")
    context.close()
