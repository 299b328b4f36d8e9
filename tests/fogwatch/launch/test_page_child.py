"""A page that dies is served again where it was, also when nobody had looked yet whether it was ready."""

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from fogwatch.launch.children import Children
from fogwatch.launch.launcher import MOST_RESTARTS, PAGE, PageChild
from runtime.starting.readiness import StartFailure, StartReport

ADDRESS = "http://127.0.0.1:40123/"


class Pages:
    """Children of which the page alone is started; each is given what it reports."""

    def __init__(self) -> None:
        self.by_name: dict[str, Any] = {}
        self.started: list[list[str]] = []
        self.report: StartReport | None = None
        self.ended = False

    def spawn(self, name: str, module: str, arguments: Sequence[str], *_: object, **__: object) -> None:
        assert (name, module) == (PAGE, "monitor")
        self.started.append(list(arguments))
        self.report, self.ended = None, False
        self.by_name[PAGE] = SimpleNamespace(
            start=SimpleNamespace(report=lambda: self.report),
            poll=lambda: -9 if self.ended else None,
            code=-9,
            describe_exit=lambda: "the page was killed by SIGKILL",
            describe_end=lambda: "the page was killed by SIGKILL",
        )


@pytest.fixture
def pages() -> Pages:
    return Pages()


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def page(pages: Pages, said: list[str], tmp_path: Path) -> PageChild:
    for name in ("starlette", "uvicorn", "websockets", "plotly"):
        pytest.importorskip(name)
    child = PageChild(cast("Children", pages), ["--access", "run"], tmp_path / "page.log", said.append)
    child.start()
    return child


@pytest.mark.parametrize("noticed", [True, False])
def test_one_that_was_ready_comes_back_at_its_address(
    noticed: bool, page: PageChild, pages: Pages, said: list[str]
) -> None:
    for _ in range(2):
        pages.report = StartReport(ADDRESS)
        if noticed:
            page.check()
        pages.ended = True
        page.check()
    assert pages.started == [["--access", "run"], *2 * [["--access", "run", "--page-port", "40123"]]]
    assert sum(line.startswith("page: ") for line in said) == 1


def test_one_that_found_its_port_taken_comes_back_at_another(page: PageChild, pages: Pages) -> None:
    pages.report = StartReport(ADDRESS)
    page.check()
    pages.ended = True
    page.check()
    pages.report, pages.ended = StartReport("", StartFailure.PORT_BUSY, "the port is busy"), True
    page.check()
    assert pages.started[1:] == [["--access", "run", "--page-port", "40123"], ["--access", "run"]]


def test_it_is_not_started_for_ever(page: PageChild, pages: Pages, said: list[str]) -> None:
    for _ in range(2 * MOST_RESTARTS):
        pages.ended = True
        page.check()
    assert len(pages.started) == 1 + MOST_RESTARTS
    assert said[-1] == "the page was killed by SIGKILL"
