from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

import fogwatch
from fogwatch.commands import animate as animate_command
from fogwatch.pictures.film import frame_ticks
from fogwatch.pictures.film_frames import SHADES, STRIP, FilmFrames
from monitor.replay.replay import Replay
from monitor.replay.run import Run, open_run
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


def shown_ages(run: Run, k: int, pixels: np.ndarray, palette: np.ndarray, oldest: int) -> int:
    """Compare the pixels that show an age with the replayed fog; return how many there are."""
    terrain, ages = run.prepared.terrain, Replay(run).fog(k).age(k)
    inside = pixels[STRIP:-STRIP]
    high, wide, _ = inside.shape
    shades = {tuple(colour): shade for shade, colour in enumerate(palette[:SHADES].tolist())}
    compared = 0
    for y in range(0, high, 3):
        for x in range(0, wide, 3):
            shade = shades.get(tuple(inside[y, x].tolist()))
            row, col = int((high - 1 - y + 0.5) * terrain.height / high), int((x + 0.5) * terrain.width / wide)
            if shade is None or not run.prepared.patrolled[row, col]:
                continue
            compared += abs(shade * oldest / (SHADES - 1) - ages[row, col]) <= 0.5 * oldest / (SHADES - 1) + 1e-9
    return compared


def test_a_gif_lasts_as_long_as_asked_and_shows_the_fog_of_its_ticks(ran: Path, shell: Shell, tmp_path: Path) -> None:
    arguments = ("--out", "a.gif", "--speed", "2", "--fps", "3", "--width", "401", "--from", "2", "--to", "18")
    assert "25 frames, 2 to 18 s at 2 times real time" in shell("animate", ran, *arguments).out
    assert [file.name for file in tmp_path.iterdir()] == ["a.gif"]
    frames = frames_of(tmp_path / "a.gif")
    assert len(frames) == 25
    # A third of a second is no whole number of hundredths; the film lasts 25 of them all the same.
    assert sum(duration for _, duration in frames) == 8330
    assert {duration for _, duration in frames} == {330, 340}
    run = open_run(ran)
    first, last = round(2 / run.step), round(18 / run.step)
    oldest = int(run.mfow[first : last + 1].max())
    film = FilmFrames(run, 400, oldest)
    assert film.size == frames[0][0].shape[1::-1] == (400, 2 * round(200 * 88 / 100) + 2 * STRIP)
    for number in (0, 11, 24):
        k = first + round(number * 2 / 3 / run.step)
        pixels = frames[number][0]
        assert (pixels == film.palette[film.frame(k)]).all()
        never = (pixels[STRIP:-STRIP] == rgb(NEVER_SEEN)).all(axis=2).mean()
        unseen = (Replay(run).fog(k).last_seen == NEVER)[run.prepared.patrolled].mean()
        assert never == pytest.approx(unseen, abs=0.06)  # trails and labels cover some


def test_each_pixel_of_the_ground_shows_its_age(ran: Path) -> None:
    run = open_run(ran)
    film = FilmFrames(run, 400, oldest := int(run.mfow.max()))
    sampled = 0
    for k in (3, 21, 39):
        assert Replay(run).fog(k).age(k)[run.prepared.patrolled].max() == run.mfow[k]
        pixels = film.palette[film.frame(k)]
        seen = (Replay(run).fog(k).last_seen != NEVER) & run.prepared.patrolled
        compared = shown_ages(run, k, pixels, film.palette, oldest)
        # A ninth of the pixels is looked at, 16 for each point; marks cover a part of them.
        assert compared > 0.6 * 16 / 9 * np.count_nonzero(seen)
        sampled += compared
    assert sampled > 1000


def test_a_closed_door_is_filled_while_it_is_closed_and_a_death_shows(ran: Path) -> None:
    run = open_run(ran)
    film = FilmFrames(run, 400, 40)
    door = (slice(STRIP + round(352 * (1 - 69 / 88)), STRIP + round(352 * (1 - 61 / 88))), slice(244, 276))
    orange = film.palette.tolist().index(list(rgb("#e07b00")))
    filled = [float((film.frame(round(t / run.step))[door] == orange).mean()) for t in (2, 8, 14)]
    assert filled[0] < 0.1
    assert filled[1] > 0.5
    assert filled[2] < 0.1

    def drawn(k: int) -> np.ndarray:
        """The pixels around r2."""
        x, y = run.poses[k, 1, :2]
        row, column = film.size[1] - STRIP - round(y * 4), round(x * 4)
        return np.asarray(film.palette[film.frame(k)[row - 3 : row + 4, column - 3 : column + 4]])

    assert (drawn(39).max(axis=2) < 60).any(), "a dead robot is dark"
    assert list(rgb(ROBOTS[1])) in drawn(20).reshape(-1, 3).tolist()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--out", "a.avi"), "GIF or MP4"),
        (("--out", "a.gif", "--fps", "80"), "--fps 80: expected more than 0 and at most 50"),
        (("--out", "a.gif", "--speed", "0"), "--speed 0: expected a number above 0"),
        (("--out", "a.gif", "--speed", "1e-300"), "makes more than 100000 frames; give a higher --speed"),
        (("--out", "a.gif", "--width", "10"), "--width 10: expected 320 to 1920"),
        (("--out", "a.gif", "--from", "99"), "--from 99: the run has 0 to 19.5 s"),
        (("--out", "a.gif", "--from", "9", "--to", "3"), "--to 3: is before --from 9"),
        (("--out", "none/a.gif"), "no such folder: none"),
        (("--out", "a.gif", "--fps", "50", "--speed", "0.01", "--width", "640"), "for at most 1014 frames"),
    ],
    ids=str,
)
def test_bad_input_is_told_in_one_line(
    ran: Path, refused: Refused, tmp_path: Path, arguments: tuple[str, ...], words: str
) -> None:
    assert words in refused("animate", ran, *arguments)
    assert not list(tmp_path.iterdir())


def test_ctrl_c_leaves_no_file(ran: Path, shell: Shell, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    draw, drawn = FilmFrames.frame, []

    def interrupted(film: FilmFrames, k: int) -> np.ndarray:
        drawn.append(k)
        if len(drawn) == 3:
            raise KeyboardInterrupt
        return draw(film, k)

    monkeypatch.setattr(FilmFrames, "frame", interrupted)
    assert shell("animate", ran, "--out", "a.gif").code == 130
    assert len(drawn) == 3
    assert not list(tmp_path.iterdir())


def test_a_run_that_was_cut_off_is_shown_as_far_as_it_got(ran: Path, shell: Shell, tmp_path: Path) -> None:
    half = cut_off(ran, tmp_path / "half", 0.5)
    said = shell("animate", half, "--out", "a.gif", "--speed", "10", "--fps", "5")
    assert said.code == 0
    assert "was cut off" in said.err
    shown = re.search(r"(\d+) frames, 0 to ([\d.]+) s", said.out)
    assert shown is not None
    assert 0 < float(shown[2]) < 19
    assert len(frames_of(tmp_path / "a.gif")) == int(shown[1])


FFMPEG = """#!{python}
import sys
wide, high = map(int, sys.argv[sys.argv.index("-s") + 1].split("x"))
read = sys.stdin.buffer.read()
if {fails}:
    sys.exit("no encoder\\nnothing written")
open(sys.argv[-1], "w").write(f"{{wide}} {{high}} {{len(read) / (wide * high * 3)}}")
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
        assert (tmp_path / "a.mp4").read_text() == "320 334 5.0"


def test_a_film_of_a_whole_run_lasts_a_quarter_of_a_minute_at_most() -> None:
    ticks = frame_ticks(0, 3000, 0.5, 100.0, 10.0)
    assert ticks == list(range(0, 3001, 20))
    assert len(ticks) == 10 * animate_command.LENGTH_S + 1
    assert frame_ticks(0, 4, 0.5, 1.0, 4.0) == [0, 0, 1, 2, 2, 2, 3, 4, 4]
    assert frame_ticks(5, 5, 0.5, 1.0, 4.0) == [5]
