"""The roster: one `RobotSpec` for each robot that a scenario names, whether it lists them or gives a group."""

from __future__ import annotations

from dataclasses import dataclass, field

from patrol.pose import Limits, Pose, wrap
from patrol.scenario.sections import BatterySpec, Body, RobotEntry, RobotGroup
from patrol.values.types import Kind


@dataclass(frozen=True, slots=True)
class RobotSpec:
    """One robot of the roster."""

    number: int  # 1..N
    name: str  # unique
    model: Kind
    speed: float  # m/s, top speed
    radius: float  # m
    turning_radius: float  # m
    start: Pose | None  # None for a random one
    spare: bool = False  # absent until it joins
    battery: BatterySpec | None = None  # None for one that never gets empty
    # dotted field of the scenario that describes it: ``robots`` of a group, ``robots.0`` of a list
    section: str = field(default="robots", compare=False)

    @property
    def limits(self) -> Limits:
        """The bounds of the body's commands."""
        return Limits(self.speed, self.radius, self.turning_radius)


def roster_of(robots: RobotGroup | tuple[RobotEntry, ...]) -> list[RobotSpec]:
    """List the robots of a scenario in the order of their numbers, 1..N."""
    if not isinstance(robots, tuple):
        starts = () if robots.starts == "random" else robots.starts
        poses = [*map(_pose, starts), *[None] * (robots.whole - len(starts))]
        return [_spec(number, robots, pose, number > robots.count) for number, pose in enumerate(poses, start=1)]
    return [
        _spec(
            number,
            entry,
            None if entry.start == "random" else _pose(entry.start),
            bool(entry.spare),
            name=entry.name,
            section=f"robots.{number - 1}",
        )
        for number, entry in enumerate(robots, start=1)
    ]


def _spec(
    number: int, body: Body, start: Pose | None, spare: bool, name: str | None = None, section: str = "robots"
) -> RobotSpec:
    name = name or f"r{number}"
    shape = body.model, body.speed, body.radius, body.turning_radius
    return RobotSpec(number, name, *shape, start, spare, body.battery, section)


def _pose(place: tuple[float, ...]) -> Pose:
    x, y, heading = (*place, 0.0)[:3]
    return Pose(x, y, wrap(heading))
