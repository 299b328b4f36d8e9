"""What is found nearby is what a look at all paths finds; boxes of cells hold the lengths that windows do."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from agent.policies.committed.cells import Layer, around, cells_of
from agent.policies.committed.kernels.hardest import hardest
from agent.policies.committed.kernels.stands import nearest_stand
from agent.policies.committed.nearby import Nearby, Question, Searched
from agent.policies.committed.search import NO_RIVALS, Decay
from agent.routes.ground import Ground
from agent.routes.path_window import FAR
from agent.routes.wave import LONGEST, Wave
from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.scenario import CommittedOptions
from tests.agent.plans import Robots, prepared_in

Choice = tuple[tuple[int, int], tuple[int, int]]


def cluttered(seed: int, shape: tuple[int, int], blocks: int, point: float = 0.25) -> Terrain:
    """Blocks on a plain, none of them near the corners."""
    dice = np.random.default_rng(seed)
    passable = np.ones(shape, dtype=np.bool_)
    for _ in range(blocks):
        row, col = (int(dice.integers(6, size - 6)) for size in shape)
        high, wide = (int(extent) for extent in dice.integers(1, 9, 2))
        passable[row : row + high, col : min(col + wide, shape[1] - 6)] = False
    return Terrain("cluttered", passable, point)


def by_all_paths(nearby: Nearby, asked: Question, start: tuple[int, int], whole: bool) -> Choice | None:
    """The same choice by windows over the whole terrain; None where not even the small one would hold a point."""
    view, wave = asked.view, asked.view.routes.window()
    for near in (False,) if whole else (True, False):
        limit = nearby._near if near else LONGEST
        rival = NO_RIVALS
        if nearby._width > 0.0 and len(asked.others):
            others = [(row + 1, col + 1) for row, col in asked.others.tolist()]
            rival = wave.lengths_from(view.ground.static, *start, others, limit)
        lengths = wave.lengths_from(view.ground, *start, [start], limit)
        decay = asked.decay.table(int(lengths[lengths < FAR].max()))
        best, place = np.array([-np.inf]), np.zeros(4, dtype=np.int64)
        for points in (None, nearby._posts.rows):
            hardest(
                points,
                wave.state,
                wave.length,
                wave.row0,
                wave.col0,
                0,
                wave.state.shape[0],
                0,
                wave.state.shape[1],
                view.fog.last_seen,
                view.fog.looked,
                view.tick,
                asked.least,
                asked.pull,
                decay,
                rival,
                nearby._width,
                asked.hand_over,
                asked.shunned,
                0,
                0,
                -1,
                best,
                place,
            )
        if best[0] == -np.inf:
            return None
        if not near or best[0] > asked.beyond(limit):
            row, col, stand_row, stand_col = place.tolist()
            return (row, col), (stand_row, stand_col)
    return None


@pytest.mark.parametrize("model", ["holonomic", "car"])
@pytest.mark.parametrize("separation", ["claims", "none"])
@pytest.mark.parametrize(("fow", "distance"), [("f3", "g4"), ("f1", "g1"), ("f2", "g5")])
def test_it_is_the_point_that_pulls_hardest_of_all(
    model: str, separation: str, fow: str, distance: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    terrain = cluttered(15, (100, 140), 30)
    starts = [Pose(0.75, 0.75, 0.0), Pose(0.75, 24.0, 0.0), Pose(34.0, 0.75, 2.0)]
    body = {"radius": 0.3, "speed": 1.5, "model": model, **({"turning_radius": 1.0} if model == "car" else {})}
    patrol = {"separation": separation, "claim_width": 0.1, "fow": fow, "distance": distance}
    robots = Robots(prepared_in(terrain, starts, body, patrol=patrol, sensor={"range": 3.0}))
    limits: list[int] = []
    found, real = [], Nearby.find

    def checked(self: Nearby, asked: Question, start: tuple[int, int], *, whole: bool = False) -> Searched:
        searched = real(self, asked, start, whole=whole)
        result = searched.best
        other = real(self, asked, start, whole=not whole).best
        assert other is None or (other.point, other.close) == by_all_paths(self, asked, start, not whole)
        wanted = by_all_paths(self, asked, start, whole)
        assert result is None or (result.point, result.close) == wanted
        found.append(result is not None)
        if result is not None:
            limits.append(result.cells.limit)
        return searched

    monkeypatch.setattr(Nearby, "find", checked)
    for _ in range(80):
        robots.tick()
    assert sum(found) > 10
    assert min(limits) < 100 * math.ceil(2.5 * 3.0 / terrain.point), "it never looks at less than the small window"


@pytest.mark.parametrize("model", ["holonomic", "car"])
@pytest.mark.parametrize("separation", ["claims", "none"])
def test_farther_away_too_it_is_the_point_that_pulls_hardest_of_the_whole_terrain(
    model: str, separation: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    terrain = cluttered(15, (100, 140), 30)
    starts = [Pose(x, y, 0.0) for x in (0.75, 1.75, 2.75, 34.0) for y in (0.75, 1.75, 24.0)]
    body = {"radius": 0.3, "speed": 1.5, "model": model, **({"turning_radius": 1.0} if model == "car" else {})}
    patrol = {"separation": separation, "claim_width": 0.1}
    robots = Robots(prepared_in(terrain, starts, body, patrol=patrol, sensor={"range": 3.0}))
    found: Counter[str] = Counter()
    real = Nearby.find

    def checked(self: Nearby, asked: Question, start: tuple[int, int], *, whole: bool = False) -> Searched:
        result = self.find_far(asked, start)
        own = by_all_paths(self, asked, start, whole=True)
        wanted = own or by_all_paths(self, asked._replace(hand_over=FAR), start, whole=True)
        assert result is None or (result.point, result.close) == wanted
        found["unknown" if result is None else "own" if own else "of a rival"] += 1
        return real(self, asked, start, whole=whole)

    monkeypatch.setattr(Nearby, "find", checked)
    for _ in range(80):
        robots.tick()
    assert found["own"] > 20
    assert (found["of a rival"] > 0) == (separation == "claims")


@pytest.mark.parametrize("seed", range(5))
def test_a_box_holds_the_lengths_of_paths_that_do_not_leave_it(seed: int) -> None:
    terrain = cluttered(seed, (60, 70), 40)
    ground, wave = Ground(terrain, terrain.passable), Wave(60, 70, 70)
    starts, limit = [(3, 4), (2, 66)], 2000
    whole = wave.lengths_from(ground, 4, 5, [(row + 1, col + 1) for row, col in starts], limit)
    cells = Layer().lay(ground, starts, around(starts, limit // 100 + 2, terrain.shape), limit)
    for row in range(24):
        for col in range(70):
            known = int(cells.cell[row - cells.row0, col - cells.col0])
            length = known >> 1 if 0 < known <= 2 * limit + 1 else FAR
            assert length == whole[row + 1, col + 1]


@pytest.mark.parametrize("seed", range(20))
def test_claimed_ground_reaches_as_far_as_the_paths_of_all_robots_say(seed: int) -> None:
    dice = np.random.default_rng(seed)
    terrain = cluttered(seed, (60, 70), int(dice.integers(0, 60)))
    ground, wave = Ground(terrain, terrain.passable), Wave(60, 70, 70)
    open_points = np.argwhere(terrain.passable)
    start, *others = open_points[dice.integers(0, len(open_points), int(dice.integers(1, 8)))].tolist()
    if seed % 5 == 0:
        others.append(start)
    rivals = np.array(others, dtype=np.int64).reshape(-1, 2)
    rival = wave.lengths_from(ground, 1, 1, [(row + 1, col + 1) for row, col in others], LONGEST)
    own = wave.lengths_from(ground, 1, 1, [(start[0] + 1, start[1] + 1)], LONGEST)
    off = np.vstack([rivals, [[-1, 3], [60, 3], [3, 70]]])
    for limit in (LONGEST, int(dice.integers(0, 4000))):
        for lead in (0, 1, int(dice.integers(1, 3000)), LONGEST):
            expected = int(own[(own <= np.minimum(rival.astype(np.int64) + lead, limit))].max())
            assert Layer().claimed(ground, (start[0], start[1]), off, lead, limit) == expected


@pytest.mark.parametrize("seed", range(6))
def test_claimed_ground_is_measured_in_a_box_no_smaller_than_what_decides_it(seed: int) -> None:
    dice = np.random.default_rng(seed)
    terrain = cluttered(seed, (200, 230), 120)
    ground, wave, layer = Ground(terrain, terrain.passable), Wave(200, 230, 230), Layer()
    open_points = np.argwhere(terrain.passable)
    for team in (60, 60, 2, 25, 60):
        start, *others = open_points[dice.integers(0, len(open_points), team)].tolist()
        rival = wave.lengths_from(ground, 1, 1, [(row + 1, col + 1) for row, col in others], LONGEST)
        own = wave.lengths_from(ground, 1, 1, [(start[0] + 1, start[1] + 1)], LONGEST)
        lead = int(dice.choice([0, 700]))
        expected = int(own[own <= np.minimum(rival.astype(np.int64) + lead, LONGEST)].max())
        rivals = np.array(others, dtype=np.int64)
        layer._reach = int(dice.integers(1, 80))
        for _ in range(2):
            assert layer.claimed(ground, (start[0], start[1]), rivals, lead, LONGEST) == expected


@pytest.mark.parametrize("name", ["g1", "g2", "g3", "g4", "g5"])
def test_a_table_of_g_holds_what_each_length_gives_by_itself(name: str) -> None:
    decay = Decay(CommittedOptions.model_validate({"distance": name}), 0.1)
    for stretch in (1.0, 3.7, 1.0):
        decay.stretch(stretch)
        for longest in (0, 7, 500, 120, 9001):
            table = decay.table(longest)
            alone = [decay.of(np.array([max(length, 1)]))[0] for length in range(longest + 1)]
            assert table.tolist() == alone


def test_where_there_is_not_room_enough_it_makes_more() -> None:
    terrain = cluttered(3, (300, 300), 900)
    ground, wave = Ground(terrain, terrain.passable), Wave(300, 300, 300)
    layer = Layer()
    cells = layer.lay(ground, [(2, 2)], (0, 300, 0, 300), LONGEST)
    expected = wave.lengths_from(ground, 3, 3, [(3, 3)], LONGEST)
    np.testing.assert_array_equal(
        np.where(cells.cell == 0, FAR, cells.cell >> 1)[expected < FAR], expected[expected < FAR]
    )
    box = (20, 50, 30, 90)
    part = cells_of(wave, None, box, LONGEST)
    assert part.length(33, 44) == expected[34, 45]
    assert part.cell.shape == (30, 60)


def eroded(mask: NDArray[np.uint8], by: int) -> NDArray[np.uint8]:
    """The points of a mask whose neighbours, up to ``by`` rows and columns away, all belong to it."""
    rows, cols = mask.shape
    around_all = np.pad(mask, by)
    parts = [around_all[up : up + rows, left : left + cols] for up in range(2 * by + 1) for left in range(2 * by + 1)]
    inner: NDArray[np.uint8] = np.minimum.reduce(parts)
    return inner


@pytest.mark.parametrize("seed", range(60))
def test_a_stand_is_the_first_of_the_nearest_points_with_room_to_spare(seed: int) -> None:
    dice = np.random.default_rng(seed)
    shape = tuple(int(size) for size in dice.integers(1, 20, 2))
    seen = (dice.random(shape) < dice.choice([0.3, 0.9, 1.0])).astype(np.uint8)
    slack, limit = int(dice.integers(0, 4)), 300
    cell = dice.choice([0, 101, 200, 401, 600, 601, 603, 5000], tuple(int(n) for n in dice.integers(1, 25, 2)))
    cell = cell.astype(np.uint32)
    row0, col0 = (int(n) for n in dice.integers(-4, 6, 2))
    inner = eroded(seen, slack)
    wanted: Any = inner if inner.any() else seen
    best = (limit + 1, -1)
    for row in range(shape[0]):
        for col in range(shape[1]):
            there = row0 + row, col0 + col
            inside = all(0 <= place < size for place, size in zip(there, cell.shape, strict=True))
            if wanted[row, col] and inside and cell[there] and cell[there] >> 1 < best[0]:
                best = int(cell[there]) >> 1, row * shape[1] + col
    assert nearest_stand(seen, slack, row0, col0, cell, limit) == best[1]
