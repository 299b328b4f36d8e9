"""A film of a run: the true fog, the robots with their trails, zones and closures, drawn and written by matplotlib."""

from __future__ import annotations

import math
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from fogwatch.pictures.run_end import MOST_NAMES, RECENT_S
from monitor.figures import ground as figures
from monitor.replay.replay import Replay
from monitor.replay.run import Run
from patrol.errors import BadInput, printable
from patrol.files.whole_file import replacing, writing
from patrol.ground.fog import NEVER
from patrol.journal.records import Status
from patrol.palette import LIGHT, MARKS, NEVER_SEEN, ROBOTS, UNCOUNTED, rgb, with_walls
from patrol.scenario.marks import looks_at, marks_of

MOST_PIXELS = 200_000_000
"""Pixels of all frames of a GIF, which are kept in memory until the file is complete."""

STRIP = 0.3
"""Height of the lines above and below the map, inches."""

LEAST_RADIUS = 4.0
"""Radius of the smallest disc for a robot, font points."""

DPI = 100

_POINTS_PER_INCH = 72.0
_GONE = (Status.DEAD, Status.LOST)


class Film:
    """Draws a run's ticks, one after the other, into one figure.

    `size` is width and height of a frame, pixels.
    """

    def __init__(self, run: Run, width: int, oldest: int) -> None:
        """Draw what is the same in all frames, `width` pixels wide; the darkest colour is an age of `oldest` ticks."""
        from matplotlib.collections import LineCollection
        from matplotlib.figure import Figure

        self._run, self._replay = run, Replay(run)
        terrain = run.prepared.terrain
        inches = (width + 0.5) / DPI  # matplotlib rounds down
        per_m = inches / (terrain.width * terrain.point)
        tall = per_m * terrain.height * terrain.point + 2 * STRIP
        self.figure = Figure((inches, tall), dpi=DPI, facecolor="white")
        self.size = width, int(tall * DPI)
        axes = self.figure.add_axes((0.0, STRIP / tall, 1.0, 1.0 - 2 * STRIP / tall), frameon=False)
        axes.set_axis_off()
        figures.frame(axes, terrain)
        self._title = self.figure.text(0.01, 1.0 - 0.5 * STRIP / tall, "", size=9, va="center")
        self._scale = figures.fog_scale(oldest * run.step)
        bar = self.figure.add_axes((0.15, 0.33 * STRIP / tall, 0.25, 0.34 * STRIP / tall))
        self.figure.colorbar(self._scale, cax=bar, orientation="horizontal").set_ticks([])
        at: dict[str, Any] = {"y": 0.5 * STRIP / tall, "size": 8, "va": "center"}
        self.figure.text(x=0.14, s="last seen 0", ha="right", **at)
        self.figure.text(x=0.41, s=f"{oldest * run.step:g} s ago", **at)
        self._never = self.figure.text(x=0.65, s="■ never seen", color=NEVER_SEEN, **at)
        # The fog is drawn at the frame's own pixels: sampling is many times as fast as shrinking each frame.
        pixels = width, max(round(width * terrain.height / terrain.width), 1)
        self._rows, self._cols = (
            ((np.arange(count) + 0.5) * points / count).astype(np.int64)
            for count, points in zip(pixels[::-1], terrain.shape, strict=True)
        )
        ground = figures.painted(terrain.shape, [figures.Layer(UNCOUNTED, "", terrain.passable)])
        ground = with_walls(ground, ~terrain.passable, max(pixels), 1)
        base, counted = (
            np.asarray(Image.fromarray(grid).resize(pixels, Image.Resampling.BOX))
            for grid in (ground, run.prepared.patrolled.astype(np.uint8) * 255)
        )
        self._fog = np.dstack([np.zeros_like(base), counted])
        left, low, right, top = terrain.bounds
        self._layers = [
            axes.imshow(layer, origin="lower", extent=(left, right, low, top), interpolation="nearest")
            for layer in (base, self._fog)
        ]
        marks = marks_of(run.prepared.scenario, terrain)
        self._marks = [(mark, mark.points) for mark in marks if mark.points is not None]
        self._rims = [figures.draw_outline(axes, terrain, points) for _, points in self._marks]
        self._colours = np.array([ROBOTS[place % len(ROBOTS)] for place in range(len(run.names))])
        radius = [max(robot.radius * per_m * _POINTS_PER_INCH, LEAST_RADIUS) for robot in run.robots]
        self._ahead_m = 1.6 * np.array(radius)[:, np.newaxis] / (per_m * _POINTS_PER_INCH)
        rim = figures.rim(2.5)
        self._trails = LineCollection([], colors=list(self._colours), lw=1.2, path_effects=rim)
        self._heads = LineCollection([], colors=LIGHT["ink"], lw=1.5, path_effects=rim, zorder=4)
        for lines in (self._trails, self._heads):
            axes.add_collection(lines)
        nowhere = np.full((len(run.names), 2), np.nan)
        self._bodies = axes.scatter(
            nowhere[:, 0], nowhere[:, 1], s=4.0 * np.square(radius), edgecolors="white", zorder=5
        )
        self._crosses, self._pauses = (
            axes.plot([], [], ls="", marker=marker, ms=6, color="white", zorder=6)[0] for marker in ("x", "$II$")
        )
        text: dict[str, Any] = {"size": 7, "ha": "center", "path_effects": figures.rim(2.0), "zorder": 7}
        self._mark_names = [axes.text(*mark.at, "", clip_on=True, **text) for mark, _ in self._marks]
        named = run.names if len(run.names) <= MOST_NAMES else ()
        self._names = [axes.annotate(name, (0, 0), (0, 7), textcoords="offset points", **text) for name in named]

    def draw(self, k: int) -> None:
        """Draw a tick, after its observations."""
        run, fog = self._run, self._replay.fog(k)
        grid = np.ix_(self._rows, self._cols)
        colours = self._fog[..., :3]
        colours[:] = self._scale.to_rgba(fog.age(k)[grid] * run.step, bytes=True)[..., :3]
        never = fog.last_seen[grid] == NEVER
        colours[never] = rgb(NEVER_SEEN)
        self._never.set_visible(bool((never & (self._fog[..., 3] > 0)).any()))
        looks = looks_at(run.prepared.scenario, k, run.closings)
        for (mark, points), rim, name in zip(self._marks, self._rims, self._mark_names, strict=True):
            look = looks[mark.section][mark.name]
            if look.filled:
                colours[points[grid]] = rgb(MARKS[mark.kind])
            rim.set(color=MARKS[mark.kind], linewidth=2.0 if look.holds else 1.0)
            name.set_text(look.text if look.holds else "")
        self._layers[1].set_data(self._fog)
        self._draw_robots(k)
        mfow, mean = run.mfow[k] * run.step, run.fog_mean[k] * run.step
        self._title.set_text(f"{k * run.step:g} s   MFoW {mfow:g} s   mean {mean:.1f} s")

    def _draw_robots(self, k: int) -> None:
        run = self._run
        status = run.status[k]
        first = max(k - round(RECENT_S / run.step), 0)
        # Where a robot has no body, its place is NaN, and matplotlib draws nothing.
        present = np.isin(run.status[first : k + 1], [state for state in Status if state.is_present])
        places = np.where(present[..., np.newaxis], run.poses[first : k + 1, :, :2], np.nan)
        here = places[-1]
        self._trails.set_segments(list(places.swapaxes(0, 1)))
        dead, paused = np.isin(status, _GONE), status == Status.PAUSED
        ahead = here + self._ahead_m * [(math.cos(heading), math.sin(heading)) for heading in run.poses[k, :, 2]]
        self._heads.set_segments(list(np.stack([here, ahead], axis=1)[~dead & ~paused]))
        self._bodies.set(offsets=here, facecolors=np.where(dead, LIGHT["ink"], self._colours))
        self._crosses.set_data(*here[dead].T)
        self._pauses.set_data(*here[paused].T)
        for name, place, shown in zip(self._names, here.tolist(), present[-1], strict=bool(self._names)):
            name.set_visible(shown)
            name.xy = tuple(place)


def write_film(film: Film, out: Path, ticks: Iterable[int], fps: int) -> None:
    """Write some ticks as an animated GIF that repeats for ever, or as an MP4, which needs ffmpeg."""
    from matplotlib.animation import FFMpegWriter, PillowWriter

    is_gif = out.suffix.lower() == ".gif"
    writer = PillowWriter(fps) if is_gif else FFMpegWriter(fps, extra_args=["-movflags", "+faststart", "-f", "mp4"])
    try:
        with writing(out), replacing(out) as part, writer.saving(film.figure, str(part.absolute()), DPI):
            for k in ticks:
                film.draw(k)
                writer.grab_frame()
    except subprocess.CalledProcessError as error:
        if isinstance(error.__context__, KeyboardInterrupt):
            raise error.__context__ from None
        lines = error.stderr.strip().splitlines()
        why = printable(lines[-1]) if lines else f"exit code {error.returncode}"
        raise BadInput(f"{out}: ffmpeg cannot write it ({why}); name a .gif file, or use another ffmpeg") from None
