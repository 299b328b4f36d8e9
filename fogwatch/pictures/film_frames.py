"""The frames of a film of a run: the true fog, the robots with their trails, zones and closures, at any tick.

A frame is an image of indices into one palette. The first `SHADES` colours are ages, so each point of the ground shows
its age to within half a shade. Marks and texts are drawn larger and shrunk, for smooth edges; their pixels take the
nearest colour of the palette.
"""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from fogwatch.pictures.run_end import MOST_NAMES, RECENT_S
from monitor.figures.ground import fog_scale
from monitor.replay.replay import Replay
from monitor.replay.run import Run
from patrol.extras import check_matplotlib
from patrol.ground.fog import NEVER
from patrol.ground.marks import outline
from patrol.ground.terrain import BoolGrid
from patrol.journal.records import Status
from patrol.palette import LIGHT, MARKS, NEVER_SEEN, ROBOTS, UNCOUNTED, WALL, WALL_EDGE, rgb, with_walls
from patrol.scenario.marks import Looks, looks_at, marks_of

Pixels = NDArray[np.uint8]
Place = tuple[float, float]
Edges = list[tuple[float, float, float, float]]
_Scalar = TypeVar("_Scalar", bound=np.generic)

SHADES = 64
"""Colours of ages; few enough that files stay small."""

FINE = 3
"""Dots of a drawing along the side of a pixel."""

TEXT = 13
"""Font size, pixels."""

STRIP = 26
"""Height of the lines above and below the map, pixels."""

LEAST_RADIUS = 5.0
"""Radius of the smallest disc for a robot, pixels."""

_WHITE, _INK, _GREY = WALL_EDGE, LIGHT["ink"], "#808080"
_FIXED = (WALL, _WHITE, UNCOUNTED, NEVER_SEEN, _INK, LIGHT["alert"], *ROBOTS, *MARKS.values())
_BLENDS = tuple((colour, other) for colour in (*ROBOTS, _INK) for other in (_WHITE, _INK, _GREY))
_BITS = 5
"""Bits of each part of a colour by which the nearest colour of the palette is looked up."""


class FilmFrames:
    """Draws frames of one run.

    `palette` is uint8 (256, 3), red, green and blue. `size` is width and height of a frame in pixels, both even, as
    video codecs want them.
    """

    def __init__(self, run: Run, width: int, oldest: int) -> None:
        """Draw what is the same in all frames.

        `width` is in pixels, rounded down to an even number. `oldest` is the age of the darkest shade in ticks, at
        least 1.
        """
        check_matplotlib("sim")
        self._run, self._oldest = run, oldest
        self._replay = Replay(run)
        self.palette = _make_palette()
        self._nearest = _nearest(self.palette)
        terrain = run.prepared.terrain
        wide = max(width // 2, 1) * 2
        self._scale = wide / (terrain.width * terrain.point)
        high = max(round(terrain.height * terrain.point * self._scale / 2.0), 1) * 2
        self.size = (wide, high + 2 * STRIP)
        # The upper edge of the map is row 0 of the image, and the last row of the grid.
        self._rows = ((np.arange(high)[::-1] + 0.5) * terrain.height / high).astype(np.int64)
        self._cols = ((np.arange(wide) + 0.5) * terrain.width / wide).astype(np.int64)
        self._font = ImageFont.load_default(TEXT * FINE)
        scenario = run.prepared.scenario
        self._marks = [
            (mark, mark.points, outline(mark.points, terrain).tolist())
            for mark in marks_of(scenario, terrain)
            if mark.points is not None
        ]
        self._base, self._ground = self._constant_frame()

    def frame(self, k: int) -> Pixels:
        """Draw a tick, after its observations, as uint8 (height, width), indices into `palette`, row 0 at the top."""
        fog_then = self._replay.fog(k)
        image = self._base.copy()
        inside = image[STRIP:-STRIP]
        last_seen = self._sample_grid(fog_then.last_seen)
        shades = np.rint(self._sample_grid(fog_then.age(k)) * ((SHADES - 1) / self._oldest))
        fog = np.minimum(shades, SHADES - 1).astype(np.uint8)
        fog[last_seen == NEVER] = self._colour_index(NEVER_SEEN)
        looks = looks_at(self._run.prepared.scenario, k, self._run.closings)
        for mark, points, _ in self._marks:
            if looks[mark.section][mark.name].filled:
                fog[self._sample_grid(points)] = self._colour_index(MARKS[mark.kind])
        inside[self._ground] = fog[self._ground]
        return self._blend_sheet(image, self._draw_overlay(k, looks))

    def _sample_grid(self, grid: NDArray[_Scalar]) -> NDArray[_Scalar]:
        """Return the values of a grid at the middles of the map's pixels."""
        return grid[self._rows[:, np.newaxis], self._cols]

    def _colour_index(self, colour: str) -> int:
        return SHADES + _FIXED.index(colour)

    def _constant_frame(self) -> tuple[Pixels, BoolGrid]:
        """Return a frame of walls, ground that does not count and the legend, and the pixels of the fog."""
        terrain, patrolled = self._run.prepared.terrain, self._run.prepared.patrolled
        high, wide = len(self._rows), len(self._cols)
        # A pixel is a wall if any of its points is, so that thin walls do not disappear.
        firsts = [np.arange(n) * points // n for n, points in zip((high, wide), terrain.shape, strict=True)]
        walls = np.maximum.reduceat(np.maximum.reduceat(~terrain.passable, firsts[0]), firsts[1], axis=1)[::-1]
        drawn = with_walls(np.zeros((*walls.shape, 3), dtype=np.uint8), walls, max(walls.shape), 1)
        ground = self._sample_grid(patrolled)
        inside = np.where(ground, self._colour_index(NEVER_SEEN), self._colour_index(UNCOUNTED)).astype(np.uint8)
        for colour in (WALL, WALL_EDGE):
            mask = (drawn == rgb(colour)).all(axis=2)
            inside[mask] = self._colour_index(colour)
            ground &= ~mask
        image = np.full(self.size[::-1], self._colour_index(_WHITE), dtype=np.uint8)
        image[STRIP:-STRIP] = inside
        return self._with_legend(image), ground

    def _with_legend(self, image: Pixels) -> Pixels:
        """Draw the scale of ages, and what its colours mean, below the map."""
        wide, high = self.size
        bar = min(round(0.2 * wide), 300)
        left, top, centre = 78, high - STRIP + 7, high - STRIP / 2
        image[top : top + 12, left : left + bar] = (np.arange(bar) * SHADES // bar).astype(np.uint8)
        sheet, draw = self._new_sheet()

        def write(x: float, text: str) -> float:
            """Write from x on; return where the text ends."""
            self._draw_text(draw, (x, centre), text, "lm")
            return float(x + draw.textlength(text, self._font) / FINE)

        write(8, "last seen")
        self._draw_text(draw, (left - 4, centre), "0", "rm")
        end = write(left + bar + 4, f"{self._oldest * self._run.step:g} s ago")
        meanings = {NEVER_SEEN: "never seen", UNCOUNTED: "does not count"}
        if not (image[STRIP:-STRIP] == self._colour_index(UNCOUNTED)).any():
            del meanings[UNCOUNTED]
        for colour, meaning in meanings.items():
            draw.rectangle([FINE * x for x in (end + 14, top, end + 26, top + 12)], fill=colour)
            end = write(end + 31, meaning)
        return self._blend_sheet(image, sheet)

    def _new_sheet(self) -> tuple[Image.Image, ImageDraw.ImageDraw]:
        """Return an empty transparent drawing as large as a frame."""
        sheet = Image.new("RGBA", (self.size[0] * FINE, self.size[1] * FINE))
        return sheet, ImageDraw.Draw(sheet)

    def _blend_sheet(self, image: Pixels, sheet: Image.Image) -> Pixels:
        """Lay a drawing over a frame; what it does not touch stays exactly as it is."""
        overlay = np.asarray(sheet.reduce(FINE))
        rows, cols = np.nonzero(overlay[..., 3])
        above = overlay[rows, cols].astype(np.float64)
        opacity = above[:, 3:] / 255.0
        mixed = above[:, :3] * opacity + self.palette[image[rows, cols]] * (1.0 - opacity)
        red, green, blue = (np.rint(mixed).astype(np.int64) >> (8 - _BITS)).T
        image[rows, cols] = self._nearest[red, green, blue]
        return image

    def _draw_overlay(self, k: int, looks: Looks) -> Image.Image:
        """Draw all that lies over the fog, and the line above the map."""
        sheet, draw = self._new_sheet()
        run = self._run
        labels: list[tuple[Place, str]] = []
        for mark, _, edges in self._marks:
            look = looks[mark.section][mark.name]
            self._draw_outline(draw, edges, MARKS[mark.kind], strong=look.holds)
            if look.holds:
                labels.append((self._pixel_at(*mark.at), look.text))
        first = max(k - round(RECENT_S / run.step), 0)
        for index in range(len(run.names)):
            self._draw_trail(draw, first, k, index)
        for index, name in enumerate(run.names):
            status = Status(int(run.status[k, index]))
            if status.is_present:
                above = self._draw_robot(draw, k, index, status)
                if len(run.names) <= MOST_NAMES:
                    labels.append((above, name))
        for where, text in labels:
            self._draw_text(draw, where, text, "mb", rim=2)
        # Nothing of the map reaches into the lines above and below it.
        for top in (0, self.size[1] - STRIP):
            sheet.paste((0, 0, 0, 0), (0, FINE * top, FINE * self.size[0], FINE * (top + STRIP)))
        mfow, mean = run.mfow[k] * run.step, run.fog_mean[k] * run.step
        self._draw_text(draw, (8, STRIP / 2), f"{k * run.step:g} s   MFoW {mfow:g} s   mean {mean:.1f} s", "lm")
        return sheet

    def _pixel_at(self, x: float, y: float) -> Place:
        """Return a place in m as pixels of a frame, from the left and from the top."""
        left, low, _, _ = self._run.prepared.terrain.bounds
        return (x - left) * self._scale, self.size[1] - STRIP - (y - low) * self._scale

    def _draw_line(self, draw: ImageDraw.ImageDraw, places: list[Place], colour: str, width: float) -> None:
        dots = [(FINE * x, FINE * y) for x, y in places]
        draw.line(dots, fill=colour, width=max(round(FINE * width), 1), joint="curve")

    def _draw_text(self, draw: ImageDraw.ImageDraw, at: Place, text: str, anchor: str, rim: float = 0.0) -> None:
        where = (FINE * at[0], FINE * at[1])
        draw.text(where, text, _INK, self._font, anchor, stroke_width=round(FINE * rim), stroke_fill=_WHITE)

    def _draw_outline(self, draw: ImageDraw.ImageDraw, edges: Edges, colour: str, *, strong: bool) -> None:
        for tone, width in ((_WHITE, 3.6 if strong else 2.4), (colour, 2.0 if strong else 1.0)):
            for x0, y0, x1, y1 in edges:
                self._draw_line(draw, [self._pixel_at(x0, y0), self._pixel_at(x1, y1)], tone, width)

    def _draw_trail(self, draw: ImageDraw.ImageDraw, first: int, last: int, place: int) -> None:
        """Draw where a robot has been, in pieces where it had no body in between."""
        run = self._run
        pieces: list[list[Place]] = [[]]
        for k in range(first, last + 1):
            if Status(int(run.status[k, place])).is_present:
                pieces[-1].append(self._pixel_at(*run.poses[k, place, :2].tolist()))
            elif pieces[-1]:
                pieces.append([])
        for tone, width in ((_WHITE, 3.0), (ROBOTS[place % len(ROBOTS)], 1.6)):
            for piece in pieces:
                if len(piece) > 1:
                    self._draw_line(draw, piece, tone, width)

    def _draw_robot(self, draw: ImageDraw.ImageDraw, k: int, place: int, status: Status) -> Place:
        """Draw a robot's body: its heading, two bars if it is paused, a cross if it is dead; return the place above."""
        true_x, true_y, heading = self._run.poses[k, place].tolist()
        x, y = self._pixel_at(true_x, true_y)
        radius = max(self._run.robots[place].radius * self._scale, LEAST_RADIUS)
        is_gone = status in (Status.DEAD, Status.LOST)
        for size, tone in ((radius + 2.4, _INK), (radius + 1.6, _WHITE), (radius, ROBOTS[place % len(ROBOTS)])):
            inner = _INK if is_gone and size == radius else tone
            draw.ellipse([FINE * end for end in (x - size, y - size, x + size, y + size)], fill=inner)
        arm = 0.6 * radius
        if is_gone:
            self._draw_line(draw, [(x - arm, y - arm), (x + arm, y + arm)], _WHITE, 2.0)
            self._draw_line(draw, [(x - arm, y + arm), (x + arm, y - arm)], _WHITE, 2.0)
        elif status == Status.PAUSED:
            for across in (-0.3 * radius, 0.3 * radius):
                self._draw_line(draw, [(x + across, y - arm), (x + across, y + arm)], _WHITE, 2.0)
        else:
            reach = 1.6 * radius
            ahead = (x + reach * math.cos(heading), y - reach * math.sin(heading))
            self._draw_line(draw, [(x, y), ahead], _INK, 3.6)
            self._draw_line(draw, [(x, y), ahead], _WHITE, 2.0)
        return x, y - radius - 5.0


def _make_palette() -> Pixels:
    """Return the shades of ages, the fixed colours, blends for smooth edges, and greys, uint8 (256, 3)."""
    shades = fog_scale(1.0).to_rgba(np.linspace(0.0, 1.0, SHADES), bytes=True)[:, :3]
    fixed = [rgb(colour) for colour in _FIXED]
    blends = [np.add(rgb(first), rgb(second)) // 2 for first, second in _BLENDS]
    colours = np.concatenate([shades, fixed, blends])
    greys = np.linspace(0.0, 255.0, 256 - len(colours))
    return np.concatenate([colours, np.repeat(greys[:, np.newaxis], 3, axis=1)]).astype(np.uint8)


def _nearest(palette: Pixels) -> Pixels:
    """Return the index of the nearest colour for the first `_BITS` bits of red, green and blue, uint8 (n, n, n)."""
    parts = np.linspace(0.0, 255.0, 1 << _BITS)
    squares = [(parts[:, np.newaxis] - palette[:, part]) ** 2 for part in range(3)]
    nearest = [(red + squares[1][:, np.newaxis] + squares[2][np.newaxis]).argmin(axis=-1) for red in squares[0]]
    return np.array(nearest, dtype=np.uint8)
