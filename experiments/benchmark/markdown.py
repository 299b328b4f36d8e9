"""The tables of the benchmark in Markdown, as docs/results/policies.md has them."""

from __future__ import annotations

from collections.abc import Iterator

from experiments.benchmark.matrix import Matrix
from experiments.benchmark.presets import Preset, beside_published
from experiments.benchmark.results import BEST_TOUR, BenchmarkResults, describe, policy_table, shared_settings
from experiments.sweeps.texttable import markdown_table


def page(
    matrix: Matrix, results: BenchmarkResults, *, command: str, computing_s: float, preset: Preset | None = None
) -> str:
    """Return benchmark.md, with the published numbers of a preset if one is given.

    `computing_s` is the processor time of all runs together.
    """
    return "\n".join([*_lines(matrix, results, command, computing_s, preset), ""])


def _lines(
    matrix: Matrix, results: BenchmarkResults, command: str, computing_s: float, preset: Preset | None
) -> Iterator[str]:
    yield "# Benchmark"
    yield ""
    runs = len(results.outcome.plan.runs)
    yield f"    {command}        # {runs} runs, {computing_s / 60.0:.0f} min of computing on one core"
    yield ""
    yield f"{shared_settings(matrix)}."
    yield "Mean MFoW of the second half in s, with half the width of the 95 % interval over seeds. (... % seen): some"
    yield "ground was never seen, so the MFoW is the time since the start. Attacks: the share that succeeds of the"
    yield "intruder that does best. Gain of watching: how many more attempts of a moving intruder, in a hundred,"
    yield "succeed because it watches."
    if results.outcome.failed:
        yield ""
        yield f"**{len(results.outcome.failed)} runs failed or were not valid; they are left out.**"
    for team, condition, cells in results.groups:
        heads, rows = policy_table(cells)
        yield ""
        yield f"## {describe(team, condition)}"
        yield ""
        yield from markdown_table(
            heads, [[f"*{name}*" if name == BEST_TOUR else f"`{name}`", *more] for name, *more in rows]
        )
    if preset is not None:
        heads, rows = beside_published(preset, results.cells)
        yield ""
        yield f"## Beside {preset.title}"
        yield ""
        yield from markdown_table(heads, rows)
        yield ""
        yield from (f"- {line}" for line in preset.differs)
