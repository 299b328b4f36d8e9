"""Runs and tables as notebooks show them."""

import base64
import io
import re
from html import unescape
from pathlib import Path

import pytest
from PIL import Image

from fogwatch.notebook import html
from fogwatch.notebook.html import MOST_ROWS, MOST_WARNINGS, lines_html, run_html, table_html
from monitor.tables.table import Table
from patrol.summary.metric import metrics_of
from patrol.summary.model import Messages, RobotFigures, Summary, VerdictFacts


def cells(shown: str) -> list[list[str]]:
    rows = re.findall(r"<tr>(.*?)</tr>", shown)
    return [[unescape(cell) for cell in re.findall(r"<t[hd]>(.*?)</t[hd]>", row)] for row in rows]


@pytest.mark.parametrize(("rows", "note"), [(40, ""), (41, "... and 1 more rows"), (100, "... and 60 more rows")])
def test_a_table_shows_its_first_forty_rows(rows: int, note: str) -> None:
    shown = table_html(Table(("a", "<b>"), [(f"{n}", f"{-n}") for n in range(rows)]))
    assert MOST_ROWS == 40
    assert cells(shown) == [["a", "<b>"], *([f"{n}", f"{-n}"] for n in range(min(rows, 40)))]
    assert re.findall("<p>(.*?)</p>", shown) == ([note] if note else [])


def test_lines_are_escaped_and_in_order() -> None:
    assert lines_html(["a & b", "<i>"]) == "<div>a &amp; b</div><div>&lt;i&gt;</div>"


def test_a_run_shows_each_figure_under_its_name(tmp_path: Path) -> None:
    verdict = VerdictFacts(outcome="valid", warnings=[f"warning {n}" for n in range(MOST_WARNINGS + 2)], checks=[])
    summary = Summary(
        name="yards",
        simulated_s=60.5,
        mfow_mean_s=1.25,
        mfow_max_s=2.5,
        fog_mean_s=3.75,
        seen_share=0.5,
        messages=Messages(delivered=7, sent=9),
        robots={"r1": RobotFigures(status="alive"), "r2": RobotFigures(status="dead")},
        verdict=verdict,
    )
    shown = run_html(summary, tmp_path, ["said first", "said next"])
    head, *figures = cells(shown)
    assert head == ["figure", "value"]
    titles = [metric.title for _, metric in metrics_of(Summary) if metric.title]
    assert [name for name, _ in figures] == [*titles, "frames delivered", "robots"]
    told = dict(figures)
    assert (told["mean MFoW"], told["largest MFoW"], told["mean fog"]) == ("1.2 s", "2.5 s", "3.8 s")
    assert (told["seen"], told["frames delivered"], told["robots"]) == ("50.00 %", "7 of 9", "r1 alive, r2 dead")
    lines = re.findall(r"<div>(.*?)</div>", shown)
    assert lines[:3] == ["<b>yards</b>: 60.5 s simulated, verdict valid", "said first", "said next"]
    assert lines[3:-1] == [*(f"warning: warning {n}" for n in range(5)), "2 more warnings"]
    exactly = summary.model_copy(update={"verdict": VerdictFacts(warnings=verdict.warnings[:5], checks=[])})
    assert "more warnings" not in run_html(exactly, tmp_path)
    assert "not judged" in run_html(summary.model_copy(update={"verdict": None}), tmp_path)


def picture_in(shown: str) -> Image.Image | None:
    found = re.search(r'src="data:image/png;base64,([^"]+)"', shown)
    return Image.open(io.BytesIO(base64.b64decode(found[1]))) if found else None


@pytest.mark.parametrize(
    ("size", "shown"), [((1280, 320), (640, 160)), ((320, 1280), (160, 640)), ((100, 50), (100, 50))]
)
def test_the_final_fog_is_shown_at_most_640_pixels_wide_and_high(
    size: tuple[int, int], shown: tuple[int, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    Image.new("RGB", size).save(tmp_path / "fog.png")
    summary = Summary(name="yards", simulated_s=1.0)
    picture = picture_in(run_html(summary, tmp_path))
    assert picture is not None
    assert picture.size == shown
    monkeypatch.setattr(html, "MOST_PIXELS", size[0] * size[1])
    assert picture_in(run_html(summary, tmp_path)) is not None
    monkeypatch.setattr(html, "MOST_PIXELS", size[0] * size[1] - 1)
    assert picture_in(run_html(summary, tmp_path)) is None


def test_a_picture_that_leads_out_of_the_folder_is_not_shown(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    summary = Summary(name="yards", simulated_s=1.0)
    Image.new("RGB", (9, 9)).save(tmp_path / "other.png")
    (folder / "fog.png").symlink_to(tmp_path / "other.png")
    assert picture_in(run_html(summary, folder)) is None
