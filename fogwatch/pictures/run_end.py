"""The picture of the end of a run."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from monitor.figures import ground as figures
from monitor.replay.replay import Replay
from patrol.ground.fog import NEVER
from patrol.journal.records import RobotFacts, Status
from patrol.palette import LIGHT, NEVER_SEEN, ROBOTS, UNCOUNTED, WALL, rgb
from patrol.pose import Pose

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from monitor.replay.run import Run


SHUT = LIGHT["alert"]


MOST_NAMES = 24
"""Robots named in the legend at most."""


RECENT_S = 60.0
"""Length of the last part of a path, which is drawn stronger, s."""


def run_picture(run: Run, out: Path) -> None:
    """Draw the true fog at the end of a run, and the robots' paths, on the part of the map that is patrolled.

    The run may have been cut off. Spare robots that never joined are left out.
    """
    tick, terrain, step = run.ticks - 1, run.prepared.terrain, run.step
    fog = Replay(run).fog(tick)
    counted = fog.patrolled.view(np.bool_)
    mfow = fog.mfow(tick) * step
    title = f"{run.title}: fog after {tick * step:g} s, MFoW {mfow:g} s, mean {fog.mean(tick) * step:.1f} s"
    shown, window = figures.cropped(terrain, counted)
    figure, axes = figures.canvas(shown, title)
    scale = figures.fog_scale(max(mfow, step))
    image = np.asarray(scale.to_rgba(fog.age(tick) * step, bytes=True)[..., :3])
    layers = [
        figures.Layer(WALL, "wall or unknown", ~terrain.passable),
        figures.Layer(UNCOUNTED, "can never be seen, does not count", terrain.passable & ~counted),
        figures.Layer(NEVER_SEEN, "never seen", counted & (fog.last_seen == NEVER)),
    ]
    for layer in layers:
        image[layer.mask] = rgb(layer.colour)
    figures.paint(axes, shown, image[window], ~shown.passable)
    keys = [figures.Key(layer.colour, layer.label) for layer in layers if layer.mask.any()]
    keys.append(figures.Key("#ffffff", f"paths, with the last {RECENT_S:g} s stronger:", ""))
    recent = max(round(RECENT_S / step), 1)
    tracks = np.where((run.status == Status.ALIVE)[..., np.newaxis], run.poses[..., :2], np.nan)
    boxes: list[figures.Box] = []
    for index, facts in enumerate(run.robots):
        colour, status = ROBOTS[index % len(ROBOTS)], Status(run.status[tick, index])
        _draw_path(axes, tracks[:, index], recent, colour)
        if status.is_present:
            _draw_body(axes, Pose(*run.poses[tick, index].tolist()), status, facts, colour, boxes)
        if index < MOST_NAMES:
            fate = "" if status == Status.ALIVE else f" ({status.name.lower()})"
            keys.append(figures.Key(colour, f"{facts.name}{fate}", "-"))
    if len(run.robots) > MOST_NAMES:
        keys.append(figures.Key("#ffffff", f"and {len(run.robots) - MOST_NAMES} more", ""))
    figures.key_column(figure, axes, shown, keys, scale, "time since last seen (s)")
    figures.save(figure, out)


def _draw_path(axes: Axes, track: NDArray[np.float64], recent: int, colour: str) -> None:
    """Draw the whole path, thin, and its last `recent` steps stronger."""
    axes.plot(track[:, 0], track[:, 1], color=colour, linewidth=0.5, alpha=0.45, zorder=3)
    late = track[-recent - 1 :]
    axes.plot(late[:, 0], late[:, 1], color="#ffffff", linewidth=2.6, alpha=0.8, zorder=4, solid_capstyle="round")
    axes.plot(late[:, 0], late[:, 1], color=colour, linewidth=1.5, zorder=4, solid_capstyle="round")


def _draw_body(
    axes: Axes, pose: Pose, status: Status, facts: RobotFacts, colour: str, taken: list[figures.Box]
) -> None:
    """Draw a robot where it ended, with a stroke for its heading, or crossed out if it did not live to the end."""
    from matplotlib.patches import Circle

    axes.add_patch(
        Circle((pose.x, pose.y), facts.radius, facecolor=colour, edgecolor="#ffffff", linewidth=1.0, zorder=5)
    )
    if status == Status.ALIVE:
        ahead = (pose.x + facts.radius * math.cos(pose.heading), pose.y + facts.radius * math.sin(pose.heading))
        axes.plot((pose.x, ahead[0]), (pose.y, ahead[1]), color="#ffffff", linewidth=1.0, zorder=5)
    else:
        axes.plot(pose.x, pose.y, marker="X", markersize=9, color=SHUT, markeredgecolor="white", zorder=5)
    figures.label(axes, pose.x, pose.y, facts.name, above=10.0, taken=taken)
