"""Several runs side by side: their measures in one table, their fogs in one chart, their maps on one scale."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from monitor.replay.run import Run
from monitor.report import html
from monitor.report.analysis import Analysis, measures, state_of, verdict_of
from monitor.report.charts import WIDTH, thinned
from monitor.report.map_charts import fog_chart
from monitor.report.style import Drawing, colour, draw, figure, plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def names_of(runs: Sequence[Run]) -> list[str]:
    """What to call each run: its folder's name, with a number where two are called alike."""
    names: list[str] = []
    for run in runs:
        plain_name = run.folder.resolve().name
        name, number = plain_name, 1
        while name in names:
            number += 1
            name = f"{plain_name} ({number})"
        names.append(name)
    return names


def rows_of(runs: Sequence[Run]) -> list[tuple[str, ...]]:
    """A row for each measure: its name, and its value in each run."""
    outcomes = [str((verdict_of(run) or {}).get("outcome", "not judged")) for run in runs]
    ended = [state_of(run)[0] for run in runs]
    lengths = [f"{run.ticks * run.step:g} s" for run in runs]
    rows: list[tuple[str, ...]] = [
        ("scenario", *(run.title for run in runs)),
        ("robots", *(str(len(run.names)) for run in runs)),
        ("verdict", *outcomes),
        ("ended", *ended),
        ("simulated", *lengths),
    ]
    columns = [measures(run) for run in runs]
    rows += [(several[0].name, *(measure.text for measure in several)) for several in zip(*columns, strict=True)]
    return rows


def differences(runs: Sequence[Run]) -> list[tuple[str, ...]]:
    """Scenario fields in which the runs differ, dotted, and each run's value; names and comments apart."""
    flat = [dict(_leaves(run.journal.header.scenario)) for run in runs]
    fields = sorted({field for leaves in flat for field in leaves} - {"name"})
    rows = []
    for field in fields:
        values = [str(leaves.get(field, "-")) for leaves in flat]
        if len(set(values)) > 1:
            rows.append((field, *(value if len(value) <= 60 else f"{value[:57]}..." for value in values)))
    return rows


def drawings(analyses: Sequence[Analysis]) -> list[Drawing]:
    """The figures of a comparison; BadInput where matplotlib is missing."""
    names = names_of([analysis.run for analysis in analyses])
    made = [
        draw("mfow", "MFoW over time", "The stalest point's fog in each run.", lambda: _mfow(analyses, names)),
        draw("fog", "Mean fog over time", "The mean over all points in each run.", lambda: _fog(analyses, names)),
        draw(
            "gaps",
            "Time between visits",
            "The share of waits between two visits that last at least so long.",
            lambda: _gaps(analyses, names),
        ),
    ]
    most = max(float(analysis.visits.mean.max()) * analysis.run.step for analysis in analyses)
    for number, (analysis, name) in enumerate(zip(analyses, names, strict=True), start=1):

        def mean(analysis: Analysis = analysis) -> Figure:
            run = analysis.run
            fog, never = analysis.visits.mean * run.step, analysis.visits.never
            return fog_chart(run.prepared.terrain, fog, run.prepared.patrolled, never, "mean fog (s)", most)

        made.append(draw(f"fog-mean-{number}", name, "Each point's mean fog.", mean))
    return made


def compare_html(analyses: Sequence[Analysis], figures: Sequence[Drawing]) -> str:
    """The comparison as a document."""
    runs = [analysis.run for analysis in analyses]
    names = names_of(runs)
    of = {figure.name: figure for figure in figures}
    maps = [html.figure(figure, heading=True) for figure in figures if figure.name.startswith("fog-mean-")]
    columns = range(1, len(runs) + 1)
    differ = differences(runs)
    apart = [
        f"{name}: the fog replayed from the journal is not the one that the run measured; its maps may be wrong."
        for name, analysis in zip(names, analyses, strict=True)
        if analysis.wrong_from is not None
    ]
    heads = ("run", "fault", "from s", "to s", "")
    faulty = [(name, analysis.bands) for name, analysis in zip(names, analyses, strict=True) if analysis.bands]
    faults = [
        (name, f"{band.id} {band.kind}".strip(), f"{band.begin:g}", f"{band.end:g}" if band.lasts else "", band.text)
        for name, bands in faulty
        for band in bands
    ]
    body = [
        html.heading(f"{len(runs)} runs side by side"),
        html.text(" · ".join(names), "sub"),
        *(html.banner(line, bad=True) for line in apart),
        html.section("measures", "Measures", html.table(("", *names), rows_of(runs), numbers=columns)),
        html.section(
            "scenario",
            "Where the scenarios differ",
            html.table(("field", *names), differ) if differ else html.text("Nowhere: they are runs of one scenario."),
        ),
        html.section("fog", "Fog", html.figure(of["mfow"]), html.figure(of["fog"])),
        html.section("visits", "Time between visits", html.figure(of["gaps"])),
        html.section("maps", "Mean fog, on one scale", html.side_by_side(*maps)),
        html.section("faults", "Faults", html.table(heads, faults, (2, 3)) if faults else ""),
    ]
    return html.page("fogwatch: runs side by side", (part for part in body if part))


def _leaves(node: object, above: str = "") -> list[tuple[str, object]]:
    """Dotted names and values; a list is one value, for entries of two lists rarely mean the same."""
    if isinstance(node, dict):
        return [leaf for key, value in node.items() for leaf in _leaves(value, f"{above}.{key}" if above else str(key))]
    return [(above, node)]


def _mfow(analyses: Sequence[Analysis], names: Sequence[str]) -> Figure:
    made = figure(WIDTH, 3.4)
    axes = made.add_subplot()
    for place, (analysis, name) in enumerate(zip(analyses, names, strict=True)):
        run = analysis.run
        times, values = thinned(run.times, run.mfow.astype(np.float64) * run.step)
        axes.plot(times, values, color=colour(place), label=name)
    axes.set_ylabel("MFoW (s)")
    return _over_time(made)


def _fog(analyses: Sequence[Analysis], names: Sequence[str]) -> Figure:
    made = figure(WIDTH, 2.6)
    axes = made.add_subplot()
    for place, (analysis, name) in enumerate(zip(analyses, names, strict=True)):
        run = analysis.run
        axes.plot(*thinned(run.times, run.fog_mean * run.step), color=colour(place), label=name)
    axes.set_ylabel("mean fog (s)")
    return _over_time(made)


def _over_time(made: Figure) -> Figure:
    (axes,) = made.axes
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("time (s)")
    plain(axes)
    made.legend(loc="outside upper left", ncols=4)
    return made


def _gaps(analyses: Sequence[Analysis], names: Sequence[str]) -> Figure:
    made = figure(WIDTH, 2.9)
    axes = made.add_subplot()
    for place, (analysis, name) in enumerate(zip(analyses, names, strict=True)):
        gaps = analysis.visits.gaps.astype(np.float64)
        if gaps.sum() == 0.0:
            continue
        left = 100.0 * np.cumsum(gaps[::-1])[::-1] / gaps.sum()
        shown = left > 0.0
        waits = np.arange(len(gaps)) * analysis.run.step
        axes.plot(waits[shown], left[shown], color=colour(place), label=name, drawstyle="steps-post")
    axes.set_xlim(left=0.0)
    axes.set_ylim(0.0, 101.0)
    axes.set_xlabel("time between two visits of a point (s)")
    axes.set_ylabel("waits at least so long (%)")
    plain(axes)
    made.legend(loc="outside upper left", ncols=4)
    return made
