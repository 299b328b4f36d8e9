"""Films of runs: which ticks their frames show, and how they are written, as animated GIF or, by ffmpeg, as MP4."""

from __future__ import annotations

import subprocess
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from shutil import which
from tempfile import TemporaryFile

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from patrol.errors import BadInput, printable
from patrol.files.whole_file import replacing, writing

Pixels = NDArray[np.uint8]

MOST_PIXELS = 400_000_000
"""Pixels of all frames of a GIF, which are kept in memory until the file is complete."""


def frame_ticks(first: int, last: int, step: float, speed: float, fps: float) -> list[int]:
    """Return the tick that each frame shows, ascending, from the first to the last, which is always shown.

    `step` is in s, `speed` is simulated time per time of the film. If frames follow each other faster than ticks,
    several show the same one.
    """
    apart = speed / (fps * step)
    ticks = [first + round(number * apart) for number in range(frame_count(first, last, step, speed, fps))]
    return ticks if ticks[-1] == last else [*ticks, last]


def frame_count(first: int, last: int, step: float, speed: float, fps: float) -> int:
    """Return the number of frames of `frame_ticks`, without one that is added for the last tick."""
    return int((last - first) / (speed / (fps * step))) + 1


def write_gif(out: Path, frames: Iterable[Pixels], count: int, palette: Pixels, fps: float) -> None:
    """Write a GIF that repeats for ever.

    Each of the `count` frames is uint8 (height, width), indices into the palette, which is uint8 (256, 3). `fps` is at
    most 50.
    """
    # GIF counts in hundredths of a second: the ends of frames are rounded, so that errors do not add up.
    ends = [round(100.0 * number / fps) for number in range(count + 1)]
    durations = [10 * (end - begin) for begin, end in pairwise(ends)]

    def images() -> Iterator[Image.Image]:
        for pixels in frames:
            image = Image.fromarray(pixels, "P")
            image.putpalette(palette.tobytes())
            yield image

    remaining = images()
    with writing(out), replacing(out) as part, part.open("wb") as file:
        animated = {"save_all": True, "duration": durations, "loop": 0, "optimize": False}
        next(remaining).save(file, "GIF", append_images=remaining, **animated)


def find_ffmpeg(out: Path) -> str:
    """Return the path of ffmpeg; `out`, the file to write with it, is named in the error."""
    program = which("ffmpeg")
    if program is None:
        raise BadInput(f"{out}: MP4 needs the program ffmpeg, which is not on PATH; install it, or name a .gif file")
    return program


def write_mp4(out: Path, frames: Iterable[Pixels], palette: Pixels, fps: float, ffmpeg: str) -> None:
    """Write a film by ffmpeg, with its own choice of encoder.

    Frames and palette are as for `write_gif`; both sides of a frame are even.
    """
    remaining = iter(frames)
    first = next(remaining)
    height, width = first.shape
    input_options = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{fps:g}", "-i", "-"]
    output_options = ["-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4"]
    with writing(out), replacing(out) as part, TemporaryFile() as messages:
        process = subprocess.Popen(
            [ffmpeg, "-v", "error", "-y", *input_options, *output_options, str(part.absolute())],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=messages,
        )
        try:
            assert process.stdin is not None
            try:
                process.stdin.write(palette[first].tobytes())
                for pixels in remaining:
                    process.stdin.write(palette[pixels].tobytes())
                process.stdin.close()
            except BrokenPipeError:
                pass  # ffmpeg has ended, and has said why
            code = process.wait()
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
        messages.seek(0)
        lines = messages.read().decode(errors="replace").strip().splitlines()
        if code != 0:
            why = printable(lines[-1]) if lines else f"exit code {code}"
            raise BadInput(f"{out}: ffmpeg cannot write it ({why}); name a .gif file, or use another ffmpeg")


def check_length(count: int, size: Sequence[int]) -> None:
    """Check that the frames of a GIF, each of `size` (width and height, pixels), fit into memory."""
    frame_limit = max(MOST_PIXELS // (size[0] * size[1]), 1)
    if count > frame_limit:
        raise BadInput(
            f"{count} frames of {size[0]} x {size[1]} pixels are more than a GIF is written with here; give a higher "
            f"--speed, or a lower --fps or --width, for at most {frame_limit} frames, or name an .mp4 file"
        )
