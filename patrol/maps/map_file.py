"""A map's YAML file, in ROS map_server's format.

Its keys are image, resolution, origin, negate, occupied_thresh, free_thresh and, if wanted, mode.
"""

from __future__ import annotations

import hashlib
import math
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import yaml

from patrol.errors import BadInput, did_you_mean, quoted
from patrol.files.foreign import kind_of_mapping
from patrol.files.untrusted import IMAGE, MAP, leads_out, read_untrusted
from patrol.files.yaml_text import parse_yaml, read_text

__all__ = ["MapFile", "read_map_file"]

IMAGE_ENDINGS = (".pbm", ".pgm", ".ppm", ".png", ".bmp", ".jpg", ".jpeg")
IS_IMAGE = "is an image; give the map's YAML file, which names the image and its resolution"

Mode = Literal["trinary", "scale", "raw"]
MODES: tuple[Mode, ...] = ("trinary", "scale", "raw")

QUARTER = 0.5 * math.pi
"""A quarter turn, rad."""


@dataclass(frozen=True, slots=True)
class MapFile:
    """The content of a map's YAML file."""

    path: Path
    # the image that it names, or the file of that name beside it where there is no such image: maps are copied from
    # other computers with absolute paths in them
    image: Path
    named_image: str
    resolution: float  # m per cell
    origin: tuple[float, float]  # x and y of the image's lower left corner, about which its yaw turns it, m
    yaw: float  # rad, anticlockwise
    negate: bool  # whether dark pixels are free
    occupied_thresh: float  # occupancy from which on a cell is occupied, 0 to 1
    free_thresh: float  # occupancy up to which a cell is free, 0 to 1
    mode: Mode  # the meaning of pixels; see `patrol.maps.cells`

    @property
    def turns(self) -> int:
        """Quarter turns of the image, anticlockwise, 0 to 3.

        For example, 1 for a yaw of 1.57, and 3 for -1.57.
        """
        return round(self.yaw / QUARTER) % 4

    @property
    def skew(self) -> float:
        """Yaw beside the quarter turns, rad; it counts as 0 where it is less than a pixel over the whole image."""
        return math.remainder(self.yaw, QUARTER)

    def corner(self, rows: int, columns: int) -> tuple[float, float]:
        """Return x and y (m) of the lower left corner of the turned image, which has so many rows and columns.

        For example, an image of 40 rows after one quarter turn, of 100 columns, with cells of 0.05 m and its origin at
        (10, 5), begins at (5, 5).
        """
        x, y = self.origin
        # The image turns about its own corner, so that after one or two quarters it lies to the left of it.
        left = columns * self.resolution if self.turns in (1, 2) else 0.0
        return x - left, y - (rows * self.resolution if self.turns in (2, 3) else 0.0)

    @property
    def meaning(self) -> dict[str, Any]:
        """The settings of the file, all but the image."""
        return {
            "resolution": self.resolution,
            "origin": self.origin,
            **({"turns": self.turns} if self.turns else {}),
            "negate": self.negate,
            "occupied_thresh": self.occupied_thresh,
            "free_thresh": self.free_thresh,
            "mode": self.mode,
        }

    def copy_to(self, folder: Path) -> None:
        """Write the file and its image into a folder, under their names."""
        try:
            image = read_untrusted(self.image, IMAGE)
        except OSError as error:
            raise BadInput(f"{self.path}: image = {self.image}: cannot be read ({error.strerror})") from None
        (folder / self.image.name).write_bytes(image)
        says = {"image": self.image.name} | self.meaning
        says |= {"origin": [*self.origin, self.turns * QUARTER], "negate": int(self.negate)}
        says.pop("turns", None)
        (folder / self.path.name).write_text(yaml.safe_dump(says, sort_keys=False), encoding="utf-8")


def read_map_file(path: Path, within: Path | None = None) -> MapFile:
    """Read a map's YAML file; it and its image must lie in `within`, where None allows any place."""
    if within is not None and leads_out(within, path):
        raise BadInput(f"{path}: this map lies outside of {within} and is not read; copy its files into that folder")
    if path.suffix.lower() in IMAGE_ENDINGS:
        raise BadInput(f"{path}: {IS_IMAGE}")
    says = parse_yaml(read_text(path, MAP), str(path))
    if not isinstance(says, dict):
        raise BadInput(f"{path}: is not a map; expected keys and values such as 'image: map.pgm'")
    if "image" not in says and (what := kind_of_mapping(says)):
        raise BadInput(f"{path}: {what}")
    image = _value_of(path, says, "image", "the image's file name")
    if not isinstance(image, str) or not image or "\0" in image:
        raise BadInput(f"{path}: image = {quoted(image)}: expected the image's file name")
    image_path = _existing_image(path, image)
    if within is not None and leads_out(within, image_path):
        raise BadInput(f"{path}: image = {quoted(image)}: lies outside of {within} and is not read; copy it there")
    resolution = _number_of(path, says, "resolution", "a finite number above 0 (m per cell)")
    if resolution <= 0.0:
        raise BadInput(f"{path}: resolution = {resolution:g}: expected a finite number above 0 (m per cell)")
    given_mode = says.get("mode", "trinary")
    mode = next((mode for mode in MODES if mode == str(given_mode).lower()), None)
    if mode is None:
        raise BadInput(f"{path}: mode = {quoted(given_mode)}: unknown; {did_you_mean(str(given_mode), MODES)}")
    occupied, free = (_number_of(path, says, f"{name}_thresh", "a number from 0 to 1") for name in ("occupied", "free"))
    if not 0.0 <= free <= occupied <= 1.0:
        raise BadInput(
            f"{path}: free_thresh = {free:g}, occupied_thresh = {occupied:g}: expected 0 <= free_thresh <= "
            "occupied_thresh <= 1"
        )
    x, y, yaw = _read_origin(path, says)
    return MapFile(
        path=path,
        image=image_path,
        named_image=image,
        resolution=resolution,
        origin=(x, y),
        yaw=yaw,
        negate=_read_negate(path, says),
        occupied_thresh=occupied,
        free_thresh=free,
        mode=mode,
    )


def map_meaning(path: Path) -> dict[str, Any]:
    """Return the meaning of a map's YAML file, with the SHA-256 (hex) of its image; where they lie does not matter."""
    says = read_map_file(path)
    try:
        image = read_untrusted(says.image, IMAGE)
    except OSError as error:
        raise BadInput(f"{path}: image = {says.image}: cannot be read ({error.strerror}); correct 'image'") from None
    return {"image": hashlib.sha256(image).hexdigest(), **says.meaning}


def _existing_image(path: Path, image: str) -> Path:
    """Return the image that a YAML file names, or the one of that name beside it where there is none."""
    named = path.parent / image
    beside = path.parent / image.replace("\\", "/").rsplit("/", 1)[-1]
    # Unlike `Path.exists`, these take a folder that may not be read, or a name that is too long, for one without it.
    return beside if not os.path.exists(named) and os.path.isfile(beside) else named  # noqa: PTH110, PTH113


def similar_image(says: MapFile) -> str:
    """Return the path of the image that is probably meant where the named one is missing; empty without one.

    That is the one in its folder, or in the YAML file's, with its name but for case and ending, or else with the YAML
    file's name.
    """
    folders = dict.fromkeys((says.image.parent, says.path.parent))
    there: list[Path] = []
    for folder in folders:
        with suppress(OSError):
            there += sorted(folder.iterdir())
    images = [file for file in there if file.suffix.lower() in IMAGE_ENDINGS]
    stems = [says.image.stem.lower(), says.path.stem.lower()]
    near = [os.path.relpath(file, says.path.parent) for stem in stems for file in images if file.stem.lower() == stem]
    return near[0] if near else ""


def _value_of(path: Path, says: Mapping[str, Any], key: str, what: str) -> Any:
    if key not in says:
        raise BadInput(f"{path}: {key}: missing; give {what}")
    return says[key]


def _number_of(path: Path, says: Mapping[str, Any], key: str, what: str) -> float:
    return _check_finite(path, key, _value_of(path, says, key, what), what)


def _check_finite(path: Path, key: str, value: Any, what: str) -> float:
    try:
        # Python takes True for 1, and YAML reads "yes" as True.
        number = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise BadInput(f"{path}: {key} = {quoted(value)}: expected {what}")
    return number


def _read_origin(path: Path, says: Mapping[str, Any]) -> list[float]:
    expected = "[x, y, yaw] in m and rad of the lower left corner"
    origin = _value_of(path, says, "origin", expected)
    if not isinstance(origin, list) or len(origin) != 3:
        raise BadInput(f"{path}: origin = {quoted(origin)}: expected {expected}")
    return [_check_finite(path, "origin", part, expected) for part in origin]


def _read_negate(path: Path, says: Mapping[str, Any]) -> bool:
    negate = _value_of(path, says, "negate", "0 or 1")
    words = {"0": False, "false": False, "no": False, "off": False, "1": True, "true": True, "yes": True, "on": True}
    word = str(negate).lower()
    if word not in words:
        raise BadInput(f"{path}: negate = {quoted(negate)}: expected 0, 1, true or false")
    return words[word]
