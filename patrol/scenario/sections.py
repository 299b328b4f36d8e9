"""The scenario's sections terrain, robots, sensor and intruders, with units and defaults."""

from __future__ import annotations

import math
from typing import Annotated, Self

from pydantic import ConfigDict, Field, Tag, ValidationInfo, field_validator, model_validator

from patrol.values.section import Section, absolute, wrong
from patrol.values.types import (
    MAX_ROBOTS,
    Builtin,
    Corner,
    Count,
    Degrees,
    Flag,
    Kind,
    NotNegative,
    PathText,
    Polygons,
    Positive,
    Quality,
    RobotName,
    Spares,
    Start,
    Starts,
    at_least,
    by_shape,
)

DEFAULT_RADIUS = 1.0
"""Radius of the paper's body, m."""


class TerrainSpec(Section):
    """Where the robots patrol: a built-in terrain by name, or a map_server YAML file."""

    builtin: Builtin | None = Field(None, description="a built-in terrain, instead of a map")
    map: PathText | None = Field(None, description="map_server YAML file, relative to this file")
    keep_out: Polygons = Field((), description="m, polygons [[x, y], ...] that no body may enter")

    @field_validator("map")
    @classmethod
    def _from_the_files_folder(cls, value: str | None, info: ValidationInfo) -> str | None:
        return absolute(value, info)

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        if (self.builtin is None) == (self.map is None):
            raise wrong("", "exactly one is needed: {builtin: NAME} or {map: FILE.yaml}")
        return self


class Body(Section):
    """The body of a robot."""

    model: Kind = Field("car", description="body model: car | differential | holonomic")
    speed: Positive = Field(4.4, description="m/s, top speed")
    radius: Positive = Field(DEFAULT_RADIUS, description="m, of the round body")
    turning_radius: Positive = Field(3.5, description="m, tightest turn of a car (unused by other models)")


class RobotGroup(Body):
    """Robots of one kind."""

    count: Count = Field(5, description="number of robots")
    spare: Spares | None = Field(None, description="number of spare robots, which may join later; null: none")
    starts: Starts = Field("random", description="random, or [x, y] or [x, y, heading] (m, rad) of the first robots")

    @model_validator(mode="after")
    def _no_more_starts_than_robots(self) -> Self:
        if self.starts != "random" and len(self.starts) > self.whole:
            raise wrong("starts", f"{len(self.starts)} starts for {self.whole} robots; raise count or remove some")
        return self

    @model_validator(mode="after")
    def _no_more_than_there_may_be(self) -> Self:
        if self.whole > MAX_ROBOTS:
            most = MAX_ROBOTS - self.count
            raise wrong("spare", f"there may be {MAX_ROBOTS} robots in all; give at most {most}", self.spare)
        return self

    @property
    def whole(self) -> int:
        """How many there are with the spare ones, which come last."""
        return self.count + (self.spare or 0)


class RobotEntry(Body):
    """One robot of a list."""

    name: RobotName | None = Field(None, description="default: r1, r2, ... by place in the list")
    start: Start = Field("random", description="random, [x, y] or [x, y, heading] (m, rad; default heading: 0)")
    spare: Flag | None = Field(None, description="true: absent until it joins")


RobotList = Annotated[
    tuple[RobotEntry, ...],
    Field(max_length=MAX_ROBOTS, json_schema_extra={"minItems": 1}),
    at_least(1, "robots"),
]
_GROUP_OR_LIST = "a group of equal robots, {count: 5, model: car, ...}, or a list with one entry per robot"
Robots = Annotated[
    Annotated[RobotGroup, Tag("=mapping")] | Annotated[RobotList, Tag("=list")],
    by_shape(_GROUP_OR_LIST),
]


RADIANS_WITHIN = 0.005
"""An angle of view this near to a multiple of pi / 2 is taken for one in radians, such as 6.28 for all round."""


class SensorSpec(Section):
    """What a robot sees."""

    range: Positive = Field(10.0, description="m, range of view")
    angle: Degrees = Field(360.0, description="degrees, angle of view, centred on the heading")
    line_of_sight: Flag = Field(True, description="obstacles block the view")
    quality: Quality = Field(1.0, description="share of a point's age that a look removes, or [[m, share], ...]")

    @model_validator(mode="after")
    def _angle_in_degrees(self) -> Self:
        for degrees in (90, 180, 270, 360):
            if abs(self.angle - math.radians(degrees)) < RADIANS_WITHIN:
                problem = f"is {degrees} degrees in radians, and this angle is in degrees; give {degrees}"
                raise wrong("angle", f"{problem}, or {round(self.angle, 1):g} for so narrow a view", self.angle)
        return self


class IntruderSpec(Section):
    """Somebody who stands on the terrain for a while, is seen by sensors, and blocks nobody."""

    model_config = ConfigDict(serialize_by_alias=True)

    place: Corner = Field(description="m, [x, y]")
    at: NotNegative = Field(0.0, description="s, when it comes")
    stay: Positive | None = Field(None, alias="for", description="s, how long it stays; null: to the end")

    def is_there(self, time_s: float) -> bool:
        """Whether it is on the terrain.

        Args:
            time_s: s.
        """
        return self.at <= time_s and (self.stay is None or time_s < self.at + self.stay)
