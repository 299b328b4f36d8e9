"""The picture of the end of a run."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from monitor.figures import ground as figures
from patrol.closures.ground import ChangingFootprint, Closings
from patrol.errors import BadInput
from patrol.ground.fog import NEVER, Fog
from patrol.journal import Journal, read_journal
from patrol.journal.records import RobotFacts, RobotTick, Status
from patrol.palette import LIGHT, NEVER_SEEN, ROBOTS, UNCOUNTED, WALL, rgb
from patrol.pose import Pose
from patrol.prepare import Prepared, prepare, sensor_footprint
from patrol.scenario import load_scenario
from worldsim.truth import Truth

if TYPE_CHECKING:
    from matplotlib.axes import Axes


SHUT = LIGHT["alert"]


MOST_NAMES = 24
"""Robots named in the legend at most."""


RECENT_S = 60.0
"""Length of the last part of a path, which is drawn stronger, s."""


def run_picture(run_folder: Path, out: Path, prepared: Prepared | None = None) -> None:
    """Draw the true fog at the end of a run, and the robots' paths, on the part of the map that is patrolled.

    Spare robots that never joined are left out.

    The fog is replayed from the folder's scenario.yaml and journal, whether or not the run reached its end.
    """
    journal = read_journal(run_folder / "journal")
    if prepared is None:
        prepared = prepare(load_scenario(run_folder / "scenario.yaml"))
    run = replay(journal, prepared)
    terrain, scenario = prepared.terrain, prepared.scenario
    counted = run.fog.patrolled.view(np.bool_)
    never = counted & (run.fog.last_seen == NEVER)
    ages = run.fog.age(run.tick) * scenario.step
    mfow, mean = run.fog.mfow(run.tick) * scenario.step, run.fog.mean(run.tick) * scenario.step
    title = f"{scenario.name}: fog after {run.tick * scenario.step:g} s, MFoW {mfow:g} s, mean {mean:.1f} s"
    shown, window = figures.cropped(terrain, counted)
    figure, axes = figures.canvas(shown, title)
    scale = figures.fog_scale(max(mfow, scenario.step))
    image = np.asarray(scale.to_rgba(ages, bytes=True)[..., :3])
    layers = [
        figures.Layer(WALL, "wall or unknown", ~terrain.passable),
        figures.Layer(UNCOUNTED, "can never be seen, does not count", terrain.passable & ~counted),
        figures.Layer(NEVER_SEEN, "never seen", never),
    ]
    for layer in layers:
        image[layer.mask] = rgb(layer.colour)
    figures.paint(axes, shown, image[window], ~shown.passable)
    keys = [figures.Key(layer.colour, layer.label) for layer in layers if layer.mask.any()]
    keys.append(figures.Key("#ffffff", f"paths, with the last {RECENT_S:g} s stronger:", ""))
    recent = max(round(RECENT_S / scenario.step), 1)
    robots = [
        facts
        for facts in journal.header.robots
        if facts.number not in scenario.spares or run.last[facts.number].status != Status.ABSENT
    ]
    boxes: list[figures.Box] = []
    for index, facts in enumerate(robots):
        colour = ROBOTS[index % len(ROBOTS)]
        _draw_path(axes, run.tracks[facts.number], recent, colour)
        if run.last[facts.number].status.is_present:
            _draw_body(axes, run.last[facts.number], facts, colour, boxes)
        if index < MOST_NAMES:
            keys.append(figures.Key(colour, f"{facts.name}{_fate_text(run.last[facts.number].status)}", "-"))
    if len(robots) > MOST_NAMES:
        keys.append(figures.Key("#ffffff", f"and {len(robots) - MOST_NAMES} more", ""))
    figures.key_column(figure, axes, shown, keys, scale, "time since last seen (s)")
    figures.save(figure, out)


@dataclass(frozen=True, slots=True)
class FinalFog:
    """The true fog at the last tick of a run."""

    tick: int
    fog: Fog  # the true one
    tracks: dict[int, NDArray[np.float64]]  # places by robot number, (ticks, 2), m; NaN while not alive
    last: dict[int, RobotTick]  # last record by robot number


def replay(journal: Journal, prepared: Prepared) -> FinalFog:
    """Replay a journal up to its last complete tick."""
    scenario = prepared.scenario
    numbers = [facts.number for facts in journal.header.robots]
    places: list[list[tuple[float, float, float]]] = []
    record = None
    for record in journal.ticks:
        places.append([(r.x, r.y, r.heading) if r.status == Status.ALIVE else (math.nan,) * 3 for r in record.robots])
    if record is None:
        raise BadInput(f"{journal.path}: holds no complete tick; there is nothing to draw")
    poses = np.array(places, dtype=np.float64)
    truth = Truth(sensor_footprint(scenario, prepared.terrain), prepared.patrolled)
    closings = Closings(scenario.closures, prepared.terrain, journal.events)
    # If one look makes a point fresh, ticks before the last MFoW do not show in the final fog.
    begin = 0 if truth.footprint.leaves_age else len(poses) - 1 - record.mfow
    for index in range(max(begin, 0), len(poses)):
        tick = record.k - len(poses) + 1 + index
        if isinstance(truth.footprint, ChangingFootprint):
            truth.footprint.close(closings.grid(tick))
        alive = [(number, Pose(*pose)) for number, pose in zip(numbers, poses[index].tolist(), strict=True)]
        truth.observe(tick, [(number, pose) for number, pose in alive if not math.isnan(pose.x)])
    tracks = {number: poses[:, index, :2] for index, number in enumerate(numbers)}
    return FinalFog(record.k, truth.fog, tracks, {robot.number: robot for robot in record.robots})


def _draw_path(axes: Axes, track: NDArray[np.float64], recent: int, colour: str) -> None:
    """Draw the whole path, thin, and its last `recent` steps stronger."""
    axes.plot(track[:, 0], track[:, 1], color=colour, linewidth=0.5, alpha=0.45, zorder=3)
    late = track[-recent - 1 :]
    axes.plot(late[:, 0], late[:, 1], color="#ffffff", linewidth=2.6, alpha=0.8, zorder=4, solid_capstyle="round")
    axes.plot(late[:, 0], late[:, 1], color=colour, linewidth=1.5, zorder=4, solid_capstyle="round")


def _draw_body(axes: Axes, robot: RobotTick, facts: RobotFacts, colour: str, taken: list[figures.Box]) -> None:
    """Draw a robot where it ended, with a stroke for its heading, or crossed out if it did not live to the end."""
    from matplotlib.patches import Circle

    place = robot.x, robot.y
    axes.add_patch(Circle(place, facts.radius, facecolor=colour, edgecolor="#ffffff", linewidth=1.0, zorder=5))
    if robot.status == Status.ALIVE:
        ahead = (robot.x + facts.radius * math.cos(robot.heading), robot.y + facts.radius * math.sin(robot.heading))
        axes.plot((robot.x, ahead[0]), (robot.y, ahead[1]), color="#ffffff", linewidth=1.0, zorder=5)
    else:
        axes.plot(robot.x, robot.y, marker="X", markersize=9, color=SHUT, markeredgecolor="white", zorder=5)
    figures.label(axes, robot.x, robot.y, facts.name, above=10.0, taken=taken)


def _fate_text(status: Status) -> str:
    return "" if status == Status.ALIVE else f" ({status.name.lower()})"
