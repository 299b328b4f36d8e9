"""``fogwatch reproduce table`` and ``calibrate``: the paper's tables. Raises BadInput; the caller prints it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table as Grid
from rich.text import Text

from experiments.commands.reproduce import app
from experiments.commands.sweep import EXIT_CODES, FAILED, Machines, finish, out_option
from experiments.paper.calibrate import best_radius, calibration_plan, crossing, fit_as_json, fit_radii, fits_as_json
from experiments.paper.calibrate import radius_setups as setups_of
from experiments.paper.figures import table_picture, terrain_picture
from experiments.paper.orderings import HELD, NOT_HELD, Judged, judge_orderings
from experiments.paper.orderings import as_json as ordering_as_json
from experiments.paper.printed import paper
from experiments.paper.tables import (
    Cell,
    PaperSetup,
    TableComparison,
    as_json,
    as_table,
    compare,
    fit_texts,
    fits_of,
    plan_of,
    to_mean_fog_text,
)
from experiments.paper.tables_page import page
from experiments.sweeps.cases import json_text, write_text
from experiments.sweeps.plan import count_of_seeds
from experiments.sweeps.progress import command_line, print_failures
from experiments.sweeps.stats import with_interval
from fogwatch.cli.command_help import command
from fogwatch.cli.options import option
from fogwatch.run_options import settings_option
from patrol.errors import BadInput
from patrol.maps.builtins import builtin_terrain
from patrol.scenario import parse_overrides
from patrol.scenario.policies import LETTER_FIELD as LETTER
from patrol.scenario.policies import TO_THE_LETTER

TERRAIN_POINT = 0.1
"""Side of one grid point of the drawn terrains, m."""

Point = Annotated[float, option("M", "Side of one grid point in m.")]
Seeds = Annotated[int, option("K", "Run each cell with seeds 1 to K.")]


@dataclass(frozen=True)
class Cells:
    """Settings and folder of the cells of tables."""

    duration: Annotated[float | None, option("S", "Simulated time in s (default: the paper's 5000).")] = None
    settings: Annotated[
        list[str] | None, settings_option("Set a field of every cell, such as sensor.line_of_sight=false.")
    ] = None
    letter: Annotated[
        bool,
        option(
            "",
            "Follow the paper to the letter: letter=true, ties=drawn, random_move_for=all in every cell.",
            "--letter",
        ),
    ] = False
    out: Annotated[Path | None, out_option("runs/paper-POINTm; runs/paper-letter-POINTm")] = None

    def setup(self, point: float, sensor_range: float | None, seeds: int) -> PaperSetup:
        """Return the setup of all cells; the sensor's range is the calibrated one unless given."""
        overrides = (dict(TO_THE_LETTER) if self.letter else {}) | parse_overrides(self.settings or [])
        if self.duration is not None:
            overrides["duration"] = self.duration
        radius = paper().sensor_range(point).range if sensor_range is None else sensor_range
        return PaperSetup(point, radius, count_of_seeds(seeds), overrides)

    def folder(self, setup: PaperSetup) -> Path:
        """Return the folder of the results."""
        name = "paper-letter" if setup.settings.get(LETTER) is True else "paper"
        return self.out or Path("runs") / f"{name}-{setup.point:g}m"


@command(app, examples=["fogwatch reproduce table 2 3 --seeds 1", "fogwatch reproduce table"], exit_codes=EXIT_CODES)
def table(
    numbers: Annotated[
        list[int] | None, typer.Argument(metavar="N...", help="Numbers of tables, 2 to 8 (default: all).")
    ] = None,
    seeds: Seeds = 3,
    point: Point = 0.5,
    sensor_range: Annotated[
        float | None, option("R", "Sensor range in m (default: calibrated for the size of the points).")
    ] = None,
    rows: Annotated[str | None, option("NAME,...", "Run only these rows.")] = None,
    columns: Annotated[str | None, option("NAME,...", "Run only these columns.")] = None,
    *,
    cells: Cells,
    machines: Machines,
) -> int:
    """Run tables of the paper, print our values beside the printed ones, and test the paper's conclusions on them.

    The folder gets the tables as JSON, CSV and pictures, and paper.md with all of it. Runs that have a result there are
    not repeated.
    """
    chosen = dict.fromkeys(numbers or paper().tables)
    tables = [paper().table(number).part(_split_names(rows), _split_names(columns)) for number in chosen]
    setup = cells.setup(point, sensor_range, seeds)
    console = Console()
    folder = cells.folder(setup)
    plan = plan_of(tables, {"": setup})
    points = f"points of {setup.point:g} m (the paper's: 0.1 m)"
    _print_text(console, f"{points}, sensor range {setup.sensor_range:g} m{_calibration_note(setup)}")
    outcome = machines.make_runs(plan, folder, console)
    comparisons = [compare(table, setup, outcome) for table in tables]
    for comparison in comparisons:
        _print_comparison(console, comparison)
        name = f"table_{comparison.table.number}"
        write_text(folder / f"{name}.json", json_text(as_json(comparison)))
        write_text(folder / f"{name}.csv", as_table(comparison).csv())
        table_picture(comparison, [folder / f"{name}.png", folder / f"{name}.svg"])
    judged = judge_orderings(paper().orderings, comparisons)
    _write_fit(console, comparisons, folder)
    _write_orderings(console, judged, folder)
    pictures = _terrain_pictures(comparisons, folder) | {f"table {number}": f"table_{number}.png" for number in chosen}
    made_by = command_line("reproduce", "table", *map(str, numbers or ()))
    spent_s = outcome.computing_s
    text = page(comparisons, judged, setup, command=made_by, computing_s=spent_s, pictures=pictures)
    write_text(folder / "paper.md", text)
    files = ", ".join(f"table_{number}" for number in chosen)
    return finish(console, outcome, f"{folder}: {files} as json, csv, png, svg, and paper.md with all results")


@command(app, examples=["fogwatch reproduce calibrate --point 1 --ranges 10,12,14"], exit_codes=EXIT_CODES)
def calibrate(
    point: Point = 0.5,
    ranges: Annotated[str, option("R,...", "Sensor ranges to try in m.")] = "10,11,12,13,14",
    seeds: Seeds = 1,
    *,
    cells: Cells,
    machines: Machines,
) -> int:
    """Find the sensor range that fits the paper's Tables 2 and 3 best, for one size of points.

    The paper does not give the sensor range.
    """
    base = cells.setup(point, None, seeds)
    setups = setups_of(point, _read_numbers(ranges), base.seeds, base.settings)
    console = Console()
    folder = cells.folder(base)
    outcome = machines.make_runs(calibration_plan(setups), folder, console)
    fits = fit_radii(setups, outcome)
    write_text(folder / "calibration.json", json_text(fits_as_json(point, base.seeds, fits)))
    grid = Grid(title=f"Tables 2 and 3 on points of {point:g} m", box=None, pad_edge=False, header_style="cyan")
    below = f"< {paper().fit_below:g} s"
    for title in ("range (m)", f"cells {below}", "median ratio", "RMS log error", "correlation", "all: RMS", "corr."):
        grid.add_column(title, justify="right")
    best = best_radius(fits)
    for fit in fits:
        numbers = [f"{fit.radius:g}", str(fit.near.cells), *fit_texts(fit.near), *fit_texts(fit.whole)[1:]]
        grid.add_row(*numbers, style="bold green" if fit is best else None)
    console.print(grid, highlight=False)
    if best is not None:
        between = crossing(fits)
        hint = "" if between is None else f"; the median ratio passes 1 at {between:.2f} m"
        use = f"fogwatch reproduce table --sensor-range {best.radius:g}"
        _print_text(console, f"best: {best.radius:g} m{hint}. Use it with: {use}")
    print_failures(console, outcome)
    return FAILED if outcome.failed else 0


def _terrain_pictures(comparisons: Sequence[TableComparison], folder: Path) -> dict[str, str]:
    """Draw the tables' terrains; files by title."""
    names = dict.fromkeys(str(comparison.table.settings["terrain.builtin"]) for comparison in comparisons)
    for name in names:
        terrain_picture(builtin_terrain(name, TERRAIN_POINT), folder / f"terrain_{name}.png")
    return {f"terrain {name}": f"terrain_{name}.png" for name in names}


def _calibration_note(setup: PaperSetup) -> str:
    calibrated = paper().sensor_range(setup.point)
    if setup.sensor_range != calibrated.range:
        return f" (calibrated for points of {calibrated.point:g} m: {calibrated.range:g} m)"
    if calibrated.point != setup.point:
        return f", calibrated for points of {calibrated.point:g} m; there is no calibration for {setup.point:g} m"
    return f" ({calibrated.found})"


def _split_names(text: str | None) -> list[str]:
    return [name.strip() for name in text.split(",")] if text else []


def _read_numbers(text: str) -> list[float]:
    try:
        return [float(number) for number in text.split(",")]
    except ValueError:
        raise BadInput(f"--ranges = {text}: expected numbers such as 10,11,12") from None


def _print_comparison(console: Console, comparison: TableComparison) -> None:
    """Print a table: as a grid on a terminal, elsewhere cell by cell."""
    table, setup = comparison.table, comparison.setup
    _print_text(console, "")
    how = f"{len(setup.seeds)} seeds, ±: 95 % interval" + (
        ", in brackets: the printed value" if console.is_terminal else ""
    )
    _print_text(console, f"Table {table.number}: {table.title}; {how}")
    for assumed in table.assumed:
        _print_text(console, f"  assumed: {assumed}")
    for field, value in setup.settings.items():
        _print_text(console, f"  set: {field} = {value}")
    if not console.is_terminal:
        for cell in comparison.cells:
            _print_text(console, f"  {cell.row}, {table.columns_are} {cell.column}: {_plain_text(cell)}")
        return
    grid = Grid(table.columns_are, *(column.name for column in table.columns), header_style="cyan", show_lines=True)
    for column in grid.columns[1:]:
        column.justify = "right"
    for row, unit in dict.fromkeys((cell.row, cell.unit) for cell in comparison.cells):
        grid.add_row(f"{row} ({unit})", *(_cell_text(cell) for cell in comparison.cells if cell.row == row))
    console.print(grid, highlight=False)


def _cell_text(cell: Cell) -> Text:
    """Our value, and below it the printed one and the ratio, which is marked where it is far from 1."""
    text = Text(with_interval(cell.found), style="bold")
    if cell.paper is not None:
        text.append(f"\n({cell.paper:g})", style="not bold dim")
    if cell.ratio is not None:
        text.append(f"\n×{cell.ratio:.2f}{' !' if cell.far_off else ''}", style="bold red" if cell.far_off else "green")
    return text


def _plain_text(cell: Cell) -> str:
    printed = "" if cell.paper is None else f", paper {cell.paper:g} {cell.unit}"
    ratio = "" if cell.ratio is None else f", x {cell.ratio:.2f}{' !' if cell.far_off else ''}"
    return f"{with_interval(cell.found)} {cell.unit}{printed}{ratio}"


def _write_fit(console: Console, comparisons: Sequence[TableComparison], folder: Path) -> None:
    """Print how well each table fits the printed one; print and write the fit of Tables 2 and 3 together."""
    _print_text(console, "")
    ratios = {f"Table {comparison.table.number}": to_mean_fog_text(comparison) for comparison in comparisons}
    for name, fit in fits_of(comparisons):
        median, error, correlation = fit_texts(fit)
        logs = f"RMS log error {error}, correlation of logs {correlation}"
        _print_text(console, f"{name}: {fit.cells} cells, median ratio {median}, {logs}")
        if ratios.get(name) is not None:
            _print_text(console, f"  {ratios[name]}")
    together = fit_as_json(comparisons)
    if together is not None:
        write_text(folder / "fit.json", json_text(together))


def _write_orderings(console: Console, judged: Sequence[Judged], folder: Path) -> None:
    """Print and write the paper's conclusions and whether each holds on our values."""
    if not judged:
        return
    write_text(folder / "orderings.json", json_text([ordering_as_json(ordering) for ordering in judged]))
    _print_text(
        console, "\nthe paper's conclusions; whether they hold here, and the ratio of the first side to the second:"
    )
    styles = {HELD: "green", NOT_HELD: "red"}
    for ordering in judged:
        ratio = ordering.ratio
        text = "-" if ratio is None else f"{ratio.mean:.3f}"
        if ratio is not None and ratio.low is not None and ratio.high is not None:
            text += f" [{ratio.low:.3f}, {ratio.high:.3f}]"
        console.print(
            Text(f"  {ordering.ordering.says}: ")
            .append(ordering.verdict, styles.get(ordering.verdict, "yellow"))
            .append(f", {text}"),
            soft_wrap=True,
        )


def _print_text(console: Console, text: str) -> None:
    console.print(text, highlight=False, markup=False, soft_wrap=True)
