"""Maps in figures and pictures: a canvas in metres, fog, what a site has, a legend, a scale bar, readable labels.

matplotlib is an optional dependency, so it is imported only when something is drawn.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from patrol.extras import check_matplotlib
from patrol.files.whole_file import replacing, writing
from patrol.ground.marks import outline
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.palette import rgb, with_walls

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend
    from matplotlib.patheffects import AbstractPathEffect

DPI = 150
LONGEST = 11.0
"""Length of the drawing's longer side, inches."""

LEGEND = 3.4
"""Width of the legend beside it, inches."""

WALL_EDGE = 2
"""Width of the edge of a wall, dots."""

BAR_LOW, BAR_TOP = 0.12, 0.54
"""Ends of the colour bar if the legend leaves room there, in heights of the drawing."""

LEAST_BAR = 1.5
"""Length of the shortest colour bar, inches."""

SCALE_BAR = 0.035
"""Height of the scale bar if there is room, in heights of the drawing."""

MARGIN = 0.12
"""Around everything that is drawn, inches."""

AROUND = 0.03
"""Margin around ground that a picture is cropped to, as a share of the longer side."""

GAP = 0.25
"""Between the legend, the colour bar and the scale bar, inches."""


@dataclass(frozen=True, slots=True)
class Layer:
    """Grid points of one colour."""

    colour: str  # #rrggbb
    label: str  # in the legend
    mask: BoolGrid  # (h, w)


@dataclass(frozen=True, slots=True)
class Key:
    """A line of the legend."""

    colour: str  # #rrggbb
    label: str
    marker: str = "s"  # a marker of matplotlib, "-" for a line, or "" for text alone


def cropped(terrain: Terrain, ground: BoolGrid) -> tuple[Terrain, tuple[slice, slice]]:
    """Cut a terrain to some ground and a margin around it; return the part, and its rows and columns.

    It keeps a small building on a large map from being a speck. `ground`, (h, w), has at least one point.

    For example, ground of 100 by 40 points keeps a margin of 3 points on each side.
    """
    rows, columns = np.flatnonzero(ground.any(axis=1)), np.flatnonzero(ground.any(axis=0))
    margin = max(round(AROUND * max(np.ptp(rows), np.ptp(columns))), 1)
    low, left = max(int(rows[0]) - margin, 0), max(int(columns[0]) - margin, 0)
    window = slice(low, int(rows[-1]) + margin + 1), slice(left, int(columns[-1]) + margin + 1)
    x, y = terrain.origin
    origin = x + left * terrain.point, y + low * terrain.point
    return Terrain(terrain.name, terrain.passable[window], terrain.point, origin), window


@dataclass(frozen=True, slots=True)
class Box:
    """A label's box, about as large as its text, in font points."""

    x: float  # of its middle, from the left of the figure
    y: float  # of its middle, from below
    wide: float
    high: float

    def overlaps(self, other: Box) -> bool:
        """Return True if the boxes cover a common place."""
        aside, above = abs(self.x - other.x), abs(self.y - other.y)
        return 2.0 * aside < self.wide + other.wide and 2.0 * above < self.high + other.high


def canvas(terrain: Terrain, title: str) -> tuple[Figure, Axes]:
    """Draw a figure with axes in m over a whole terrain."""
    check_matplotlib("sim")
    from matplotlib.figure import Figure

    xmin, ymin, xmax, ymax = terrain.bounds
    inches = LONGEST / max(xmax - xmin, ymax - ymin)
    width, height = (xmax - xmin) * inches, (ymax - ymin) * inches
    left, low, above = 0.7, 0.6, 0.45
    size = (left + width + 0.2 + LEGEND, low + max(height, 4.5) + above)
    figure = Figure(figsize=size, dpi=DPI, facecolor="white")
    axes = figure.add_axes((left / size[0], low / size[1], width / size[0], height / size[1]))
    frame(axes, terrain)
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    axes.tick_params(labelsize=8)
    axes.set_title(title, loc="left", fontsize=11)
    return figure, axes


def frame(axes: Axes, terrain: Terrain) -> None:
    """Let axes show a whole terrain, in m."""
    xmin, ymin, xmax, ymax = terrain.bounds
    axes.set_xlim(xmin, xmax)
    axes.set_ylim(ymin, ymax)
    axes.set_aspect("equal")


def paint(
    axes: Axes,
    terrain: Terrain,
    image: NDArray[np.uint8],
    walls: BoolGrid | None = None,
    longest: int = round(LONGEST * DPI),
    edge: int = WALL_EDGE,
) -> None:
    """Draw an image over a terrain; where it is shrunk, colours mix.

    The image is uint8 (h, w, 3 or 4), row 0 lowest. `walls`, (h, w), are drawn over it with their edges of `edge`
    pixels, on an image whose longer side has about `longest`.
    """
    if walls is not None:
        image = with_walls(image, walls, longest, edge)
    xmin, ymin, xmax, ymax = terrain.bounds
    axes.imshow(image, origin="lower", extent=(xmin, xmax, ymin, ymax), interpolation="antialiased")


def painted(shape: tuple[int, int], layers: Sequence[Layer]) -> NDArray[np.uint8]:
    """Paint layers over each other on white, the lowest first; return the image, uint8 (h, w, 3)."""
    image = np.full((*shape, 3), 255, dtype=np.uint8)
    for layer in layers:
        image[layer.mask] = rgb(layer.colour)
    return image


def fog_scale(stalest: float) -> ScalarMappable:
    """Return the colours of ages up to `stalest`, s: cividis from fresh (bright) to stale (dark).

    Colour-blind people read them the same way.
    """
    import matplotlib as mpl
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    return ScalarMappable(Normalize(0.0, stalest, clip=True), mpl.colormaps["cividis"].reversed())


def draw_outline(axes: Axes, terrain: Terrain, points: BoolGrid, **look: Any) -> LineCollection:
    """Draw and return the edges of some points; `look` is that of a LineCollection."""
    from matplotlib.collections import LineCollection

    lines = LineCollection(list(outline(points, terrain).reshape(-1, 2, 2)), **look)
    axes.add_collection(lines)
    return lines


def rim(width: float, colour: str = "white") -> list[AbstractPathEffect]:
    """Return the effect of a rim, so wide in font points, which makes text and lines readable on any colour."""
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=width, foreground=colour)]


def label(
    axes: Axes,
    x: float,
    y: float,
    text: str,
    *,
    colour: str = "#000000",
    size: float = 7.0,
    above: float = 0.0,
    taken: list[Box] | None = None,
) -> None:
    """Write text with a white rim, readable on any colour, its middle at `x` and `y`, m.

    `size` and `above`, how far above the place it stands, are in font points. `taken` are the boxes of earlier labels,
    which this one joins. It stands below, right or left of the place instead where it would cover one of them.
    """
    wide, high = 0.62 * size * len(text), 1.2 * size
    shift = (0.0, above)
    if taken is not None:
        aside = above + 0.5 * wide
        points = axes.transData.transform((x, y)) * 72.0 / axes.figure.dpi
        for shift in ((0.0, above), (0.0, -above - 0.5 * high), (aside, 0.0), (-aside, 0.0)):
            box = Box(points[0] + shift[0], points[1] + shift[1], wide, high)
            if not any(box.overlaps(earlier) for earlier in taken):
                break
        else:
            shift = (0.0, above)
        taken.append(Box(points[0] + shift[0], points[1] + shift[1], wide, high))
    axes.annotate(
        text,
        (x, y),
        shift,
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=size,
        color=colour,
        path_effects=rim(2.2),
        clip_on=True,
        zorder=6,
    )


def key_column(
    figure: Figure,
    axes: Axes,
    terrain: Terrain,
    keys: Sequence[Key],
    scale: ScalarMappable | None = None,
    text: str = "",
) -> None:
    """Draw the legend, the colour bar and the scale bar to the right of the drawing, one below the other.

    Beside a low drawing they go on below its lower edge. There is no colour bar without `scale`; `text` is its label.
    """
    drawn = legend(axes, keys)
    _lay_out(figure)  # only then does the legend have a size
    inch = DPI / axes.bbox.height
    low = float(axes.transAxes.inverted().transform((0.0, drawn.get_window_extent().y0))[1])
    if scale is not None:
        top = min(BAR_TOP, low - GAP * inch)
        low = min(BAR_LOW, top - LEAST_BAR * inch)
        wide = DPI / axes.bbox.width
        bar = axes.inset_axes((1.0 + 0.2 * wide, low, 0.27 * wide, top - low))
        figure.colorbar(scale, cax=bar).set_label(text, size=9)
        bar.tick_params(labelsize=8)
    _scale_bar(axes, terrain, min(SCALE_BAR, low - GAP * inch), 0.07 * inch)


def legend(axes: Axes, keys: Sequence[Key]) -> Legend:
    """Draw the legend, to the right of the drawing."""
    from matplotlib.lines import Line2D

    handles = []
    for key in keys:
        is_line = key.marker == "-"
        handles.append(
            Line2D(
                [],
                [],
                color=key.colour,
                linestyle="-" if is_line else "none",
                linewidth=2.5,
                marker=None if is_line else key.marker,
                markersize=9,
                markeredgecolor="#55585e",
                markeredgewidth=0.6,
                label=key.label,
            )
        )
    return axes.legend(
        handles=handles, loc="upper left", bbox_to_anchor=(1.015, 1.0), borderaxespad=0, fontsize=8, frameon=False
    )


def _scale_bar(axes: Axes, terrain: Terrain, height: float, gap: float) -> None:
    """Draw a bar of a round length, about a seventh of the terrain's width, and the length below; in axes' heights."""
    xmin, _, xmax, _ = terrain.bounds
    length = round_length((xmax - xmin) / 7.0)
    left = 1.02
    right = left + length / (xmax - xmin)
    axes.plot((left, right), (height, height), transform=axes.transAxes, clip_on=False, color="black", linewidth=3)
    middle, below = 0.5 * (left + right), height - gap
    axes.text(middle, below, f"{length:g} m", transform=axes.transAxes, ha="center", va="top", fontsize=9)


def _lay_out(figure: Figure) -> None:
    """Give everything its place and size, as drawing does, without the images, which take most of the time."""
    images = [image for axes in figure.axes for image in axes.images]
    for image in images:
        image.set_visible(False)
    figure.draw_without_rendering()
    for image in images:
        image.set_visible(True)


def round_length(about: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that is not above `about`.

    For example, 5 for 7.3 and 0.2 for 0.3.

    `about` must be above 0.
    """
    power = 10.0 ** math.floor(math.log10(about))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= about * (1.0 + 1e-9))


def save(figure: Figure, out: Path) -> None:
    """Write a figure as a PNG file."""
    _lay_out(figure)
    shown = figure.get_tightbbox().padded(MARGIN)
    with writing(out), replacing(out) as part:
        figure.savefig(part, format="png", bbox_inches=shown)
