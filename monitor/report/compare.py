"""The comparison of several runs: their measures in one table, their fog in one chart, their maps on a common scale."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from hashlib import sha256
from os.path import commonprefix
from typing import TYPE_CHECKING, Any

import numpy as np

from monitor.figures.style import WIDTH, Drawing, colour, figure, plain
from monitor.replay.run import Run
from monitor.report import html
from monitor.report.analysis import Analysis, disagreement, measures, outcome_of, state_of
from monitor.report.charts import thinned
from monitor.report.map_charts import fog_chart, never_seen_note
from patrol.errors import printable

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray


CAUTIONS = {
    "sensor.range": "robots that see farther keep ground fresher, so a part of the difference is the sensor's; the "
    "preset paper has 12 m and the default 10 m, so give all the same --sensor-range",
    "point": "MFoW is a maximum over points, so it depends on their size; give all the same --point",
}
"""Settings that make runs hard to compare, and why."""

Line = tuple["NDArray[np.float64]", "NDArray[np.float64]"]
"""The values along x and y."""

TRACE_DIGITS = 16
"""Digits of a trace hash that a table shows."""


def names_of(runs: Sequence[Run]) -> list[str]:
    """Return a unique name for each run: its folder's name, with a number if needed."""
    names: list[str] = []
    for run in runs:
        plain_name = printable(run.folder.resolve().name)
        name, number = plain_name, 1
        while name in names:
            number += 1
            name = f"{plain_name} ({number})"
        names.append(name)
    return names


def rows_of(runs: Sequence[Run]) -> list[tuple[str, ...]]:
    """Return the rows of the table of measures: the measure's name, and its value in each run."""
    rows: list[tuple[str, ...]] = [
        ("scenario", *(run.title for run in runs)),
        ("robots", *(str(len(run.names)) for run in runs)),
        ("verdict", *(printable(outcome_of(run)) for run in runs)),
        ("ended", *(printable(state_of(run)[0]) for run in runs)),
        ("simulated", *(f"{run.ticks * run.step:g} s" for run in runs)),
    ]
    columns = [measures(run) for run in runs]
    rows += [(several[0].name, *(measure.text for measure in several)) for several in zip(*columns, strict=True)]
    rows.append(("trace hash", *(run.trace[:TRACE_DIGITS] for run in runs)))
    return rows


def differences(runs: Sequence[Run]) -> list[tuple[str, ...]]:
    """Return the fields in which the scenarios differ, except the name: the dotted field, and its value in each run.

    Files count by what is in them, not by where they lie: two copies of a policy or of a map are no difference.

    For example, runs that differ in their seeds alone give [("seed", "1", "2")].
    """
    flat = [_by_content(dict(_walk_leaves(run.journal.header.scenario)), run) for run in runs]
    fields = sorted({field for leaves in flat for field in leaves} - {"name"})
    rows = []
    for field in fields:
        in_runs = [leaves.get(field, "-") for leaves in flat]
        if any(value != in_runs[0] for value in in_runs):
            texts = [_text_of(value) for value in in_runs]
            shared = len(commonprefix(texts))  # noqa: RUF071 - of characters
            rows.append((field, *(_cut_text(text, shared) for text in texts)))
    return rows


def contradictions(differ: Sequence[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Return the rows of `differences` without policy options that some runs lack and the others share."""
    return [row for row in differ if not row[0].startswith("patrol.options.") or len(set(row[1:]) - {"-"}) > 1]


def cautions(differ: Sequence[Sequence[str]]) -> list[str]:
    """Return a line for each setting whose difference makes runs hard to compare."""
    return [
        f"{field} is {', '.join(dict.fromkeys(values))}: {CAUTIONS[field]}"
        for field, *values in differ
        if field in CAUTIONS
    ]


def drawings(analyses: Sequence[Analysis]) -> list[Drawing]:
    """Draw the figures of a comparison."""
    names = names_of([analysis.run for analysis in analyses])
    figures = [
        Drawing(
            "mfow",
            "MFoW over time",
            "Age of the stalest point in each run.",
            lambda: _over_time(analyses, names, 3.4, "MFoW (s)", lambda run: run.mfow),
        ),
        Drawing(
            "fog",
            "Mean fog over time",
            "Mean age over all points in each run.",
            lambda: _over_time(analyses, names, 2.6, "mean fog (s)", lambda run: run.fog_mean),
        ),
        Drawing(
            "gaps",
            "Time between visits",
            "Share of the gaps between two visits to a point that are at least as long as the time on the axis.",
            lambda: _gaps_chart(analyses, names),
        ),
    ]
    largest_s = max(float(analysis.visits.mean.max()) * analysis.run.step for analysis in analyses)
    for number, (analysis, name) in enumerate(zip(analyses, names, strict=True), start=1):

        def mean(analysis: Analysis = analysis) -> Figure:
            run, visits = analysis.run, analysis.visits
            return fog_chart(run, visits.mean * run.step, visits.never, "mean fog (s)", largest_s, has_site=False)

        caption = "Mean age of each point." + never_seen_note(analysis.visits.never)
        figures.append(Drawing(f"fog-mean-{number}", name, caption, mean))
    return figures


def compare_html(analyses: Sequence[Analysis], figures: Sequence[Drawing]) -> str:
    """Return the comparison as an HTML document."""
    runs = [analysis.run for analysis in analyses]
    names = names_of(runs)
    of = {figure.name: figure for figure in figures}
    maps = [html.figure(figure, heading=True) for figure in figures if figure.name.startswith("fog-mean-")]
    columns = range(1, len(runs) + 1)
    differ = differences(runs)
    mismatches = [
        f"{name}: the fog replayed from the journal differs from the one measured during the run; maps may be wrong."
        for name, analysis in zip(names, analyses, strict=True)
        if analysis.wrong_from is not None
    ]
    mismatches += [f"{name}: {line}" for name, run in zip(names, runs, strict=True) if (line := disagreement(run))]
    heads = ("run", "fault", "from (s)", "to (s)", "details")
    faults = [
        (name, f"{band.id} {band.kind}".strip(), f"{band.begin:g}", f"{band.end:g}" if band.lasts else "", band.text)
        for name, analysis in zip(names, analyses, strict=True)
        for band in analysis.bands
    ]
    body = [
        html.main_heading(f"Comparison of {len(runs)} runs"),
        html.text(" · ".join(names), "sub"),
        *(html.banner(line, bad=True) for line in mismatches),
        html.section("measures", "Measures", html.table(("", *names), rows_of(runs), numbers=columns)),
        html.section(
            "scenario",
            "Differences between the scenarios",
            html.table(("field", *names), differ) if differ else html.text("None: all runs have the same scenario."),
            *(html.text(line, "note") for line in cautions(differ)),
        ),
        html.section("fog", "Fog", html.figure(of["mfow"]), html.figure(of["fog"])),
        html.section("visits", "Time between visits", html.figure(of["gaps"])),
        html.section("maps", "Mean fog, on a common scale", html.side_by_side(*maps)),
        html.section("faults", "Faults", html.table(heads, faults, (2, 3))),
    ]
    return html.page("fogwatch: comparison of runs", (part for part in body if part))


def _walk_leaves(node: object, above: str = "") -> list[tuple[str, object]]:
    """Return dotted names and values. A list is one value, because entries of two lists rarely correspond."""
    if isinstance(node, dict):
        return [
            leaf for key, value in node.items() for leaf in _walk_leaves(value, f"{above}.{key}" if above else str(key))
        ]
    return [(above, node)]


def _text_of(value: object) -> str:
    """Spell a value without quotes, so that more of a list fits: ``[{kind: silence, at: 9.0, who: r2}]``."""
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False).replace('"', "")


def _cut_text(text: str, shared: int) -> str:
    """Cut a text to 60 characters that show where it differs from the others."""
    if len(text) > 60 and shared > 40:
        text = f"...{text[min(shared - 20, len(text) - 57) :]}"
    return text if len(text) <= 60 else f"{text[:57]}..."


def _by_content(leaves: dict[str, object], run: Run) -> dict[str, object]:
    """Return the fields of a run's scenario with what a file holds in place of its path.

    For example "Greedy (sha256 5f2a9c81d3b0)" in place of "elsewhere/my_policy.py:Greedy".
    """
    for field in ("patrol.policy", "sensor.kind", "radio.model"):
        if digest := leaves.pop(f"{field}_sha256", None):
            leaves[field] = f"{str(leaves[field]).rpartition(':')[2]} (sha256 {str(digest)[:12]})"
    if leaves.get("terrain.map"):
        terrain = run.prepared.terrain
        facts = terrain.passable.tobytes() + repr((terrain.shape, terrain.point, terrain.origin)).encode()
        leaves["terrain.map"] = f"{terrain.name} (sha256 {sha256(facts).hexdigest()[:12]})"
    if leaves.get("radio.key"):
        leaves["radio.key"] = "given"
    return leaves


def _over_time(
    analyses: Sequence[Analysis], names: Sequence[str], height: float, label: str, ages: Callable[[Run], NDArray[Any]]
) -> Figure:
    """Draw ages in ticks, one line per run, over time."""

    def line(analysis: Analysis) -> Line:
        run = analysis.run
        return thinned(run.times, ages(run).astype(np.float64) * run.step)

    return _lines_chart(analyses, names, height, "time (s)", label, line)


def _gaps_chart(analyses: Sequence[Analysis], names: Sequence[str]) -> Figure:
    def line(analysis: Analysis) -> Line:
        gaps = analysis.visits.gaps.astype(np.float64)
        remaining = 100.0 * np.cumsum(gaps[::-1])[::-1] / max(gaps.sum(), 1.0)
        shown = remaining > 0.0
        return (np.arange(len(gaps)) * analysis.run.step)[shown], remaining[shown]

    labels = "time between two visits to a point (s)", "gaps at least as long (%)"
    return _lines_chart(analyses, names, 2.9, *labels, line, drawstyle="steps-post")


def _lines_chart(
    analyses: Sequence[Analysis],
    names: Sequence[str],
    height: float,
    x_label: str,
    y_label: str,
    line: Callable[[Analysis], Line],
    **look: Any,
) -> Figure:
    """Draw a line for each run that has one; `look` is that of matplotlib's lines."""
    chart = figure(WIDTH, height)
    axes = chart.add_subplot()
    for index, (analysis, name) in enumerate(zip(analyses, names, strict=True)):
        x, y = line(analysis)
        if len(x):
            axes.plot(x, y, color=colour(index), label=name, **look)
    axes.set(xlabel=x_label, ylabel=y_label)
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    plain(axes)
    chart.legend(loc="outside upper left", ncols=4)
    return chart
