"""A sensor of one's own: it sees far ahead and little to the sides, an ellipse around the robot.

    fogwatch run yards --set sensor.kind=./examples/elliptic_sensor.py:Ellipse --set sensor.options.across=4

docs/sensors.md has the rules for sensors; `fogwatch.testing.check_sensor` checks them.
"""

import math

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from patrol.ground.footprint import SensorSetup, View
from patrol.ground.sensors import Disc, SeeThrough
from patrol.pose import Pose


class Ellipse:
    """Sees `sensor.range` ahead and behind, and less to the sides; obstacles hide what is behind them."""

    all_round = False
    leaves_age = False

    class Options(BaseModel):
        """The fields of `sensor.options`."""

        model_config = ConfigDict(extra="forbid")
        across: float = Field(4.0, gt=0, description="m, range to the sides")

    def __init__(self, setup: SensorSetup) -> None:
        self._ahead = setup.radius  # in points
        self._across = min(setup.options.across / setup.terrain.point, setup.radius)
        self._in_sight = (Disc if setup.line_of_sight else SeeThrough)(setup)
        offsets = np.arange(-setup.reach, setup.reach + 1)
        self._rows, self._cols = np.meshgrid(offsets, offsets, indexing="ij")

    def visible(self, pose: Pose) -> View:
        """Return the points in sight that lie in the ellipse."""
        view = self._in_sight.visible(pose)
        cos, sin = math.cos(pose.heading), math.sin(pose.heading)
        ahead = (self._cols * cos + self._rows * sin) / self._ahead
        across = (self._rows * cos - self._cols * sin) / self._across
        return View(view.row0, view.col0, view.mask * (ahead**2 + across**2 <= 1.0 + 1e-9))
