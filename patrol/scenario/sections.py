"""The scenario's sections terrain, robots, docks, sensor and intruders, with units and defaults."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Final, Self

from pydantic import ConfigDict, Field, Tag, ValidationInfo, field_validator, model_validator

from patrol.classes.class_file import ClassSection, class_check
from patrol.energy.spec import BatterySpec
from patrol.errors import BadInput
from patrol.graph import PIXEL, VISIT_M, read_graph
from patrol.maps.map_file import map_meaning, read_map_file
from patrol.pose import MODELS, TURNS_IN_ARCS, Limits, Pose, wrap
from patrol.values import (
    MAX_ROBOTS,
    Builtin,
    ClassText,
    Corner,
    Count,
    Degrees,
    Digest,
    Flag,
    Kind,
    NotNegative,
    PathText,
    Patrolled,
    Polygons,
    Positive,
    Quality,
    RobotName,
    Section,
    Spares,
    Start,
    Starts,
    absolute,
    at_least,
    by_shape,
    digest_of,
    wrong,
)

if TYPE_CHECKING:
    from patrol.ground.terrain import Terrain

GROUND: Final = "ground"
VERTICES: Final = "vertices"
"""Values of `terrain.patrolled`: all ground that robots can see, or the vertices of the terrain's graph."""

MAP = "map"
"""The folder of a run's folder that keeps the map."""

DEFAULT_RADIUS = 1.0
"""Radius of the paper's body, m."""


class GraphSpec(Section):
    """A graph of the terrain: places, and the ways between neighbours."""

    LATER = MappingProxyType({"visit": VISIT_M})

    vertices: tuple[Corner, ...] = Field(min_length=1, description="m, [x, y] of each vertex")
    edges: tuple[tuple[int, int, Positive], ...] = Field((), description="[vertex, vertex, m], each edge once")
    pixel: Positive = Field(PIXEL, description="m, side of a pixel, in which constants of the literature count")
    visit: Positive = Field(VISIT_M, description="m, within which a robot visits a vertex")

    @model_validator(mode="after")
    def _edges_join_vertices(self) -> Self:
        for first, last, _ in self.edges:
            if not 0 <= first < len(self.vertices) or not 0 <= last < len(self.vertices) or first == last:
                raise wrong("edges", f"[{first}, {last}] joins no two of the {len(self.vertices)} vertices; correct it")
        return self


def _image_of(map_file: str | None) -> tuple[int, int] | None:
    """Return the width and height of a map's image; None without a map, and where it cannot be read."""
    if map_file is None:
        return None
    from patrol.maps.cells import image_size  # here: few scenarios have graphs

    try:
        rows, columns = image_size(read_map_file(Path(map_file)))
    except BadInput:
        return None
    return columns, rows


class TerrainSpec(Section):
    """The terrain of the patrol: a built-in one by name, or a map_server YAML file."""

    LATER = MappingProxyType({"graph": None, "patrolled": GROUND})

    builtin: Builtin | None = Field(None, description="a built-in terrain, instead of a map")
    map: PathText | None = Field(None, description="map_server YAML file, relative to this file")
    graph: GraphSpec | None = Field(
        None,
        description="FILE.graph of patrolling_sim, Open-RMF's FILE.yaml, Nav2's FILE.geojson, {file: FILE, visit: M}, "
        "or vertices and edges; null: made from the ground if needed",
    )
    patrolled: Patrolled = Field(GROUND, description="ground: all that robots can see | vertices: those of graph")
    keep_out: Polygons = Field((), description="m, polygons [[x, y], ...] that no body may enter")

    @field_validator("graph", mode="before")
    @classmethod
    def _from_a_file(cls, value: Any, info: ValidationInfo) -> Any:
        entry = {"file": value} if isinstance(value, str) else value
        if not isinstance(entry, dict) or "file" not in entry:
            return value
        settings = {key: entry[key] for key in entry if key != "file"}
        file = entry["file"]
        if not isinstance(file, str) or settings.keys() & {"vertices", "edges"}:
            raise wrong("", "expected FILE.graph, {file: FILE.graph, visit: M}, or vertices and edges without a file")
        try:
            return {**read_graph(Path(absolute(file, info)), _image_of(info.data.get("map"))), **settings}
        except BadInput as error:
            raise wrong("", str(error)) from None

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        if (self.builtin is None) == (self.map is None):
            raise wrong("", "exactly one is needed: {builtin: NAME} or {map: FILE.yaml}")
        return self

    @model_validator(mode="after")
    def _vertices_of_a_graph(self) -> Self:
        if self.patrolled == VERTICES and self.graph is None:
            raise wrong("patrolled", "vertices: there is no graph; set terrain.graph, or drop patrolled")
        return self

    def reduce(self, says: dict[str, Any], files: bool) -> None:
        """Let a map enter by its content."""
        super().reduce(says, files)
        if not files:
            says["map"] = self.map is not None
        elif self.map is not None:
            says["map"] = digest_of(map_meaning(Path(self.map)))

    def with_copies(self, folder: Path) -> Self:
        """Copy the map."""
        if self.map is None:
            return self
        source = read_map_file(Path(self.map))
        (folder / MAP).mkdir()
        source.copy_to(folder / MAP)
        return self.model_copy(update={"map": f"{MAP}/{source.path.name}"})


class Body(Section):
    """The body of a robot."""

    model: Kind = Field("car", description=f"body model: {' | '.join(MODELS)}")
    speed: Positive = Field(4.4, description="m/s, top speed")
    radius: Positive = Field(DEFAULT_RADIUS, description="m, of the round body")
    turning_radius: Positive = Field(3.5, description="m, tightest turn of a car (unused by other models)")
    battery: BatterySpec | None = Field(
        None, description="{capacity: Wh, idle: W, drive: J per m, charge: W, start, full, reserve}; null: never empty"
    )


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
            most_spares = MAX_ROBOTS - self.count
            raise wrong("spare", f"there may be {MAX_ROBOTS} robots in all; give at most {most_spares}", self.spare)
        return self

    @property
    def whole(self) -> int:
        """Number of robots with the spare ones, which come last."""
        return self.count + (self.spare or 0)


class RobotEntry(Body):
    """One robot of a list."""

    name: RobotName | None = Field(None, description="default: r1, r2, ... by place in the list")
    start: Start = Field("random", description="random, [x, y] or [x, y, heading] (m, rad; default heading: 0)")
    spare: Flag | None = Field(None, description="true: absent until it joins")


RobotList = Annotated[tuple[RobotEntry, ...], Field(max_length=MAX_ROBOTS), at_least(1, "robots")]
_GROUP_OR_LIST = "a group of equal robots, {count: 5, model: car, ...}, or a list with one entry per robot"
Robots = Annotated[
    Annotated[RobotGroup, Tag("=mapping")] | Annotated[RobotList, Tag("=list")], by_shape(_GROUP_OR_LIST)
]


RADIANS_WITHIN = 0.005
"""An angle of view this near to a multiple of pi / 2 is taken for one in radians, such as 6.28 for all round."""


DISC, SECTOR = "disc", "sector"
BUILT_IN_SENSORS = (SECTOR, DISC)
"""Kinds of sensors that come with fogwatch."""


class SensorSpec(ClassSection):
    """A robot's sensor.

        sensor: {range: 8, angle: 90}                                       a sector
        sensor: {kind: ./mine.py:Mine, range: 8, options: {across: 3}}      a sensor of one's own

    `range` and `line_of_sight` hold for every kind: they decide what the robots can ever see (`patrol.ground.fields`).
    """

    NAMED = "sensor.kind"
    SORT = "sensor"

    kind: Annotated[ClassText, class_check("sector, disc")] = Field(
        SECTOR,
        description="sector (with angle: 360, a disc) | disc | package.module:Class | ./file.py:Class | entry point",
    )
    kind_sha256: Digest | None = Field(None, description="of the sensor's file; filled in when this file is loaded")
    options: dict[str, Any] | None = Field(None, description="settings of a sensor of one's own, by name")
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

    @model_validator(mode="after")
    def _settings_have_effect(self) -> Self:
        if self.kind in BUILT_IN_SENSORS:
            if self.options is not None:
                raise wrong("options", f"are those of a sensor of one's own, and kind is {self.kind}; drop them")
            if self.kind == DISC and self.angle != 360.0:
                raise wrong("angle", f"a {DISC} looks all round; set kind to {SECTOR}, or drop the angle", self.angle)
        else:
            for field in ("angle", "quality"):
                if getattr(self, field) != type(self).model_fields[field].default:
                    remedy = f"drop it, or name it in sensor.options if {self.kind.rpartition(':')[2]} has such a one"
                    raise wrong(field, f"is a setting of the kinds {' and '.join(BUILT_IN_SENSORS)}; {remedy}")
        return self

    def reduce(self, says: dict[str, Any], files: bool) -> None:
        """Leave out what a built-in sensor does not need: its other settings say it all."""
        super().reduce(says, files)
        if self.kind in BUILT_IN_SENSORS:
            del says["kind"], says["options"]


class IntruderSpec(Section):
    """An intruder: it stands on the terrain for a while, is seen by sensors, and blocks no robot."""

    EXAMPLE = "{place: [10, 10], at: 60}"

    model_config = ConfigDict(serialize_by_alias=True)

    place: Corner = Field(description="m, [x, y]")
    at: NotNegative = Field(0.0, description="s, when it comes")
    stay: Positive | None = Field(None, alias="for", description="s, how long it stays; null: to the end")

    def is_there(self, time_s: float) -> bool:
        """Return True if it is on the terrain."""
        return self.at <= time_s and (self.stay is None or time_s < self.at + self.stay)

    def check_place(self, terrain: Terrain, field: str) -> None:
        """Refuse an intruder that does not stand on passable ground."""
        x, y = self.place
        where = f"{field} = [{x:g}, {y:g}]"
        if not terrain.contains(x, y):
            raise BadInput(f"{where}: not on {terrain.name}, which {terrain.span}; move it there")
        if not terrain.passable[terrain.point_at(x, y)]:
            raise BadInput(f"{where}: in an obstacle of {terrain.name}; move it to passable ground")


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

    @property
    def meaning(self) -> list[Any]:
        """The values that enter a scenario's hash."""
        start = None if self.start is None else [self.start.x, self.start.y, self.start.heading]
        turning = self.turning_radius if self.model in TURNS_IN_ARCS else None
        meaning = [self.name, self.model, self.speed, self.radius, turning, start]
        if self.spare:
            meaning.append("spare")
        if self.battery is not None:
            meaning.append(self.battery.model_dump(mode="json"))
        return meaning


def roster_of(robots: RobotGroup | tuple[RobotEntry, ...]) -> list[RobotSpec]:
    """List the robots of a scenario in the order of their numbers, 1..N."""
    if not isinstance(robots, tuple):
        explicit = () if robots.starts == "random" else robots.starts
        starts = [*explicit, *["random"] * (robots.whole - len(explicit))]
        return [_make_spec(number, robots, start, number > robots.count) for number, start in enumerate(starts, 1)]
    return [
        _make_spec(number, entry, entry.start, bool(entry.spare), entry.name, f"robots.{number - 1}")
        for number, entry in enumerate(robots, 1)
    ]


def _make_spec(
    number: int,
    body: Body,
    start: tuple[float, ...] | str,
    spare: bool,
    name: str | None = None,
    section: str = "robots",
) -> RobotSpec:
    pose = None
    if not isinstance(start, str):
        x, y, heading = (*start, 0.0)[:3]
        pose = Pose(x, y, wrap(heading))
    shape = body.model, body.speed, body.radius, body.turning_radius
    return RobotSpec(number, name or f"r{number}", *shape, pose, spare, body.battery, section)
