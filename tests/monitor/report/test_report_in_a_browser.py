from pathlib import Path
from typing import Any

import pytest

from monitor.report.analysis import analyse
from monitor.report.document import write_report
from tests.browser import Look, browser_or_skip

pytestmark = browser_or_skip()


@pytest.fixture(scope="module")
def report(faulty: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(analyse(faulty.open()), path)
    return path


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 390])
def test_a_report_asks_nobody_fits_and_can_be_read(chromium: Any, report: Path, scheme: str, width: int) -> None:
    with Look(chromium, report.as_uri(), width, 720, scheme) as look:
        for details in look.page.query_selector_all("summary"):
            details.click()
        assert [url for url in look.asked if not url.startswith("data:image/png")] == [report.as_uri()]
        assert look.evaluate("document.documentElement.scrollWidth") <= width
        heights = "[...document.querySelectorAll('figure svg')].map(one => one.getBoundingClientRect().height)"
        assert min(look.evaluate(heights)) > 80
        cut = "[...document.querySelectorAll('figure, .scroll')].filter((one) => one.scrollWidth > one.clientWidth + 1)"
        assert look.evaluate(f"{cut}.map((one) => one.textContent.slice(0, 80))") == []
        ink, paper = (look.evaluate(f"getComputedStyle(document.body).{of}") for of in ("color", "backgroundColor"))
        assert look.evaluate("getComputedStyle(document.querySelector('#fog svg text')).fill") == ink
        brightness = [sum(map(int, tone[4:-1].split(","))) for tone in (ink, paper)]
        assert (brightness[0] > brightness[1]) == (scheme == "dark")
