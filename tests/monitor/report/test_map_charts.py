"""The maps of a report, from ground and paths that are told here."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from monitor.figures.ground import fog_scale
from monitor.report import map_charts
from monitor.report.map_charts import fog_chart, never_seen_note, paths_chart
from patrol.ground.terrain import Terrain
from patrol.journal.records import Status
from patrol.palette import NEVER_SEEN, rgb
from patrol.scenario import load_scenario

PASSABLE = np.ones((4, 6), dtype=np.bool_)
PASSABLE[0, 5] = False
TERRAIN = Terrain("hall", PASSABLE, 0.5, (10.0, 20.0))
PATROLLED = PASSABLE.copy()
PATROLLED[3, :] = False


def painted_of(monkeypatch: pytest.MonkeyPatch, most: float | None) -> tuple[Any, Any, Any]:
    """The image, the walls and the colour bar's end of a map of fog that grows by row and column."""
    painted: list[Any] = []
    monkeypatch.setattr(map_charts, "paint", lambda *what: painted.append(what))
    prepared = SimpleNamespace(
        terrain=TERRAIN, patrolled=PATROLLED, scenario=load_scenario({"terrain": {"builtin": "open"}})
    )
    run: Any = SimpleNamespace(prepared=prepared)
    fog = np.arange(24, dtype=np.float64).reshape(4, 6)
    never = np.zeros((4, 6), dtype=np.bool_)
    never[1, 2] = never[3, 3] = True
    chart = fog_chart(run, fog, never, "fog (s)", most)
    ((_, terrain, image, walls, _, _),) = painted
    assert terrain is TERRAIN
    return image, walls, chart.axes[1].get_ylim()[1]


@pytest.mark.parametrize(("most", "end"), [(None, 17.0), (40.0, 40.0)])
def test_ages_never_seen_and_uncounted_ground_have_their_colours(
    monkeypatch: pytest.MonkeyPatch, most: float | None, end: float
) -> None:
    """The patrolled ground is up to 17 s old: what lies beyond it does not count for the scale."""
    image, walls, top = painted_of(monkeypatch, most)
    assert top == end
    assert np.array_equal(walls, ~PASSABLE)
    scale = fog_scale(end)
    for row, col in ((0, 0), (1, 1), (2, 5), (2, 0)):
        assert image[row, col].tolist() == list(scale.to_rgba(np.array(6.0 * row + col), bytes=True))
    assert image[1, 2].tolist() == [*rgb(NEVER_SEEN), 255]
    for row, col in ((3, 0), (3, 3), (0, 5)):
        assert image[row, col].tolist() == [128, 128, 128, 56]


def test_only_ground_that_was_never_seen_is_said_to_be_shown() -> None:
    never = np.zeros((2, 2), dtype=np.bool_)
    assert never_seen_note(never) == ""
    never[1, 0] = True
    assert never_seen_note(never) == " Purple: never seen."


def run_on(tracks: list[list[tuple[float, float]]], status: list[list[Status]], end: list[str]) -> Any:
    """A run of robots that were at these places in each tick; `end` is how each ended."""
    poses = np.zeros((len(tracks[0]), len(tracks), 3))
    poses[:, :, :2] = np.array(tracks).transpose(1, 0, 2)
    figures = [SimpleNamespace(distance_m=10.0 * n + 0.6, status=word) for n, word in enumerate(end)]
    return SimpleNamespace(
        prepared=SimpleNamespace(terrain=TERRAIN),
        names=tuple(f"r{n}" for n in range(1, len(tracks) + 1)),
        poses=poses,
        status=np.array(status, dtype=np.uint8).T,
        ticks=len(tracks[0]),
        robot_figures=figures,
    )


def places_of(line: Any) -> list[list[float]]:
    shown: list[list[float]] = np.asarray(line.get_xydata()).tolist()
    return shown


def test_a_path_leads_from_its_ring_to_its_dot_or_cross() -> None:
    alive, left, absent, dead = Status.ALIVE, Status.LEFT, Status.ABSENT, Status.DEAD
    one = [(10.0, 20.0), (11.0, 20.5), (12.0, 21.0)]
    two = [(12.5, 21.5), (12.0, 21.0), (11.5, 20.5)]
    three = [(10.5, 21.5), (10.5, 21.0), (10.0, 20.5)]
    run = run_on(
        [one, two, three],
        [[alive, alive, dead], [absent, alive, left], [alive, alive, alive]],
        ["dead", "left", "lost"],
    )
    panels = [axes for axes in paths_chart(run).axes if axes.axison]
    assert [axes.get_title() for axes in panels] == ["r1: 1 m", "r2: 11 m", "r3: 21 m"]
    marks = []
    for axes in panels:
        _, ring, end = axes.lines
        marks.append((places_of(ring)[0], places_of(end)[0], end.get_marker()))
        assert ring.get_markerfacecolor() == "none"
    assert marks == [
        ([10.0, 20.0], [12.0, 21.0], "X"),
        ([12.0, 21.0], [12.0, 21.0], "o"),  # it was there in one tick alone
        ([10.5, 21.5], [10.0, 20.5], "X"),  # lost after the last tick
    ]
    assert places_of(panels[0].lines[0]) == [list(place) for place in one]
    assert (panels[0].get_xlim(), panels[0].get_ylim()) == ((10.0, 13.0), (20.0, 22.0))


@pytest.mark.parametrize(("robots", "panels"), [(12, 12), (13, 1)])
def test_up_to_twelve_robots_have_a_panel_each(robots: int, panels: int) -> None:
    track = [(10.0, 20.0), (11.0, 20.5)]
    run = run_on([track] * robots, [[Status.ALIVE] * 2] * robots, ["alive"] * robots)
    shown = [axes for axes in paths_chart(run).axes if axes.axison]
    assert len(shown) == panels
    assert sum(len(axes.lines) for axes in shown) == 3 * robots


@pytest.mark.parametrize(("ticks", "points"), [(2500, 2500), (2501, 1251)])
def test_a_long_path_is_thinned(ticks: int, points: int) -> None:
    track = [(10.0 + 0.001 * k, 20.0) for k in range(ticks)]
    run = run_on([track], [[Status.ALIVE] * ticks], ["alive"])
    path, _, end = paths_chart(run).axes[0].lines
    assert len(places_of(path)) == points
    assert places_of(end)[0] == pytest.approx(list(track[-1]))
