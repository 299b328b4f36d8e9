"""The roster: one `RobotSpec` for each robot that a scenario names, whether it lists them or gives a group."""

from __future__ import annotations

from dataclasses import dataclass, field

from patrol.pose import Limits, Pose, wrap
from patrol.scenario.sections import BatterySpec, Body, RobotEntry, RobotGroup
from patrol.values.types import Kind


@dataclass(frozen=True, slots=True)
class RobotSpec:
    """One robot of the roster.

    Attributes:
        number: 1..N.
        name: Unique.
        model: Of its body.
        speed: m/s, top speed.
        radius: m.
        turning_radius: m.
        start: None for a random one.
        spare: It is absent until it joins.
        battery: None for one that never gets empty.
        section: Dotted field of the scenario that describes it: ``robots`` of a group, ``robots.0`` of a list.
    """

    number: int
    name: str
    model: Kind
    speed: float
    radius: float
    turning_radius: float
    start: Pose | None
    spare: bool = False
    battery: BatterySpec | None = None
    section: str = field(default="robots", compare=False)

    @property
    def limits(self) -> Limits:
        """The bounds of the body's commands."""
        return Limits(self.speed, self.radius, self.turning_radius)


def roster_of(robots: RobotGroup | tuple[RobotEntry, ...]) -> list[RobotSpec]:
    """List the robots of a scenario in the order of their numbers, 1..N.

    Args:
        robots: The scenario's section `robots`.
    """
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
