"""The built site: what its pages load, what its search finds, and how it looks on a phone and in the dark.

`make docs` builds it, which checks all links between pages, and then runs these tests.
"""

import json
import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from tests.browser import Look, browser_or_skip

SITE = Path(__file__).parents[2] / "build" / "site"
PHONE, LAPTOP = {"width": 390, "height": 844}, {"width": 1280, "height": 900}
PAGES = ("docs/index", "docs/tutorial", "docs/commands", "docs/scenario", "docs/python-reference", "docs/student")
LOADED = {("source", "srcset"), ("link", "href"), *((tag, "src") for tag in ("img", "script", "iframe", "video"))}
"""Attributes whose files a browser loads by itself."""

pytestmark = [pytest.mark.site]


class LoadedFiles(HTMLParser):
    """The files that a page has a browser load, as it names them."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.named: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.named.extend(value or "" for name, value in attrs if (tag, name) in LOADED)


def html_pages() -> list[Path]:
    return sorted(SITE.rglob("*.html"))


def search_index() -> Any:
    text = (SITE / "searchindex.js").read_text(encoding="utf-8")
    return json.loads(text.removeprefix("Search.setIndex(").removesuffix(")"))


def test_there_is_a_page_for_each_document() -> None:
    root = SITE.parents[1]
    documents = {path.relative_to(root).with_suffix(".html") for path in (root / "docs").rglob("*.md")}
    assert len(documents) > 50
    assert documents <= {page.relative_to(SITE) for page in html_pages()}


def test_what_a_page_loads_is_what_its_elements_name() -> None:
    html = '<img src="https://a.example/b.png"><a href="https://a.example">c</a><script src="d.js"></script>'
    assert LoadedFiles(html).named == ["https://a.example/b.png", "d.js"]


def loaded() -> Iterator[tuple[Path, str]]:
    """Each file that a page loads, with the page."""
    for page in html_pages():
        yield from ((page, name) for name in LoadedFiles(page.read_text(encoding="utf-8")).named)


def test_no_page_loads_anything_from_another_host() -> None:
    assert not [(page, name) for page, name in loaded() if re.match(r"(?:\w+:)?//", name)]


def test_no_style_and_no_script_loads_anything_from_another_host() -> None:
    styles = [
        path for path in SITE.rglob("*.css") if re.search(r"(?:url\(|@import)\s*[\"']?(?:https?:)?//", path.read_text())
    ]
    scripts = [path for path in SITE.rglob("*.js") if re.search(r"(?:fetch|import)\([\"']https?://", path.read_text())]
    assert not styles + scripts


def test_whatever_a_page_loads_is_there() -> None:
    files = ((page, re.split("[?#]", name)[0]) for page, name in loaded() if not name.startswith("data:"))
    assert not [(page, name) for page, name in files if not (page.parent / name).exists()]


@pytest.mark.parametrize(
    ("word", "stem", "page"), [("silence", "silenc", "docs/faults"), ("claims", "claim", "docs/algorithm")]
)
def test_the_search_index_holds_words(word: str, stem: str, page: str) -> None:
    index = search_index()
    pages = index["terms"][stem]
    numbers = pages if isinstance(pages, list) else [pages]
    assert page in {index["docnames"][number] for number in numbers}, word


def test_the_search_index_holds_options() -> None:
    assert {"--set", "--in-process", "--policies"} <= search_index()["indexentries"].keys()


def look(chromium: Any, page: str, scheme: str = "light") -> Look:
    """A look at a page from the disk, as on a phone."""
    return Look(chromium, (SITE / f"{page}.html").as_uri(), scheme=scheme, **PHONE)


class TestInABrowser:
    """Pages opened from the disk; leaving a `Look` fails if one complains or asks another host."""

    pytestmark = browser_or_skip()

    @pytest.mark.parametrize("scheme", ["light", "dark"])
    @pytest.mark.parametrize("page", PAGES)
    def test_a_page_fits_a_phone(self, chromium: Any, page: str, scheme: str) -> None:
        with look(chromium, page, scheme) as seen:
            assert seen.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
            colour = seen.evaluate("getComputedStyle(document.body).backgroundColor")
            assert (sum(map(int, re.findall(r"\d+", colour)[:3])) < 200) == (scheme == "dark")

    @pytest.mark.parametrize("notebook", ["first-patrol", "your-policy"])
    def test_in_the_dark_plots_are_turned_and_maps_of_ages_keep_their_colours(
        self, chromium: Any, notebook: str
    ) -> None:
        with look(chromium, f"docs/notebooks/{notebook}", "dark") as seen:
            shown = "(where) => [...document.querySelectorAll(where)].map((one) => getComputedStyle(one).filter)"
            assert seen.page.evaluate(shown, ".tag_map img") == ["brightness(0.85)"]
            plots = seen.page.evaluate(shown, ".cell:not(.tag_map) img[src$='.png']")
            assert set(plots) == {"invert(0.92) hue-rotate(180deg)"}

    @pytest.mark.parametrize("size", [PHONE, LAPTOP], ids=["phone", "laptop"])
    def test_every_page_fits(self, chromium: Any, size: dict[str, int]) -> None:
        wide = []
        with Look(chromium, (SITE / f"{PAGES[0]}.html").as_uri(), size["width"], size["height"]) as seen:
            for page in (page for page in html_pages() if page.parent != SITE or page.name != "index.html"):
                seen.page.goto(page.as_uri(), wait_until="load")
                if seen.evaluate("document.documentElement.scrollWidth") > size["width"]:
                    wide.append(str(page.relative_to(SITE)))
        assert not wide

    @pytest.mark.parametrize(
        ("word", "page"), [("silence", "faults.html"), ("claims", "algorithm.html"), ("--set", "commands.html")]
    )
    def test_the_search_finds(self, chromium: Any, word: str, page: str) -> None:
        with Look(chromium, f"{(SITE / 'search.html').as_uri()}?q={word}") as seen:
            seen.until("(document.querySelector('.search-summary')?.innerText ?? '') !== ''")
            results = seen.evaluate("[...document.querySelectorAll('#search-results li a')].map(link => link.href)")
            assert any(page in result for result in results)

    def test_the_first_page_leads_to_the_site(self, chromium: Any) -> None:
        with look(chromium, "index") as seen:
            seen.page.wait_for_url("**/docs/index.html")
            assert seen.page.title().startswith("fogwatch")
