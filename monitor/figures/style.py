"""The style of figures: the palette, and functions that draw a figure and write it as PNG, SVG or for a page.

Colours of text and lines become CSS variables in a page, so that one drawing suits light and dark themes. matplotlib is
an optional dependency, so it is imported only for drawing.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal
from xml.sax.saxutils import quoteattr

from patrol.extras import check_matplotlib
from patrol.files.whole_file import writing
from patrol.palette import LIGHT, ROBOTS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, MUTED, GRID, ALERT, ACCENT = (LIGHT[name] for name in ("ink", "muted", "grid", "alert", "accent"))
"""Colours that a page replaces by variables. They must differ from the colours of `ROBOTS`."""

_VARIABLES = {INK: "--ink", MUTED: "--muted", GRID: "--grid", ALERT: "--alert", ACCENT: "--accent"}

UNCOUNTED = (0.5, 0.5, 0.5, 0.22)
"""Ground of maps that no robot can see, as red, green, blue and opacity, for light and dark themes."""

DPI = 200
"""Resolution of PNG files."""

PAGE_DPI = 110
"""Resolution of images within SVG."""

WIDTH = 9.4
"""Width of a chart across the page, inches."""

FLATTEST = 4.2
"""Most that a figure is wider than high: a phone shows all of its width, and it can still be read there."""

PAD = 0.05
"""White round the content of a file, inches."""

UNDATED = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
"""Metadata that files leave out, so that the same figure is the same file."""

_HASH_SALT = "fogwatch"

SPREAD = 8.0
"""A measure whose values differ by more than this factor is drawn on a logarithmic scale."""


@dataclass(frozen=True, eq=False)
class Drawing:
    """A figure with its texts, drawn when it is first needed."""

    name: str  # file name without extension
    heading: str
    caption: str
    make: Callable[[], Figure]
    is_exact: bool = False  # files keep the figure's own size; else white margins are cut off

    @cached_property
    def figure(self) -> Figure:
        """The figure in this style."""
        return self.draw()

    def draw(self) -> Figure:
        """Draw the figure anew."""
        with drawn():
            return self.make()

    @cached_property
    def page_svg(self) -> str:
        """The figure as an <svg> element without a fixed size, whose colours follow the page's theme."""
        out = io.StringIO()
        with drawn():
            self.figure.savefig(
                out,
                format="svg",
                dpi=PAGE_DPI,
                facecolor="none",
                bbox_inches="tight",
                pad_inches=PAD,
                metadata=UNDATED[".svg"],
            )
        text = out.getvalue()
        text = text[text.index("<svg") :]
        for colour, variable in _VARIABLES.items():
            text = text.replace(colour, f"var({variable})")
        # The ids of several figures on one page must differ.
        text = re.sub(r'\bid="([^"]+)"', rf'id="{self.name}-\1"', text)
        text = re.sub(r"url\(#([^)]+)\)", rf"url(#{self.name}-\1)", text)
        text = re.sub(r'href="#([^"]+)"', rf'href="#{self.name}-\1"', text)
        text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
        width = re.search(r'width="([\d.]+)pt"', text)
        text = re.sub(r' (?:width|height)="[\d.]+pt"', "", text, count=2)
        points = float(width.group(1)) if width else 600.0
        label = f'<svg role="img" aria-label={quoteattr(self.heading)} style="{_figure_size(points)}"'
        return text.replace("<svg", label, 1).strip()

    def save(self, folder: Path) -> list[Path]:
        """Write the figure as PNG, as SVG and as PDF."""
        files = [folder / f"{self.name}.{ending}" for ending in ("png", "svg", "pdf")]
        write_figure(self.figure, files, is_exact=self.is_exact)
        return files


def write_figure(figure: Figure, files: Sequence[Path], *, is_exact: bool = False) -> None:
    """Write a figure into files, whose names say how; white margins are cut off unless it `is_exact`."""
    for file in files:
        with writing(file, "choose another folder"), drawn():
            file.parent.mkdir(parents=True, exist_ok=True)
            figure.savefig(
                file,
                dpi=DPI if file.suffix == ".png" else PAGE_DPI,
                facecolor="white",
                bbox_inches=None if is_exact else "tight",
                pad_inches=PAD,
                metadata=UNDATED.get(file.suffix),
            )


@contextmanager
def drawn() -> Iterator[None]:
    """Draw figures in this style within the context."""
    check_matplotlib("monitor")
    import matplotlib as mpl

    style: dict[str, Any] = {
        "svg.fonttype": "none",
        "pdf.fonttype": 42,  # TrueType: many journals refuse the default, Type 3
        "svg.hashsalt": _HASH_SALT,
        "font.family": ["DejaVu Sans", "sans-serif"],
        "font.size": 9.0,
        "text.parse_math": False,  # names of faults and states are text, whatever it holds
        "text.color": INK,
        "axes.edgecolor": MUTED,
        "axes.labelcolor": INK,
        "axes.linewidth": 0.8,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "axes.axisbelow": True,
        "axes.titlesize": 9.5,
        "axes.titlelocation": "left",
        "axes.facecolor": "none",
        "grid.color": GRID,
        "grid.linewidth": 0.8,
        "xtick.color": MUTED,
        "ytick.color": MUTED,
        "xtick.labelcolor": INK,
        "ytick.labelcolor": INK,
        "xtick.labelsize": 8.5,
        "ytick.labelsize": 8.5,
        "legend.frameon": False,
        "legend.fontsize": 8.5,
        "lines.linewidth": 1.4,
        "path.simplify_threshold": 0.4,
    }
    with mpl.rc_context(style):  # type: ignore[arg-type]
        yield


def figure(width: float, height: float) -> Figure:
    """Return an empty figure; width and height in inches. A flatter one than `FLATTEST` is made higher."""
    from monitor.figures.shown import ShownFigure  # here: its library is an extra

    return ShownFigure(figsize=(width, max(height, width / FLATTEST)), layout="constrained")


def colour(place: int) -> str:
    """Return the colour of a robot or a run, by its place."""
    return ROBOTS[place % len(ROBOTS)]


def plain(axes: Axes, *, grid: str = "y") -> None:
    """Show grid lines of one axis only: ``"x"``, ``"y"``, or with ``"none"`` of neither."""
    axes.grid(visible=False)
    if grid in ("x", "y"):
        axes.grid(visible=True, axis=grid)  # type: ignore[arg-type]


def logarithmic(axes: Axes, along: Literal["x", "y"]) -> None:
    """Use a logarithmic scale along an axis, with plain numbers as labels."""
    from matplotlib.ticker import LogLocator, NullLocator

    axes.set(**{f"{along}scale": "log"})
    axis = axes.xaxis if along == "x" else axes.yaxis
    axis.set_major_locator(LogLocator(10.0, subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())


def _figure_size(points: float) -> str:
    """Return the CSS limit for the width of a figure, given in points; a phone shows all of it, smaller."""
    return f"max-width:{points * 1.45:.0f}px"
