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
from patrol.extras import check_matplotlib
from runtime.process.lifeline import heed

if TYPE_CHECKING:
    from monitor.replay.run import Run


MOST_FRAMES = 100_000
"""Frames of a film, at most: hours of it."""

LENGTH_S = 15.0
"""Length of a film whose speed is not given, s: the whole run, or real time if that is shorter."""

GIF_FPS = (1, 2, 4, 5, 10, 20, 25, 50)
"""Frames per second of a GIF, which counts in hundredths of a second; browsers slow down faster ones."""

MOST_FPS = 1000

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
    fps: Annotated[int, option("N", "Frames per second.")] = 10,
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
    if kind == ".gif" and fps not in GIF_FPS:
        choice = ", ".join(map(str, GIF_FPS))
        raise BadInput(f"--fps {fps}: a GIF counts in hundredths of a second; give {choice}, or name an .mp4 file")
    if not 0 < fps <= MOST_FPS:
        raise BadInput(f"--fps {fps}: expected 1 to {MOST_FPS}, such as --fps 10")
    if speed is not None and not 0.0 < speed < math.inf:
        raise BadInput(f"--speed {speed:g}: expected a number above 0, such as --speed 20")
    if not LEAST_WIDTH <= width <= MOST_WIDTH:
        raise BadInput(f"--width {width}: expected {LEAST_WIDTH} to {MOST_WIDTH} pixels, such as --width 480")
    check_matplotlib("sim")
    from matplotlib.animation import FFMpegWriter

    if kind == ".mp4" and not FFMpegWriter.isAvailable():
        raise BadInput(f"{out}: MP4 needs the program ffmpeg, which is not on PATH; install it, or name a .gif file")
    heed(None, patience=0)  # any signal raises KeyboardInterrupt, after which no half file stays
    opened, going = open_folder(run, key)
    first, last = _tick_span(opened, begin, end)
    pace = speed or max(math.ceil((last - first) * opened.step / LENGTH_S), 1)
    apart = pace / (fps * opened.step)
    if (count := int((last - first) / apart) + 1) > MOST_FRAMES:
        raise BadInput(
            f"--speed {pace:g}: makes more than {MOST_FRAMES} frames; give a higher --speed, a lower --fps, or a part "
            "of the run by --from and --to"
        )
    ticks = [first + round(number * apart) for number in range(count)]
    ticks += [last] if ticks[-1] != last else []
    from fogwatch.pictures.film import MOST_PIXELS, Film, write_film
    from fogwatch.terminal.live_table import bar_on

    film = Film(opened, width, max(int(opened.mfow[first : last + 1].max()), 1))
    if kind == ".gif" and len(ticks) > (frame_limit := max(MOST_PIXELS // math.prod(film.size), 1)):
        raise BadInput(
            f"{len(ticks)} frames of {film.size[0]} x {film.size[1]} pixels are more than a GIF is written with here; "
            f"give a higher --speed, or a lower --fps or --width, for at most {frame_limit} frames, or an .mp4 file"
        )
    with bar_on() as bar:
        write_film(film, out, bar.track(ticks, description="frames"), fps)
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
