"""Sweeps from Python: many runs on all cores, as one tidy table with a row a run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fogwatch.notebook.arguments import checked_arguments, with_names
from fogwatch.notebook.html import lines_html, table_html
from patrol.errors import BadInput
from patrol.files.untrusted import SWEEP
from patrol.files.yaml_text import parse_yaml, read_text
from patrol.scenario import BUILTINS, Scenario, as_mapping

if TYPE_CHECKING:
    import pyarrow as pa
    from matplotlib.figure import Figure

    from experiments.sweeps.plan import Run as SweptRun
    from experiments.sweeps.results import RunResult
    from experiments.sweeps.runner import SweepOutcome

__all__ = ["SweepResult", "sweep"]

NAME = "sweep"


class SweepResult:
    """The results of a sweep.

    Attributes:
        outcome: The results by run, as `experiments.sweeps` has them.
        folder: The folder that keeps them; the same call goes on from what is there.
    """

    def __init__(self, outcome: SweepOutcome, folder: Path) -> None:
        """Take results.

        Args:
            outcome: The results.
            folder: The folder that keeps them.
        """
        self.outcome = outcome
        self.folder = folder

    @cached_property
    def table(self) -> pa.Table:
        """Table with a row a run: case, what the case sets, seed, outcome, metrics, trace hash, wall time.

        The metrics are those of docs/sweeps.md; they are null for a run that failed.
        """
        from experiments.sweeps.cases import runs_table

        return runs_table(self.outcome).arrow()

    @cached_property
    def cases(self) -> pa.Table:
        """Table with a row a case: means over seeds with 95 % intervals, as in summary.csv (docs/sweeps.md)."""
        from experiments.sweeps.cases import case_rows, cases_table

        return cases_table(case_rows(self.outcome)).arrow()

    @cached_property
    def comparisons(self) -> pa.Table:
        """Table with a row for each paired test, as in comparisons.csv; empty without `against`."""
        from experiments.sweeps.cases import case_rows, comparisons_table, paired_tests

        return comparisons_table(paired_tests(case_rows(self.outcome))).arrow()

    @cached_property
    def figures(self) -> dict[str, Figure]:
        """The figures of the sweep by name, as the command `fogwatch sweep` writes them."""
        from experiments.sweeps.cases import case_rows
        from experiments.sweeps.figures import drawings

        return {drawing.name: drawing.figure for drawing in drawings(case_rows(self.outcome), self.outcome.plan.name)}

    @property
    def failed(self) -> list[RunResult]:
        """The runs that failed, each with its error."""
        return self.outcome.failed

    def __repr__(self) -> str:
        plan = self.outcome.plan
        failed = f", {len(self.failed)} failed" if self.failed else ""
        return f"<SweepResult {plan.name}: {len(plan.cases)} cases, {len(plan.runs)} runs{failed}, in {self.folder}>"

    def _repr_html_(self) -> str:
        """Show the sweep in a notebook: the means of each case."""
        from experiments.sweeps.cases import case_rows, comparison_lines, shown_table

        errors = [f"{result.case} seed {result.seed} failed: {result.error}" for result in self.failed]
        rows = case_rows(self.outcome)
        lines = [*comparison_lines(rows), *self.outcome.plan.notes, *errors]
        return table_html(shown_table(rows, {})) + lines_html(lines)


class _Shown:
    """Hands on how many runs have a result (`experiments.sweeps.runner.SweepObserver`)."""

    def __init__(self, progress: Callable[[int, int], None]) -> None:
        self._progress = progress
        self._done = self._total = 0

    def begin(self, todo: list[SweptRun], done: list[RunResult], workers: int) -> None:
        """Hand on how many runs there are."""
        del workers
        self._done, self._total = len(done), len(done) + len(todo)
        self._progress(self._done, self._total)

    def result(self, result: RunResult) -> None:
        """Hand on that one more run is done."""
        del result
        self._done += 1
        self._progress(self._done, self._total)


@checked_arguments
def sweep(
    base: Scenario | Mapping[str, Any] | str | Path,
    *,
    grid: Mapping[str, Sequence[object]] | None = None,
    cases: Mapping[str, Mapping[str, object]] | None = None,
    seeds: int | Sequence[int] | None = None,
    against: Mapping[str, object] | None = None,
    out: str | Path | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> SweepResult:
    """Run a scenario with every combination of some settings and every seed, as `fogwatch sweep` does.

    Runs that have a result in the folder are not repeated, so an interrupted call continues when it is made again. For
    example, what two lengths of dilatation come to for one robot and for three, with five seeds each:

        fogwatch.sweep("yards", grid={"patrol.options.dilatation": [0, 5], "robots.count": [1, 3]}, seeds=5)

    Args:
        base: What is varied: a scenario file, a map's YAML file, the name of a built-in terrain, a mapping shaped like
            a scenario file, or a loaded scenario. A sweep file (docs/sweeps.md), or a mapping shaped like one, says
            everything but `seeds` itself.
        grid: Lists of values by dotted field; every combination is a case. A value may have a name for tables and
            figures: ``{"label": "half lost", "value": [{"kind": "loss", "rate": 0.5}]}``.
        cases: Settings by the name of a case, values by dotted field; with a grid, each is run on the whole grid.
        seeds: Seeds 1 to this number, or these seeds; the scenario's own unless given.
        against: Each case is compared, seed by seed, with the case that differs only in these settings, or with the
            named one: ``{"case": "mode"}``.
        out: The folder of the results; ``runs/<name of the sweep>`` unless given.
        workers: Runs at a time; one per core unless given.
        cluster: Address of a Dask scheduler whose workers make the runs instead.
        progress: Called with the number of runs that have a result, and of all.

    Returns:
        The results.

    Raises:
        BadInput: The input is wrong, or the folder or the workers cannot be used; runs that fail raise nothing.
    """
    if cluster is not None and workers is not None:
        raise BadInput("workers and cluster: a cluster has its own workers; give only one of the two")
    from experiments.sweeps.cases import write_tables
    from experiments.sweeps.plan import plan_of
    from experiments.sweeps.runner import run_sweep
    from experiments.sweeps.workers import ClusterWorkers, LocalWorkers
    from fogwatch.own_classes import find_classes

    content, file = _content_of(base)
    count = seeds if isinstance(seeds, int) else None
    varied = {"grid": grid, "cases": cases, "against": against}
    if "base" in content:
        for name, values in varied.items():
            if values is not None:
                raise BadInput(f"{name}: {file} is a sweep, which says so itself; leave it out, or give its base")
    else:
        content = {
            "name": f"{NAME}-{_name_of(content, file)}",
            "base": content if file == Path(NAME) else file.name,
            **({} if grid is None else {"grid": with_names(grid)}),
            **({} if cases is None else {"cases": [{"name": n, "set": with_names(s)} for n, s in cases.items()]}),
            **({} if against is None else {"against": with_names(against)}),
        }
    if seeds is not None and count is None:
        content = {**content, "seeds": list(seeds) if isinstance(seeds, Iterable) else seeds}
    plan = plan_of(content, file, count)
    find_classes(run.scenario for run in plan.runs)
    folder = Path("runs") / plan.name if out is None else Path(out)
    pool = LocalWorkers(workers) if cluster is None else ClusterWorkers(cluster)
    observer = None if progress is None else _Shown(progress)
    outcome = run_sweep(plan, folder, workers=pool, observer=observer)
    write_tables(outcome, folder)
    return SweepResult(outcome, folder)


def _content_of(base: Scenario | Mapping[str, Any] | str | Path) -> tuple[dict[str, Any], Path]:
    """Return the keys and values of a scenario or a sweep, and the file that they are from, or one that stands for it.

    A path in a mapping is relative to the current folder, as if the mapping were a file in it.
    """
    here = Path(NAME)
    if isinstance(base, Scenario):
        return as_mapping(base), here
    if isinstance(base, Mapping):
        return dict(base), here
    if str(base) in BUILTINS:
        return {"terrain": {"builtin": str(base)}}, here
    file = Path(base)
    if not file.is_file():
        raise BadInput(f"{base}: no such sweep, scenario or map file, and no built-in terrain ({', '.join(BUILTINS)})")
    content = parse_yaml(read_text(file, SWEEP), str(file))
    if not isinstance(content, dict):
        raise BadInput(f"{base}: expected keys and values, as in a sweep, scenario or map file")
    if "image" in content and "terrain" not in content:
        return {"terrain": {"map": str(file.absolute())}}, here
    return content, file


def _name_of(content: Mapping[str, Any], file: Path) -> str:
    """Return the name of a scenario's content."""
    if "name" in content:
        return str(content["name"])
    terrain = content.get("terrain")
    builtin = terrain.get("builtin") if isinstance(terrain, Mapping) else None
    return str(builtin) if builtin and file == Path(NAME) else file.stem
