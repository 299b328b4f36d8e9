"""How figures look: one palette, one way to make a figure, and one to write it as PNG, SVG or for a page.

Colours of text and lines are written as they are into pictures, and as CSS variables into a page, so that one
drawing serves light and dark. matplotlib is an extra, so it is imported only when something is drawn.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

from patrol.errors import BadInput

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK = "#1c2127"
MUTED = "#5b6571"
GRID = "#dde2e7"
ALERT = "#c1121f"
ACCENT = "#1f6fb2"
"""Told apart from the series' colours by their exact values: a page puts variables in their place."""

_VARIABLES = {INK: "--ink", MUTED: "--muted", GRID: "--grid", ALERT: "--alert", ACCENT: "--accent"}

SERIES = ("#0077bb", "#e69f00", "#009e73", "#d55e00", "#b25f97", "#3aa5dd", "#8a6d3b", "#7f7f7f")
"""Okabe and Ito's colours, those too faint on white or black made a little stronger; more than eight share them."""

WALL = (0.45, 0.48, 0.52, 1.0)
UNCOUNTED = (0.5, 0.5, 0.5, 0.22)
NEVER = (0.69, 0.19, 0.42, 1.0)
"""Colours of maps, as red, green, blue and opacity; they read on light and dark alike."""

DPI = 200
"""Of PNG files."""

PAGE_DPI = 110
"""Of the pictures within SVG."""

_HASH_SALT = "fogwatch"


@dataclass(frozen=True, eq=False)
class Drawing:
    """A figure with its file's name (without ending), heading and what there is to say about it."""

    name: str
    heading: str
    caption: str
    figure: Figure

    def page_svg(self) -> str:
        """An <svg> element for a page, without size, whose colours follow the page's theme."""
        text = _svg(self.figure, transparent=True)
        text = text[text.index("<svg") :]
        for colour, variable in _VARIABLES.items():
            text = text.replace(colour, f"var({variable})")
        # What several figures of one page call alike is told apart.
        text = re.sub(r'\bid="([^"]+)"', rf'id="{self.name}-\1"', text)
        text = re.sub(r"url\(#([^)]+)\)", rf"url(#{self.name}-\1)", text)
        text = re.sub(r'href="#([^"]+)"', rf'href="#{self.name}-\1"', text)
        text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
        width = re.search(r'width="([\d.]+)pt"', text)
        text = re.sub(r' (?:width|height)="[\d.]+pt"', "", text, count=2)
        points = float(width.group(1)) if width else 600.0
        label = f'<svg role="img" aria-label={quoteattr(self.heading)} style="{_size(points)}"'
        return text.replace("<svg", label, 1).strip()

    def save(self, folder: Path) -> list[Path]:
        """Write it as PNG and as SVG into a folder, which is made when missing; BadInput where that fails."""
        png, svg = folder / f"{self.name}.png", folder / f"{self.name}.svg"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with drawn():
                self.figure.savefig(png, format="png", dpi=DPI, facecolor="white", bbox_inches="tight", pad_inches=0.1)
            svg.write_text(_svg(self.figure, transparent=False), encoding="utf-8")
        except OSError as error:
            raise BadInput(f"{folder}: cannot be written ({error.strerror}); choose another folder") from None
        return [png, svg]


@contextmanager
def drawn() -> Iterator[None]:
    """Make and write figures in our style; BadInput where matplotlib is missing."""
    try:
        import matplotlib as mpl
    except ImportError:
        raise BadInput("figures need matplotlib; install it with: pip install 'fogwatch[monitor]'") from None
    style: dict[str, Any] = {
        "svg.fonttype": "none",
        "svg.hashsalt": _HASH_SALT,
        "font.family": ["DejaVu Sans", "sans-serif"],
        "font.size": 9.0,
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
    """An empty figure; inches."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def colour(place: int) -> str:
    """The colour of a robot, or of a run, by its place."""
    return SERIES[place % len(SERIES)]


def plain(axes: Axes, *, grid: str = "y") -> None:
    """Grid lines across one axis only (x, y or none)."""
    axes.grid(visible=False)
    if grid in ("x", "y"):
        axes.grid(visible=True, axis=grid)  # type: ignore[arg-type]


def draw(name: str, heading: str, caption: str, make: Callable[[], Figure]) -> Drawing:
    """Make a drawing in our style."""
    with drawn():
        return Drawing(name, heading, caption, make())


def _size(points: float) -> str:
    """How wide a figure of so many points may become on a page; on a phone it is scrolled rather than unreadable."""
    return f"min-width:{min(600.0, points):.0f}px;max-width:{points * 1.45:.0f}px"


def _svg(figure: Figure, *, transparent: bool) -> str:
    out = io.StringIO()
    with drawn():
        back = "none" if transparent else "white"
        figure.savefig(
            out,
            format="svg",
            dpi=PAGE_DPI,
            facecolor=back,
            bbox_inches="tight",
            pad_inches=0.05,
            metadata={"Date": None},
        )
    return out.getvalue()
