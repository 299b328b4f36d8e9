"""The footprint: the points a robot observes from a pose, and the port of the sensors that decide which these are.

    Sensor      points in view of a pose       visible(pose) -> view
    Footprint   a sensor on a terrain, as everything that computes with looks uses it

A sensor sits at the centre of the point that holds the robot. It sees no point whose centre is farther than its range.
Two rules hold for all sensors, so that robots can plan with them:

- A robot sees its own point.
- A robot that faces a point within the range sees it, if the sensor looks through obstacles or the line of sight to
  the point is free. So what robots can ever see depends on the range and on the line of sight alone
  (`patrol.ground.fields`), and a robot that stands at a point's post only has to turn.

A sensor is deterministic. A view depends on the pose as encoded on the wire and on the terrain, and on nothing else:
the world, all minds and the verdict compute it separately and must agree on every point.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from patrol.ground.terrain import Terrain
from patrol.pose import Pose

__all__ = ["Footprint", "Sensor", "SensorSetup", "View"]

REMEMBERED = 64
"""Views that a `Footprint` keeps unless told otherwise: in one tick every robot asks for the same few."""


@dataclass(frozen=True, slots=True)
class View:
    """The points seen from one pose.

    Attributes:
        row0: The terrain's row under the window's row 0; may lie outside the terrain.
        col0: The terrain's column under the window's column 0; may lie outside the terrain.
        mask: uint8 (m, m), 1 where the point is seen, 0 outside the terrain; read-only.
        quality: float64 (m, m) in (0, 1], share of the age that an observation removes, or None where it makes a point
            fresh; read-only.
    """

    row0: int
    col0: int
    mask: NDArray[np.uint8]
    quality: NDArray[np.float64] | None = None

    def mark(self, grid: NDArray[np.int32], tick: int) -> None:
        """Note in a grid at which tick each seen point was last in view.

        Args:
            grid: int32 (height, width) of the terrain, ticks; changed where this view is the later one.
            tick: When this view was seen.
        """
        rows, cols = self.mask.shape
        top, left = max(0, -self.row0), max(0, -self.col0)
        part = grid[self.row0 + top : self.row0 + rows, self.col0 + left : self.col0 + cols]
        visible = self.mask[top : top + part.shape[0], left : left + part.shape[1]] != 0
        # Late frames come after newer ones and must not make a point look older.
        part[visible] = np.maximum(part[visible], tick)

    def box(self, shape: tuple[int, int]) -> tuple[int, int, int, int] | None:
        """Cut the window to a terrain.

        For example, a window of 5 by 5 points at (-2, 3) on 10 by 10 points gives (0, 2, 3, 7).

        Args:
            shape: The terrain's rows and columns.

        Returns:
            First and last row and first and last column on the terrain; None where the window lies beside it.
        """
        (rows, cols), (height, width) = self.mask.shape, shape
        box = max(0, self.row0), min(height, self.row0 + rows) - 1, max(0, self.col0), min(width, self.col0 + cols) - 1
        return box if box[0] <= box[1] and box[2] <= box[3] else None

    def shows(self, row: int, col: int) -> bool:
        """Return True if the terrain's point (row, col) is seen.

        Args:
            row: Of the terrain.
            col: Of the terrain.
        """
        up, across = row - self.row0, col - self.col0
        rows, cols = self.mask.shape
        return 0 <= up < rows and 0 <= across < cols and bool(self.mask[up, across])


@dataclass(frozen=True, slots=True)
class SensorSetup:
    """The ground, range and options that a sensor is made from.

    Attributes:
        terrain: The ground, and what blocks the view.
        range_m: The scenario's `sensor.range`, m.
        line_of_sight: Whether obstacles block the view.
        options: What `sensor.options` says, as the sensor's own ``Options``; an empty mapping where it has none.
    """

    terrain: Terrain
    range_m: float
    line_of_sight: bool = True
    options: Any = None

    @property
    def radius(self) -> float:
        """The range in points; no sensor reaches farther than across the terrain."""
        return min(self.range_m / self.terrain.point, math.hypot(*self.terrain.shape))

    @property
    def reach(self) -> int:
        """Whole points from a window's middle to its edge."""
        return math.floor(self.radius + 1e-9)


class Sensor(Protocol):
    """A kind of sensor on one terrain. It is made by ``Sensor(setup)`` (`SensorSetup`).

    A class of one's own may have a pydantic model named ``Options``, which `sensor.options` of the scenario is
    validated by. For example, a sensor that sees its own point and the one ahead:

        class Probe:
            all_round = False
            leaves_age = False

            def __init__(self, setup: SensorSetup) -> None:
                self.terrain = setup.terrain

            def visible(self, pose: Pose) -> View: ...
    """

    @property
    def all_round(self) -> bool:
        """True if a view is the same for every heading."""
        ...

    @property
    def leaves_age(self) -> bool:
        """True if views have a quality: a look may leave some of a point's age."""
        ...

    def visible(self, pose: Pose) -> View:
        """The points seen from a pose.

        Args:
            pose: The centre of a point, m, which may lie outside the terrain, and a heading as on the wire, rad; 0 for
                a sensor that looks all round.

        Returns:
            A window of 2 reach + 1 points in each direction with the pose's point in the middle (`SensorSetup.reach`).
        """
        ...


class Footprint:
    """A sensor on a terrain: from a pose to the points it observes, with the latest views kept.

    Attributes:
        changes: Whether what it sees from a pose may change during a run.

    Args:
        setup: What the sensor was made from.
        sensor: The sensor.
        remembered: How many views to keep.
    """

    changes = False

    def __init__(self, setup: SensorSetup, sensor: Sensor, remembered: int = REMEMBERED) -> None:
        self.terrain = setup.terrain
        self.range_m = setup.range_m
        self.radius = setup.radius
        self.line_of_sight = setup.line_of_sight
        self.all_round = sensor.all_round
        self.leaves_age = sensor.leaves_age
        self._sensor = sensor
        self._remembered = lru_cache(maxsize=remembered)(self._look_from)

    def visible(self, pose: Pose) -> View:
        """The points seen from a pose.

        Args:
            pose: As receivers of its frame compute with it (`patrol.radio.message.as_received`), so that all who hear
                it agree on the points.

        Returns:
            The view, shared and read-only.
        """
        # By the point and not by the place: all places on a point have the same view, so few views are computed.
        row, col = self.terrain.point_at(pose.x, pose.y)
        return self._remembered(row, col, 0.0 if self.all_round else pose.heading)

    def _look_from(self, row: int, col: int, heading: float) -> View:
        view = self._sensor.visible(Pose(*self.terrain.centre(row, col), heading))
        view.mask.setflags(write=False)
        if view.quality is not None:
            view.quality.setflags(write=False)
        return view
