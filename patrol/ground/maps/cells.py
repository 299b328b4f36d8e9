"""The cells of a map: which pixels of its image are free, and what its settings make of all of them."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import BinaryIO, cast

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError
from PIL.ImageFile import ImageFile

from patrol.errors import BadInput
from patrol.files.untrusted import IMAGE, open_untrusted
from patrol.ground.maps.map_file import MapFile
from patrol.ground.terrain import BoolGrid

FORMATS = ("PPM", "PNG", "BMP", "JPEG")
MAX_CELLS = 100_000_000

TOLERANCE = 1e-6
"""Overlaps thinner than this (in cells) are rounding and do not count."""

QUANTA = 65535
"""The scale on which the map server adds a pixel's channels."""

MOST_READS = 1 << 16
"""Times that a decoder may read from an image, and once more for each `BYTES_A_READ` of the file. Decoders read
comments and markers byte by byte, or a few bytes at a time, in Python: a megabyte of them takes seconds."""

BYTES_A_READ = 256

BLOCK = 256
"""Rows of an image that are judged at a time."""

NEARLY_NOTHING = 0.05
"""Share of free cells below which a map's settings rather than its walls are to blame."""

SEVERAL = 4.0
"""Factor of more free cells that makes another value of a setting more likely than the one given."""


def free_cells(says: MapFile) -> BoolGrid:
    """Return the cells of a map that are free, that is neither occupied nor unknown.

    As nav2: a pixel's shade is the mean of its channels (with alpha in mode trinary) and its occupancy 1 - shade, or
    shade where negate is set; free is what lies below free_thresh. In mode scale a pixel that is not opaque is unknown.
    In mode raw the pixel itself, 0 to 100, is the occupancy in percent, and more is unknown.

    Args:
        says: The map's YAML file.

    Returns:
        bool (rows, columns), the lowest y first.

    Raises:
        BadInput: When the image cannot be read.
    """
    return _cells_of(says, lambda occupancy: occupancy < says.free_thresh)


def marked_cells(says: MapFile) -> BoolGrid:
    """Return the cells of a mask that are marked: those whose value is above 0 as nav2 reads it.

    In mode trinary that is what is occupied. In mode scale the value rises from 0 at free_thresh to 100 at
    occupied_thresh, and in mode raw it is the pixel itself; a cell is marked from 1 on. Unknown is not marked.

    Args:
        says: The mask's YAML file.

    Returns:
        bool (rows, columns), the lowest y first.

    Raises:
        BadInput: When the image cannot be read.
    """
    span = says.occupied_thresh - says.free_thresh

    def is_marked(occupancy: NDArray[np.float64]) -> BoolGrid:
        if says.mode == "trinary":
            return occupancy > says.occupied_thresh
        if says.mode == "scale":
            return np.asarray(np.rint(100.0 * (occupancy - says.free_thresh) / span) >= 1.0)
        return occupancy >= 0.01

    return _cells_of(says, is_marked)


def _cells_of(says: MapFile, holds: Callable[[NDArray[np.float64]], BoolGrid]) -> BoolGrid:
    """Return the cells whose occupancy is known and holds, bool (rows, columns), the lowest y first."""
    pixels = _pixels(says)
    cells = np.empty(pixels.levels.shape[:2], dtype=np.bool_)
    for first, block in pixels.blocks():
        known, occupancy = _occupancy(says, block, pixels.has_alpha)
        cells[first : first + BLOCK] = known & holds(occupancy)
    return cells[::-1]


def touched_points(
    cells: BoolGrid, resolution: float, point: float, shape: tuple[int, int], start: tuple[float, float] = (0.0, 0.0)
) -> BoolGrid:
    """Return the points that share some area with a marked cell.

    Args:
        cells: bool (rows, columns), the marked cells.
        resolution: Side of one cell, m.
        point: Side of one point, m; it may be smaller or larger than a cell.
        shape: (height, width) in points.
        start: x and y of the corner of point (0, 0) from the corner of cell (0, 0), m.

    Returns:
        bool (height, width).
    """
    # count[r, c] counts the marked cells below row r and left of column c.
    count = np.zeros((cells.shape[0] + 1, cells.shape[1] + 1), dtype=np.int32)
    np.cumsum(cells, axis=0, dtype=np.int32, out=count[1:, 1:])
    np.cumsum(count[1:, 1:], axis=1, out=count[1:, 1:])
    low_row, high_row = _overlaps(shape[0], cells.shape[0], point / resolution, start[1] / resolution)
    low_col, high_col = _overlaps(shape[1], cells.shape[1], point / resolution, start[0] / resolution)
    touched = count[np.ix_(high_row, high_col)] - count[np.ix_(low_row, high_col)]
    touched += count[np.ix_(low_row, low_col)] - count[np.ix_(high_row, low_col)]
    return np.asarray(touched > 0)


def _overlaps(count: int, cells: int, point: float, start: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First cell, and the one after the last, that each point along one side shares some area with; both in cells."""
    index = np.arange(count, dtype=np.float64)
    first = np.floor(index * point + start + TOLERANCE).astype(np.int64)
    after = np.ceil((index + 1.0) * point + start - TOLERANCE).astype(np.int64)
    return np.clip(first, 0, cells), np.clip(after, 0, cells)


def image_size(says: MapFile) -> tuple[int, int]:
    """Return the (rows, columns) of a map's image, from its first bytes.

    Args:
        says: The map's YAML file.

    Raises:
        BadInput: When the image cannot be read, or has more than MAX_CELLS pixels.
    """
    with _image(says) as image:
        return image.height, image.width


def _occupancy(says: MapFile, block: NDArray[np.float64], has_alpha: bool) -> tuple[BoolGrid, NDArray[np.float64]]:
    """Return the known cells of some rows, as far as the image tells, and the occupancy of each, 0 to 1."""
    alpha = block[..., -1] if has_alpha else np.full(block.shape[:2], float(QUANTA))
    colours = block[..., :-1] if has_alpha and says.mode != "trinary" else block
    shade = colours.sum(axis=-1) / colours.shape[-1] / QUANTA
    if says.mode == "raw":
        percent = np.floor(shade * 255.0 + 0.5)
        return percent <= 100.0, percent / 100.0
    return (alpha == QUANTA) | (says.mode == "trinary"), shade if says.negate else 1.0 - shade


@dataclass(frozen=True, slots=True)
class CellShares:
    """The shares of free and of occupied cells under a map's settings.

    Attributes:
        free: Share of the free cells, 0 to 1.
        occupied: Share of those whose occupancy is above occupied_thresh.
    """

    free: float
    occupied: float

    def __str__(self) -> str:
        """Return the three shares in percent."""
        unknown = max(1.0 - self.free - self.occupied, 0.0)
        free, occupied = _percent(self.free), _percent(self.occupied)
        return f"{free} of its cells free, {occupied} occupied and {_percent(unknown)} unknown"


def cell_shares(says: MapFile) -> CellShares:
    """Return the shares of free and occupied cells.

    Args:
        says: The map's YAML file.

    Raises:
        BadInput: When the image cannot be read.
    """
    pixels = _pixels(says)
    free = occupied = 0
    for _, block in pixels.blocks():
        known, occupancy = _occupancy(says, block, pixels.has_alpha)
        free += int(np.count_nonzero(known & (occupancy < says.free_thresh)))
        occupied += int(np.count_nonzero(known & (occupancy > says.occupied_thresh)))
    cells = pixels.levels.shape[0] * pixels.levels.shape[1]
    return CellShares(free / cells, occupied / cells)


def suspicious(says: MapFile) -> str:
    """Describe the cells under a map's settings and the setting to correct, where they seem wrong.

    They seem wrong where nearly nothing is free, and where another value of one of them would free several times more.

    Args:
        says: The map's YAML file.

    Returns:
        The end of an error, empty where nothing seems wrong.

    Raises:
        BadInput: When the image cannot be read.
    """
    shares = cell_shares(says)
    others = {
        f"negate: {int(not says.negate)}": replace(says, negate=not says.negate),
        "mode: trinary": replace(says, mode="trinary"),
        "free_thresh: 0.196 and occupied_thresh: 0.65": replace(says, free_thresh=0.196, occupied_thresh=0.65),
    }
    freed = {spelled: cell_shares(other).free for spelled, other in others.items()}
    best = max(freed, key=lambda spelled: freed[spelled])
    better = freed[best] > max(SEVERAL * shares.free, NEARLY_NOTHING)
    if shares.free >= NEARLY_NOTHING and not better:
        return ""
    remedy = "correct negate, mode or the thresholds"
    if shares.free >= NEARLY_NOTHING:
        remedy = f"if the image shows something else, {remedy}"
    if better:
        remedy += f" ({best} would make {_percent(freed[best])} free)"
    return (
        f"negate = {str(says.negate).lower()}, mode = {says.mode}, free_thresh = {says.free_thresh:g} and "
        f"occupied_thresh = {says.occupied_thresh:g} make {shares}; {remedy}"
    )


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"


@dataclass(frozen=True, slots=True)
class _Pixels:
    """An image.

    Attributes:
        levels: uint8 or uint16 (rows, columns, channels).
        has_alpha: Whether the last channel is opacity.
        scale: What a level is multiplied by, so that the greatest is QUANTA.
    """

    levels: NDArray[np.uint8] | NDArray[np.uint16]
    has_alpha: bool
    scale: float

    def blocks(self) -> Iterator[tuple[int, NDArray[np.float64]]]:
        """The first row of each block of rows, and its pixels as float64 (rows, columns, channels), 0 to QUANTA."""
        for first in range(0, self.levels.shape[0], BLOCK):
            yield first, self.levels[first : first + BLOCK].astype(np.float64) * self.scale


def _pixels(says: MapFile) -> _Pixels:
    with _image(says) as image:
        image.load()
        return _channels(image, _where(says))


def _where(says: MapFile) -> str:
    return f"{says.path}: image = {says.image}"


@contextmanager
def _image(says: MapFile) -> Iterator[Image.Image]:
    """The image of a map, opened but not decoded; whatever is wrong with it becomes BadInput."""
    where = _where(says)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of sizes, which MAX_CELLS judges, and of oddities in what can be read
            with (
                open_untrusted(says.image, IMAGE) as file,
                Image.open(cast(BinaryIO, metered := _Metered(file)), formats=FORMATS) as image,
            ):
                metered.is_plain = isinstance(image, ImageFile) and image.tile[0][0] == "ppm_plain"
                if image.width * image.height > MAX_CELLS:
                    raise BadInput(f"{where}: {image.width} x {image.height} pixels, more than {MAX_CELLS}; crop it")
                yield image
    except FileNotFoundError:
        raise BadInput(f"{where}: no such file; correct 'image', which is relative to the YAML file") from None
    except UnidentifiedImageError:
        raise BadInput(f"{where}: is not a PGM, PNG, BMP or JPEG image; give one") from None
    except _Laborious as error:
        raise BadInput(f"{where}: {error}; save it as a PNG") from None
    except Image.DecompressionBombError:
        raise BadInput(f"{where}: more than {MAX_CELLS} pixels; crop it") from None
    except BadInput:
        raise
    except Exception as error:  # noqa: BLE001 - a broken file can make an image decoder raise anything
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise BadInput(f"{where}: cannot be read ({reason}); give an undamaged PGM, PNG, BMP or JPEG image") from None


class _Laborious(Exception):
    """An image that takes far longer to read than others of its size; the text says why."""


class _Metered:
    """A file that a decoder reads, but not in more steps than an honest image takes.

    Attributes:
        is_plain: Whether its pixels follow as text. Comments between them take seconds for each MB, and no program
            writes them.
    """

    def __init__(self, file: BinaryIO) -> None:
        self.is_plain = False
        self._file = file
        self._left = MOST_READS + os.fstat(file.fileno()).st_size // BYTES_A_READ

    def read(self, size: int = -1) -> bytes:
        self._left -= 1
        if self._left < 0:
            raise _Laborious("has more comments or markers than an image needs")
        content = self._file.read(size)
        if self.is_plain and b"#" in content:
            raise _Laborious("has comments between its pixels")
        return content

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        return self._file.tell()


def _channels(image: Image.Image, where: str) -> _Pixels:
    if image.mode.startswith("I"):
        return _Pixels(np.clip(np.asarray(image), 0, QUANTA).astype(np.uint16)[..., None], False, 1.0)
    if image.mode == "F":
        raise BadInput(f"{where}: has floating-point pixels; give a grey or colour image of 8 or 16 bits")
    has_alpha = image.mode in ("LA", "PA", "RGBA", "RGBa", "La") or "transparency" in image.info
    if has_alpha:
        image = image.convert("RGBA")
    elif image.mode != "L":
        image = image.convert("L" if image.mode == "1" else "RGB")
    levels = np.asarray(image, dtype=np.uint8)
    return _Pixels(levels[..., None] if levels.ndim == 2 else levels, has_alpha, QUANTA / 255)
