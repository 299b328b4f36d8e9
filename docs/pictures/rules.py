"""Makes the pictures of the paper's rules that docs/student.md shows, `make pictures`: of the decisions of one run.

Three robots patrol `yards` by the paper's policy. At one tick the first robot's view is drawn, with the code that
robots use themselves.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from agent.bodies.refine import psi_field
from agent.policies.potential_field.direction import bisectors
from agent.policies.potential_field.force import distance_force, fow_force
from agent.policies.potential_field.policy import PotentialField
from agent.ports import Intent
from agent.view import View
from experiments.inprocess import run_in_process
from patrol.ground.terrain import Terrain
from patrol.palette import ROBOTS, WALL
from patrol.prepare import Prepared, prepare
from patrol.scenario import load_scenario

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
    """A run of the paper's policy that draws the first robot's view and intent at `TICK`, while they hold."""

    def __init__(self, prepared: Prepared, draw: Callable[[View, Intent], None]) -> None:
        self._decide, self._draw, self._drawn = PotentialField.decide, draw, False
        self._prepared = prepared

    def run(self) -> None:
        """Do the run, with a look at each decision."""
        drawn_run = self

        def decide(policy: PotentialField, view: View) -> Intent:
            intent = drawn_run._decide(policy, view)
            if view.tick == TICK and not drawn_run._drawn:
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

    DrawnRun(prepared, draw).run()


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
    places = [(view.pose.x, view.pose.y), *((peer.pose.x, peer.pose.y) for peer in view.peers.values())]
    for place, colour in zip(places, ROBOTS, strict=False):
        axes.plot(*place, "o", markersize=9, color=colour, markeredgecolor="white", markeredgewidth=1.5)


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
    axes.plot(x, y, "D", markersize=8, color="white", markeredgecolor="black", clip_on=False)
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


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=FOLDER, metavar="FOLDER", help="folder of the pictures")
    FOLDER = parser.parse_args().out
    main()
