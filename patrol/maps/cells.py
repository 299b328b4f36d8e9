"""The cells of a map: which pixels of its image are free, and what its settings make of all of them.

The rule is that of Nav2's `map_server` of 2026 (`nav2_map_server/src/map_io.cpp`). A pixel is first made grey, 0 to
255, as GraphicsMagick does: 0.299 red + 0.587 green + 0.114 blue. Its occupancy is 1 - grey / 255, or grey / 255 where
negate is set. A cell is free up to free_thresh, occupied from occupied_thresh on, and unknown between them; a pixel
that is not opaque is unknown, whatever its grey. For example, grey 205, which means unknown in maps of `map_saver`, has
the occupancy 0.19608: it is unknown with free_thresh 0.196, and free with 0.25. In mode raw the grey itself is the
occupancy in percent, and more than 100 is unknown.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import BinaryIO, cast

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError
from PIL.ImageFile import ImageFile

from patrol.errors import BadInput
from patrol.files.foreign import HEAD, kind_of_bytes
from patrol.files.untrusted import IMAGE, open_untrusted
from patrol.ground.terrain import BoolGrid
from patrol.maps.map_file import MapFile, similar_image

FORMATS = ("PPM", "PNG", "BMP", "JPEG")
MAX_CELLS = 400_000_000
"""The most pixels of a grey image of 8 bits; of other images a quarter, since each takes four bytes."""


LEVELS = 256
"""Greys that are told apart."""

FULL = 65535
"""The greatest level of a 16-bit image."""

A_GREY = 257
"""Levels of a 16-bit image that are one grey."""

BLOCK = 256
"""Rows of an image that are made grey, counted or compared at a time."""

MOST_READS = 1 << 16
"""Times that a decoder may read from an image, and once more for each `BYTES_A_READ` of the file. Decoders read
comments and markers byte by byte, or a few bytes at a time, in Python: a megabyte of them takes seconds."""

BYTES_A_READ = 256

Levels = NDArray[np.bool_]
"""For each grey whether it has some meaning, such as free."""


@dataclass(frozen=True, eq=False)
class MapImage:
    """The pixels of a map's image, the lowest row (that of the lowest y) first."""

    greys: NDArray[np.uint8]
    opaque: BoolGrid | None  # None where all pixels are
    is_jpeg: bool  # whether the image is a JPEG, whose greys are inexact

    def cells(self, levels: Levels) -> BoolGrid:
        """Return the opaque cells whose grey is among some, bool (rows, columns)."""
        cells = levels[self.greys]
        if self.opaque is not None:
            cells &= self.opaque
        return cells

    def rows(self, first: int, after: int) -> MapImage:
        """Return the rows from `first` up to, but without, `after`, counted from the lowest."""
        opaque = None if self.opaque is None else self.opaque[first:after]
        return MapImage(self.greys[first:after], opaque, self.is_jpeg)

    @cached_property
    def histogram(self) -> NDArray[np.int64]:
        """The number of opaque pixels of each grey, int64 (256,)."""
        counts = np.zeros(LEVELS, dtype=np.int64)
        for first in range(0, len(self.greys), BLOCK):  # counting takes eight bytes a pixel
            greys = self.greys[first : first + BLOCK]
            counted = greys if self.opaque is None else greys[self.opaque[first : first + BLOCK]]
            counts += np.bincount(counted.reshape(-1), minlength=LEVELS)
        return counts


def free_levels(says: MapFile) -> Levels:
    """Return the greys that are free, bool (256,)."""
    # In 32 bits, as nav2 compares them: grey 205 lies just at a common threshold.
    return occupancy_of(says) <= np.float32(says.free_thresh)


def occupied_levels(says: MapFile) -> Levels:
    """Return the greys that are occupied, bool (256,)."""
    occupancy = occupancy_of(says)
    return (occupancy >= np.float32(says.occupied_thresh)) & (occupancy <= 1.0) & ~free_levels(says)


def occupancy_of(says: MapFile) -> NDArray[np.float32]:
    """Return the occupancy of each grey, float32 (256,): 0 to 1, and above 1 for unknown in mode raw.

    For example, in mode trinary grey 0 (black) has the occupancy 1 and grey 255 (white) 0; with negate it is the other
    way round.
    """
    greys = np.arange(LEVELS, dtype=np.float32)
    if says.mode == "raw":
        return np.where(greys <= 100.0, greys / np.float32(100.0), np.float32(np.inf))
    shade = greys / np.float32(255.0)
    return shade if says.negate else np.float32(1.0) - shade


def free_cells(says: MapFile) -> BoolGrid:
    """Return the cells of a map that are free, that is neither occupied nor unknown; the lowest y first."""
    return read_image(says).cells(free_levels(says))


def marked_cells(says: MapFile) -> BoolGrid:
    """Return the cells of a mask that are marked: those whose value is above 0 as nav2 reads it.

    In mode trinary that is what is occupied. In mode scale the value rises from 0 at free_thresh to 100 at
    occupied_thresh, and in mode raw it is the pixel itself; a cell is marked from 1 on. Unknown is not marked. The
    lowest y comes first.
    """
    marked = occupied_levels(says)
    occupancy = occupancy_of(says)
    if says.mode == "raw":
        marked = (occupancy > 0.0) & (occupancy <= 1.0)
    elif says.mode == "scale":
        free, occupied = np.float32(says.free_thresh), np.float32(says.occupied_thresh)
        between = (occupancy > free) & (occupancy < occupied)
        # Half of 1 in 100 rounds up to the 1 from which on a cell is marked.
        marked |= between & (np.float32(100.0) * (occupancy - free) >= np.float32(0.5) * (occupied - free))
    return read_image(says).cells(marked)


def single_unknown_cells(image: MapImage, says: MapFile) -> BoolGrid:
    """Return the single unknown cells at the edge of free ground or in it; they are no obstacles.

    Mapping leaves such cells where no beam happened to pass. All cells around one are free or occupied, and the free
    ones lie side by side, so that taking the cell as free opens no way through a wall. Beyond the image all is
    occupied. Of these three unknown cells (?) the first two are specks, and the third is a gap in a wall (#):

        . . .   # # #   . . .
        . ? .   . ? .   # ? #
        . . .   . . .   . . .
    """
    free, occupied = image.cells(free_levels(says)), image.cells(occupied_levels(says))
    unknown = np.pad(~free & ~occupied, 1)
    inner = slice(1, -1)
    beside = unknown[:-2, inner] | unknown[2:, inner] | unknown[inner, :-2] | unknown[inner, 2:]
    rows, columns = np.nonzero(unknown[inner, inner] & ~beside)
    ring = [(rows + 1 + up, columns + 1 + right) for up, right in _RING]
    is_free = np.stack([np.pad(free, 1)[window] for window in ring])
    runs = np.count_nonzero(is_free & ~np.roll(is_free, 1, axis=0), axis=0)
    alone = ~np.logical_or.reduce([unknown[window] for window in ring]) & ((runs == 1) | is_free.all(axis=0))
    specks = np.zeros(free.shape, dtype=np.bool_)
    # Free cells in one run, or all around: no wall leads through the cell.
    specks[rows[alone], columns[alone]] = True
    return specks


_RING = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))
"""The cells around one, side by side: rows up and columns to the right."""


def image_size(says: MapFile) -> tuple[int, int]:
    """Return the (rows, columns) of a map's image, as it is turned, from its first bytes."""
    with _open_image(says) as image:
        return (image.width, image.height) if says.turns % 2 else (image.height, image.width)


def read_image(says: MapFile) -> MapImage:
    """Return the pixels of a map's image."""
    with _open_image(says) as image:
        image.load()
        pixels = _pixels_of(image, _image_location(says))
    if says.turns:
        greys = np.ascontiguousarray(np.rot90(pixels.greys, -says.turns))  # rows go up, so the other way round
        opaque = None if pixels.opaque is None else np.ascontiguousarray(np.rot90(pixels.opaque, -says.turns))
        return MapImage(greys, opaque, pixels.is_jpeg)
    return pixels


def _image_location(says: MapFile) -> str:
    return f"{says.path}: image = {says.image}"


_SMALLER = (
    "crop it, save it in 8-bit grey, or shrink it, for example to the darkest pixel of each 2 x 2, with 'resolution' "
    "doubled"
)
"""The remedy for an image that is too large."""


@contextmanager
def _open_image(says: MapFile) -> Iterator[Image.Image]:
    """The image of a map, opened but not decoded; whatever is wrong with it becomes BadInput."""
    where = _image_location(says)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of oddities in what can be read
            with (
                _any_size(),
                open_untrusted(says.image, IMAGE) as file,
                Image.open(cast(BinaryIO, metered := _Metered(file)), formats=FORMATS) as image,
            ):
                metered.is_plain = isinstance(image, ImageFile) and image.tile[0][0] == "ppm_plain"
                pixel_limit = MAX_CELLS if image.mode in ("1", "L") else MAX_CELLS // 4
                if image.width * image.height > pixel_limit:
                    raise BadInput(
                        f"{where}: {image.width} x {image.height} pixels, more than {pixel_limit}; {_SMALLER}"
                    )
                if abs(says.skew) * max(image.size) >= 1.0:
                    turn = f"{says.path}: origin: a yaw of {says.yaw:g} rad is no quarter turn"
                    raise BadInput(f"{turn}; rotate the image instead, and set it to 0")
                yield image
    except FileNotFoundError:
        near = similar_image(says)
        remedy = f"set image: {near}, which exists" if near else "correct 'image', which is relative to the YAML file"
        raise BadInput(f"{where}: no such file; {remedy}") from None
    except UnidentifiedImageError:
        with open_untrusted(says.image, IMAGE) as file:
            head = file.read(HEAD)
        what = kind_of_bytes(head) or f"is {'' if head else 'empty, '}not a PGM, PNG, BMP or JPEG image; give one"
        raise BadInput(f"{where}: {what}") from None
    except _Laborious as error:
        raise BadInput(f"{where}: {error}; save it as a PNG") from None
    except BadInput:
        raise
    except Exception as error:  # noqa: BLE001 - a broken file can make an image decoder raise anything
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise BadInput(f"{where}: cannot be read ({reason}); give an undamaged PGM, PNG, BMP or JPEG image") from None


class _Laborious(Exception):
    """An image that takes far longer to read than others of its size; the text says why."""


class _Metered:
    """A file that a decoder reads, but not in more steps than an honest image takes.

    `is_plain` says that its pixels follow as text. Comments between them are then refused: they take seconds for each
    MB, and no program writes them.
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


def _pixels_of(image: Image.Image, where: str) -> MapImage:
    is_jpeg = image.format == "JPEG"
    if image.mode.startswith("I"):
        levels = np.clip(np.asarray(image), 0, FULL).astype(np.uint16)
        return MapImage((levels // A_GREY).astype(np.uint8)[::-1], None, is_jpeg)
    if image.mode == "F":
        raise BadInput(f"{where}: has floating-point pixels; give a grey or colour image of 8 or 16 bits")
    if image.mode in ("LA", "PA", "RGBA", "RGBa", "La") or "transparency" in image.info:
        image = image.convert("RGBA")
    elif image.mode != "L":
        image = image.convert("L" if image.mode == "1" else "RGB")
    pixels = np.asarray(image)[::-1]
    if pixels.ndim == 2:
        return MapImage(pixels, None, is_jpeg)
    opaque = pixels[..., 3] == LEVELS - 1 if pixels.shape[2] == 4 else None
    return MapImage(_grey_of(pixels), opaque, is_jpeg)


def _grey_of(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the grey of colours as GraphicsMagick computes it: rounded to 16 bits, then cut to 8.

    For example, pure red is grey 76, pure green 149 and pure blue 29.
    """
    greys = np.empty(pixels.shape[:2], dtype=np.uint8)
    for first in range(0, len(pixels), BLOCK):
        # int32: the sum below comes to 66 million for white.
        red, green, blue = np.moveaxis(pixels[first : first + BLOCK, :, :3].astype(np.int32), -1, 0)
        level = (A_GREY * (299 * red + 587 * green + 114 * blue) + 500) // 1000
        greys[first : first + BLOCK] = level // A_GREY
    return greys


@contextmanager
def _any_size() -> Iterator[None]:
    """Let MAX_CELLS judge the size of images in place of Pillow's own limit, which is smaller."""
    limit = Image.MAX_IMAGE_PIXELS
    # The limit is a global of Pillow's, so it is set back whatever happens.
    Image.MAX_IMAGE_PIXELS = None
    try:
        yield
    finally:
        Image.MAX_IMAGE_PIXELS = limit
