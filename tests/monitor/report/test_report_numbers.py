"""The numbers of a report are those of the run's summary, whatever went wrong in it."""

import re
from collections import Counter
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from monitor.recording.run_recorder import Recorder
from monitor.replay.replay import play
from monitor.replay.run import Run, open_run
from monitor.report.analysis import analyse, measures
from monitor.report.charts import radio_chart, troubles_chart
from monitor.report.document import report_html
from monitor.report.html import escape
from monitor.report.map_charts import paths_chart
from patrol.faults.kinds import KINDS
from patrol.journal.records import TickRecord
from tests.monitor.conftest import DOORS, QUIET, SPOOF, rewritten, run_of
from tests.recordings import decoded

ALL_KINDS: list[dict[str, Any]] = [
    {"kind": "loss", "rate": 0.3, "at": 1, "for": 30},
    {"kind": "delay", "delay": {"uniform": [0.0, 3.0]}, "at": 2},
    {"kind": "duplicate", "rate": 0.3, "delay": {"constant": 1}, "at": 2, "for": 30},
    {"kind": "reorder", "rate": 0.3, "hold": 1.5, "at": 2, "for": 30},
    {"kind": "partition", "groups": "one", "at": 5, "for": 4},
    {"kind": "silence", "who": "r2", "direction": "out", "at": 10, "for": 3},
    {"kind": "range", "reach": 20, "at": 12, "for": 5},
    {"kind": "bandwidth", "bytes_per_s": 40, "at": 14, "for": 5},
    {**SPOOF, "at": 5, "for": 15},
    {"kind": "drift", "who": "r2", "bias": [1.5, 0.0], "at": 12, "for": 6},
    {"kind": "clock", "who": "r3", "offset": 1.0, "at": 12, "for": 6},
    {"kind": "pause", "who": "r3", "at": 18, "for": 10},
    {"kind": "resume", "who": "r3", "at": 21},
    {"kind": "kill", "who": "r1", "at": 22},
    {"kind": "restart", "who": "r1", "at": 26},
    {"kind": "leave", "who": "r4", "at": 24},
    {"kind": "join", "who": "r5", "at": 20},
    {"kind": "kill", "who": "all", "at": 34},
    {"kind": "motion", "at": 2.0, "for": 3.0, "who": ["r1"], "speed": 0.1},
    {"kind": "close", "at": 4.0, "for": 6.0, "closure": "crate"},
    {"kind": "open", "at": 6.0, "for": 3.0, "closure": "gate"},
]

LAST = 68
"""The tick before which nobody is left: there is none, as in a run that ends because everybody was lost."""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    assert {fault["kind"] for fault in ALL_KINDS} == set(KINDS)
    robots = {"count": 4, "spare": 2, "model": "holonomic"}
    doors = {name: DOORS[name] for name in ("closures", "patrol")}
    scenario = {**QUIET, **doors, "name": "troubled", "robots": robots, "faults": ALL_KINDS}
    whole = run_of(tmp_path_factory.mktemp("whole"), scenario)
    folder = tmp_path_factory.mktemp("troubled") / "run"
    return open_run(rewritten(whole, folder, lambda record: record if record.k < LAST else None))


def rows(page: str, section: str, number: int = 0) -> dict[str, list[str]]:
    """The rows of a section's table, by their first cells."""
    part = page.partition(f'<section id="{section}">')[2].partition("</section>")[0]
    body = re.findall(r"<tbody>(.*?)</tbody>", part, re.DOTALL)[number]
    cells = [re.findall(r"<td[^>]*>(.*?)</td>", row, re.DOTALL) for row in re.findall(r"<tr>(.*?)</tr>", body)]
    heads = 2 if section == "links" and len(cells[0]) > 4 else 1
    return {" to ".join(row[:heads]): list(map(unescape, row)) for row in cells}


def test_every_number_that_a_summary_has_too(run: Run) -> None:
    summary = run.stated.document()
    assert run.ticks == summary["ticks"] == LAST
    page = report_html(analyse(run), ())
    for name, row in rows(page, "robots").items():
        facts = summary["robots"][name]
        planned = facts["planned_share"]
        ways = [f"{facts['distance_m']:.0f}", f"{100.0 * facts['dead_end_share']:.1f}"]
        ways.append("-" if planned is None else f"{100.0 * planned:.1f}")
        counts = [str(facts[name]) for name in ("collisions", "decisions")]
        ms = [f"{facts[name]:.1f}" for name in ("decision_ms_p50", "decision_ms_p99")]
        assert row == [name, facts["status"], *ways, *counts, *ms]
    assert set(rows(page, "robots")) == {"r1", "r2", "r3", "r4", "r5"}
    assert {facts["status"] for facts in summary["robots"].values()} == {"dead", "left", "absent"}

    assert rows(page, "closures") == {
        name: [name, str(facts["closings"]), f"{facts['closed_s']:g}"] for name, facts in summary["closures"].items()
    }
    assert {name: facts["closings"] for name, facts in summary["closures"].items()} == {"gate": 2, "crate": 1}
    assert {*rows(page, "faults")} >= {name for name, facts in summary["faults"].items() if facts["kind"] == "close"}

    messages = summary["messages"]
    for words in (
        f"{messages['delivered']} of {messages['sent']} frames were delivered",
        f"{messages['in_flight']} were still in flight at the end",
        f"Robots rejected {messages['rejected']} frames.",
    ):
        assert words in page
    by_kind: Counter[str] = Counter()
    for cause, frames, _ in rows(page, "links", 0).values():
        by_kind[cause.partition(":")[0]] += int(frames)
    assert +by_kind == messages["dropped_by_cause"]
    listed = rows(page, "links", 1)
    linked = {f"{source} to {to}": facts for source, links in summary["links"].items() for to, facts in links.items()}
    assert set(listed) == set(linked)
    for link, (_, _, sent, delivered, flying, share, _) in listed.items():
        facts = linked[link]
        assert [int(sent), int(delivered), int(flying)] == [facts["sent"], facts["delivered"], facts["in_flight"]]
        settled = facts["sent"] - facts["in_flight"]
        assert float(share) == pytest.approx(100.0 * facts["delivered"] / settled, abs=0.01)

    expected = {
        "robots at the end": 0,
        "mean MFoW": summary["mfow_mean_s"],
        "largest MFoW": summary["mfow_max_s"],
        "mean fog": summary["fog_mean_s"],
        "seen": summary["seen_share"],
        "driven": sum(robot["distance_m"] for robot in summary["robots"].values()),
        "collisions": sum(robot["collisions"] for robot in summary["robots"].values()),
        "delivered": messages["delivered"] / (messages["delivered"] + messages["dropped"]),
    }
    found = {measure.name: measure.value for measure in measures(run)}
    assert {name: found[name] for name in expected} == pytest.approx(expected)
    assert found["largest MFoW"] == summary["mfow_max_s"]


def test_a_large_number_is_written_as_people_write_it(run: Run) -> None:
    driven = replace(next(measure for measure in measures(run) if measure.name == "driven"), value=12345.6)
    assert escape(driven.text) == "12,346 m"


def test_forged_frames_are_no_part_of_what_was_delivered_over_time(run: Run, tmp_path: Path) -> None:
    assert run.links.delivered[0].any()
    assert run.links.delivered_in.sum() == run.links.delivered[1:].sum()
    assert run.links.dropped_in.sum() == run.links.lost[1:].sum()
    line = radio_chart(run, ()).axes[0].lines[0]
    settled = run.links.delivered_in + run.links.dropped_in
    shares = 100.0 * run.links.delivered_in[settled > 0] / settled[settled > 0]
    shown = np.asarray(line.get_ydata())
    np.testing.assert_allclose(shown[~np.isnan(shown)], shares)
    recorder = Recorder(run, tmp_path / "a.mcap")
    play(run, [recorder])
    recorder.close()
    recorded = [100.0 * message.data for _, message in decoded(tmp_path / "a.mcap")["/delivered_share"]]
    np.testing.assert_allclose(recorded, shares)


def test_who_was_lost_after_the_last_tick_is_drawn_as_lost(run: Run) -> None:
    assert run.status[-1, run.names.index("r2")] == 1
    for axes, name in zip(paths_chart(run).axes, run.names, strict=False):
        assert [line.get_marker() for line in axes.lines][-1] == ("o" if name == "r4" else "X"), name


def test_dead_ends_are_a_share_of_decisions_as_in_the_summary(quiet: Any, tmp_path: Path) -> None:
    """Robots that miss every other command, and get out of a dead end whenever they decide in the second half."""

    def missed(record: TickRecord) -> TickRecord:
        state = "dead-end" if record.k >= 40 else "patrolling"
        change: dict[str, Any] = {"state": "", "decision_ms": None} if record.k % 2 else {"state": state}
        return replace(record, robots=tuple(replace(row, **change) for row in record.robots))

    run = open_run(rewritten(quiet, tmp_path / "missed", missed))
    assert [facts.dead_end_share for facts in run.stated.robots.values()] == [0.5, 0.5, 0.5]
    assert [row[3] for row in rows(report_html(analyse(run), ()), "robots").values()] == ["50.0"] * 3
    assert [bar.get_width() for bar in bars(troubles_chart(run))] == [50.0] * 3


def bars(made: Figure) -> list[Rectangle]:
    return [patch for patch in made.axes[0].patches if isinstance(patch, Rectangle)]


# --- direct radio ----------------------------------------------------------------------------------------------------

SAID = {
    "r1": {"sent": 80, "heard": {"r2": 60, "r3": 50}, "refused": 0, "final": True},
    "r2": {"sent": 80, "heard": {"r1": 40}, "refused": 0, "final": True},
}


@pytest.mark.parametrize("overheard", [True, False])
def test_of_a_direct_radio_a_report_says_what_robots_said_alone(quiet: Any, tmp_path: Path, overheard: bool) -> None:
    def direct(record: TickRecord) -> TickRecord:
        frames = record.frames if overheard or record.k != 30 else ()
        return replace(record, deliveries=(), dropped=(), frames=frames)

    scenario = {**QUIET, "pace": 1.0, "radio": {"via": "direct"}}
    notes = {"direct": {"said": SAID, "missed": {"r1": 0, "r2": 0, "r3": 0}}}
    folder = rewritten(quiet, tmp_path / "direct", direct, scenario, notes)
    run = open_run(folder)
    analysis = analyse(run)
    assert analysis.beliefs is None
    page = report_html(analysis, ())
    assert not any(words in page for words in ("No frames were sent", "was exact", "Reconstructed from"))
    assert "Unknown: robots heard each other directly" in page
    assert "they heard 100 of 160 frames and rejected 0. The counts of r3 are missing or incomplete." in page
    assert rows(page, "links") == {
        "r2 to r1": ["r2 to r1", "80", "60", "75.00"],
        "r1 to r2": ["r1 to r2", "80", "40", "50.00"],
    }
    found = {measure.name: measure.value for measure in measures(run)}
    assert found["delivered"] == pytest.approx(run.stated.direct.heard_share)

    (folder / "summary.json").unlink()
    page = report_html(analyse(open_run(folder)), ())
    assert "No two robots reported at the end" in page


def test_one_slow_decision_does_not_move_the_median(quiet: Any, tmp_path: Path) -> None:
    """One in five takes 96 ms, so the mean is 20 ms."""

    def slow(record: TickRecord) -> TickRecord:
        ms = 96.0 if record.k % 5 == 0 else 1.0
        return replace(record, robots=tuple(replace(row, decision_ms=ms) for row in record.robots))

    found = {measure.name: measure for measure in measures(open_run(rewritten(quiet, tmp_path / "slow", slow)))}
    assert found["median decision time"].text == "1.00 ms"
