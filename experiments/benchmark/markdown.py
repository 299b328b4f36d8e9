"""The tables of the benchmark in Markdown, as docs/results/policies.md has them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from experiments.benchmark.matrix import Matrix
from experiments.benchmark.presets import Preset, beside_published
from experiments.benchmark.results import BEST_TOUR, BenchmarkResults, describe, policy_table, shared_settings


def page(
    matrix: Matrix, results: BenchmarkResults, *, command: str, computing_s: float, preset: Preset | None = None
) -> str:
    """Return benchmark.md, with the published numbers of a preset if one is given.

    `computing_s` is the processor time of all runs together.
    """
    return "\n\n".join(_page_parts(matrix, results, command, computing_s, preset)) + "\n"


def _page_parts(
    matrix: Matrix, results: BenchmarkResults, command: str, computing_s: float, preset: Preset | None
) -> Iterator[str]:
    yield "# Benchmark"
    runs = len(results.outcome.plan.runs)
    yield f"    {command}        # {runs} runs, {computing_s / 60.0:.0f} min of computing on one core"
    yield f"""{shared_settings(matrix)}.
Mean MFoW of the second half in s, with half the width of the 95 % interval over seeds. (... % seen): some
ground was never seen, so the MFoW is the time since the start. Attacks: the share that succeeds of the
intruder that does best. Gain of watching: how many more attempts of a moving intruder, in a hundred,
succeed because it watches."""
    if results.outcome.failed:
        yield f"**{len(results.outcome.failed)} runs failed or were not valid; they are left out.**"
    for team, condition, cells in results.groups:
        yield f"## {describe(team, condition)}"
        table = policy_table(cells)
        rows = [[f"*{name}*" if name == BEST_TOUR else f"`{name}`", *values] for name, *values in table.rows]
        yield replace(table, rows=rows).markdown()
    if preset is not None:
        yield f"## Beside {preset.title}"
        yield beside_published(preset, results.cells).markdown()
        yield "\n".join(f"- {line}" for line in preset.differs)
