"""Writes `report.html`: the report of a run, in one file that loads nothing else.

Figures are inline SVG drawn by matplotlib, with colours that follow the page's light or dark theme. A charting library
would add 4.8 MB to every report and offer only what the live page has. Without it a report takes less than a megabyte
and needs no script, and its figures can also be written as PNG and SVG.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

import numpy as np

from monitor.figures.style import Drawing
from monitor.replay.belief_errors import SAMPLES
from monitor.replay.run import Run
from monitor.replay.run_files import RECORDING, REPORT, SCENARIO, check_out
from monitor.report import charts, html, map_charts
from monitor.report.analysis import Analysis, disagreement, measures, outcome_of, state_of, warnings_of
from monitor.report.radio_section import links_section
from patrol.errors import BadInput
from patrol.extras import check_matplotlib
from patrol.files.whole_file import write_whole, writing
from patrol.files.yaml_text import read_text
from patrol.measures.best_tour import best_tour
from patrol.scenario.patrols import describe_patrol
from patrol.summary.features import FEATURES, Feature
from patrol.summary.metric import metrics_of
from patrol.summary.model import CheckFacts, FaultFacts, RobotFigures
from runtime.process.aside import in_two

MOST_EVENTS = 300
MOST_ROBOTS = 100
MOST_WARNINGS = 20

NOT_PASSED = {"failed": "failed", "warning": "with warnings", "not judged": "could not be judged"}
"""Badges of checks that have not just passed, and what a count of them says."""


def drawings(analysis: Analysis) -> list[Drawing]:
    """List the figures of a report."""
    run, visits = analysis.run, analysis.visits
    bands = (*analysis.bands, *analysis.intruders)
    step = run.step
    red = (" Red: faults." if analysis.bands else "") + (" Blue: intruders." if analysis.intruders else "")
    tour_s = best_tour(run.prepared).bound_of_fleet_s(run.prepared.scenario)
    figures = [
        Drawing(
            "mfow",
            "MFoW over time",
            f"Age of the stalest point (MFoW), and mean age over all points.{red}",
            lambda: charts.mfow_chart(run, bands, tour_s),
        ),
        Drawing(
            "states",
            "States of the robots",
            f"State in each tick. Marks: moves cancelled because of a collision.{red}",
            lambda: charts.states_chart(run, bands),
        ),
        Drawing(
            "fog-mean",
            "Mean fog",
            "Mean age of each point over the run." + map_charts.never_seen_note(visits.never),
            lambda: map_charts.fog_chart(run, visits.mean * step, visits.never, "mean fog (s)"),
        ),
        Drawing(
            "fog-worst",
            "Worst fog",
            "Largest age of each point." + map_charts.never_seen_note(visits.never),
            lambda: map_charts.fog_chart(run, visits.worst * step, visits.never, "worst fog (s)"),
        ),
        Drawing(
            "gaps",
            "Time between visits",
            "From the end of one visit to the beginning of the next, over all points and the whole run.",
            lambda: charts.gaps_chart(visits.gaps, step),
        ),
        Drawing(
            "paths",
            "Paths",
            "Ring: start of a robot; dot: end; cross: where it was lost.",
            lambda: map_charts.paths_chart(run),
        ),
    ]
    if len(run.names) > 1 and (run.links.delivered.any() or run.links.lost.any()):
        caption = "Share of the frames from each robot (row) to each other robot (column) that were delivered."
        figures.append(Drawing("links", "Delivered share by link", caption, lambda: charts.links_chart(run)))
        if run.links.lost.any():
            caption = (
                f"Share of the robots' frames that were delivered, of those delivered or dropped at the time.{red}"
            )
            figures.append(
                Drawing("radio", "Delivered share over time", caption, lambda: charts.radio_chart(run, bands))
            )
    errors, moving = analysis.beliefs, analysis.moving
    if errors is not None and len(errors.ticks):
        caption = f"Mean over all points of |believed age - true age|, at {len(errors.ticks)} ticks.{red}"
        figures.append(Drawing("belief", "Belief error", caption, lambda: charts.belief_chart(run, errors, bands)))
    if moving is not None:
        caption = (
            "An attempt that succeeds and one that does not, of the intruder that watches. Dashed: the "
            "intruder's way to its target (star). Lines: robots meanwhile, up to the dots. Red: where it was seen."
        )
        figures.append(Drawing("moving", "A moving intruder", caption, lambda: moving.chart(run)))
    if not np.isnan(run.decision_ms).all():
        caption = "Bar: 25th to 75th percentile; line: 1st to 99th percentile; vertical mark: median; cross: maximum."
        figures.append(Drawing("decisions", "Decision times", caption, lambda: charts.decisions_chart(run)))
    caption = "Share of each robot's decisions that were made in a dead end, and number of its cancelled moves."
    figures.append(Drawing("troubles", "Dead ends and collisions", caption, lambda: charts.troubles_chart(run)))
    return figures


def report_html(analysis: Analysis, figures: Sequence[Drawing], going: bool = False, beside: Path | None = None) -> str:
    """Return the report as an HTML document.

    Links to the run's files are relative to the folder `beside`; without one, to the run's own. `going` says that the
    run may still be running.
    """
    run = analysis.run
    of = {figure.name: figure for figure in figures}
    (word, why), outcome = state_of(run, going), outcome_of(run)
    scenario, header = run.prepared.scenario, run.journal.header
    count = len(run.names)
    warnings = warnings_of(run)
    hidden = len(warnings) - MOST_WARNINGS
    sub = [
        f"{count} robot{'s' if count != 1 else ''} on {header.terrain.name}",
        f"patrol: {describe_patrol(scenario.patrol.policy)}",
        f"{run.ticks * run.step:g} s in {run.ticks} ticks, {word}",
        *([f"started {header.started}"] if header.started else []),
        header.software,
    ]
    sections = [
        html.section("verdict", "Verdict", _verdict_section(run)),
        html.section(
            "fog", "Fog", html.figure(of.get("mfow")), _stalest_section(run), _figure_pair(of, "fog-mean", "fog-worst")
        ),
        html.section("visits", "Time between visits", html.figure(of.get("gaps"))),
        html.section(
            "robots", "Robots", html.figure(of.get("states")), _robots_table(run), html.figure(of.get("troubles"))
        ),
        *(html.section(feature.name, feature.name.capitalize(), _feature_table(feature, run)) for feature in FEATURES),
        html.section("paths", "Paths", html.figure(of.get("paths"))),
        html.section("links", "Radio", html.figure(of.get("links")), html.figure(of.get("radio")), links_section(run)),
        html.section("belief", "Belief error", _belief_section(analysis), html.figure(of.get("belief"))),
        html.section("decisions", "Decision times", html.figure(of.get("decisions"))),
        html.section("moving", "A moving intruder", _moving_table(analysis), html.figure(of.get("moving"))),
        html.section("faults", "Faults", _faults_table(analysis)),
        html.section("events", "Events", _events_table(run)),
        html.section("scenario", "Scenario", _scenario_section(run)),
    ]
    body = [
        html.main_heading(
            scenario.name, html.badge(outcome, outcome if outcome in ("valid", "invalid") else "unknown")
        ),
        html.text(" · ".join(sub), "sub"),
        html.banner(why),
        html.banner(_mismatch_text(analysis), bad=True),
        html.banner(disagreement(run), bad=True),
        *(html.banner(f"Warning: {line}", bad=True) for line in warnings[:MOST_WARNINGS]),
        html.text(f"{hidden} more warnings are in summary.json" if hidden > 0 else "", "note"),
        html.boxes((measure.text, measure.name, measure.note) for measure in measures(run)),
        html.navigation(_contents_links(sections)),
        *(part for part in sections if part),
        html.section("files", "Files", html.navigation(_file_links(run.folder, beside or run.folder))),
    ]
    return html.page(f"{scenario.name}: fogwatch report", (part for part in body if part))


def write_report(analysis: Analysis, out: Path, going: bool = False, figures: Path | None = None) -> list[Drawing]:
    """Write the report of a run into an HTML file, and return its figures.

    With a folder `figures`, they are also written there as files. `going` says that the run may still be running.
    """
    check_out(out, REPORT)
    drawn = drawings(analysis)
    _draw_figures(drawn)
    write_page(report_html(analysis, drawn, going, out.parent), out)
    for drawing in drawn if figures is not None else ():
        drawing.save(figures)  # type: ignore[arg-type]
    return drawn


def _draw_figures(drawn: Sequence[Drawing]) -> None:
    """Draw figures for a page, every other one in another process meanwhile."""
    check_matplotlib("monitor")  # loads it for both
    for drawing, svg in zip(drawn, in_two(lambda drawing: drawing.page_svg, drawn), strict=True):
        vars(drawing)["page_svg"] = svg


def write_page(document: str, out: Path) -> None:
    """Write a document; a file with the final name is always complete."""
    check_out(out, REPORT)
    with writing(out):
        write_whole(out, document)


def _verdict_section(run: Run) -> str:
    verdict = run.stated.verdict
    if verdict is None:
        return html.text("The run has no verdict: there is no summary.json, or it contains none.", "note")
    standings = [_standing_of(check) for check in verdict.checks]
    counts = Counter(standings)
    failing = [f"{counts[standing]} {text}" for standing, text in NOT_PASSED.items() if counts[standing]]
    rows: dict[bool, list[tuple[str, str, str]]] = {True: [], False: []}
    for standing, check in zip(standings, verdict.checks, strict=True):
        badge = html.badge(standing, standing if standing in ("ok", "failed") else "open")
        rows[standing == "ok"].append((badge, check.name, check.detail))
    heads = ("", "check", "details")
    listed = html.details("checks passed", html.table(heads, rows[True]))
    counted = ", ".join([f"{counts['ok']} checks passed", *failing])
    return html.text(f"{counted}.") + html.table(heads, rows[False]) + listed


def _standing_of(check: CheckFacts) -> str:
    if not check.ok:
        return "failed"
    return "warning" if check.warnings else "ok" if check.judged else "not judged"


def _stalest_section(run: Run) -> str:
    """Describe the stalest place over the run and at its end, and the robots nearest to it."""
    rows = []
    for when, stalest in (("over the run", run.stated.stalest.worst), ("at the end", run.stated.stalest.end)):
        if stalest is not None:
            near = "-" if stalest.nearest is None else f"{stalest.nearest}, {stalest.nearest_m:.0f} m away"
            since = f"{stalest.at_s - stalest.age_s:g} s" if stalest.seen else "never"
            rows.append(
                (when, f"{stalest.x:.1f}, {stalest.y:.1f}", f"{stalest.at_s:g}", f"{stalest.age_s:g}", since, near)
            )
    heads = ("stalest place", "x, y (m)", "at (s)", "age (s)", "last seen before at", "nearest robot then")
    return html.table(heads, rows, numbers=(1, 2, 3))


def _robots_table(run: Run) -> str:
    shown = [(key, metric) for key, metric in metrics_of(RobotFigures) if metric.title]
    heads = [f"{metric.title} ({metric.unit})" if metric.unit else metric.title for _, metric in shown]
    rows = [
        (name, robot.status, *(metric.number(getattr(robot, key)) for key, metric in shown))
        for name, robot in zip(run.names, run.robot_figures, strict=True)
    ]
    numbers = range(2, 2 + len(heads))
    return html.long_table("numbers", ("robot", "status at the end", *heads), rows, numbers, MOST_ROBOTS)


def _belief_section(analysis: Analysis) -> str:
    run, errors = analysis.run, analysis.beliefs
    if len(run.names) == 1:
        return ""
    if run.direct:
        return html.text(
            "Unknown: robots heard each other directly, and it was not recorded which frames reached which robot."
        )
    if errors is None:
        return html.text(
            "None: every position reached every robot in the tick in which it was sent, so every belief was exact."
        )
    origin = "Reconstructed from each robot's own positions and the frames that it received, before dilatation"
    if len(errors.robots) < len(run.names):
        origin += f"; only for the {len(errors.robots)} robots that missed most frames"
    if analysis.untested:
        origin += ". The fleet's key was not given (--key), so authentication tags were not checked"
    rows = []
    for column, robot in enumerate(errors.robots):
        off = errors.mean[:, column] * run.step
        if np.isnan(off).all():
            continue
        rows.append((run.names[robot], f"{np.nanmean(off):.2f}", f"{np.nanmax(off):.2f}"))
    table = html.table(("robot", "mean error (s)", f"largest of {SAMPLES} ticks (s)"), rows, numbers=(1, 2))
    return html.text(f"{origin}.", "note") + html.details("numbers", table)


def _faults_table(analysis: Analysis) -> str:
    rows = []
    for band in analysis.bands:
        until = f"{band.end:g}" if band.lasts else ""
        facts = analysis.run.stated.faults.get(band.id)
        numbers = "" if facts is None else _fault_counts(band.kind, facts)
        rows.append((band.id, band.kind, f"{band.begin:g}", until, band.text, numbers))
    return html.table(("id", "kind", "from (s)", "to (s)", "details", "frames"), rows, numbers=(2, 3))


def _feature_table(feature: Feature, run: Run) -> str:
    table = feature.table(run.stated, run.prepared.scenario, run.ticks * run.step)
    shown = html.table(table.heads, table.rows, table.numbers)
    return html.text(table.text) + shown if shown else ""


def _moving_table(analysis: Analysis) -> str:
    why = analysis.no_moving
    return html.text(f"Not played: {why}.", "note") if analysis.moving is None else analysis.moving.table()


def _fault_counts(kind: str, facts: FaultFacts) -> str:
    """Return the effect of a radio fault, from the counts in the summary."""
    if facts.frames is None:
        return ""
    effects = {"dropped": facts.dropped, "delayed": facts.delayed, "duplicated": facts.duplicated}
    counts = [f"{count} {effect}" for effect, count in effects.items() if count]
    return ", ".join([f"{facts.frames} {'forged' if kind == 'spoof' else 'on its links'}", *counts])


def _events_table(run: Run) -> str:
    names = dict(zip(run.numbers, run.names, strict=True))
    rows = [
        (f"{event.k * run.step:g}", event.kind, names.get(event.robot or 0, ""), event.detail) for event in run.events
    ]
    heads = ("time (s)", "event", "robot", "details")
    return html.long_table(f"{len(rows)} events", heads, rows, (0,), MOST_EVENTS) if rows else ""


def _scenario_section(run: Run) -> str:
    try:
        yaml_text = read_text(run.folder / SCENARIO)
    except BadInput:
        return ""
    shown = html.details("resolved scenario", html.preformatted(yaml_text))
    shown += html.text(f"scenario hash {run.journal.header.scenario_hash}", "note")
    return shown + html.text("" if run.journal.end is None else f"trace hash {run.journal.end.trace_hash}", "note")


def _mismatch_text(analysis: Analysis) -> str:
    k = analysis.wrong_from
    if k is None:
        return ""
    return (
        f"From {k * analysis.run.step:g} s on, the fog replayed from the journal differs from the one measured during "
        "the run. The scenario, the map or the journal was changed, or another version made them. The maps, visits and "
        "beliefs below may be wrong."
    )


def _figure_pair(of: dict[str, Drawing], *names: str) -> str:
    return html.side_by_side(*(html.figure(of.get(name), heading=True) for name in names))


def _contents_links(sections: Sequence[str]) -> list[tuple[str, str]]:
    heads = [part.split('"', 2)[1] for part in sections if part]
    return [(f"#{name}", name) for name in heads]


def _file_links(folder: Path, beside: Path) -> list[tuple[str, str]]:
    """Return links to the run's files from a page in the folder `beside`."""
    wanted = (RECORDING, "journal", "ticks.csv", "summary.json", SCENARIO, "fog.png")
    way = Path(os.path.relpath(folder.resolve(), beside.resolve()))
    return [(quote((way / name).as_posix()), name) for name in wanted if (folder / name).is_file()]
