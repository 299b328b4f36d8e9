"""The scenario's sections: terrain, robots, sensor, patrol and intruders, with units and defaults."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, Self

from pydantic import ConfigDict, Field, Tag, ValidationInfo, field_validator, model_validator

from patrol.scenario.policy_file import PAPER, policy_file
from patrol.values.section import Section, absolute, wrong
from patrol.values.types import (
    AUTO,
    MAX_ROBOTS,
    SEPARATIONS,
    AutoNotNegative,
    AutoPositive,
    Builtin,
    Corner,
    Count,
    Degrees,
    Digest,
    Exponent,
    Flag,
    Kind,
    NotNegative,
    PathText,
    PolicyText,
    Polygons,
    Positive,
    Probability,
    Quality,
    RobotName,
    Sectors,
    Separation,
    Spares,
    Start,
    Starts,
    Tolerance,
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


class PatrolSpec(Section):
    """How a robot decides where to go."""

    policy: PolicyText = Field(
        PAPER, description="potential-field | package.module:Class | ./file.py:Class beside this file | an entry point"
    )
    policy_sha256: Digest | None = Field(None, description="of the policy's file; filled in when this file is loaded")
    options: dict[str, Any] | None = Field(None, description="settings of a policy of one's own, by name")
    fow: Literal["f1", "f2", "f3", "f4", "f5"] = Field("f3", description="f1..f5, force of a point's staleness")
    distance: Literal["g1", "g2", "g3", "g4", "g5"] = Field("g4", description="g1..g5, fall of the force with distance")
    alpha: Exponent = Field(40.0, description="weight of staleness in f")
    beta: Positive = Field(4000.0, description="spread of g4, in squared points of 0.1 m for any `point`")
    length: Positive = Field(800.0, description="l of g3 and g5, in points of 0.1 m for any `point`")
    paths: Literal["wave", "straight", "regions"] = Field(
        "wave", description="wave (round obstacles) | straight | regions (straight within convex regions)"
    )
    regions: Polygons | None = Field(None, description="m, convex polygons; null: found automatically")
    commitment: Literal["none", "target"] = Field(
        "target", description="target (go to one place until it is seen) | none (a direction chosen anew at each tick)"
    )
    direction: Literal["mode", "vector"] = Field(
        "mode", description="mode (strongest sector) | vector (sum), without commitment"
    )
    sectors: Sectors = Field(8, description="number of sectors that mode chooses from, without commitment")
    reach: Literal["paper", "area"] = Field(
        "paper", description="paper | area (farther on larger ground), how far g reaches without commitment"
    )
    dilatation: AutoNotNegative = Field(
        AUTO, description="m, how far staleness spreads without commitment; 0: not at all; auto: 5 radii"
    )
    avoidance: Literal["none", "goal-refinement", "fuzzy"] = Field(
        "goal-refinement", description="none | goal-refinement | fuzzy (mode only), without commitment"
    )
    separation: Separation = Field("claims", description=SEPARATIONS)
    random_move: Probability = Field(
        0.02, description="probability of a random step in a tick, so that patrols stay unpredictable"
    )
    random_move_for: Literal["holonomic", "all"] = Field(
        "all", description="holonomic | all, the bodies that make random steps; the paper's cars make none"
    )
    give_way: Flag = Field(True, description="of two robots that bumped, one goes round the other")
    manoeuvres: Flag = Field(
        True, description="cars make three-point turns and back out; all find back to the ground of routes"
    )
    claim_width: Positive = Field(0.3, description="m, width s of the claims")
    obstacle_radius: AutoPositive = Field(
        AUTO, description="m, of the artificial obstacle at each other robot; auto: 5 radii"
    )
    critical_areas: Polygons | None = Field(None, description="m, polygons; null: narrow passages")
    critical_width: AutoPositive = Field(
        AUTO, description="m, passages narrower than this are critical areas; auto: 8 radii"
    )
    repulsion: NotNegative = Field(0.5, description="repulsion of a robot nearby, as a share of all attraction")
    repulsion_reach: Positive = Field(10.0, description="m, distance over which the repulsion falls")
    fuzzy_distance: AutoPositive = Field(
        AUTO, description="m, R_0: nearer obstacles weaken their sector; auto: 5.5 radii"
    )
    goal_distance: AutoPositive = Field(
        AUTO, description="m, from the robot to its goal; auto: 2.5 strides, at least 5.5 radii"
    )
    refine_side: AutoPositive = Field(
        AUTO, description="m, side of the square in which the goal is refined; auto: 2 radii"
    )
    refine_reach: AutoPositive = Field(
        AUTO, description="m, reach of the obstacle field psi that refines the goal; auto: 10 radii"
    )
    surround_distance: AutoPositive = Field(
        AUTO, description="m, from an intruder to the robots around it; auto: 8 radii, at most 0.8 sensor ranges"
    )
    surround_repulsion: NotNegative = Field(0.3, description="repulsion of a robot nearby, as a share of attraction")
    contact_memory: NotNegative = Field(
        5.0, description="s after the last report of an intruder until patrolling resumes"
    )
    tolerance: Tolerance = Field(1e-16, description="relative error by leaving out far points; 0: none left out")

    @field_validator("policy")
    @classmethod
    def _from_the_files_folder(cls, value: str, info: ValidationInfo) -> str:
        path = policy_file(value)
        return value if path is None else f"{absolute(str(path), info)}:{value.rpartition(':')[2]}"

    @property
    def separations(self) -> tuple[str, ...]:
        """The mechanisms in use, none when there are none."""
        chosen = (self.separation,) if isinstance(self.separation, str) else self.separation
        return tuple(name for name in chosen if name != "none")

    @model_validator(mode="after")
    def _a_file_has_a_hash(self) -> Self:
        if self.policy_sha256 is not None and policy_file(self.policy) is None:
            raise wrong("policy_sha256", "only a policy that is a file has a hash; drop it")
        return self

    @model_validator(mode="after")
    def _fuzzy_weakens_sectors(self) -> Self:
        if self.avoidance == "fuzzy" and self.direction != "mode":
            raise wrong("avoidance", "fuzzy weakens sectors, and patrol.direction is vector; set it to mode")
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
