"""The sections of a report, from values that are told here; no two of them are alike."""

import re
from dataclasses import replace
from html import unescape
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from monitor.observation.fault_bands import Band
from monitor.replay.belief_errors import BeliefErrors
from monitor.replay.run import Run
from monitor.report.analysis import analyse, disagreement, measures, outcome_of, state_of
from monitor.report.document import report_html
from monitor.report.radio_section import links_section
from patrol.journal.records import End, Event
from patrol.summary.model import FaultFacts, RobotFigures, Stalest, Stalests, Summary, VerdictFacts

NUMBER = re.compile(r"-?[\d,]+(\.\d+)?|-|never|")


def tables(page: str) -> list[list[list[tuple[str, str]]]]:
    """The rows of each table: class and text of each cell."""
    bodies = re.findall(r"<tbody>(.*?)</tbody>", page, re.DOTALL)
    rows = [re.findall(r"<tr>(.*?)</tr>", body, re.DOTALL) for body in bodies]
    cell = re.compile(r'<td(?: class="([^"]*)")?[^>]*>(.*?)</td>', re.DOTALL)
    return [[[(kind, unescape(text)) for kind, text in cell.findall(row)] for row in table] for table in rows]


def section(page: str, name: str) -> list[list[str]]:
    """The texts of a section's first table."""
    part = page.partition(f'<section id="{name}">')[2].partition("</section>")[0]
    found = tables(part)
    return [[text for _, text in row] for row in found[0]] if found else []


@pytest.mark.parametrize("which", ["faulty", "doors", "trapped"])
def test_columns_of_numbers_are_aligned_and_no_others(which: str, request: pytest.FixtureRequest) -> None:
    page = report_html(analyse(request.getfixturevalue(which).open()), ())
    checked = 0
    for table in tables(page):
        for column in zip(*table, strict=True):
            kinds, texts = {kind for kind, _ in column}, [text for _, text in column]
            is_number = all(NUMBER.fullmatch(text) for text in texts) and any(re.search(r"\d", text) for text in texts)
            if any(re.fullmatch(r"-?\d+(\.\d+)?, -?\d+(\.\d+)?", text) for text in texts):
                is_number = True  # a place
            assert kinds == ({"n"} if is_number else {""}) or not any(texts), texts[:3]
            checked += 1
    assert checked > 20


@pytest.fixture
def run(quiet: Any) -> Run:
    opened: Run = quiet.open()
    return opened


def test_the_stalest_places_are_told_with_their_ages_and_who_was_near(run: Run) -> None:
    worst = Stalest(x=1.26, y=2.34, age_s=7.5, at_s=20.0, seen=True, nearest="r2", nearest_m=3.6)
    end = Stalest(x=5.0, y=6.0, age_s=8.25, at_s=40.0, seen=False, nearest=None, nearest_m=None)
    page = report_html(analyse(replace(run, summary=Summary(stalest=Stalests(worst=worst, end=end)))), ())
    assert section(page, "fog") == [
        ["over the run", "1.3, 2.3", "20", "7.5", "12.5 s", "r2, 4 m away"],
        ["at the end", "5.0, 6.0", "40", "8.25", "never", "-"],
    ]


def test_belief_errors_are_means_and_maxima_of_each_robot_in_seconds(run: Run) -> None:
    nan = float("nan")
    mean = np.array([[2.0, nan, 0.5], [4.0, nan, nan], [9.0, nan, 0.75]])
    errors = BeliefErrors(np.array([0, 1, 2]), (2, 1, 0), mean, mean, exact=False)
    page = report_html(replace(analyse(run), beliefs=errors), ())
    assert section(page, "belief") == [["r3", "2.50", "4.50"], ["r1", "0.31", "0.38"]]  # half a second a tick
    assert "only for" not in page
    some = BeliefErrors(errors.ticks, (2, 1), mean[:, :2], mean[:, :2], exact=False)
    assert "; only for the 2 robots that missed most frames." in report_html(replace(analyse(run), beliefs=some), ())


def test_faults_are_told_with_the_frames_that_they_touched(run: Run) -> None:
    bands = (
        Band("f1", "loss", 1.0, 3.5, "all to all"),
        Band("f2", "spoof", 2.0, 4.0, "r1"),
        Band("f3", "kill", 5.0, 5.0, "r2"),
        Band("f4", "delay", 6.0, 8.0, "r3"),
    )
    facts = {
        "f1": FaultFacts(kind="loss", frames=30, dropped=12, delayed=0, duplicated=0),
        "f2": FaultFacts(kind="spoof", frames=7),
        "f3": FaultFacts(kind="kill"),
        "f4": FaultFacts(kind="delay", frames=40, dropped=1, delayed=2, duplicated=3),
    }
    page = report_html(replace(analyse(replace(run, summary=Summary(faults=facts))), bands=bands), ())
    assert section(page, "faults") == [
        ["f1", "loss", "1", "3.5", "all to all", "30 on its links, 12 dropped"],
        ["f2", "spoof", "2", "4", "r1", "7 forged"],
        ["f3", "kill", "5", "", "r2", ""],
        ["f4", "delay", "6", "8", "r3", "40 on its links, 1 dropped, 2 delayed, 3 duplicated"],
    ]


def test_events_are_told_with_their_time_and_robot(run: Run) -> None:
    events = tuple(Event(k, "dead" if k % 2 else "noted", k % 3 or None, f"event {k}") for k in range(301))
    page = report_html(analyse(replace(run, events=events)), ())
    rows = section(page, "events")
    assert rows[:3] == [
        ["0", "noted", "", "event 0"],
        ["0.5", "dead", "r1", "event 1"],
        ["1", "noted", "r2", "event 2"],
    ]
    assert len(rows) == 300
    assert "301 events" in page
    assert "1 more are not listed" in page
    exactly = report_html(analyse(replace(run, events=events[:300])), ())
    assert "are not listed" not in exactly.partition('<section id="events">')[2].partition("</section>")[0]


def test_each_robots_row_holds_its_own_numbers_in_their_units(run: Run) -> None:
    figures = tuple(
        RobotFigures(
            status="alive",
            distance_m=1000.0 * n + 0.4,
            dead_end_share=0.01 * n,
            planned_share=None if n == 3 else 0.5 * n,
            collisions=n,
            decisions=10 * n,
            decision_ms_p50=1.04 * n,
            decision_ms_p99=None if n == 3 else 2.06 * n,
        )
        for n in (1, 2, 3)
    )
    changed = replace(run)
    vars(changed)["robot_figures"] = figures
    rows = section(report_html(analyse(changed), ()), "robots")
    assert rows == [
        ["r1", "alive", "1000", "1.0", "50.0", "1", "10", "1.0", "2.1"],
        ["r2", "alive", "2000", "2.0", "100.0", "2", "20", "2.1", "4.1"],
        ["r3", "alive", "3000", "3.0", "-", "3", "30", "3.1", "-"],
    ]


# --- words about the whole run ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("verdict", "words"),
    [
        (None, "not judged"),
        (VerdictFacts(outcome="valid", checks=[]), "valid"),
        (VerdictFacts(outcome="valid", warnings=["r1 was trapped"], checks=[]), "valid, with warnings"),
        (VerdictFacts(outcome="invalid", warnings=["r1 was trapped"], checks=[]), "invalid, with warnings"),
    ],
)
def test_the_outcome_in_words(run: Run, verdict: VerdictFacts | None, words: str) -> None:
    assert outcome_of(replace(run, summary=Summary(verdict=verdict))) == words
    assert outcome_of(replace(run, summary=None)) == "not judged"


def test_how_a_run_ended_in_words(run: Run) -> None:
    assert state_of(run) == state_of(run, going=True) == ("completed", "")
    assert state_of(replace(run, ended="stopped")) == ("stopped", "The run ended early (stopped), after 40 s of 40 s.")
    cut = replace(run, ended=None)
    assert state_of(cut)[1] == "The run was cut off: its journal stops after 40 s of 40 s. It has no verdict."
    torn = state_of(replace(cut, truncated=True))[1]
    assert torn.startswith("The run was cut off: its journal stops in the middle of a record after 40 s")
    assert state_of(cut, going=True)[1].startswith("The run is still going: 40 s of 40 s so far.")


def test_a_summary_that_the_journal_contradicts_is_told_and_rounding_is_none(run: Run) -> None:
    assert disagreement(run) == ""
    stated = run.stated
    mean_s = stated.mfow_mean_s or 0.0
    nearly = {"mfow_mean_s": mean_s * (1.0 + 5e-10)}
    assert disagreement(replace(run, summary=stated.model_copy(update=nearly))) == ""
    for key, value in (("mfow_mean_s", mean_s * (1.0 + 5e-9)), ("ticks", run.ticks + 1), ("ended", "stopped")):
        told = disagreement(replace(run, summary=stated.model_copy(update={key: value})))
        assert told.startswith(f"summary.json states {key} = ")
        assert told.endswith(". `fogwatch judge` compares the rest, and judges the run again.")
        assert told.count("summary.json") == 1
    others = {"messages": stated.messages.model_copy(update={"sent": 1}), "robots": {}}
    assert disagreement(replace(run, summary=stated.model_copy(update=others))) == ""
    other: Any = SimpleNamespace(end=End("completed", "0123"))
    told = disagreement(replace(run, journal=other))
    assert told.startswith("the journal's ticks do not have the trace hash that its end states. ")


def test_ratios_to_tour_and_bound_wait_until_the_run_is_long_enough(run: Run) -> None:
    def ratios(**figures: Any) -> list[tuple[float | None, str]]:
        changed = replace(run, figures=run.figures.model_copy(update=figures))
        by_name = {measure.name: measure for measure in measures(changed)}
        shown = [by_name[f"mean MFoW / {yardstick}"] for yardstick in ("best tour", "bound")]
        return [(measure.value, measure.note) for measure in shown]

    tour_s = next(measure.value for measure in measures(run) if measure.name == "best tour found")
    assert tour_s
    long = {"seen_share": 1.0, "mfow_mean_s": 12.0, "bound_s": 8.0, "simulated_s": 4.0 * max(tour_s, 8.0)}
    assert ratios(**long) == [(pytest.approx(12.0 / tour_s), ""), (1.5, "")]
    assert ratios(**long | {"seen_share": 0.99}) == [(None, "not all was seen")] * 2
    assert ratios(**long | {"simulated_s": 4.0 * min(tour_s, 8.0) - 0.1}) == [(None, "run too short")] * 2
    assert ratios(**long | {"mfow_mean_s": None}) == [(None, "")] * 2


def test_medians_and_counts_are_over_all_robots(run: Run) -> None:
    ms = np.full((run.ticks, 3), np.nan)
    ms[:3] = [[1.0, 2.0, 3.0], [10.0, 20.0, np.nan], [40.0, np.nan, np.nan]]
    changed = replace(run, decision_ms=ms)
    vars(changed)["robot_figures"] = tuple(
        RobotFigures(status=status, distance_m=way, collisions=hits)
        for status, way, hits in (("alive", 1.5, 2), ("dead", 2.0, 0), ("alive", 4.0, 5))
    )
    found = {measure.name: measure for measure in measures(changed)}
    assert found["median decision time"].value == 6.5  # of 1, 2, 3, 10, 20 and 40
    assert (found["robots at the end"].value, found["robots at the end"].note) == (2, "of 3")
    assert (found["driven"].value, found["collisions"].value) == (7.5, 7)
    silent = replace(run, decision_ms=np.full((run.ticks, 3), np.nan))
    assert {measure.name: measure.text for measure in measures(silent)}["median decision time"] == "-"


# --- radio -----------------------------------------------------------------------------------------------------------


def links_of(**more: Any) -> Any:
    """A run of two robots whose frames are told here; row and column 0 are the forger's."""
    zero = np.zeros((3, 3), dtype=np.int64)
    sent, delivered, lossy, weak = zero.copy(), zero.copy(), zero.copy(), zero.copy()
    sent[1, 2], delivered[1, 2], lossy[1, 2], weak[1, 2] = 20, 12, 3, 1
    sent[2, 1], delivered[2, 1] = 8, 8
    sent[0, 1], delivered[0, 1], lossy[0, 1] = 6, 4, 2
    links = {"sent": sent, "delivered": delivered, "dropped": {"loss:f1": lossy, "range": weak}, "late": 0, **more}
    links["lost"] = sum(links["dropped"].values(), zero)
    return SimpleNamespace(
        direct=False,
        step=0.5,
        names=("a", "b"),
        links=SimpleNamespace(**links),
        figures=SimpleNamespace(messages=SimpleNamespace(rejected=9)),
    )


def test_frames_are_told_by_their_fate_and_by_link() -> None:
    page = links_section(links_of())
    assert page.startswith(
        "<p>20 of 28 frames were delivered (counted once for each receiver). 4 forged frames were delivered. "
        "4 were still in flight at the end. All arrived in the tick in which they were sent. Robots rejected 9 frames."
    )
    causes, rows = ([[text for _, text in row] for row in table] for table in tables(page))
    assert causes == [["loss:f1", "3", "2"], ["range", "1", "0"]]
    assert rows == [
        ["forger", "a", "6", "4", "0", "66.67", "loss:f1 2"],
        ["a", "b", "20", "12", "4", "75.00", "loss:f1 3, range 1"],
        ["b", "a", "8", "8", "0", "100.00", ""],
    ]


def test_delays_and_frames_on_their_way_are_told_only_where_there_are_any() -> None:
    late = links_section(links_of(late=3))
    assert "The largest delay was 1.5 s. Robots" in late
    delivered = np.zeros((3, 3), dtype=np.int64)
    sent = delivered.copy()
    sent[1, 2] = 5
    flying = links_section(links_of(sent=sent, delivered=delivered, dropped={}))
    assert "0 of 5 frames were delivered" in flying
    assert "5 were still in flight" in flying
    assert [text for _, text in tables(flying)[0][0]] == ["a", "b", "5", "0", "5", "-", ""]
    assert "forged" not in flying
    assert "No frames were sent." in links_section(links_of(sent=delivered, delivered=delivered, dropped={}))
