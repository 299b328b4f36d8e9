"""A check of a sensor: views from many poses on a small ground with walls."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fogwatch.testing.broken import RuleBroken, class_of, disturb_chance
from patrol.classes.named_class import NamedClass, options_of
from patrol.ground.footprint import SensorSetup, View
from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import Terrain
from patrol.own_sensor import SENSORS, CheckedSensor, SensorFailed
from patrol.pose import Pose
from patrol.radio.message import as_received

HEADINGS = 7
"""Headings of each place."""

FACED = 12
"""Points that a robot faces from each place."""


NEARER = 0.95
"""Share of the range within which faced points are; headings on the wire are rounded."""


@dataclass(frozen=True, slots=True)
class SensorReport:
    """The figures of a sensor under check.

    Attributes:
        views: Number of views compared.
        median_ms: Wall time of half of them at most, ms. It is not judged: machines differ.
    """

    views: int
    median_ms: float

    def __str__(self) -> str:
        return f"{self.views} views, median {self.median_ms:.2f} ms"


def check_sensor(
    sensor: type[Any] | str,
    *,
    options: Mapping[str, Any] | None = None,
    range_m: float = 6.0,
    line_of_sight: bool = True,
    terrain: Terrain | None = None,
) -> SensorReport:
    """Check that a sensor keeps the rules of `patrol.ground.footprint.Sensor`.

    Views are well formed, within the range and on the terrain, and hold the robot's own point, also from walls, edges
    and places outside; a pose always has the same view, from two sensors and in any order, in all states of
    `random` and `numpy.random`; the heading changes nothing where the class says `all_round`; a robot that faces a
    point in sight sees it.

    Args:
        sensor: The class, or its name as in a scenario (``./file.py:Class``).
        options: What `sensor.options` says.
        range_m: What `sensor.range` says, m.
        line_of_sight: What `sensor.line_of_sight` says.
        terrain: The ground; a small one with walls unless given.

    Returns:
        How many views were compared, and how long they took.

    Raises:
        RuleBroken: The sensor breaks a rule; the message says which, and from what pose.
        BadInput: The options are wrong.
    """
    checked = class_of(sensor, SENSORS)
    ground = terrain or _walled_hall()
    setup = SensorSetup(
        ground, range_m, line_of_sight, options_of(NamedClass(SENSORS, checked.__name__, None, options or {}), checked)
    )
    sensor_1, sensor_2 = _make_sensor(checked, setup), _make_sensor(checked, setup)
    poses = [*_sample_poses(ground)]
    times = []
    first: list[View] = []
    for pose in poses:
        began = time.perf_counter()
        first.append(_look_from(sensor_1, pose))
        times.append(1000.0 * (time.perf_counter() - began))
    for number, repeated in enumerate((sensor_2, sensor_1)):
        disturb_chance(number + 1)
        for pose, view in reversed([*zip(poses, first, strict=True)]):
            if differing := _view_difference(view, _look_from(repeated, pose)):
                raise RuleBroken(
                    f"{checked.__name__}: one pose has one view; from {_at(pose)} {differing} are not as before. Use "
                    "no clock, no chance and nothing from an earlier call"
                )
    if sensor_1.all_round:
        _check_headings(checked.__name__, sensor_1, poses, first)
    _check_faced(checked.__name__, sensor_1, setup, poses[::HEADINGS])
    return SensorReport(len(times), statistics.median(times))


def _make_sensor(checked: type[Any], setup: SensorSetup) -> CheckedSensor:
    try:
        return CheckedSensor(checked, setup, checked.__name__)
    except SensorFailed as failed:
        raise RuleBroken(str(failed)) from failed.__cause__


def _look_from(sensor: CheckedSensor, pose: Pose) -> View:
    try:
        return sensor.visible(pose)
    except SensorFailed as failed:
        raise RuleBroken(str(failed)) from failed.__cause__


def _view_difference(view: View, other: View) -> str:
    """Say what differs between two views of a pose; empty where nothing does."""
    if points := np.count_nonzero(view.mask != other.mask):
        return f"{points} points"
    if (view.quality is None) != (other.quality is None):
        return "qualities"
    if view.quality is not None and other.quality is not None:
        in_view = view.mask != 0
        if points := np.count_nonzero(view.quality[in_view] != other.quality[in_view]):
            return f"the qualities of {points} points"
    return ""


def _check_headings(name: str, sensor: CheckedSensor, poses: Sequence[Pose], views: Sequence[View]) -> None:
    for pose, view in zip(poses, views, strict=True):
        if differing := _view_difference(view, _look_from(sensor, Pose(pose.x, pose.y, 0.0))):
            raise RuleBroken(
                f"{name}: all_round says that headings change nothing; from {_at(pose)} {differing} are not as with "
                "the heading 0. Set all_round to False"
            )


def _check_faced(name: str, sensor: CheckedSensor, setup: SensorSetup, places: Sequence[Pose]) -> None:
    ground = setup.terrain
    sight = footprint_of(ground, NEARER * setup.range_m, line_of_sight=setup.line_of_sight)
    for pose in places:
        row, col = ground.point_at(pose.x, pose.y)
        if not ground.inside(row, col) or not ground.passable[row, col]:
            continue
        view = sight.visible(pose)
        points = np.argwhere(view.mask)
        for up, across in points[:: max(len(points) // FACED, 1)].tolist():
            target = view.row0 + up, view.col0 + across
            x, y = ground.centre(*target)
            facing = as_received(Pose(pose.x, pose.y, math.atan2(y - pose.y, x - pose.x)))
            facing = Pose(pose.x, pose.y, facing.heading)
            if not _look_from(sensor, facing).shows(*target):
                away = math.hypot(x - pose.x, y - pose.y)
                raise RuleBroken(
                    f"{name}: a robot sees what it faces; from {_at(facing)} the point ahead at ({x:g}, {y:g}), "
                    f"{away:.2f} m away and in sight, is not seen. Give a shorter sensor.range, or see it"
                )


def _sample_poses(ground: Terrain) -> Iterator[Pose]:
    """Yield poses all over the ground, at its edges and outside, each with several headings."""
    height, width = ground.shape
    rows = [-3, -1, 0, height - 1, height + 2, *range(1, height, max(height // 7, 1))]
    cols = [-3, -1, 0, width - 1, width + 2, *range(1, width, max(width // 7, 1))]
    for row in rows:
        for col in cols:
            for turn in range(HEADINGS):
                heading = as_received(Pose(0.0, 0.0, math.tau * turn / HEADINGS - math.pi + 0.1)).heading
                yield Pose(*ground.centre(row, col), heading)


def _walled_hall() -> Terrain:
    """Make a hall of 20 x 15 m with a wall, a door and a pillar."""
    passable = np.ones((30, 40), dtype=np.bool_)
    passable[:, 20] = False
    passable[14:17, 20] = True
    passable[6:9, 8:11] = False
    passable[0], passable[-1], passable[:, 0], passable[:, -1] = False, False, False, False
    return Terrain("hall", passable, 0.5)


def _at(pose: Pose) -> str:
    return f"({pose.x:g}, {pose.y:g}), heading {math.degrees(pose.heading):.1f} degrees,"
