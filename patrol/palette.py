"""The colours of all that people look at: live pages, replays, reports, comparisons and pictures.

This is their only source: Python takes the constants, pages take `css` and `script`.

Ages are drawn in cividis, whose steps go through every lightness, so no single colour of a wall differs from all of
them. A wall is therefore dark with a light edge: wherever the fog is too dark for the one it is dark enough for the
other (contrast 3 or more). Robots have the colours of Okabe and Ito, with more contrast on white and on black.
"""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

ROBOTS = ("#0077bb", "#e69f00", "#009e73", "#d55e00", "#b25f97", "#3aa5dd", "#8a6d3b", "#7f7f7f")
"""Colours of robots, and of runs that are compared, by place; they repeat after eight."""

WALL, WALL_EDGE = "#2b2f36", "#ffffff"
NEVER_SEEN, NEVER_DOT = "#b0306a", "#e59bbf"
"""Ground that has never been seen, and the dots on it for those who cannot tell it from grey."""

UNCOUNTED = "#c9ccd1"
"""Ground that no robot can see, in pictures; pages follow their theme."""

MARKS: Mapping[str, str] = {
    "keepout": "#c1121f",
    "slow": "#00796b",
    "weight": "#6a1b9a",
    "closure": "#e07b00",
    "dock": "#2e7d32",
}
"""Colours of marks by kind (`patrol.ground.marks`)."""

MEANINGS: Mapping[str, str] = {
    "keepout": "keep-out",
    "slow": "slow zone",
    "weight": "zone with a weight or an age",
    "closure": "closure",
    "dock": "dock",
}
"""Words of a legend for kinds of marks."""

LIGHT: Mapping[str, str] = {
    "paper": "#f6f7f9",
    "card": "#ffffff",
    "ink": "#1c2127",
    "muted": "#5b6571",
    "grid": "#dde2e7",
    "line": "#d4dae0",
    "well": "#e9edf1",
    "accent": "#1f6fb2",
    "alert": "#c1121f",
    "warn": "#9a5b00",
    "good": "#1b7f4b",
    "uncounted": "#d6dbe0",
    "stripe": "#bec5cc",
    "mean": "#b45f06",
}
DARK: Mapping[str, str] = {
    "paper": "#14171b",
    "card": "#1c2026",
    "ink": "#e6e9ed",
    "muted": "#9aa5b1",
    "grid": "#333a42",
    "line": "#323942",
    "well": "#0f1215",
    "accent": "#6db3ee",
    "alert": "#ff7a80",
    "warn": "#f0b35a",
    "good": "#4cc38a",
    "uncounted": "#4a525b",
    "stripe": "#6a737d",
    "mean": "#f0b35a",
}
"""Colours of pages by what they are for, in light and in dark."""


def css() -> str:
    """Style sheet with the colours of pages as variables, such as ``--ink``, in light and in dark."""

    def variables(colours: Mapping[str, str]) -> str:
        return " ".join(f"--{name}: {value};" for name, value in colours.items())

    marks = variables({f"mark-{kind}": colour for kind, colour in MARKS.items()})
    fixed = f"--never: {NEVER_SEEN}; --never-dot: {NEVER_DOT}; {marks}"
    dark = f"@media (prefers-color-scheme: dark) {{ :root {{ {variables(DARK)} }} }}"
    return f":root {{ {variables(LIGHT)} {fixed} color-scheme: light dark; }}\n{dark}\n"


def script() -> str:
    """ES module with the colours that a page draws with, under the names that they have here."""
    fog = {"WALL": WALL, "WALL_EDGE": WALL_EDGE, "NEVER_SEEN": NEVER_SEEN, "NEVER_DOT": NEVER_DOT}
    colours = {"ROBOTS": ROBOTS, "MARKS": dict(MARKS), **fog}
    return "".join(f"export const {name} = {json.dumps(value)};\n" for name, value in colours.items())


def rgb(colour: str) -> tuple[int, int, int]:
    """Convert a colour, ``#rrggbb``, to three numbers from 0 to 255."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def with_walls(image: NDArray[np.uint8], walls: NDArray[np.bool_], longest: int, edge: int) -> NDArray[np.uint8]:
    """Draw walls with their edges over an image of the ground, uint8 (h, w, 3 or 4), a pixel for each point.

    Each point becomes a block of n x n pixels, so that the longer side has about `longest`: uint8 (h * n, w * n, 3 or
    4). `edge` is in pixels too.
    """
    blocks = max(1, round(longest / max(walls.shape)))
    image = image.repeat(blocks, axis=0).repeat(blocks, axis=1)
    walls = walls.repeat(blocks, axis=0).repeat(blocks, axis=1)
    wide = walls.copy()
    for _ in range(edge):
        grown = wide.copy()
        grown[1:] |= wide[:-1]
        grown[:-1] |= wide[1:]
        grown[:, 1:] |= wide[:, :-1]
        grown[:, :-1] |= wide[:, 1:]
        wide = grown
    opaque = (255,) if image.shape[2] == 4 else ()
    image[wide] = (*rgb(WALL_EDGE), *opaque)
    image[walls] = (*rgb(WALL), *opaque)
    return image
