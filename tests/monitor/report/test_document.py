import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from monitor.figures.style import Drawing
from monitor.replay.run import Run, open_run
from monitor.report import html
from monitor.report.analysis import analyse, measures, state_of
from monitor.report.charts import troubles_chart
from monitor.report.compare import compare_html, differences, names_of, rows_of
from monitor.report.compare import drawings as drawings_of_several
from monitor.report.document import drawings, report_html, write_page, write_report
from patrol.errors import BadInput
from patrol.measures.best_tour import best_tour
from patrol.scenario import load_scenario
from patrol.summary.model import Summary
from tests.monitor.conftest import cut, run_of, shorten_range

OPENING = ("verdict", "fog", "visits", "robots", "paths", "links", "belief", "decisions", "moving")
SECTIONS = (*OPENING, "scenario", "files")


def sections(page: str) -> list[str]:
    return re.findall(r'<section id="([^"]+)">', page)


def asks_nobody(page: str) -> bool:
    """Nothing in a page is fetched from anywhere: no script, no address but files, names of XML, places on the page."""
    addresses = re.findall(r'(?:href|src|url)\s*[=(]\s*"?([^")\s>]+)', page)
    is_here = re.compile(r"#.*|data:image/png.*|[\w.][\w./-]*", re.DOTALL).fullmatch
    return (
        all(map(is_here, addresses))
        and not any(word in page for word in ("<script", "@import"))
        and "default-src 'none'" in page
    )


def page_of(run: Run) -> str:
    """A run's report without drawings."""
    return report_html(analyse(run), ())


def rows_of_section(page: str, section: str) -> list[list[str]]:
    """The cells of a section's table, row by row, without the head."""
    shown = page.partition(f'<section id="{section}">')[2].partition("</section>")[0]
    return [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in re.findall(r"<tr>(.*?)</tr>", shown)][1:]


def with_verdict(folder: Path, change: Callable[[dict[str, Any]], None]) -> Run:
    """Change the verdict in a run's summary, and open the run."""
    file = folder / "summary.json"
    summary = json.loads(file.read_text(encoding="utf-8"))
    change(summary["verdict"])
    file.write_text(json.dumps(summary), encoding="utf-8")
    return open_run(folder)


def test_a_report_tells_the_whole_run(faulty: Any, tmp_path: Path) -> None:
    run = faulty.open()
    analysis = analyse(run)
    made = write_report(analysis, tmp_path / "report.html", figures=tmp_path / "figures")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert sections(page) == [*OPENING, "faults", "events", "scenario", "files"]
    assert asks_nobody(page)
    assert page.count("<svg") == page.count("</svg>") == len(made) == 11
    assert len(page) < 2_000_000
    assert run.journal.header.scenario_hash in page
    assert "var(--ink)" in page
    assert "#1c2127" not in page.split("</style>")[1]
    for fault in ("loss", "delay", "spoof", "drift", "pause", "kill", "restart"):
        assert re.search(f"<td[^>]*>{fault}</td>", page)
    assert (run.folder / "scenario.yaml").read_text(encoding="utf-8").splitlines()[3] in page
    ids = re.findall(r'\bid="([^"]+)"', page)
    references = set(re.findall(r'(?:url\(#|href="#)([^")]+)', page))
    assert references <= set(ids)
    for drawing in made:
        with Image.open(tmp_path / "figures" / f"{drawing.name}.png") as image:
            assert min(image.size) > 250
            assert np.asarray(image.convert("L")).std() > 5.0
        svg = (tmp_path / "figures" / f"{drawing.name}.svg").read_text(encoding="utf-8")
        assert "var(" not in svg
        assert svg.startswith("<?xml")


def test_a_report_says_and_draws_what_was_closed(doors: Any) -> None:
    analysis = analyse(doors.open())
    page = report_html(analysis, made := drawings(analysis))
    assert "closures" in sections(page)
    assert "closed out" in sections(page)
    assert re.search(r"Reachable MFoW: mean [\d.]+ s, .* closed out [\d.]+ % of ground x time", page)
    assert "crate waits to close: r1 in it" in page
    assert "close: closure crate" in page
    for drawing in made:
        if drawing.name.startswith("fog-"):
            texts = {text.get_text() for axes in drawing.figure.axes for text in axes.texts}
            assert texts == {"gate", "crate"}


def test_what_events_say_is_never_taken_for_html() -> None:
    hostile = '<span class="badge ok">valid</span><img src=x>'
    page = html.table(("event", hostile), [("dead", hostile), (html.badge(hostile, "ok"), "")])
    assert "<img" not in page
    assert page.count("<span") == 1
    assert page.count("&lt;span") == 5, "three cells, and the head that a phone shows beside each of two"
    assert html.text("a\u202eb\nc") == "<p>a\\u202eb\nc</p>", "nothing reverses what follows"


def test_a_quiet_run_has_no_faults_and_no_error(quiet: Any) -> None:
    analysis = analyse(quiet.open())
    page = report_html(analysis, drawings(analysis))
    assert sections(page) == list(SECTIONS)
    assert "so every belief was exact" in page
    assert ">valid</span>" in page


def test_a_run_that_was_killed(faulty: Any, copied: Callable[..., Path]) -> None:
    folder = copied(faulty)
    cut(folder, 0.5)
    run = open_run(folder)
    page = page_of(run)
    assert all(words in page for words in ("not judged", "The run was cut off", "in the middle of a record"))
    assert "The run is still going" in report_html(analyse(run), (), going=True)
    assert [state_of(run)[0], state_of(run, True)[0]] == ["cut off", "still going"]


def test_a_verdict_that_is_not_valid(quiet: Any, copied: Callable[..., Path]) -> None:
    def fail(verdict: dict[str, Any]) -> None:
        verdict["checks"][0] |= {"ok": False, "detail": "<b>a hole</b>"}
        verdict["checks"][1]["judged"] = False
        verdict |= {"valid": False, "outcome": "invalid"}

    run = with_verdict(copied(quiet), fail)
    page = page_of(run)
    checks = len(run.stated.document()["verdict"]["checks"])
    assert f"{checks - 2} checks passed, 1 failed, 1 could not be judged" in page
    assert "&lt;b&gt;a hole&lt;/b&gt;" in page
    assert ">invalid</span>" in page


def test_a_changed_scenario_is_told(quiet: Any, copied: Callable[..., Path]) -> None:
    folder = copied(quiet)
    shorten_range(folder)
    analysis = analyse(open_run(folder))
    assert analysis.wrong_from == 0
    assert "differs from the one measured during the run" in report_html(analysis, ())


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (shutil.rmtree, "no such folder"),
        (lambda folder: (folder / "journal").unlink(), "holds no file journal, so it is not"),
        (lambda folder: (folder / "scenario.yaml").unlink(), "holds no file scenario.yaml, so it is not"),
        (lambda folder: (folder / "journal").write_bytes(b"something else"), "is not a fogwatch journal"),
        (lambda folder: (folder / "journal").write_bytes(b"fogwatch journal 1\n"), "no complete header"),
    ],
)
def test_what_is_no_run_is_said(
    quiet: Any, copied: Callable[..., Path], spoil: Callable[[Path], object], words: str
) -> None:
    folder = copied(quiet)
    spoil(folder)
    with pytest.raises(BadInput, match=words):
        open_run(folder)


def test_a_journal_and_a_scenario_of_two_runs_are_told_apart(quiet: Any, copied: Callable[..., Path]) -> None:
    folder = copied(quiet)
    text = (folder / "scenario.yaml").read_text(encoding="utf-8")
    for change, words in (("point: 0.5", "points"), ("count: 4", "other robots")):
        name = change.partition(":")[0]
        changed = re.sub(rf"\b{name}: [0-9.]+", change, text, count=1)
        (folder / "scenario.yaml").write_text(changed, encoding="utf-8")
        with pytest.raises(BadInput, match=words):
            open_run(folder)


def test_runs_side_by_side(quiet: Any, faulty: Any, hazy: Any) -> None:
    runs = [seen.open() for seen in (quiet, faulty, hazy)]
    names = names_of(runs)
    rows = {name: values for name, *values in rows_of(runs)}
    assert rows["scenario"] == ["short", "faulty", "hazy"]
    assert rows["verdict"][0] == "valid"
    assert [float(text.split()[0]) for text in rows["largest MFoW"]] == [run.mfow.max() * run.step for run in runs]
    differ = {field: values for field, *values in differences(runs)}
    assert differ.keys() == {"faults", "sensor.quality"}
    empty, some, *_ = differ["faults"]
    assert (empty, some[:8]) == ("[]", "[{kind: ")
    analyses = [analyse(run) for run in runs]
    made = drawings_of_several(analyses)
    page = compare_html(analyses, made)
    assert asks_nobody(page)
    assert page.count("<svg") == len(made) == 6
    assert sections(page) == ["measures", "scenario", "fog", "visits", "maps", "faults"]
    assert all(name in page for name in names)


POLICY = """
from agent.ports import Stay


class Lazy:
    def __init__(self, setup):
        pass

    def decide(self, view):
        return Stay()
"""


def test_two_copies_of_a_policy_and_of_a_map_are_no_difference(tmp_path: Path) -> None:
    plan = "image: plan.png\nresolution: 1.0\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.6\nfree_thresh: 0.2\n"
    runs = []
    for name, text in (("one", POLICY), ("two", POLICY), ("three", POLICY + "# changed")):
        folder = tmp_path / name / "map"
        folder.mkdir(parents=True)
        (tmp_path / name / f"{name}.py").write_text(text, encoding="utf-8")
        Image.new("L", (30, 20), 254).save(folder / "plan.png")
        (folder / "plan.yaml").write_text(plan, encoding="utf-8")
        terrain, policy = {"map": str(folder / "plan.yaml")}, {"policy": f"{tmp_path / name / name}.py:Lazy"}
        robots = {"count": 1, "model": "holonomic"}
        facts = {"terrain": terrain, "duration": 5, "point": 1.0, "robots": robots, "patrol": policy}
        runs.append(run_of(tmp_path / name, facts).open())
    assert differences(runs[:2]) == []
    ((field, *values),) = differences(runs)
    assert field == "patrol.policy"
    assert values[0] == values[1] != values[2]
    assert all(re.fullmatch(r"Lazy \(sha256 [0-9a-f]{12}\)", value) for value in values)


def test_a_report_shows_intruders_with_their_numbers(tmp_path: Path) -> None:
    intruders = [{"place": [20, 10], "at": 1, "for": 6}, {"place": [30, 40], "at": 9.0}, {"place": [1, 1], "at": 9.1}]
    robots = [{"model": "holonomic", "start": [20, 14]}, {"model": "holonomic", "start": [24, 10]}]
    facts = {"terrain": {"builtin": "open"}, "duration": 10, "point": 1.0, "robots": robots, "intruders": intruders}
    run = run_of(tmp_path, {**facts}).open()
    analysis = analyse(run)
    assert [(band.id, band.begin, band.end) for band in analysis.intruders] == [
        ("intruder1", 1.0, 7.0),
        ("intruder2", 9.0, 10.0),
        ("intruder3", 9.1, 10.0),
    ]
    made = drawings(analysis)
    page = report_html(analysis, made)
    assert "Blue: intruders." in page
    assert "Red: faults." not in page
    rows = rows_of_section(page, "intruders")
    counted = run.stated.intruders[0]
    assert counted.first_reported_s == 1.0
    assert rows[0][:6] == ["intruder1", "at (20, 10)", "1", "7", "1", f"{counted.reported_s:g}"]
    assert rows[1][4] == "never"
    assert re.search(r"<td[^>]*>intruder1</td><td[^>]*>at \(20, 10\)</td>", page_of(replace(run, summary=None)))


def test_a_report_lists_the_zones(tmp_path: Path) -> None:
    square = [[2, 2], [20, 2], [20, 20], [2, 20]]
    zones = [
        {"name": "vault", "polygon": square, "weight": 10, "weights": [[7, 3]], "times": [[2, 4], [6, 8]]},
        {"name": "ward", "polygon": square, "speed": 0.5, "times": []},
        {"name": "stairs", "polygon": [[80, 80], [84, 80], [84, 84], [80, 84]], "keep_out": True},
    ]
    facts = {"terrain": {"builtin": "open"}, "duration": 10, "point": 1.0, "robots": 1 * [{}], "zones": zones}
    run = run_of(tmp_path, facts).open()
    rows = rows_of_section(page_of(run), "zones")
    vault = run.stated.zones["vault"]
    ages = [f"{value:.1f}" for value in (vault.fog_mean_s, vault.mfow_mean_s, vault.mfow_max_s)]
    assert rows[0] == ["vault x10, x3 from 7 s", "2 to 4 s, 6 to 8 s", *ages, "-"]
    assert [row[:3] for row in rows[1:3]] == [["ward 0.5 m/s", "never", "-"], ["stairs: keep out", "always", "-"]]
    assert rows[3][:2] == ["elsewhere x1", "always"]


def test_no_collision_is_drawn_as_none_of_one(quiet: Any) -> None:
    run = quiet.open()
    assert run.bumped.sum() == 0
    right = troubles_chart(run).axes[1]
    assert right.get_xlim() == (0.0, 1.0)
    assert all(tick == round(tick) for tick in right.get_xticks())


def test_what_cannot_be_written_is_said(quiet: Any, tmp_path: Path) -> None:
    run = quiet.open()
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(BadInput, match="cannot be written"):
        write_page("", tmp_path / "file" / "report.html")
    drawing = Drawing("troubles", "", "", lambda: troubles_chart(run))
    with pytest.raises(BadInput, match="cannot be written"):
        drawing.save(tmp_path / "file")


def test_a_valid_run_with_warnings_says_so_at_the_top(quiet: Any, copied: Callable[..., Path]) -> None:
    def warn(verdict: dict[str, Any]) -> None:
        warnings = ["r1 was trapped: <here>", *(f"r{n} was trapped" for n in range(2, 24))]
        progress = next(check for check in verdict["checks"] if check["name"] == "progress")
        progress["warnings"] = verdict["warnings"] = warnings

    page = page_of(with_verdict(copied(quiet), warn))
    top = page.split('<section id="verdict"')[0]
    assert '<span class="badge unknown">valid, with warnings</span>' in top
    assert "Warning: r1 was trapped: &lt;here&gt;" in top
    assert "Warning: r20 was trapped" in top
    assert "3 more warnings are in summary.json" in top
    assert "1 with warnings" in page
    assert '<span class="badge open">warning</span>' in page


def test_a_report_says_what_the_mfow_compares_with(quiet: Any) -> None:
    run = quiet.open()
    best = next(measure for measure in measures(run) if measure.name == "best tour found")
    assert best.value == best_tour(run.prepared).bound_s(dict.fromkeys(run.numbers, 1.0))
    assert best.note == f"for all {len(run.numbers)} robots, as if none were ever down"
    assert "stalest place" not in page_of(replace(run, summary=Summary(verdict=run.stated.verdict)))


def test_a_report_says_when_robots_of_several_speeds_share_a_tour(quiet: Any) -> None:
    run = quiet.open()
    robots = [{"speed": 1.0 + index} for index in range(len(run.numbers))]
    scenario = load_scenario({"terrain": {"builtin": "open"}, "robots": robots})
    mixed = replace(run, prepared=replace(run.prepared, scenario=scenario))
    best = next(measure for measure in measures(mixed) if measure.name == "best tour found")
    assert best.note == f"for all {len(robots)} robots, each at its own speed, as if none were ever down"


def test_a_lower_bound_of_0_is_explained(quiet: Any) -> None:
    run = quiet.open()
    without = replace(run, figures=run.figures.model_copy(update={"bound_s": 0.0}))
    by_name = {measure.name: measure for measure in measures(without)}
    assert by_name["mean MFoW"].note.startswith("lower bound 0: discs of the sensor's range")
    assert (by_name["mean MFoW / bound"].value, by_name["mean MFoW / bound"].note) == (None, "the lower bound is 0")
