"""The folder of a plan and the drawing of its pictures; the scenarios of its fleets are ready to run.

plan.json            all figures
curve.png, curve.svg the age that fleets keep, over their number of robots
tour.png             the tour that all robots of the chosen fleet share
territories.png      the ground and the tour of each of them
robots-N.yaml        the scenario of a fleet of N robots; `fogwatch run FOLDER/robots-N.yaml` runs it
robots-N-one-dead.yaml, robots-N-PATROL.yaml       the chosen fleet's other runs
map/                 a copy of the map, if there is one
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fogwatch.pictures.maps import COLOURS
from fogwatch.planning.plan import FleetPlan, FleetSize, plan_facts
from fogwatch.run_folder.runfolder import RUNS, untaken
from fogwatch.terminal.live_table import robots_text
from monitor.figures.ground import Key, Layer, canvas, key_column, label, paint, painted, save
from monitor.figures.style import ALERT, INK, MUTED, drawn, figure, write_figure
from patrol.classes.class_file import class_file
from patrol.errors import BadInput
from patrol.files.whole_file import writing
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.palette import ROBOTS, UNCOUNTED, WALL
from patrol.scenario import Scenario, changed_scenario, dump_scenario
from patrol.scenario.patrols import patrol_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fogwatch.planning.plan import AgeKept


def plan_folder(out: Path | None, name: str) -> Path:
    """Return the folder for a plan, after checking that it can be written; it is not made yet.

    `out` is new or empty. Without it, the folder is `runs/plan-NAME`, with a number appended if that is taken.
    """
    folder = untaken(RUNS / f"plan-{name}") if out is None else out
    with writing(f"--out {folder}", "choose another folder"):
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise BadInput(f"--out {folder}: is not an empty folder; choose one that is, or that does not exist yet")
        existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
        with tempfile.TemporaryFile(dir=existing):
            pass
    return folder


def write_plan(plan: FleetPlan, folder: Path) -> None:
    """Write all files of a plan."""
    with writing(folder, "choose another --out"):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "plan.json").write_text(f"{json.dumps(plan_facts(plan), indent=1)}\n", encoding="utf-8")
        copied = plan.scenario.with_copies(folder)
        for size in plan.sizes:
            name = f"robots-{size.robots}"
            alone = changed_scenario(plan.scenario, {"robots.count": size.robots})
            runs = {
                name: alone if size.simulated is None else size.simulated.scenario,
                f"{name}-one-dead": None if size.one_dead is None else size.one_dead.scenario,
            }
            if (alternative := size.other_patrol) is not None:
                runs[f"{name}-{patrol_name(alternative.scenario.patrol.policy)}"] = alternative.scenario
            for file, scenario in runs.items():
                if scenario is not None:
                    _write_scenario(folder / f"{file}.yaml", scenario, copied)
    write_figure(curve_figure(plan), [folder / "curve.png", folder / "curve.svg"])
    drawn = plan.sizes[-1] if plan.chosen is None else plan.size(plan.chosen)
    if drawn.tour_s is not None:
        tour_picture(plan, drawn, folder / "tour.png")
    if drawn.territories is not None:
        territories_picture(plan, drawn, folder / "territories.png")


def _write_scenario(file: Path, scenario: Scenario, copied: Scenario) -> None:
    """Write a scenario that names the copies of its map and classes."""
    policy = {"policy": copied.patrol.policy} if class_file(scenario.patrol.policy) is not None else {}
    complete = scenario.model_copy(
        update={
            "terrain": copied.terrain,
            "patrol": scenario.patrol.model_copy(update=policy),
            "sensor": copied.sensor,
            "radio": copied.radio,
        }
    )
    file.write_text(dump_scenario(complete), encoding="utf-8")


Way = Sequence[tuple[float, float]]


def curve_figure(plan: FleetPlan) -> Figure:
    """Draw the ages that fleets keep, over their number of robots, as a matplotlib figure."""
    with drawn():
        chart = figure(9.5, 4.8)
        _draw_ages(chart, plan)
    return chart


def _draw_ages(chart: Figure, plan: FleetPlan) -> None:
    axes = chart.subplots()
    bounds = [(size.robots, size.bound_s) for size in plan.sizes if size.bound_s > 0.0]
    _draw_line(axes, bounds, "lower bound", "v:", MUTED)
    _draw_line(axes, [(size.robots, size.tour_s) for size in plan.sizes], "one tour for all", "o-", ROBOTS[0])
    _draw_line(axes, [(size.robots, size.own_tours_s) for size in plan.sizes], "a tour for each", "s--", ROBOTS[1])
    for simulated, caption, colour, shift in (
        ([(size.robots, size.simulated) for size in plan.sizes], "simulated", ROBOTS[2], 0.0),
        ([(size.robots, size.one_dead) for size in plan.sizes], "simulated, one dead", ALERT, 0.08),
        ([(size.robots, size.other_patrol) for size in plan.sizes], "simulated, other patrol", ROBOTS[4], -0.08),
    ):
        _draw_ranges(axes, [(robots, run) for robots, run in simulated if run is not None], caption, colour, shift)
    if plan.wanted_s is not None:
        axes.axhline(plan.wanted_s, color=INK, linewidth=1.0, linestyle="--", label="wanted")
    axes.set_ylim(bottom=0.0)
    axes.locator_params(axis="x", integer=True)
    axes.set_xlabel("robots")
    axes.set_ylabel("age of the stalest point (s)")
    if axes.get_legend_handles_labels()[0]:
        chart.legend(loc="outside right upper")
    axes.set_title(f"{plan.scenario.name}: the age that robots keep")


def tour_picture(plan: FleetPlan, size: FleetSize, out: Path) -> None:
    """Draw the tours that all robots of a fleet share; `size` must have tours."""
    title = f"{plan.scenario.name}: one tour for all; {robots_text(size.robots)} come by every {size.tour_s:.0f} s"
    _draw_tours(plan.terrain, title, [], [(part.way, part.length_m or 0.0) for part in size.tours.parts], out)


def territories_picture(plan: FleetPlan, size: FleetSize, out: Path) -> None:
    """Draw the ground and the tour of each robot; `size` must have territories."""
    territories = size.territories or ()
    title = (
        f"{plan.scenario.name}: a tour for each of {robots_text(size.robots)}, at most {size.own_tours_s:.0f} s long"
    )
    tours = [(territory.tour.way, territory.tour.length_m) for territory in territories]
    _draw_tours(plan.terrain, title, [territory.ground for territory in territories], tours, out)


def _draw_tours(
    terrain: Terrain, title: str, grounds: Sequence[BoolGrid], tours: Sequence[tuple[Way, float]], out: Path
) -> None:
    figure, axes = canvas(terrain, title)
    layers = [Layer(WALL, "wall or unknown", ~terrain.passable)]
    if grounds:
        unseen = terrain.passable & ~np.logical_or.reduce(list(grounds))
        layers.append(Layer(UNCOUNTED, "can never be seen, does not count", unseen))
    pale = [Layer(COLOURS[index % len(COLOURS)], "", ground) for index, ground in enumerate(grounds)]
    paint(axes, terrain, painted(terrain.shape, [*layers, *pale]), ~terrain.passable)
    keys = [Key(layer.colour, layer.label) for layer in layers if layer.mask.any()]
    for index, (way, length_m) in enumerate(tours):
        colour = ROBOTS[index % len(ROBOTS)]
        xs, ys = zip(*way, way[0], strict=True)
        axes.plot(xs, ys, color="#ffffff", linewidth=3.4, alpha=0.85, zorder=4)
        axes.plot(xs, ys, color=colour, linewidth=1.8, marker="o" if length_m == 0.0 else None, zorder=5)
        label(axes, *way[len(way) // 2], str(index + 1), size=10.0)
        keys.append(Key(colour, f"tour {index + 1}: {length_m:.0f} m", "-"))
    key_column(figure, axes, terrain, keys)
    save(figure, out)


def _draw_line(axes: Axes, values: Sequence[tuple[int, float | None]], what: str, style: str, colour: str) -> None:
    points = [(robots, age) for robots, age in values if age is not None]
    if points:
        axes.plot(*zip(*points, strict=True), style, color=colour, label=what, linewidth=1.5, markersize=5)


def _draw_ranges(axes: Axes, values: Sequence[tuple[int, AgeKept]], what: str, colour: str, shift: float) -> None:
    """Draw the mean of simulated ages as a point, and a line up to the largest."""
    if not values:
        return
    xs = [robots + shift for robots, _ in values]
    means, largest = [run.mean_s for _, run in values], [run.max_s for _, run in values]
    axes.vlines(xs, means, largest, color=colour, linewidth=2.0)
    axes.plot(xs, largest, "_", color=colour, markersize=11, markeredgewidth=2.0)
    axes.plot(xs, means, "D", color=colour, markersize=5, label=f"{what}: mean to largest")
