import re
import sys
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

import fogwatch
from fogwatch.commands import animate as animate_command
from fogwatch.pictures.film import DPI, STRIP, Film
from monitor.figures.ground import fog_scale
from monitor.replay.replay import Replay
from monitor.replay.run import open_run
from patrol.ground.fog import NEVER
from patrol.palette import NEVER_SEEN, ROBOTS, rgb
from tests.fleets import COARSE
from tests.fogwatch.conftest import Refused, Shell, cut_off

DOORS = {
    **COARSE,
    "duration": 20,
    "robots": {"count": 2, "model": "holonomic"},
    "closures": [{"name": "gate", "polygon": [[60, 60], [70, 60], [70, 70], [60, 70]], "closed": [[5, 10]]}],
    "zones": [{"name": "yard", "polygon": [[5, 60], [20, 60], [20, 75], [5, 75]], "weight": 3}],
    "faults": [{"kind": "kill", "who": "r2", "at": 12}],
}


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with a closure, a zone and a death; nobody changes it."""
    return fogwatch.run(DOORS, out=tmp_path_factory.mktemp("run") / "doors").folder


def frames_of(file: Path) -> list[tuple[np.ndarray, int]]:
    """The frames of a GIF as uint8 (h, w, 3), each with its duration, ms."""
    with Image.open(file) as image:
        return [(np.asarray(frame.convert("RGB")), frame.info["duration"]) for frame in ImageSequence.Iterator(image)]


def drawn(film: Film, k: int) -> np.ndarray:
    """The pixels of the map at a tick, uint8 (h, w, 3), row 0 lowest."""
    film.draw(k)
    pixels = BytesIO()
    film.figure.savefig(pixels, format="rgba", dpi=DPI)
    strip, (wide, high) = round(STRIP * DPI), film.size
    frame = np.frombuffer(pixels.getbuffer(), dtype=np.uint8).reshape(high, wide, 4)
    return frame[strip:-strip, :, :3][::-1]


def test_a_gif_lasts_as_long_as_asked_and_has_the_frames_of_its_ticks(ran: Path, shell: Shell, tmp_path: Path) -> None:
    arguments = ("--out", "a.gif", "--speed", "2", "--fps", "5", "--width", "401", "--from", "2", "--to", "18")
    assert "41 frames, 2 to 18 s at 2 times real time" in shell("animate", ran, *arguments).out
    assert [file.name for file in tmp_path.iterdir()] == ["a.gif"]
    frames = frames_of(tmp_path / "a.gif")
    # Frames that are equal are joined by Pillow, as several show the same tick.
    assert sum(duration for _, duration in frames) == 41 * 200
    run = open_run(ran)
    film = Film(run, 401, int(run.mfow[round(2 / run.step) : round(18 / run.step) + 1].max()))
    assert film.size == frames[0][0].shape[1::-1]
    strip = round(STRIP * DPI)
    for pixels, k in ((frames[0][0], round(2 / run.step)), (frames[-1][0], round(18 / run.step))):
        off = np.abs(pixels[strip:-strip][::-1].astype(int) - drawn(film, k)).max(axis=2)
        assert (off < 16).mean() > 0.97, "but for a few that GIF's 256 colours do not have"


def test_the_ground_shows_its_ages(ran: Path) -> None:
    run = open_run(ran)
    film = Film(run, 401, oldest := int(run.mfow.max()))
    scale = fog_scale(oldest * run.step)
    for k in (3, 21, 39):
        pixels, fog = drawn(film, k), Replay(run).fog(k)
        high, wide, _ = pixels.shape
        rows, cols = (
            (np.arange(n) + 0.5) * points / n for n, points in zip((high, wide), fog.age(k).shape, strict=True)
        )
        grid = np.ix_(rows.astype(int), cols.astype(int))
        expected = np.where(
            (fog.last_seen == NEVER)[grid][..., np.newaxis],
            rgb(NEVER_SEEN),
            scale.to_rgba(fog.age(k)[grid] * run.step, bytes=True)[..., :3],
        )
        equal = (np.abs(pixels.astype(int) - expected).max(axis=2) <= 1)[run.prepared.patrolled[grid]]
        assert equal.mean() > 0.8, "marks and trails cover a part"


def test_a_closed_door_is_filled_while_it_is_closed_and_a_death_shows(ran: Path) -> None:
    run = open_run(ran)
    film = Film(run, 400, 40)
    door = (slice(61 * 4, 69 * 4), slice(61 * 4, 69 * 4))
    orange = rgb("#e07b00")
    filled = [float((drawn(film, round(t / run.step))[door] == orange).all(axis=2).mean()) for t in (2, 8, 14)]
    assert filled[0] < 0.1
    assert filled[1] > 0.5
    assert filled[2] < 0.1

    def around(k: int) -> np.ndarray:
        """The pixels around r2."""
        column, row = np.rint(run.poses[k, 1, :2] * 4).astype(int)
        return drawn(film, k)[row - 5 : row + 6, column - 5 : column + 6]

    assert (around(39).max(axis=2) < 60).any(), "a dead robot is dark"
    assert list(rgb(ROBOTS[1])) in around(20).reshape(-1, 3).tolist()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--out", "a.avi"), "GIF or MP4"),
        (("--out", "a.gif", "--fps", "30"), "--fps 30: a GIF counts in hundredths of a second; give 1, 2, 4, 5, 10"),
        (("--out", "a.mp4", "--fps", "0"), "--fps 0: expected 1 to 1000"),
        (("--out", "a.gif", "--speed", "0"), "--speed 0: expected a number above 0"),
        (("--out", "a.gif", "--speed", "1e-300"), "makes more than 100000 frames; give a higher --speed"),
        (("--out", "a.gif", "--width", "10"), "--width 10: expected 320 to 1920"),
        (("--out", "a.gif", "--from", "99"), "--from 99: the run has 0 to 19.5 s"),
        (("--out", "a.gif", "--from", "9", "--to", "3"), "--to 3: is before --from 9"),
        (("--out", "none/a.gif"), "no such folder: none"),
        (("--out", "a.gif", "--fps", "50", "--speed", "0.01", "--width", "640"), "for at most 501 frames"),
    ],
    ids=str,
)
def test_bad_input_is_told_in_one_line(
    ran: Path, refused: Refused, tmp_path: Path, arguments: tuple[str, ...], words: str
) -> None:
    assert words in refused("animate", ran, *arguments)
    assert not list(tmp_path.iterdir())


def test_ctrl_c_leaves_no_file(ran: Path, shell: Shell, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    draw, ticks = Film.draw, []

    def interrupted(film: Film, k: int) -> None:
        ticks.append(k)
        if len(ticks) == 3:
            raise KeyboardInterrupt
        draw(film, k)

    monkeypatch.setattr(Film, "draw", interrupted)
    assert shell("animate", ran, "--out", "a.gif").code == 130
    assert len(ticks) == 3
    assert not list(tmp_path.iterdir())


def test_a_run_that_was_cut_off_is_shown_as_far_as_it_got(ran: Path, shell: Shell, tmp_path: Path) -> None:
    half = cut_off(ran, tmp_path / "half", 0.5)
    said = shell("animate", half, "--out", "a.gif", "--speed", "10", "--fps", "5")
    assert said.code == 0
    assert "was cut off" in said.err
    shown = re.search(r"(\d+) frames, 0 to ([\d.]+) s", said.out)
    assert shown is not None
    assert 0 < float(shown[2]) < 19
    assert sum(duration for _, duration in frames_of(tmp_path / "a.gif")) == 200 * int(shown[1])


FFMPEG = """#!{python}
import sys
wide, high = map(int, sys.argv[sys.argv.index("-s") + 1].split("x"))
read = sys.stdin.buffer.read()
if {fails}:
    sys.exit("no encoder\\nnothing written")
open(sys.argv[-1], "w").write(f"{{wide}} {{high}} {{len(read) / (wide * high * 4)}}")
"""


@pytest.mark.parametrize("fails", [False, True], ids=["works", "fails"])
def test_an_mp4_is_the_same_frames_piped_to_ffmpeg(
    ran: Path, shell: Shell, refused: Refused, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, fails: bool
) -> None:
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))
    assert "MP4 needs the program ffmpeg, which is not on PATH; install it" in refused("animate", ran, "--out", "a.mp4")
    (folder / "ffmpeg").write_text(FFMPEG.format(python=sys.executable, fails=fails), encoding="utf-8")
    (folder / "ffmpeg").chmod(0o755)
    said = shell("animate", ran, "--out", "a.mp4", "--speed", "10", "--fps", "2", "--width", "321")
    if fails:
        assert said.code == 2
        assert "ffmpeg cannot write it (nothing written)" in said.err
        assert [file.name for file in tmp_path.iterdir()] == ["bin"]
    else:
        assert said.code == 0
        assert (tmp_path / "a.mp4").read_text() == "320 342 5.0"


def test_a_film_of_a_whole_run_lasts_a_quarter_of_a_minute_at_most(ran: Path, shell: Shell) -> None:
    said = shell("animate", ran, "--out", "a.gif").out
    assert "98 frames, 0 to 19.5 s at 2 times real time" in said
    assert animate_command.LENGTH_S * 10 >= 98
