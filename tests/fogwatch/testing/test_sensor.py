"""The check of sensors: the shipped ones pass, and one broken sensor for each rule."""

import itertools
import random  # noqa: TID251 - what a sensor must not use
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import BaseModel

from fogwatch.testing import RuleBroken, check_sensor
from patrol.errors import BadInput
from patrol.ground.footprint import SensorSetup, View
from patrol.ground.sensors import Disc, Sector, SeeThrough
from patrol.pose import Pose

ELLIPSE = Path(__file__).parents[3] / "examples" / "elliptic_sensor.py"


class Whole(Disc):
    """A disc whose views may be changed."""

    all_round: Any = True
    leaves_age: Any = False

    def __init__(self, setup: SensorSetup) -> None:
        super().__init__(setup)
        self.setup = setup

    def visible(self, pose: Pose) -> Any:
        return self.changed(super().visible(pose), pose)

    def changed(self, view: View, pose: Pose) -> Any:
        del pose
        return view


class Quarter(Sector):
    class Options(BaseModel):
        angle: float = 90.0

    def __init__(self, setup: SensorSetup) -> None:
        super().__init__(Disc(setup, [(1.0, 1.0), (6.0, 0.2)]), setup.options.angle)


def test_the_shipped_sensors_pass() -> None:
    report = check_sensor(f"{ELLIPSE}:Ellipse", options={"across": 1.0})
    assert report.views > 500
    assert str(report).startswith(f"{report.views} views, median ")
    for sensor in (Whole, Disc):
        check_sensor(sensor)
    check_sensor(SeeThrough, line_of_sight=False)
    check_sensor(Quarter, options={"angle": 30.0})
    check_sensor(Quarter, options={"angle": 30.0}, range_m=0.4)


def shifted(view: View, by: int) -> View:
    return replace(view, col0=view.col0 + by)


class Random(Whole):
    def changed(self, view: View, pose: Pose) -> Any:
        del pose
        view.mask[self.setup.reach, self.setup.reach + 1] *= random.random() < 0.5
        return view


class Counting(Whole):
    calls = itertools.count()

    def changed(self, view: View, pose: Pose) -> Any:
        del pose
        view.mask[view.mask.shape[0] // 2 + 2] *= next(self.calls) % 3 != 0
        return view


class Fading(Whole):
    """Its quality falls with each call."""

    leaves_age = True

    def changed(self, view: View, pose: Pose) -> Any:
        del pose
        self.share = 0.999 * getattr(self, "share", 1.0)
        return replace(view, quality=np.full(view.mask.shape, self.share))


class Looking(Whole):
    """Sees less to the left, and says that it looks all round."""

    def changed(self, view: View, pose: Pose) -> Any:
        if pose.heading > 1.0:
            view.mask[: self.setup.reach] = 0
        return view


class Backwards(Sector):
    def __init__(self, setup: SensorSetup) -> None:
        super().__init__(Disc(setup), 90.0)

    def visible(self, pose: Pose) -> View:
        return super().visible(replace(pose, heading=pose.heading + np.pi))


class Short(Disc):
    def __init__(self, setup: SensorSetup) -> None:
        super().__init__(replace(setup, range_m=0.5 * setup.range_m))
        self.reach = setup.reach

    def visible(self, pose: Pose) -> View:
        view = super().visible(pose)
        less = self.reach - view.mask.shape[0] // 2
        return View(view.row0 - less, view.col0 - less, np.pad(view.mask, less))


def changing(change: Any, **flags: Any) -> type[Whole]:
    return type("Changed", (Whole,), {"changed": lambda _, view, pose: change(view, pose), **flags})


BROKEN: dict[str, Any] = {
    "one pose has one view; from (": Random,
    "points are not as before. Use no clock": Counting,
    "the qualities of ": Fading,
    "all_round says that headings change nothing; from (": Looking,
    "a robot sees what it faces; from (": Backwards,
    "m away and in sight, is not seen. Give a shorter sensor.range": Short,
    "in its middle": changing(lambda view, _: shifted(view, 1)),
    "bool of shape (25, 25) as mask": changing(lambda view, _: replace(view, mask=view.mask != 0)),
    "farther than the range of 6 m": changing(lambda view, _: replace(view, mask=np.ones_like(view.mask))),
    "without the robot's own point": changing(lambda view, _: replace(view, mask=np.zeros_like(view.mask))),
    "give more than 0 and at most 1": changing(lambda view, _: replace(view, quality=2.0 * view.mask), leaves_age=True),
    "its leaves_age is False": changing(lambda view, _: replace(view, quality=0.5 * view.mask)),
    "leaves_age is 1; give the class": changing(lambda view, _: view, leaves_age=1),
    "raised ZeroDivisionError: division by zero (test_sensor.py:": changing(lambda _, pose: 1 / (pose.x > 0.0)),
    "is not a class with a method visible(pose)": int,
}


@pytest.mark.parametrize("says", BROKEN)
def test_a_sensor_that_breaks_a_rule_is_named_with_pose_and_value(says: str) -> None:
    with pytest.raises(RuleBroken) as found:
        check_sensor(BROKEN[says])
    assert says in str(found.value)
    assert "\n" not in str(found.value)


def test_what_a_sensor_raises_is_the_cause() -> None:
    with pytest.raises(RuleBroken) as found:
        check_sensor(BROKEN["raised ZeroDivisionError: division by zero (test_sensor.py:"])
    assert isinstance(found.value.__cause__, ZeroDivisionError)


def test_options_are_validated() -> None:
    with pytest.raises(BadInput, match=r"sensor\.options\.angel = 3: unknown key; Quarter has the options angle"):
        check_sensor(Quarter, options={"angel": 3})
