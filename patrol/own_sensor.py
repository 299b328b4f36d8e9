"""A scenario's sensor: one that comes with fogwatch, or one of one's own (`patrol.classes.named_class`).

A sensor of one's own runs in everything that computes looks: in the world, in every robot, and in commands that play a
run again or judge it. Those open what others may have written, and must not run a stranger's code. So such a sensor is
run only if this user has run a scenario with it on this machine (`allow_sensor`), of which a file in the user's cache
folder is the record: its name is the SHA-256 of the sensor's file, or of the name of a class in an installed package.

What it returns is checked, and what it raises becomes one line that names it (`SensorFailed`).
"""

from __future__ import annotations

import hashlib
import math
import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path, PurePath
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from patrol.classes.class_file import checked_source, class_file
from patrol.classes.named_class import ClassSort, NamedClass, load
from patrol.errors import BadInput
from patrol.ground.footprint import Footprint, Sensor, SensorSetup, View
from patrol.kernel_cache import make_folder, user_cache
from patrol.pose import Pose
from patrol.scenario.sections import BUILT_IN_SENSORS, SensorSpec

if TYPE_CHECKING:
    from patrol.ground.terrain import Terrain

SENSORS = ClassSort(
    noun="sensor",
    field="sensor.kind",
    call="visible(pose)",
    group="fogwatch.sensors",
    built_in=MappingProxyType(dict.fromkeys(BUILT_IN_SENSORS, "patrol.ground.sensors:Sector")),
)
"""Sensors of scenarios. Those that come with fogwatch are made of several classes (`footprint_of`), not by name."""

_allowed: set[str] = set()
"""Records of this process, for a cache folder that cannot be written."""


class SensorFailed(BadInput):
    """A sensor of one's own has raised or returned something that is no view; one line says which."""


def sensor_named(spec: SensorSpec) -> NamedClass:
    """Return a scenario's sensor by name; nothing of it is imported."""
    return NamedClass(SENSORS, spec.kind, spec.kind_sha256, spec.options or {})


def allow_sensor(spec: SensorSpec, *, record: bool = False) -> None:
    """Find a sensor of one's own, and let this process run it.

    With `record`, all commands of this user may run it from now on, because this user runs a scenario with it.
    """
    if spec.kind in BUILT_IN_SENSORS:
        return
    named = sensor_named(spec)
    name = _record_name(named)
    load(named if class_file(named.name) is None else replace(named, sha256=name))
    _allowed.add(name)
    if record and (folder := user_cache("sensors")) is not None:
        with suppress(OSError):
            make_folder(folder)
            (folder / name).touch()


def make_footprint(spec: SensorSpec, terrain: Terrain, remembered: int) -> Footprint:
    """Make a scenario's sensor, which keeps at most `remembered` views.

    A sensor of one's own that this user has not run yet is refused.
    """
    if spec.kind in BUILT_IN_SENSORS:
        from patrol.ground.sensors import footprint_of  # here: its kernels take time to load

        return footprint_of(terrain, spec.range, spec.angle, spec.line_of_sight, spec.quality, remembered)
    named = sensor_named(spec)
    _check_allowed(named)
    sensor_class, options = load(named)
    setup = SensorSetup(terrain, spec.range, spec.line_of_sight, options)
    return Footprint(setup, CheckedSensor(sensor_class, setup, named.field), remembered)


class CheckedSensor:
    """A sensor of one's own whose views can be used by everything that computes with them."""

    def __init__(self, made: type[Any], setup: SensorSetup, name: str) -> None:
        self._setup, self._name = setup, name
        try:
            self._sensor: Sensor = made(setup)
        except (Exception, SystemExit) as error:
            raise self._make_failure("cannot be made", error) from error
        self.all_round = self._read_flag("all_round")
        self.leaves_age = self._read_flag("leaves_age")
        offsets = np.arange(-setup.reach, setup.reach + 1)
        self._beyond = offsets[:, None] ** 2 + offsets[None, :] ** 2 > setup.radius**2 + 1e-9

    def visible(self, pose: Pose) -> View:
        """Return the points seen from a pose, checked."""
        try:
            view = self._sensor.visible(pose)
        except (Exception, SystemExit) as error:
            raise self._make_failure(f"from {_pose_text(pose)}: raised", error) from error
        if wrong := next(self._view_problems(view, pose), ""):
            raise SensorFailed(f"{self._name}: visible(pose) from {_pose_text(pose)} returned {wrong}")
        quality = None if view.quality is None else np.array(view.quality, order="C")
        return View(int(view.row0), int(view.col0), np.array(view.mask, order="C"), quality)

    def _view_problems(self, view: object, pose: Pose) -> Iterator[str]:
        """Give the problems of a view, each with its remedy; those after the first may be wrong."""
        setup, side = self._setup, 2 * self._setup.reach + 1
        if not isinstance(view, View):
            yield f"{type(view).__name__}; return patrol.ground.footprint.View"
            return
        mask, quality = view.mask, view.quality
        row, col = setup.terrain.point_at(pose.x, pose.y)
        corner = (row - setup.reach, col - setup.reach)
        if (view.row0, view.col0) != corner:
            yield f"a window at {(view.row0, view.col0)}; let it begin at {corner}, so that the pose is in its middle"
        if not _is_grid(mask, side, np.uint8):
            yield f"{_kind_name(mask)} as mask; return uint8 of shape ({side}, {side})"
        if mask.max() > 1:
            yield f"a mask that holds {mask.max()}; mark seen points with 1 and others with 0"
        if mask[self._beyond].any():
            yield f"a point farther than the range of {setup.range_m:g} m; leave it out, or give more as sensor.range"
        rows, cols = np.nonzero(mask)
        height, width = setup.terrain.shape
        up, across = rows + corner[0], cols + corner[1]
        outside = (up < 0) | (up >= height) | (across < 0) | (across >= width)
        if (outside & ((up != row) | (across != col))).any():
            yield "a point outside the terrain; leave it out"
        if setup.terrain.inside(row, col) and setup.terrain.passable[row, col] and not view.shows(row, col):
            yield "a view without the robot's own point; mark it"
        if quality is None:
            return
        if not self.leaves_age:
            yield "a quality, and its leaves_age is False; return None, or set leaves_age to True"
        if not _is_grid(quality, side, np.float64):
            yield f"{_kind_name(quality)} as quality; return float64 of shape ({side}, {side}), or None"
        shares = quality[mask != 0]
        if (bad := shares[~((shares > 0.0) & (shares <= 1.0))]).size:
            yield f"the quality {bad[0]:g}; give more than 0 and at most 1"

    def _read_flag(self, name: str) -> bool:
        value = getattr(self._sensor, name, None)
        if not isinstance(value, bool):
            raise SensorFailed(f"{self._name}: {name} is {value!r}; give the class {name} = True or False")
        return value

    def _make_failure(self, what: str, error: BaseException) -> SensorFailed:
        frame = error.__traceback__
        while frame is not None and frame.tb_next is not None:
            frame = frame.tb_next
        where = "" if frame is None else f" ({PurePath(frame.tb_frame.f_code.co_filename).name}:{frame.tb_lineno})"
        return SensorFailed(f"{self._name}: {what} {type(error).__name__}: {error}{where}; correct it")


def _is_grid(grid: object, side: int, dtype: type[np.generic]) -> bool:
    return isinstance(grid, np.ndarray) and grid.dtype == dtype and grid.shape == (side, side)


def _kind_name(value: object) -> str:
    if isinstance(value, np.ndarray):
        array: NDArray[Any] = value
        return f"{array.dtype} of shape {array.shape}"
    return type(value).__name__


def _pose_text(pose: Pose) -> str:
    return f"x = {pose.x:g} m, y = {pose.y:g} m, heading = {math.degrees(pose.heading):g} degrees"


def _check_allowed(named: NamedClass) -> None:
    """Refuse a sensor that this user has not run; it is not opened to find out."""
    path = class_file(named.name)
    if path is not None and named.sha256 is None:
        raise BadInput(f"{named.field}: the scenario has no sensor.kind_sha256, so the file is not run; run it first")
    record = _text_digest(named.name) if path is None else str(named.sha256)
    folder = user_cache("sensors")
    if record not in _allowed and not (folder is not None and _is_own_file(folder / record)):
        where = f"~/.cache/fogwatch/sensors/{record}" if folder is None else str(folder / record)
        raise BadInput(
            f"{named.field}: is a program, and this user has not run a scenario with it here; read it, and if you "
            f"trust it, make the file {where}, or run the scenario"
        )


def _is_own_file(path: Path) -> bool:
    """Return True if a file is there and this user has made it; a link to one may be another user's."""
    try:
        return path.lstat().st_uid == os.geteuid()
    except OSError:
        return False


def _record_name(named: NamedClass) -> str:
    """Return the name of the file that records that a user runs a sensor."""
    path = class_file(named.name)
    return _text_digest(named.name) if path is None else checked_source(path, named.sha256, named.sort.field)[1]


def _text_digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
