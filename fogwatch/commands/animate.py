"""``fogwatch animate``: a run as a film. The command raises BadInput; the caller prints it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from fogwatch.cli.command_help import command
from fogwatch.cli.ending import say
from fogwatch.cli.open_run import Key, RunFolder, open_folder, print_state
from fogwatch.cli.options import option
from patrol.errors import BadInput
from patrol.process.lifeline import heed

if TYPE_CHECKING:
    from monitor.replay.run import Run


MOST_FRAMES = 100_000
"""Frames of a film, at most: hours of it."""

LENGTH_S = 15.0
"""Length of a film whose speed is not given, s: the whole run, or real time if that is shorter."""

MOST_FPS = 50.0
"""Frames per second of the fastest GIF: browsers slow down faster ones."""

LEAST_WIDTH, MOST_WIDTH = 320, 1920


@command(
    examples=[
        "fogwatch animate runs/yards-20260101-120000 --out patrol.gif",
        "fogwatch animate RUN --out patrol.mp4 --from 300 --to 360 --speed 5 --width 1280",
    ]
)
def animate(
    run: RunFolder,
    out: Annotated[Path, option("FILE", "File to write: .gif, or .mp4, which needs ffmpeg.")],
    speed: Annotated[
        float | None, option("X", f"Times real time (default: the whole run in {LENGTH_S:g} s).", show_default=False)
    ] = None,
    fps: Annotated[float, option("N", "Frames per second.")] = 10.0,
    begin: Annotated[float, option("S", "Simulated time to begin at, in s.", "--from")] = 0.0,
    end: Annotated[
        float | None, option("S", "Simulated time to end at, in s (default: the end).", "--to", show_default=False)
    ] = None,
    width: Annotated[int, option("PIXELS", "Width of the film in pixels.")] = 480,
    key: Key = None,
) -> None:
    """Write a run as a film: an animated GIF or an MP4 with the true fog, the robots, closures and zones."""
    from monitor.replay.run_files import check_out

    check_out(out, "patrol.gif")
    kind = out.suffix.lower()
    if kind not in (".gif", ".mp4"):
        raise BadInput(f"--out {out}: films are GIF or MP4; name a file that ends in .gif or .mp4")
    most_fps = MOST_FPS if kind == ".gif" else 1000.0
    if not 0.0 < fps <= most_fps:
        raise BadInput(f"--fps {fps:g}: expected more than 0 and at most {most_fps:g} for {kind}, such as --fps 10")
    if speed is not None and not 0.0 < speed < math.inf:
        raise BadInput(f"--speed {speed:g}: expected a number above 0, such as --speed 20")
    if not LEAST_WIDTH <= width <= MOST_WIDTH:
        raise BadInput(f"--width {width}: expected {LEAST_WIDTH} to {MOST_WIDTH} pixels, such as --width 480")
    from fogwatch.pictures.film import check_length, find_ffmpeg, frame_count, frame_ticks, write_gif, write_mp4

    ffmpeg = find_ffmpeg(out) if kind == ".mp4" else ""
    heed(None, patience=0)  # any signal raises KeyboardInterrupt, after which no half file stays
    opened, going = open_folder(run, key)
    first, last = _tick_span(opened, begin, end)
    pace = speed or max(math.ceil((last - first) * opened.step / LENGTH_S), 1)
    if frame_count(first, last, opened.step, pace, fps) > MOST_FRAMES:
        raise BadInput(
            f"--speed {pace:g}: makes more than {MOST_FRAMES} frames; give a higher --speed, a lower --fps, or a part "
            "of the run by --from and --to"
        )
    ticks = frame_ticks(first, last, opened.step, pace, fps)
    from fogwatch.pictures.film_frames import FilmFrames
    from fogwatch.terminal.live_table import bar_on

    film = FilmFrames(opened, width, max(int(opened.mfow[first : last + 1].max()), 1))
    if kind == ".gif":
        check_length(len(ticks), film.size)
    with bar_on() as bar:
        frames = map(film.frame, bar.track(ticks, description="frames"))
        if kind == ".gif":
            write_gif(out, frames, len(ticks), film.palette, fps)
        else:
            write_mp4(out, frames, film.palette, fps, ffmpeg)
    print_state(opened, going)
    shown = f"{first * opened.step:g} to {last * opened.step:g} s at {pace:g} times real time"
    say(f"film: {out}, {out.stat().st_size / 1e6:.1f} MB, {len(ticks)} frames, {shown}")


def _tick_span(run: Run, begin: float, end: float | None) -> tuple[int, int]:
    """Return the first and the last tick between two times, s; the whole run's last tick if `end` is None."""
    last = run.ticks - 1
    length = last * run.step
    if not 0.0 <= begin <= length:
        raise BadInput(f"--from {begin:g}: the run has 0 to {length:g} s; give a time in between")
    if end is not None and not begin <= end:
        raise BadInput(f"--to {end:g}: is before --from {begin:g}; give a later time")
    until = last if end is None or end >= length else round(end / run.step)
    return min(round(begin / run.step), until), until
