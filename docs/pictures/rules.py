"""Makes the pictures of the paper's rules that docs/student.md shows, `make pictures`.

Most are of one decision: three robots patrol `yards` by the paper's policy, and at one tick the first robot's view is
drawn, with the code that robots use themselves. The others are of whole runs: what the score is, and rules that show in
how robots move.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

import fogwatch
from agent.policies.forces import bisectors, distance_force, fow_force
from agent.policies.potential_field import PotentialField
from agent.ports import Intent
from agent.psi import psi_field
from agent.view import View
from fogwatch.cli.ending import guarded
from fogwatch.inprocess import run_in_process
from fogwatch.notebook.run import Run
from fogwatch.run_options import preset_settings
from patrol.ground.terrain import Terrain
from patrol.palette import LIGHT, ROBOTS, WALL
from patrol.prepare import Prepared, prepare
from patrol.scenario import load_scenario, open_scenario

FOLDER = Path(__file__).with_name("rules")
SCENARIO: dict[str, Any] = {
    "name": "rules",
    "terrain": {"builtin": "yards"},
    "point": 0.5,
    "duration": 100,
    "seed": 2,
    "robots": {"count": 3, "model": "holonomic"},
    "patrol": {"policy": "potential-field", "options": {"dilatation": 5}},
}
TICK = 170
"""The tick whose decisions are drawn."""

PAPER_POINTS_M = 0.1
"""The paper's unit of length, m."""

Grid = NDArray[np.float64]


class DrawnRun:
    """A run of the paper's policy that draws the first view and intent that are asked for, while they hold."""

    def __init__(
        self, prepared: Prepared, draw: Callable[[View, Intent], None], is_wanted: Callable[[View], bool]
    ) -> None:
        self._decide, self._draw, self._drawn = PotentialField.decide, draw, False
        self._prepared, self._is_wanted = prepared, is_wanted

    def run(self) -> None:
        """Do the run, with a look at each decision."""
        drawn_run = self

        def decide(policy: PotentialField, view: View) -> Intent:
            intent = drawn_run._decide(policy, view)
            if not drawn_run._drawn and drawn_run._is_wanted(view):
                drawn_run._drawn = True
                drawn_run._draw(view, intent)
            return intent

        PotentialField.decide = decide  # type: ignore[method-assign]
        try:
            run_in_process(self._prepared)
        finally:
            PotentialField.decide = self._decide  # type: ignore[method-assign]
        assert self._drawn


def main() -> None:
    """Write the pictures."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    prepared = prepare(load_scenario(SCENARIO))
    draw_functions()
    draw_psi(prepared.terrain)

    def draw(view: View, intent: Intent) -> None:
        draw_fog(view)
        draw_lengths(view)
        draw_dilatation(view, prepared)
        draw_force(view, prepared)
        draw_sectors(intent)

    DrawnRun(prepared, draw, lambda view: view.tick == TICK).run()
    draw_apart()
    with tempfile.TemporaryDirectory() as folder:
        draw_mfow(Path(folder))
        draw_unstuck(Path(folder))
        draw_surround(Path(folder))


def canvas(panels: int = 1) -> tuple[Figure, list[Axes]]:
    """Return a figure with equal panels side by side."""
    figure = Figure(figsize=(5.2 * panels, 4.6), dpi=100, facecolor="white", layout="constrained")
    axes = figure.subplots(1, panels, squeeze=False)[0]
    return figure, list(axes)


def paint(axes: Axes, terrain: Terrain, grid: Grid, cmap: str, label: str, top: float | None = None) -> None:
    """Draw a grid over the terrain with its colour bar; walls stay dark."""
    xmin, ymin, xmax, ymax = terrain.bounds
    shown = np.ma.masked_where(~terrain.passable | ~np.isfinite(grid), grid)
    axes.set_facecolor(WALL)
    image = axes.imshow(shown, origin="lower", extent=(xmin, xmax, ymin, ymax), cmap=cmap, vmin=0, vmax=top)
    axes.figure.colorbar(image, ax=axes, label=label, shrink=0.85)
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")


def mark_robots(axes: Axes, view: View) -> None:
    """Draw the robot, and the others where it last heard them."""
    mark_places(axes, [(view.pose.x, view.pose.y), *((peer.pose.x, peer.pose.y) for peer in view.peers.values())])


def mark_places(axes: Axes, places: Iterable[tuple[float, float]]) -> None:
    """Draw robots where they stand."""
    for place, colour in zip(places, ROBOTS, strict=False):
        axes.plot(*place, "o", markersize=9, color=colour, markeredgecolor="white", markeredgewidth=1.5)


def mark_stalest(axes: Axes, x: float, y: float) -> None:
    """Draw the diamond of the stalest point."""
    axes.plot(x, y, "D", markersize=8, color="white", markeredgecolor="black", clip_on=False)


def ages(view: View, last_seen: NDArray[np.int32]) -> Grid:
    """Return ages in s, NaN where nothing is patrolled."""
    age_s = (view.tick - np.maximum(last_seen, 0)) * view.time_s / view.tick
    return np.where(view.fog.patrolled, age_s, np.nan)


def save(figure: Figure, name: str) -> None:
    """Write a picture."""
    figure.savefig(FOLDER / f"{name}.png", pil_kwargs={"optimize": True})


def draw_fog(view: View) -> None:
    """The fog that a robot believes in, and its stalest point."""
    figure, (axes,) = canvas()
    age = ages(view, view.fog.last_seen)
    paint(axes, view.ground.terrain, age, "cividis_r", "age (s)")
    row, col = np.unravel_index(np.nanargmax(age), age.shape)
    x, y = view.place_of((int(row), int(col)))
    mark_stalest(axes, x, y)
    axes.annotate(f"{np.nanmax(age):.0f} s", (x, y), (8, 6), textcoords="offset points", weight="bold", color="white")
    mark_robots(axes, view)
    save(figure, "fog")


def draw_lengths(view: View) -> None:
    """The lengths of ways from the robot."""
    figure, (axes,) = canvas()
    lengths = view.lengths()
    paint(axes, view.ground.terrain, lengths, "viridis_r", "length of the way (m)")
    xmin, ymin, xmax, ymax = view.ground.terrain.bounds
    shown = np.where(np.isfinite(lengths), lengths, np.nan)
    axes.contour(shown, levels=range(10, 200, 10), extent=(xmin, xmax, ymin, ymax), colors="white", linewidths=0.7)
    mark_robots(axes, view)
    save(figure, "lengths")


def draw_dilatation(view: View, prepared: Prepared) -> None:
    """Ages before and after dilatation, where a body fits."""
    figure, panels = canvas(2)
    top = float(np.nanmax(ages(view, view.fog.last_seen)))
    for axes, grid, title in zip(
        panels, (view.fog.last_seen, view.fog.dilated), ("age", "dilated by 5 m"), strict=True
    ):
        age = np.where(prepared.fields[1].reach, ages(view, grid), np.nan)
        paint(axes, view.ground.terrain, age, "cividis_r", "age (s)", top)
        axes.set_title(title)
        mark_robots(axes, view)
    save(figure, "dilatation")


def draw_force(view: View, prepared: Prepared) -> None:
    """Draw the pull of each point."""
    figure, (axes,) = canvas()
    options = prepared.scenario.patrol.options
    age = ages(view, view.fog.dilated) / np.nanmax(ages(view, view.fog.last_seen))
    by_age = fow_force(options.fow, np.nan_to_num(age), options.alpha)
    lengths = view.lengths() / PAPER_POINTS_M
    by_length = np.zeros_like(lengths)
    near = np.isfinite(lengths)
    by_length[near] = distance_force(options.distance, lengths[near], options.beta, options.length)
    force = np.where(view.fog.patrolled, by_age * by_length, np.nan)
    paint(axes, view.ground.terrain, force / np.nanmax(force), "magma_r", "force, strongest = 1")
    mark_robots(axes, view)
    reach = 22.0
    axes.set_xlim(view.pose.x - reach, view.pose.x + reach)
    axes.set_ylim(view.pose.y - reach, view.pose.y + reach)
    save(figure, "force")


def draw_sectors(intent: Intent) -> None:
    """The sums of forces by direction, and the direction that wins."""
    sums = np.array([value for name, value in intent.figures.items() if name.startswith("sector")])
    figure = Figure(figsize=(4.2, 4.2), dpi=100, facecolor="white", layout="constrained")
    axes = figure.add_subplot(projection="polar")
    colours = [ROBOTS[3] if k == int(np.argmax(sums)) else ROBOTS[5] for k in range(len(sums))]
    axes.bar(bisectors(len(sums)), sums / sums.max(), width=math.tau / len(sums) * 0.95, color=colours)
    axes.set_yticklabels([])
    save(figure, "sectors")


def draw_functions() -> None:
    """The functions f and g of the paper's Table 1."""
    figure, (left, right) = canvas(2)
    share = np.linspace(0.0, 1.0, 200)
    length = np.linspace(1.0, 300.0, 300)
    for k, colour in zip(range(1, 6), ROBOTS, strict=False):
        force = fow_force(f"f{k}", share, 40.0)
        left.plot(share, force / force[-1], color=colour, label=f"f{k}")
        force = distance_force(f"g{k}", length, 4000.0, 800.0)
        right.plot(length * PAPER_POINTS_M, force / force[0], color=colour, label=f"g{k}")
    left.set_xlabel("age, stalest point = 1")
    right.set_xlabel("length of the way (m)")
    for axes in (left, right):
        axes.set_ylabel("force, largest = 1")
        axes.legend()
        axes.grid(alpha=0.3)
    save(figure, "functions")


def draw_psi(terrain: Terrain) -> None:
    """Draw the nearness of obstacles."""
    figure, (axes,) = canvas()
    psi = psi_field(terrain, 10.0).astype(np.float64)
    paint(axes, terrain, psi, "cividis_r", "psi", float(np.quantile(psi[np.isfinite(psi)], 0.98)))
    save(figure, "psi")


def draw_apart() -> None:
    """Draw what is closed to a robot near another one, by the paper's two methods, and the ways that are left."""
    figure, panels = canvas(2)
    for axes, method in zip(panels, ("artificial-obstacles", "semaphores"), strict=True):

        def draw(view: View, _: Intent, axes: Axes = axes, method: str = method) -> None:
            terrain, shut = view.ground.terrain, closed(view)
            xmin, ymin, xmax, ymax = terrain.bounds
            extent = (xmin, xmax, ymin, ymax)
            paint(axes, terrain, view.lengths(), "viridis_r", "length of the way (m)", 60.0)
            axes.contourf(shut, levels=[0.5, 1.5], extent=extent, colors=["white"], hatches=["//"])
            mark_robots(axes, view)
            axes.set_title(method)
            side = 36.0
            left = min(max(view.pose.x - side / 2.0, xmin), xmax - side)
            bottom = min(max(view.pose.y - side / 2.0, ymin), ymax - side)
            axes.set_xlim(left, left + side)
            axes.set_ylim(bottom, bottom + side)

        settings = {"robots.count": 6, "robots.model": "holonomic", "patrol.options.separation": method, "seed": 1}
        prepared = prepare(open_scenario("clutter", {**preset_settings("paper"), **settings, "duration": 200}))
        DrawnRun(prepared, draw, has_closed_ground_nearby).run()
    save(figure, "apart")


def closed(view: View) -> NDArray[np.bool_]:
    """Return the points where the robot's centre may be as a rule, and may not now."""
    return view.ground.static.open_now & ~view.ground.open_now


def has_closed_ground_nearby(view: View) -> bool:
    """Return whether a good part of the ground around the robot is closed."""
    row, col = view.point_of((view.pose.x, view.pose.y))
    return np.count_nonzero(closed(view)[max(row - 24, 0) : row + 25, max(col - 24, 0) : col + 25]) > 150


def patrol(out: Path, terrain: str, preset: str, settings: Mapping[str, object]) -> Run:
    """Return a run by the paper's rules."""
    return fogwatch.run(terrain, out=out, preset=preset, overrides=settings, picture=False)


def draw_walls(axes: Axes, run: Run) -> None:
    """Draw the ground of a run, white."""
    axes.imshow(np.isnan(run.fog()), extent=run.extent, origin="lower", cmap=ListedColormap(["white", WALL]))
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")


def draw_mfow(folder: Path) -> None:
    """Draw the true fog at one moment with its stalest point, and beside it MFoW over time with its mean."""
    run = patrol(
        folder / "mfow", "yards", "paper", {"robots.count": 3, "robots.model": "holonomic", "duration": 600, "seed": 2}
    )
    ticks = run.ticks.to_pydict()
    times, mfow = np.array(ticks["time_s"]), np.array(ticks["mfow_s"])
    at = int(np.argmax(mfow))
    ages = run.fog(times[at])
    figure, (left, right) = canvas(2)
    west, east, south, north = run.extent
    left.set_facecolor(WALL)
    image = left.imshow(ages, origin="lower", extent=run.extent, cmap="cividis_r", vmin=0)
    figure.colorbar(image, ax=left, label="age (s)", shrink=0.85)
    row, col = np.unravel_index(np.nanargmax(ages), ages.shape)
    rows, cols = ages.shape
    x, y = west + (col + 0.5) * (east - west) / cols, south + (row + 0.5) * (north - south) / rows
    mark_stalest(left, x, y)
    now = run.robots.slice(at * len(run.scenario.roster), len(run.scenario.roster)).to_pydict()
    mark_places(left, zip(now["x_m"], now["y_m"], strict=True))
    left.set_title(f"the fog at {times[at]:.0f} s: MFoW {mfow[at]:.0f} s")
    right.plot(times, mfow, color=LIGHT["accent"], label="MFoW: age of the stalest point")
    right.plot(times, ticks["fog_mean_s"], color=LIGHT["mean"], label="mean age of all points")
    right.axhline(mfow.mean(), color=LIGHT["accent"], linestyle="--", label=f"mean MFoW: {mfow.mean():.0f} s")
    mark_stalest(right, times[at], mfow[at])
    right.set_xlabel("time (s)")
    right.set_ylabel("age (s)")
    right.set_ylim(0, 1.35 * mfow[at])
    right.legend(loc="upper left")
    right.grid(alpha=0.3)
    save(figure, "mfow")


def draw_unstuck(folder: Path) -> None:
    """Draw a car's first dead end, and the one that the printed rule does not get it out of."""
    settings = {
        "robots.count": 1,
        "robots.model": "car",
        "duration": 200,
        "seed": 1,
        "patrol.options.ties": "diagonal",
        "patrol.options.random_move": 0,
    }
    run = patrol(folder / "unstuck", "clutter", "letter", settings)
    table = run.robots.to_pydict()
    x, y, speed = (np.array(table[name]) for name in ("x_m", "y_m", "speed_m_s"))
    states = [(state, len(list(group))) for state, group in groupby(table["state"])]
    first = states[0][1]
    figure, panels = canvas(2)
    for axes, (begin, end) in zip(panels, ((first - 12, first + 24), (len(x) - 60, len(x))), strict=True):
        draw_walls(axes, run)
        part = slice(begin, end)
        back = part.start + np.flatnonzero(speed[part] < 0)
        axes.plot(x[part], y[part], ".-", color=ROBOTS[5], linewidth=5, alpha=0.6, label="forwards")
        for k in back:
            axes.plot(x[k : k + 2], y[k : k + 2], ".-", color=ROBOTS[3], label="backwards" if k == back[0] else None)
        middle = x[back].mean(), y[back].mean()
        axes.set_xlim(middle[0] - 12.0, middle[0] + 12.0)
        axes.set_ylim(middle[1] - 12.0, middle[1] + 12.0)
        axes.set_title(f"{table['time_s'][begin]:.0f} to {table['time_s'][end - 1]:.0f} s")
        axes.legend(loc="upper left")
    save(figure, "unstuck")


def draw_surround(folder: Path) -> None:
    """Draw the ways of five robots from the first report of an intruder until they stand around it."""
    intruder, ring = (50.0, 20.0), 8.0
    settings = {
        "robots.count": 5,
        "robots.model": "holonomic",
        "duration": 160,
        "seed": 2,
        "patrol.options.letter": ["surround-forces"],
        "patrol.surround_distance": ring,
        "intruders": [{"place": list(intruder), "at": 40}],
    }
    run = patrol(folder / "surround", "yards", "paper", settings)
    table = run.robots.to_pandas()
    begin = table[table.state == "surrounding"].time_s.min()
    table = table[(table.time_s >= begin) & (table.time_s <= begin + 30.0)]
    figure, (axes,) = canvas()
    draw_walls(axes, run)
    for (_, way), colour in zip(table.groupby("robot"), ROBOTS, strict=False):
        axes.plot(way.x_m, way.y_m, color=colour, linewidth=1.2)
    mark_places(axes, [(way.x_m.iloc[-1], way.y_m.iloc[-1]) for _, way in table.groupby("robot")])
    axes.plot(*intruder, "X", markersize=11, color=LIGHT["alert"], markeredgecolor="white")
    axes.add_patch(Circle(intruder, ring, fill=False, linestyle="--", color=LIGHT["muted"]))
    axes.set_title(f"{begin:.0f} to {table.time_s.max():.0f} s")
    save(figure, "surround")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=FOLDER, metavar="FOLDER", help="folder of the pictures")
    FOLDER = parser.parse_args().out
    sys.exit(guarded(main))
