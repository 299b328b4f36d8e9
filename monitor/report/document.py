"""`report.html`: what happened in a run, in one file that asks nobody for anything.

Figures are inline SVG drawn by matplotlib, whose colours follow the page's light or dark theme. A charting script in
each report would be 4.8 MB for every run of a sweep and add only what a live page has; this way a report is less than a
megabyte, needs no script, and its figures are those that are also written as PNG and SVG.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from monitor.replay.belief_errors import SAMPLES
from monitor.replay.run import Run
from monitor.replay.run_files import RECORDING, REPORT, SCENARIO, check_out
from monitor.report import charts, html, map_charts
from monitor.report.analysis import Analysis, direct_of, measures, state_of, verdict_of
from monitor.report.style import Drawing, draw
from patrol.errors import BadInput

MOST_EVENTS = 300
MOST_LINKS = 400
MOST_ROBOTS = 100


def drawings(analysis: Analysis) -> list[Drawing]:
    """The report's figures; BadInput where matplotlib is missing."""
    run, bands, visits = analysis.run, analysis.bands, analysis.visits
    terrain, counted, step = run.prepared.terrain, run.prepared.patrolled, run.step
    red = " Red: faults." if bands else ""
    made = [
        draw(
            "mfow",
            "MFoW over time",
            f"How long ago the stalest point was last seen (MFoW), and the mean over all points.{red}",
            lambda: charts.mfow_chart(run, bands),
        ),
        draw(
            "states",
            "What the robots did",
            f"Tick by tick, and where a move was cancelled because two would have collided.{red}",
            lambda: charts.states_chart(run, bands),
        ),
        draw(
            "fog-mean",
            "Mean fog",
            "Each point's time since it was last seen, mean over the run.",
            lambda: map_charts.fog_chart(terrain, visits.mean * step, counted, visits.never, "mean fog (s)"),
        ),
        draw(
            "fog-worst",
            "Worst fog",
            "The longest that each point waited; purple was never seen." if visits.never.any() else "The longest wait.",
            lambda: map_charts.fog_chart(
                terrain, visits.worst.astype(np.float64) * step, counted, visits.never, "worst fog (s)"
            ),
        ),
        draw(
            "gaps",
            "Time between visits",
            "From the last look of a visit to the first of the next, over all points and the whole run.",
            lambda: charts.gaps_chart(visits.gaps, step),
        ),
        draw(
            "paths",
            "Paths",
            "Ring: where a robot began; dot: where it ended; cross: where it was lost.",
            lambda: map_charts.paths_chart(run),
        ),
    ]
    if len(run.names) > 1 and (run.links.delivered.any() or run.links.lost.any()):
        says = "Of the frames that each robot (row) sent to each other one (column), the share that arrived."
        made.append(draw("links", "Delivered share by link", says, lambda: charts.links_chart(run)))
        if run.links.lost.any():
            says = f"Of the robots' frames whose fate was settled at the time.{red}"
            made.append(draw("radio", "Delivered share over time", says, lambda: charts.radio_chart(run, bands)))
    errors = analysis.beliefs
    if errors is not None and len(errors.ticks):
        said = f"Mean over points of |believed - true| fog, at {len(errors.ticks)} moments."
        made.append(draw("belief", "Belief error", f"{said}{red}", lambda: charts.belief_chart(run, errors, bands)))
    if not np.isnan(run.decision_ms).all():
        says = "Bar: middle half; line: 1 to 99 %; stroke across: median; cross: longest."
        made.append(draw("decisions", "Decision times", says, lambda: charts.decisions_chart(run)))
    says = "Share of its decisions in which a robot was getting out of a dead end, and its cancelled moves."
    made.append(draw("troubles", "Dead ends and collisions", says, lambda: charts.troubles_chart(run)))
    return made


def report_html(analysis: Analysis, figures: Sequence[Drawing], going: bool = False, beside: Path | None = None) -> str:
    """The report as a document. going: the run may not be over. beside: the folder that it is for; else the run's."""
    run = analysis.run
    of = {figure.name: figure for figure in figures}
    word, why = state_of(run, going)
    scenario, header = run.prepared.scenario, run.journal.header
    count = len(run.names)
    sub = [
        f"{count} robot{'s' if count != 1 else ''} on {header.terrain.name}",
        f"{run.ticks * run.step:g} s in {run.ticks} ticks, {word}",
        *([f"begun {header.started}"] if header.started else []),
        header.software,
    ]
    sections = [
        html.section("verdict", "Verdict", _verdict(run)),
        html.section("fog", "Fog", html.figure(of.get("mfow")), _pair(of, "fog-mean", "fog-worst")),
        html.section("visits", "Time between visits", html.figure(of.get("gaps"))),
        html.section("robots", "Robots", html.figure(of.get("states")), _robots(run), html.figure(of.get("troubles"))),
        html.section("paths", "Paths", html.figure(of.get("paths"))),
        html.section("links", "Radio", html.figure(of.get("links")), html.figure(of.get("radio")), _links(run)),
        html.section("belief", "Belief error", _belief(analysis), html.figure(of.get("belief"))),
        html.section("decisions", "Decision times", html.figure(of.get("decisions"))),
        html.section("faults", "Faults", _faults(analysis)),
        html.section("events", "Events", _events(run)),
        html.section("scenario", "Scenario", _scenario(run)),
    ]
    body = [
        html.heading(scenario.name, html.badge(*_outcome(run))),
        html.text(" · ".join(sub), "sub"),
        html.banner(why),
        html.banner(_mismatch(analysis), bad=True),
        html.boxes((measure.text, measure.name, measure.note) for measure in measures(run)),
        html.navigation(_contents(sections)),
        *(part for part in sections if part),
        html.section("files", "Files", html.navigation(_files(run.folder, beside or run.folder))),
    ]
    return html.page(f"{scenario.name}: fogwatch report", (part for part in body if part))


def write_report(analysis: Analysis, out: Path, going: bool = False, figures: Path | None = None) -> list[Drawing]:
    """Write the report into `out`, and its figures as PNG and SVG into the folder `figures` if one is named.

    BadInput where matplotlib is missing or something cannot be written.
    """
    check_out(out, REPORT)
    made = drawings(analysis)
    write_page(report_html(analysis, made, going, out.parent), out)
    for drawing in made if figures is not None else ():
        drawing.save(figures)  # type: ignore[arg-type]
    return made


def write_page(document: str, out: Path) -> None:
    """Write a document so that a file of that name is always whole."""
    check_out(out, REPORT)
    part = out.with_name(f"{out.name}.part")
    try:
        part.write_text(document, encoding="utf-8")
        part.replace(out)
    except OSError as error:
        with suppress(OSError):
            part.unlink()
        raise BadInput(f"{out}: cannot be written ({error.strerror}); choose another file") from None


def _outcome(run: Run) -> tuple[str, str]:
    verdict = verdict_of(run)
    outcome = "not judged" if verdict is None else str(verdict.get("outcome", "unknown"))
    return outcome, outcome if outcome in ("valid", "invalid") else "unknown"


def _verdict(run: Run) -> str:
    verdict = verdict_of(run)
    if verdict is None:
        return html.text("There is no summary.json with a verdict: nobody has judged this run.", "note")
    heads = ("", "check", "what was found")
    apart: list[tuple[str, str, str]] = []
    passed: list[tuple[str, str, str]] = []
    for check in verdict["checks"]:
        facts = (str(check.get("name")), str(check.get("detail", "")))
        if not check.get("ok"):
            apart.append((html.badge("failed", "failed"), *facts))
        elif not check.get("judged", True):
            apart.append((html.badge("not judged", "open"), *facts))
        else:
            passed.append((html.badge("ok", "ok"), *facts))
    failed = sum(not check.get("ok") for check in verdict["checks"])
    counts = [f"{len(passed)} checks passed", *([f"{failed} failed"] if failed else [])]
    if len(apart) > failed:
        counts.append(f"{len(apart) - failed} could not be judged")
    shown = html.table(heads, apart) if apart else ""
    return html.text(f"{', '.join(counts)}.") + shown + html.details("checks passed", html.table(heads, passed))


def _robots(run: Run) -> str:
    heads = ("robot", "at the end", "driven m", "dead end %", "collisions", "decision p50 ms", "p99 ms")
    rows = []
    for place, name in enumerate(run.names[:MOST_ROBOTS]):
        times = run.decision_ms[:, place]
        times = times[~np.isnan(times)]
        p50, p99 = (f"{np.percentile(times, part):.1f}" if len(times) else "-" for part in (50, 99))
        stuck = 100.0 * float(run.dead_end_share[place])
        end = charts.STATUS_WORDS[int(run.standing[place])]
        rows.append(
            (name, end, f"{run.driven[place]:.0f}", f"{stuck:.1f}", str(int(run.bumped[:, place].sum())), p50, p99)
        )
    shown = html.table(heads, rows, numbers=range(2, 7))
    more = len(run.names) - MOST_ROBOTS
    return html.details("numbers", shown, html.text(f"and {more} more" if more > 0 else "", "note"))


def _links(run: Run) -> str:
    if run.direct:
        return _direct_links(run)
    sent, lost = run.links.sent, run.links.lost
    if not sent.any():
        return html.text("Nobody sent anything to anybody.", "note")
    on_its_way = sent - run.links.delivered - lost
    total, arrived, flying = (int(counts[1:].sum()) for counts in (sent, run.links.delivered, on_its_way))
    forged = f", and {int(run.links.delivered[0].sum())} forged ones" if sent[0].any() else ""
    flying_says = f", {flying} were still on their way at the end" if flying else ""
    says = f"{arrived} of {total} frames arrived (a frame counts once per receiver){forged}{flying_says}"
    late = f"; the latest {run.links.late * run.step:g} s after its tick" if run.links.late else ", each in its tick"
    causes = [(why, *(str(int(of.sum())) for of in (c[1:], c[0]))) for why, c in run.links.dropped.items()]
    parts = [html.text(f"{says}{late}. Robots refused {run.rejected}.")]
    if causes:
        parts.append(html.table(("dropped because of", "frames", "forged ones"), causes, numbers=(1, 2)))
    names = ("a forger", *run.names)
    rows = []
    for row, column in zip(*np.nonzero(sent), strict=True):
        delivered, number = int(run.links.delivered[row, column]), int(sent[row, column])
        why = ", ".join(f"{cause} {c[row, column]}" for cause, c in run.links.dropped.items() if c[row, column])
        settled = number - int(on_its_way[row, column])
        share = f"{100.0 * delivered / settled:.2f}" if settled else "-"
        counts = (number, delivered, number - settled)
        rows.append((names[row], names[column], *map(str, counts), share, why))
    heads = ("from", "to", "sent", "delivered", "on its way", "% of settled", "dropped because of")
    return "".join([*parts, _every_link(heads, rows, range(2, 6))])


def _every_link(heads: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[int]) -> str:
    listed = html.table(heads, rows[:MOST_LINKS], numbers)
    more = f"and {len(rows) - MOST_LINKS} more links" if len(rows) > MOST_LINKS else ""
    return html.details("every link", listed, html.text(more, "note"))


def _direct_links(run: Run) -> str:
    """What robots said of a radio that nobody carries: how many frames they sent and heard."""
    why = "Robots heard each other directly, so nobody knows what became of a frame"
    said = direct_of(run)
    links = said.get("links") or {}
    if not links:
        return html.text(f"{why}, and no two robots said at the end how many they sent and heard.", "note")
    sent, heard = (sum(int(counts[what]) for counts in links.values()) for what in ("sent", "heard"))
    missing = ", ".join(said.get("unsaid", ()))
    unsaid = f" Counts of {missing} are missing, or end before it did." if missing else ""
    rows = []
    for link, counts in links.items():
        share = f"{100.0 * counts['heard'] / counts['sent']:.2f}" if counts["sent"] else "-"
        rows.append((link, str(counts["sent"]), str(counts["heard"]), share))
    says = html.text(
        f"{why}; by what they say they heard {heard} of {sent} frames. They refused {run.rejected}.{unsaid}"
    )
    return says + _every_link(("link", "sent", "heard", "%"), rows, range(1, 4))


def _belief(analysis: Analysis) -> str:
    run, errors = analysis.run, analysis.beliefs
    if len(run.names) == 1:
        return ""
    if run.direct:
        return html.text("Not known: robots heard each other directly, and nobody noted which frames reached whom.")
    if errors is None:
        return html.text("None: every position reached every robot in its tick, so what each believed was the truth.")
    says = "Rebuilt from each robot's own positions and the frames that reached it, before any dilatation"
    some = "" if len(errors.robots) == len(run.names) else f"; shown: the {len(errors.robots)} that missed most"
    keyless = " The fleet's key could not be read, so tags were not tested." if analysis.untested else ""
    rows = []
    for column, place in enumerate(errors.robots):
        off = errors.mean[:, column] * run.step
        if np.isnan(off).all():
            continue
        rows.append((run.names[place], f"{np.nanmean(off):.2f}", f"{np.nanmax(off):.2f}"))
    table = html.table(("robot", "mean error s", f"most, of {SAMPLES} moments, s"), rows, numbers=(1, 2))
    return html.text(f"{says}{some}.{keyless}", "note") + html.details("numbers", table)


def _faults(analysis: Analysis) -> str:
    run = analysis.run
    counted: Any = (run.summary or {}).get("faults")
    rows = []
    for band in analysis.bands:
        until = f"{band.end:g}" if band.lasts else ""
        facts = counted.get(band.id) if isinstance(counted, dict) else None
        numbers = _fault_counts(band.kind, facts) if isinstance(facts, dict) else ""
        rows.append((band.id, band.kind, f"{band.begin:g}", until, band.text, numbers))
    return html.table(("", "kind", "from s", "to s", "", "frames"), rows, numbers=(2, 3)) if rows else ""


def _fault_counts(kind: str, facts: Mapping[str, Any]) -> str:
    """What a fault of the radio did, as the summary counts it."""
    if "frames" not in facts:
        return ""
    heads = [f"{facts['frames']} {'forged' if kind == 'spoof' else 'on its links'}"]
    did = [f"{facts[name]} {name}" for name in ("dropped", "delayed", "duplicated") if facts.get(name)]
    return ", ".join(heads + did)


def _events(run: Run) -> str:
    names = dict(zip(run.numbers, run.names, strict=True))
    rows = [
        (f"{event.k * run.step:g}", event.kind, names.get(event.robot or 0, ""), event.detail)
        for event in run.events[:MOST_EVENTS]
    ]
    if not rows:
        return ""
    listed = html.table(("s", "event", "robot", ""), rows, numbers=(0,))
    more = len(run.events) - MOST_EVENTS
    return html.details(f"{len(run.events)} events", listed, html.text(f"and {more} more" if more > 0 else "", "note"))


def _scenario(run: Run) -> str:
    try:
        says = (run.folder / SCENARIO).read_text(encoding="utf-8")
    except OSError:
        return ""
    facts = [f"scenario hash {run.journal.header.scenario_hash}"]
    if run.journal.end is not None:
        facts.append(f"trace hash {run.journal.end.trace_hash}")
    return html.details("resolved, as it was run", html.preformatted(says)) + "".join(
        html.text(f, "note") for f in facts
    )


def _mismatch(analysis: Analysis) -> str:
    k = analysis.wrong_from
    if k is None:
        return ""
    return (
        f"From {k * analysis.run.step:g} s on the fog replayed from the journal's poses is not the one that the run "
        "measured: scenario, map or journal were changed, or another version made them. Maps, visits and beliefs below "
        "may be wrong."
    )


def _pair(of: dict[str, Drawing], *names: str) -> str:
    return html.side_by_side(*(html.figure(of.get(name), heading=True) for name in names))


def _contents(sections: Sequence[str]) -> list[tuple[str, str]]:
    heads = [part.split('"', 2)[1] for part in sections if part]
    return [(f"#{name}", name) for name in heads]


def _files(folder: Path, beside: Path) -> list[tuple[str, str]]:
    """The run's files as links from a page in the folder `beside`."""
    wanted = (RECORDING, "journal", "ticks.csv", "summary.json", SCENARIO, "fog.png")
    way = Path(os.path.relpath(folder.resolve(), beside.resolve()))
    return [(quote((way / name).as_posix()), name) for name in wanted if (folder / name).is_file()]
