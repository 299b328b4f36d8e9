"""Doubts about how a map is read: settings and images whose free ground is probably not what the map shows.

For example, maps of `map_saver` show unknown ground as grey 205, whose occupancy is 0.19608. With `free_thresh: 0.25`,
which older savers of Nav2 write, the rule makes it free, and robots would patrol ground that was never mapped.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from patrol.ground.cspace import parts_of
from patrol.ground.shapes import touched_points
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.maps.cells import BLOCK, LEVELS, Levels, MapImage, free_levels, occupancy_of, occupied_levels, read_image
from patrol.maps.map_file import MapFile, read_map_file

DARK = 0.15
"""Occupancy above which a grey that is read as free looks like one for unknown ground. White is 0, black 1."""

NOTABLE = 0.01
"""Share of the free cells from which on it is worth a word that they are doubtful."""

BLUR = 16
"""Greys by which the artefacts of a JPEG often change a pixel."""

SEVERAL = 4.0
"""Factor of more free cells that makes another value of a setting more likely than the one given."""

NEARLY_NOTHING = 0.05
"""Share of free cells that another setting must exceed to be likely."""

LIGHT = 0.05
"""Occupancy up to which a grey is white enough that other thresholds should make it free."""

BROAD = 0.75
"""Share of free cells with nothing but free cells around them, from which on ground is broader than walls are."""

SKEW = 0.01
"""Pixels of skew over the whole map from which on it is worth a word."""

MOSTLY = 0.5
"""Share of an image's pixels that are transparent from which on they are probably not meant."""

UNKNOWN_GREYS = (205, 206)
"""The greys of unknown ground in maps that `map_saver` writes; the second after some conversions."""


def doubts(terrain: Terrain) -> list[str]:
    """Describe the doubts about the reading of a terrain's map, each with the remedy, in one line.

    The map is read again. A terrain that was read from no map has no doubts.
    """
    if terrain.source is None:
        return []
    says = read_map_file(terrain.source)
    image = read_image(says)
    settings = (f"{says.path.name}: is this what the map shows? {text}" for text in _setting_doubts(says, image))
    # The dark greys of a JPEG may be artefacts, so its own warning goes first.
    greys = list(_jpeg_doubts(says, image)) or _dark_free_ground(says, image)
    return [*_image_elsewhere(says), *_skew(says, image), *greys, *settings]


def wrong_settings(says: MapFile, image: MapImage) -> str:
    """Return the end of an error about a map's settings where another setting would free several times more.

    It describes the cells, and is empty where nothing seems wrong.
    """
    return next(_setting_doubts(says, image), "")


def settings_text(says: MapFile, image: MapImage) -> str:
    """Return the end of an error: what a map's settings make of its cells, and the setting to correct."""
    return wrong_settings(says, image) or f"{_shares_text(says, image)}; correct negate, mode or the thresholds"


def perhaps_unknown(terrain: Terrain) -> BoolGrid:
    """Return the passable points with cells of a dark grey that is read as free; see `DARK`."""
    if terrain.source is None:
        return np.zeros(terrain.shape, dtype=np.bool_)
    says = read_map_file(terrain.source)
    image = read_image(says)
    levels = _dark_free_levels(says, image)
    if not levels.any():
        return np.zeros(terrain.shape, dtype=np.bool_)
    return touched_points(image.cells(levels), says.resolution, terrain.point, terrain.shape) & terrain.passable


def _image_elsewhere(says: MapFile) -> Iterator[str]:
    if says.image != says.path.parent / says.named_image:
        beside = f"{says.image.name} beside it is read"
        yield f"{says.path.name}: image = {says.named_image}: no such file; {beside}"


def _skew(says: MapFile, image: MapImage) -> Iterator[str]:
    if abs(says.skew) * max(image.greys.shape) > SKEW:
        yield f"{says.path.name}: origin: a yaw of {says.skew:g} rad counts as 0, less than a pixel over the whole map"


def _transparent(says: MapFile, image: MapImage) -> str:
    """Describe an image that is mostly transparent and hardly free; empty for any other."""
    share = 0.0 if image.opaque is None else 1.0 - float(np.mean(image.opaque))
    if share < MOSTLY or _free_share(says, image) > NEARLY_NOTHING:
        return ""
    return f"{_format_percent(share)} of its pixels are transparent, which counts as unknown; flatten it on white"


def _dark_free_levels(says: MapFile, image: MapImage) -> Levels:
    """Return the greys of the image that look like unknown ground and are read as free, if they make up much of it.

    Only in mode trinary: in the others greys are meant to differ. Where the saver's own grey is unknown and in the
    image, the greys beside it are only the rims that smoothing leaves.
    """
    free, counts = free_levels(says), image.histogram
    saved = LEVELS - 1 - UNKNOWN_GREYS[0] if says.negate else UNKNOWN_GREYS[0]
    if not free[saved] and counts[saved] > NOTABLE * counts.sum():
        return np.zeros_like(free)
    dark = free & (counts > 0) & (occupancy_of(says) > DARK)
    is_notable = counts[dark].sum() >= NOTABLE * counts[free].sum()
    return dark if is_notable and says.mode == "trinary" else np.zeros_like(free)


def _dark_free_ground(says: MapFile, image: MapImage) -> Iterator[str]:
    """Warn of dark greys that are read as free, with the threshold that makes nearly all of them unknown.

    Where that threshold would leave nearly nothing free, as on a floor that is drawn in such a grey, it is no remedy.
    """
    dark, counts = _dark_free_levels(says, image), image.histogram
    if not dark.any():
        return
    greys = np.flatnonzero(dark)
    named = f"grey {greys[0]}" if len(greys) == 1 else f"greys {greys[0]} to {greys[-1]}"
    free_count, dark_count = (int(counts[levels].sum()) for levels in (free_levels(says), dark))
    occupancy = occupancy_of(says)
    from_light = greys[np.argsort(occupancy[greys])]
    # As many as may stay free without another warning.
    is_enough = np.cumsum(counts[from_light]) > NOTABLE * min(dark_count, free_count - dark_count)
    threshold = float(occupancy[from_light[is_enough.argmax()]])
    cure = math.floor(1000.0 * threshold - 1e-6) / 1000.0
    cured = _Ground(replace(says, free_thresh=cure), image)
    cured_count = int(counts[free_levels(cured.says)].sum())
    meaning = f"unknown; if it does here, set free_thresh: {cure:g}"
    if cured_count < NOTABLE * free_count and cured.core < BROAD:  # a small room in a large image is broad
        meaning = (
            f"unknown, but then only {_area_m2(says, cured_count)} would be free; if it is floor here, draw it white"
        )
    yield (
        f"{says.path.name}: free_thresh = {says.free_thresh:g} reads {named} as free: {_area_m2(says, dark_count)} of "
        f"{_area_m2(says, free_count)} free ground. In most maps such grey means {meaning}"
    )


def _jpeg_doubts(says: MapFile, image: MapImage) -> Iterator[str]:
    """Warn of ground whose reading a JPEG's artefacts may have changed."""
    if not image.is_jpeg:
        return
    free, counts = free_levels(says), image.histogram
    steps = [np.roll(free, step) for step in (BLUR, -BLUR)]
    steps[0][:BLUR], steps[1][-BLUR:] = free[0], free[-1]
    unsure = np.where((free != steps[0]) | (free != steps[1]), counts, 0)
    if unsure.sum() >= NOTABLE * counts[free].sum():
        is_free, is_not = (_area_m2(says, int(unsure[levels].sum())) for levels in (free, ~free))
        yield (
            f"{says.image.name}: a JPEG, which blurs greys: {is_free} read as free and {is_not} read as not free lie "
            f"within {BLUR} greys of free_thresh; export the map as PNG or PGM"
        )


def _setting_doubts(says: MapFile, image: MapImage) -> Iterator[str]:
    """Describe the shares of cells, and the setting whose other value is more likely; nothing where none is."""
    if transparent := _transparent(says, image):
        yield transparent
        return
    now = _Ground(says, image)
    negated = _Ground(replace(says, negate=not says.negate), image)
    light = now.share
    if says.mode != "raw":
        light += float(image.histogram[~free_levels(says) & (occupancy_of(says) <= LIGHT)].sum() / image.greys.size)
    freed = {
        "mode: trinary": _free_share(replace(says, mode="trinary"), image),
        "free_thresh: 0.196 and occupied_thresh: 0.65": light,
    }
    if says.mode != "raw" and _is_inverted(now, negated):
        freed = {f"negate: {int(not says.negate)}": negated.share}
    best = max(freed, key=lambda spelled: freed[spelled])
    if "negate" in best or freed[best] > max(SEVERAL * now.share, NEARLY_NOTHING):
        remedy = "if the image shows something else, correct negate, mode or the thresholds"
        yield f"{_shares_text(says, image)}; {remedy} ({best} would make {_format_percent(freed[best])} free)"


def _border_of(grid: NDArray[Any]) -> NDArray[Any]:
    return np.concatenate((grid[0], grid[-1], grid[:, 0], grid[:, -1]))


@dataclass(frozen=True, eq=False)
class _Ground:
    """The free cells of one reading of a map."""

    says: MapFile
    image: MapImage

    @property
    def cells(self) -> BoolGrid:
        return self.image.cells(free_levels(self.says))

    @property
    def share(self) -> float:
        return _free_share(self.says, self.image)

    @property
    def core(self) -> float:
        """Share of the free cells around which all cells are free: of lines as thin as walls, nearly none."""
        inner, levels = 0, free_levels(self.says)
        for first in range(0, len(self.image.greys) - 2, BLOCK):
            free = self.image.rows(first, first + BLOCK + 2).cells(levels)
            rows = free[:-2] & free[1:-1] & free[2:]
            inner += int(np.count_nonzero(rows[:, :-2] & rows[:, 1:-1] & rows[:, 2:]))
        return float(inner / max(self.image.histogram[levels].sum(), 1))

    @property
    def border(self) -> float:
        """Share of the cells at the image's border that are free."""
        free = free_levels(self.says)[_border_of(self.image.greys)]
        if self.image.opaque is not None:
            # A transparent pixel is unknown, whatever colour it has.
            free &= _border_of(self.image.opaque)
        return float(np.mean(free))

    @property
    def is_one_piece(self) -> bool:
        """True if most of the free cells hang together."""
        labels, count = parts_of(self.cells)
        sizes = np.bincount(labels.reshape(-1), minlength=count + 1)[1:]
        return count > 0 and bool(sizes.max() > 0.5 * sizes.sum())


def _is_inverted(now: _Ground, negated: _Ground) -> bool:
    """Return whether a map's free ground is probably what is occupied now.

    Free ground that consists of thin lines is walls. Thick walls are recognised beside a saver's grey for unknown
    ground, which is inverted where `negate: 0` is wrong. Then there must be a broad floor as well, not at the border,
    since drawings have walls in any grey. Savers write no `negate: 1`, so where it is set, less is needed: that grey,
    or free ground all around one piece that is occupied.
    """
    # Whatever speaks against the reading, its opposite must show a floor.
    if negated.share <= NEARLY_NOTHING or negated.core < BROAD:
        return False
    is_mostly_lines = now.core < 0.5 or (now.core < BROAD and now.share < NEARLY_NOTHING)
    if is_mostly_lines or (negated.share > SEVERAL * now.share and negated.border < 0.5):
        return True
    counts, greys = now.image.histogram, np.array(UNKNOWN_GREYS)
    has_unknown = bool(counts[greys if now.says.negate else LEVELS - 1 - greys].sum() > NOTABLE * counts.sum())
    if not now.says.negate:
        floor = _Ground(replace(negated.says, free_thresh=min(negated.says.free_thresh, DARK)), now.image)
        is_floor = floor.share > NEARLY_NOTHING and floor.core >= BROAD and floor.border < 0.5
        return has_unknown and is_floor and now.says.mode == "trinary"
    if has_unknown:
        return True
    return now.border > 0.9 and negated.border < 0.1 and negated.is_one_piece


def _free_share(says: MapFile, image: MapImage) -> float:
    return float(image.histogram[free_levels(says)].sum() / image.greys.size)


def _shares_text(says: MapFile, image: MapImage) -> str:
    free = _free_share(says, image)
    occupied = float(image.histogram[occupied_levels(says)].sum() / image.greys.size)
    unknown = max(1.0 - free - occupied, 0.0)
    return (
        f"negate = {str(says.negate).lower()}, mode = {says.mode}, free_thresh = {says.free_thresh:g} and "
        f"occupied_thresh = {says.occupied_thresh:g} make {_format_percent(free)} of its cells free, "
        f"{_format_percent(occupied)} occupied and {_format_percent(unknown)} unknown"
    )


def _format_percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"


def _area_m2(says: MapFile, cells: int) -> str:
    return f"{cells * says.resolution**2:.1f} m²"
