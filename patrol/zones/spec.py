"""The scenario's zones: ground that matters more or less, that is slow, or that no body may enter.

    zones:
      - {name: vault, polygon: [[2, 2], [8, 2], [8, 6], [2, 6]], weight: 10, times: [[600, 1200]]}
      - {name: lobby, polygon: [[20, 2], [30, 2], [30, 9]], age: 60}
      - {name: ward, polygon: [[20, 12], [30, 12], [30, 19]], speed: 0.3}
      - {name: stairs, mask: keepout.yaml, keep_out: true}

A zone with times is in force in these alone, any other always. It is a polygon in metres, or the marked cells of a mask
in the format of Nav2's costmap filters. A mask is read when the scenario is loaded, and the loaded scenario holds its
cells. So a loaded scenario needs no mask's file.
"""

from __future__ import annotations

import base64
import binascii
import math
import zlib
from bisect import bisect_right
from collections.abc import Iterable
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from patrol.areas import MOST_TIMES, Spans, check_spans, has_area, is_in_one_of, listed_in_file
from patrol.errors import BadInput
from patrol.exchange import LEAST_WEIGHT, MOST_WEIGHT, MOST_ZONES
from patrol.ground.marks import Look, Mark, Moment, mark_ground
from patrol.ground.shapes import cover, touched_points
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.maps.map_file import read_map_file
from patrol.values import (
    Corner,
    Flag,
    Name,
    NotNegative,
    Polygon,
    Positive,
    Section,
    absolute,
    at_most,
    expecting,
    wrong,
)

MOST_CELLS = 25_000_000
"""Cells of the largest mask."""

MOST_TEXT = 400_000
"""Characters of the longest text of a mask's cells."""

ELSEWHERE = "elsewhere"
"""What figures call the ground in no zone."""

Cells = Annotated[str, Field(max_length=MOST_TEXT), expecting("the cells of a mask, as fogwatch writes them")]
Weight = Annotated[
    float,
    Field(ge=LEAST_WEIGHT, le=MOST_WEIGHT, strict=True),
    expecting(f"a number from {LEAST_WEIGHT:g} to {MOST_WEIGHT:g}", bare=True),
]

Weights = Annotated[tuple[tuple[NotNegative, Weight], ...], at_most(MOST_TIMES, "weights")]

MOST_NAMED = 4
"""Times of a zone that are named to people, at most, and its later weights."""

Weighing = frozenset[tuple[str, float | None]]
"""The zones in force whose ages count otherwise than elsewhere: the name and weight of each, None for a wanted age."""

Side = Annotated[int, Field(ge=1, le=MOST_CELLS, strict=True), expecting("a number of cells above 0")]


class MaskSpec(Section):
    """The marked cells of a mask, the lowest row first."""

    resolution: Positive = Field(description="m, side of a cell")
    origin: Corner = Field(description="m, [x, y] of the lower left corner")
    rows: Side = Field(description="number of rows")
    columns: Side = Field(description="number of columns")
    cells: Cells = Field(description="one bit per cell, compressed with zlib and written in base64")

    @model_validator(mode="after")
    def _holds_all_cells(self) -> Self:
        if self.rows * self.columns > MOST_CELLS:
            raise wrong(
                "", f"has {self.rows} x {self.columns} cells, and at most {MOST_CELLS} are read; make it coarser"
            )
        if self._packed_cells() is None:
            raise wrong("cells", f"are not {self.rows} x {self.columns} cells; name the mask's YAML file again")
        return self

    @classmethod
    def of(cls, file: Path) -> Self:
        """Read a mask in the format of Nav2's costmap filters."""
        from patrol.maps.cells import marked_cells  # here: loads the image library

        says = read_map_file(file)
        marked = marked_cells(says)
        if not marked.any():
            raise BadInput(f"{file}: marks no cell; correct the image, mode, negate or the thresholds")
        rows, columns = marked.shape
        cells = base64.b64encode(zlib.compress(np.packbits(marked).tobytes(), 9)).decode()
        if len(cells) > MOST_TEXT or marked.size > MOST_CELLS:
            raise BadInput(f"{file}: has too many cells or too fine a pattern for a zone; make the mask coarser")
        return cls(
            resolution=says.resolution, origin=says.corner(rows, columns), rows=rows, columns=columns, cells=cells
        )

    def marked(self) -> BoolGrid:
        """Return the marked cells, bool (rows, columns), the lowest row first."""
        bits = self._packed_cells()
        assert bits is not None
        count = self.rows * self.columns
        packed = np.frombuffer(bits, dtype=np.uint8)
        return np.unpackbits(packed, count=count).view(np.bool_).reshape(self.rows, self.columns)

    def _packed_cells(self) -> bytes | None:
        """Return the packed cells; None where the text does not hold as many."""
        size = (self.rows * self.columns + 7) // 8
        try:
            bits = zlib.decompressobj().decompress(base64.b64decode(self.cells, validate=True), size + 1)
        except (binascii.Error, ValueError, zlib.error):
            return None
        return bits if len(bits) == size else None


class ZoneSpec(Section):
    """A zone: where it is, and what holds there."""

    EXAMPLE = "{name: vault, polygon: [[2, 2], [8, 2], [8, 6]], weight: 10}"
    LATER = MappingProxyType(dict.fromkeys(("speed", "times", "weights")))

    name: Name = Field(description="the zone's name")
    polygon: Polygon | None = Field(None, description="m, [[x, y], ...]")
    mask: MaskSpec | None = Field(None, description="FILE.yaml in the format of Nav2's costmap filters, instead")
    keep_out: Flag | None = Field(None, description="true: no body may enter")
    weight: Weight | None = Field(None, description="a point's age counts so many times; 1 elsewhere")
    weights: Weights | None = Field(None, description="[[s, weight], ...], each from then on in place of weight")
    age: Positive | None = Field(None, description="s, that no point of it should exceed")
    speed: Positive | None = Field(None, description="m/s, top speed of bodies whose centre is in it")
    times: Spans | None = Field(None, description="s, [[from, to], ...] in which it is in force; always without any")

    @field_validator("mask", mode="before")
    @classmethod
    def _from_a_file(cls, value: Any, info: ValidationInfo) -> Any:
        if not isinstance(value, str):
            return value
        try:
            return MaskSpec.of(Path(absolute(value, info)))
        except BadInput as error:
            raise wrong("", str(error)) from None

    @model_validator(mode="after")
    def _says_one_thing(self) -> Self:
        if self.name == ELSEWHERE:
            raise wrong("name", f"{ELSEWHERE} is what figures call the ground in no zone; choose another name")
        if (self.polygon is None) == (self.mask is None):
            raise wrong("", f"{self.name}: exactly one is needed: a polygon or a mask")
        if self.polygon is not None and not has_area(self.polygon):
            raise wrong("polygon", f"{self.name}: its corners lie on one line, so it has no area; correct them")
        if self.keep_out is False:
            raise wrong("keep_out", f"{self.name}: is true or left out; drop it")
        rules = [self.keep_out, self.weight, self.age, self.speed]
        if len(rules) - rules.count(None) != 1:
            needed = "exactly one is needed: keep_out: true, a weight, an age or a speed"
            raise wrong("", f"{self.name}: {needed}")
        if self.keep_out and self.times is not None:
            raise wrong("times", f"{self.name}: a keep-out always holds; drop them, or make it one of closures")
        check_spans(self.times or (), "times", self.name)
        starts_s = [start_s for start_s, _ in self.weights or ()]
        if self.weight is None and self.weights is not None:
            raise wrong("weights", f"{self.name}: take the place of weight, which is missing; give it, or drop them")
        if sorted(set(starts_s)) != starts_s:
            raise wrong("weights", f"{self.name}: each begins later than the one before it; sort them")
        return self

    @property
    def weighs(self) -> bool:
        """True if its ages count otherwise than elsewhere: by a weight or a wanted age."""
        return self.weight is not None or self.age is not None

    def weight_at(self, time_s: float) -> float | None:
        """Return the weight at a time; None for a zone that has none."""
        changed = self.weights or ()
        index = bisect_right(changed, (time_s, math.inf))
        return changed[index - 1][1] if index else self.weight

    @property
    def kind(self) -> Literal["keepout", "slow", "weight"]:
        """The kind of zone, as maps tell them apart."""
        if self.keep_out:
            return "keepout"
        return "slow" if self.speed is not None else "weight"

    @property
    def label(self) -> str:
        """The name, and what holds there, as maps show it: ``vault x10``."""
        if self.keep_out:
            return f"{self.name}: keep out"
        if self.speed is not None:
            return f"{self.name} {self.speed:g} m/s"
        return f"{self.name} {self.age:g} s" if self.weight is None else f"{self.name} x{self.weight:g}"

    def label_at(self, time_s: float) -> str:
        """Return `label` with the weight at a time."""
        weight = self.weight_at(time_s)
        return self.label if weight is None else f"{self.name} x{weight:g}"

    def mark(self, terrain: Terrain, number: int) -> Mark | None:
        """Return the zone's outline."""
        del number
        return mark_ground(self.kind, self.name, self.label, points_of(self, terrain), terrain)

    def look(self, moment: Moment) -> Look:
        """Return what its mark looks like at a moment."""
        time_s = moment.time_s
        return Look(self.label_at(time_s), self.holds(time_s), weight=self.weight_at(time_s))

    @property
    def labels(self) -> str:
        """The label, and the later weights, for people: ``vault x10, x5 from 60 s``."""
        later = self.weights or ()
        suffix = f", and {len(later) - MOST_NAMED} more" if len(later) > MOST_NAMED else ""
        return (
            ", ".join([self.label, *(f"x{weight:g} from {start:g} s" for start, weight in later[:MOST_NAMED])]) + suffix
        )

    @property
    def when(self) -> str:
        """The times at which it is in force, for people: ``20 to 60 s, 80 to 90 s``."""
        if not self.times:
            return "always" if self.times is None else "never"
        suffix = f" and {len(self.times) - MOST_NAMED} times more" if len(self.times) > MOST_NAMED else ""
        return ", ".join(f"{first:g} to {end:g} s" for first, end in self.times[:MOST_NAMED]) + suffix

    def holds(self, time_s: float) -> bool:
        """Return True if the zone is in force at a time."""
        return self.times is None or is_in_one_of(self.times, time_s)


def zones_in_force(zones: Iterable[ZoneSpec], time_s: float) -> frozenset[str]:
    """Return the names of the zones that are in force at a time."""
    return frozenset(zone.name for zone in zones if zone.holds(time_s))


def weighing_at(zones: Iterable[ZoneSpec], time_s: float) -> Weighing:
    """Return the zones with weights or wanted ages that are in force at a time, with their weights then."""
    return frozenset((zone.name, zone.weight_at(time_s)) for zone in zones if zone.weighs and zone.holds(time_s))


Zones = Annotated[
    tuple[ZoneSpec, ...],
    at_most(MOST_ZONES, "zones"),
    listed_in_file("zones", "{name: vault, polygon: ..., weight: 10}"),
]


def points_of(zone: ZoneSpec, terrain: Terrain) -> BoolGrid:
    """Return the points that share some area with a zone.

    A zone's mask may have another resolution and another origin than the terrain.
    """
    if zone.polygon is not None:
        return cover(zone.polygon, terrain.shape, terrain.point, terrain.origin)
    mask = zone.mask
    assert mask is not None
    start = terrain.origin[0] - mask.origin[0], terrain.origin[1] - mask.origin[1]
    return touched_points(mask.marked(), mask.resolution, terrain.point, terrain.shape, start)
