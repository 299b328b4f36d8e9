from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from fogwatch.grounds.map_check import check_map
from fogwatch.inprocess import run_in_process
from fogwatch.pictures.maps import map_picture
from fogwatch.pictures.run_end import run_picture
from monitor.figures.ground import Key, Layer, canvas, cropped, fog_scale, key_column, painted, round_length
from monitor.replay.replay import Replay
from monitor.replay.run import open_run
from patrol.errors import BadInput
from patrol.ground.terrain import Terrain
from patrol.prepare import prepare
from patrol.scenario import dump_scenario, load_scenario

ROBOTS = {"count": 2, "model": "holonomic"}
SCENARIO: dict[str, Any] = {"terrain": {"builtin": "yards"}, "point": 1.0, "duration": 30, "robots": ROBOTS}


def run(folder: Path, **changes: Any) -> None:
    """Leave a run folder of a short run."""
    scenario = load_scenario({**SCENARIO, **changes})
    (folder / "scenario.yaml").write_text(dump_scenario(scenario), encoding="utf-8")
    prepared = prepare(scenario)
    run_in_process(prepared, journal=folder / "journal")


def size_of(picture: Path) -> tuple[int, int]:
    with Image.open(picture) as image:
        assert image.format == "PNG"
        return image.size


@pytest.mark.parametrize("sensor", [{}, {"quality": 0.6}, {"angle": 120.0, "range": 8.0}], ids=str)
def test_the_replayed_fog_is_the_worlds(tmp_path: Path, sensor: dict[str, Any]) -> None:
    run(tmp_path, sensor=sensor)
    ended = open_run(tmp_path)
    last = ended.ticks - 1
    fog = Replay(ended).fog(last)
    assert last == 59
    assert fog.mfow(last) == ended.mfow[last]
    assert fog.mean(last) == pytest.approx(ended.fog_mean[last])
    assert fog.seen == ended.seen[last]


def test_a_run_is_drawn_from_its_folder(tmp_path: Path) -> None:
    run(tmp_path)
    run_picture(open_run(tmp_path), tmp_path / "fog.png")
    assert min(size_of(tmp_path / "fog.png")) > 300


def test_a_run_that_was_cut_off_is_drawn_as_far_as_it_got(tmp_path: Path) -> None:
    run(tmp_path)
    whole = (tmp_path / "journal").read_bytes()
    (tmp_path / "journal").write_bytes(whole[: len(whole) // 2])
    run_picture(open_run(tmp_path), tmp_path / "fog.png")
    assert 0 < open_run(tmp_path).ticks < 60
    # The header is the longest record; nothing but it is left.
    header = whole[: whole.index(b"\xa4type\xa4tick") - 9]
    (tmp_path / "journal").write_bytes(header)
    with pytest.raises(BadInput, match="holds no complete tick"):
        run_picture(open_run(tmp_path), tmp_path / "fog.png")


def test_what_cannot_be_drawn_or_written_is_bad_input(tmp_path: Path) -> None:
    report = check_map(Terrain("field", np.ones((20, 20), dtype=np.bool_), 0.5), 1.0)
    with pytest.raises(BadInput, match="cannot be written"):
        map_picture(report, tmp_path / "none" / "map.png")


def test_later_layers_cover_earlier_ones() -> None:
    everywhere = np.ones((2, 3), dtype=np.bool_)
    corner = np.zeros((2, 3), dtype=np.bool_)
    corner[1, 2] = True
    image = painted((2, 3), [Layer("#102030", "ground", everywhere), Layer("#ffffff", "corner", corner)])
    assert image[0, 0].tolist() == [16, 32, 48]
    assert image[1, 2].tolist() == [255, 255, 255]


@pytest.mark.parametrize("shape", [(20, 400), (100, 160), (400, 20)], ids=str)
@pytest.mark.parametrize("lines", [3, 27])
def test_legend_colour_bar_and_scale_bar_never_overlap(shape: tuple[int, int], lines: int) -> None:
    terrain = Terrain("field", np.ones(shape, dtype=np.bool_), 0.5)
    figure, axes = canvas(terrain, "")
    keys = [Key("#102030", f"line {number}", "-") for number in range(lines)]
    key_column(figure, axes, terrain, keys, fog_scale(60.0), "time since last seen (s)")
    figure.draw_without_rendering()
    legend, (bar,) = axes.get_legend(), axes.child_axes
    assert legend is not None
    boxes = [legend.get_window_extent(), bar.get_tightbbox(), axes.lines[-1].get_window_extent()]
    assert boxes[-1] is not None
    for above, below in pairwise(boxes):
        assert above is not None
        assert below is not None
        assert above.y0 > below.y1
    assert boxes[1] is not None
    assert boxes[1].height > 150  # an inch


def test_robots_that_come_and_go_are_drawn_and_a_spare_one_that_never_joined_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    named: list[str] = []

    def noted(*drawn: Any) -> None:
        named.extend(key.label for key in drawn[3])
        key_column(*drawn)

    monkeypatch.setattr("monitor.figures.ground.key_column", noted)
    faults = [{"kind": "leave", "who": "r1", "at": 5}, {"kind": "join", "who": "r3", "at": 10}]
    run(tmp_path, robots={**ROBOTS, "spare": 2}, faults=faults)
    run_picture(open_run(tmp_path), tmp_path / "fog.png")
    assert min(size_of(tmp_path / "fog.png")) > 100
    assert [name for name in named if name.startswith("r")] == ["r1 (left)", "r2", "r3"]


@pytest.mark.parametrize(("about", "length"), [(14.3, 10), (7.4, 5), (34.0, 20), (0.99, 0.5), (1.0, 1.0)])
def test_scale_bars_are_round(about: float, length: float) -> None:
    assert round_length(about) == pytest.approx(length)


def test_a_small_building_on_a_large_map_fills_the_picture() -> None:
    free = np.zeros((4000, 4000), dtype=np.bool_)
    free[1000:1100, 3000:3200] = True
    shown, (rows, columns) = cropped(Terrain("speck", free, 0.05, (-100.0, -50.0)), free)
    assert shown.bounds == pytest.approx((49.7, -0.3, 60.3, 5.3))
    assert np.array_equal(free[rows, columns], shown.passable)
    whole = np.ones((40, 60), dtype=np.bool_)
    assert cropped(Terrain("open", whole, 1.0), whole)[0].bounds == (0.0, 0.0, 60.0, 40.0)
