"""Pictures of a map check and of the end of a run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fogwatch.grounds.map_check import MapReport
from monitor.figures.ground import (
    Box,
    Key,
    Layer,
    canvas,
    cropped,
    draw_outline,
    fog_scale,
    key_column,
    label,
    paint,
    painted,
    save,
)
from patrol.closures.ground import ChangingFootprint, Closings
from patrol.errors import BadInput
from patrol.ground.doors import Door
from patrol.ground.fog import NEVER, Fog
from patrol.journal import Journal, read_journal
from patrol.journal.records import RobotFacts, RobotTick, Status
from patrol.palette import LIGHT, MARKS, NEVER_SEEN, ROBOTS, UNCOUNTED, WALL, rgb
from patrol.pose import Pose
from patrol.prepare import Prepared, prepare, sensor_footprint
from patrol.scenario import load_scenario
from worldsim.truth import Truth

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from patrol.ground.marks import Mark
    from patrol.ground.terrain import Terrain

REACHABLE = "#d9ecf5"
SEEN = "#8fc3dd"
SEALED_SEEN = "#f6e3a1"
SEALED = "#e79f3c"
KEEP_OUT = "#9c8fb5"
PERHAPS_UNKNOWN = "#c9a7d8"
PASSES = "#1d5f8a"
SHUT = LIGHT["alert"]

MOST_DOORS = 25
"""Doors drawn at most: first those too narrow for the body, then the narrowest of the others."""

MOST_NAMES = 24
"""Robots named in the legend at most."""

KINDS = {
    "keepout": "keep-out",
    "oneway": "one-way zone",
    "slow": "slow zone",
    "weight": "zone with a weight or an age",
    "closure": "closure",
    "dock": "dock",
}
"""Words of the legend for kinds of marks."""

RECENT_S = 60.0
"""Length of the last part of a path, which is drawn stronger, s."""


def map_picture(report: MapReport, out: Path, marks: Sequence[Mark] = ()) -> None:
    """Draw a map check: walls, what is reached, seen and not seen, sealed-off parts, doors, and a site's marks."""
    terrain, fields = report.terrain, report.fields
    sealed = report.sealed > 0
    unseen = terrain.passable & ~fields.patrolled
    unreached = fields.patrolled & ~fields.reach
    layers = [
        Layer(WALL, "wall or unknown", ~terrain.passable),
        Layer(REACHABLE, "reached by the body's centre", fields.reach),
        Layer(SEEN, "seen, but no place for the centre", unreached & ~sealed & ~terrain.keep_out),
        Layer(KEEP_OUT, "keep-out area, but seen", unreached & ~sealed & terrain.keep_out),
        Layer(SEALED_SEEN, "sealed off, but seen", sealed & unreached),
        Layer(SEALED, "sealed off and never seen", sealed & unseen),
        Layer(NEVER_SEEN, "never seen: small parts, blind corners", unseen & ~sealed),
        Layer(PERHAPS_UNKNOWN, "read as free, perhaps unknown", report.perhaps_unknown),
    ]
    title = f"{terrain.name}: a body of {report.radius:g} m radius, a sensor of {report.sensor_range:g} m"
    shown, window = cropped(terrain, terrain.passable)
    figure, axes = canvas(shown, title)
    paint(axes, shown, painted(terrain.shape, layers)[window], ~shown.passable)
    doors = sorted(report.doors, key=lambda door: (door.passes, door.width))[:MOST_DOORS]
    boxes: list[Box] = []
    for door in doors:
        _draw_door(axes, door, boxes)
    for number, part in enumerate(report.parts, start=1):
        label(axes, part.x, part.y, str(number), size=9.0, taken=boxes)
    keys = [
        Key(layer.colour, f"{layer.label}: {np.count_nonzero(layer.mask) * terrain.point_area:.1f} m²")
        for layer in layers
        if layer.mask.any()
    ]
    keys += [Key(SHUT, "door too narrow for the body, m", "X")] * any(not door.passes for door in doors)
    keys += [Key(PASSES, "door that lets it pass, m", "o")] * any(door.passes for door in doors)
    key_column(figure, axes, shown, keys + _draw_marks(axes, terrain, marks))
    save(figure, out)


def _draw_marks(axes: Axes, terrain: Terrain, marks: Sequence[Mark]) -> list[Key]:
    """Draw outlines, places and names; return their lines of the legend."""
    keys: dict[str, Key] = {}
    for mark in marks:
        colour, sign, above = MARKS[mark.kind], "-", 0.0
        if mark.points is None:
            sign, above = "P", 11.0
            axes.plot(*mark.at, sign, color=colour, markersize=9, markeredgecolor="white", zorder=6)
        else:
            style, above = ("dashed", 12.0) if mark.closes else ("solid", 0.0)  # doors have their widths there
            draw_outline(axes, terrain, mark.points, colors=colour, linewidths=1.8, linestyles=style, zorder=5)
        label(axes, *mark.at, mark.label, colour=colour, size=8.0, above=above)
        keys[mark.kind] = Key(colour, KINDS[mark.kind], sign)
    return [keys[kind] for kind in MARKS if kind in keys]


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
    shown, window = cropped(terrain, counted)
    figure, axes = canvas(shown, title)
    scale = fog_scale(max(mfow, scenario.step))
    image = np.asarray(scale.to_rgba(ages, bytes=True)[..., :3])
    layers = [
        Layer(WALL, "wall or unknown", ~terrain.passable),
        Layer(UNCOUNTED, "can never be seen, does not count", terrain.passable & ~counted),
        Layer(NEVER_SEEN, "never seen", never),
    ]
    for layer in layers:
        image[layer.mask] = rgb(layer.colour)
    paint(axes, shown, image[window], ~shown.passable)
    keys = [Key(layer.colour, layer.label) for layer in layers if layer.mask.any()]
    keys.append(Key("#ffffff", f"paths, with the last {RECENT_S:g} s stronger:", ""))
    recent = max(round(RECENT_S / scenario.step), 1)
    robots = [
        facts
        for facts in journal.header.robots
        if facts.number not in scenario.spares or run.last[facts.number].status != Status.ABSENT
    ]
    boxes: list[Box] = []
    for index, facts in enumerate(robots):
        colour = ROBOTS[index % len(ROBOTS)]
        _draw_path(axes, run.tracks[facts.number], recent, colour)
        if run.last[facts.number].status.is_present:
            _draw_body(axes, run.last[facts.number], facts, colour, boxes)
        if index < MOST_NAMES:
            keys.append(Key(colour, f"{facts.name}{_fate_text(run.last[facts.number].status)}", "-"))
    if len(robots) > MOST_NAMES:
        keys.append(Key("#ffffff", f"and {len(robots) - MOST_NAMES} more", ""))
    key_column(figure, axes, shown, keys, scale, "time since last seen (s)")
    save(figure, out)


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


def _draw_body(axes: Axes, robot: RobotTick, facts: RobotFacts, colour: str, taken: list[Box]) -> None:
    """Draw a robot where it ended, with a stroke for its heading, or crossed out if it did not live to the end."""
    from matplotlib.patches import Circle

    axes.add_patch(
        Circle((robot.x, robot.y), facts.radius, facecolor=colour, edgecolor="#ffffff", linewidth=1.0, zorder=5)
    )
    if robot.status == Status.ALIVE:
        ahead = (robot.x + facts.radius * math.cos(robot.heading), robot.y + facts.radius * math.sin(robot.heading))
        axes.plot((robot.x, ahead[0]), (robot.y, ahead[1]), color="#ffffff", linewidth=1.0, zorder=5)
    else:
        axes.plot(robot.x, robot.y, marker="X", markersize=9, color=SHUT, markeredgecolor="white", zorder=5)
    label(axes, robot.x, robot.y, facts.name, above=10.0, taken=taken)


def _fate_text(status: Status) -> str:
    return "" if status == Status.ALIVE else f" ({status.name.lower()})"


def _draw_door(axes: Axes, door: Door, taken: list[Box]) -> None:
    """Draw a circle as wide as the door, a cross where the body does not pass, and the width."""
    from matplotlib.patches import Circle

    colour = PASSES if door.passes else SHUT
    axes.add_patch(Circle((door.x, door.y), 0.5 * door.width, facecolor=colour, edgecolor=colour, alpha=0.35, zorder=4))
    if door.passes:
        label(axes, door.x, door.y, f"{door.width:.2f}", taken=taken)
        return
    axes.plot(door.x, door.y, marker="X", markersize=7, color=SHUT, markeredgecolor="white", zorder=5)
    label(axes, door.x, door.y, f"{door.width:.2f}", colour=SHUT, above=9.0, taken=taken)
