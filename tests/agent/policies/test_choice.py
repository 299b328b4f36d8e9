"""The choice of a target: the best point of the whole terrain, whatever box it is found in."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from agent.kernels.best import any_nearer, best_of, longest_own_way, oldest_that_may_win, those_within
from agent.kernels.wave import FAR
from agent.policies import choice
from agent.policies.choice import Best, FreeChoice
from agent.policies.pursuit import GivenUp
from agent.routes.ground import NO_BENDS, BoxPaths
from agent.routes.wave import Wave
from patrol.pose import Pose
from tests.agent.plans import Robots, cluttered, prepared_in

# Not the product's own, so that a wrong one there is noticed.
MOST_AGE = 1e5
LONGEST = 2**26


def scores_by_looking_everywhere(
    choice: FreeChoice, view: Any, start: Any, rivals: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The score of each point of the terrain, by the wave of the whole of it and plain numpy."""
    terrain = view.ground.terrain
    wave: Any = Wave(terrain.height, terrain.width, max(terrain.shape))
    own = wave.lengths_from(view.ground, *start, [start], LONGEST)[1:-1, 1:-1].astype(np.float64)
    other = np.full(own.shape, np.inf)
    if len(rivals):
        others = [(row, col) for row, col in view.ground.static.join_each(rivals).tolist()]
        lengths = wave.lengths_from(view.ground.static, *start, others, LONGEST)[1:-1, 1:-1].astype(np.float64)
        other = np.where(lengths < FAR, lengths, np.inf)
    row, col = np.indices(own.shape)
    for point_row, point_col, post_row, post_col in choice.posts.rows.tolist():
        row[point_row, point_col], col[point_row, point_col] = post_row, post_col
    way, rival = own[row, col], other[row, col]
    age = np.where(view.fog.patrolled, view.tick - np.maximum(view.fog.last_seen, 0), 0).clip(0).astype(np.float64)
    # The docs' 3 m and tenth.
    score = age**2 / (way + 100.0 * 3.0 / terrain.point) * np.where(rival < way, 0.1, 1.0)
    return np.where((way < FAR) & (view.fog.looked != view.tick), score, 0.0)


@pytest.mark.parametrize("model", ["holonomic", "car"])
@pytest.mark.parametrize("separation", ["claims", "none"])
@pytest.mark.parametrize(
    ("shape", "columns"), [((100, 140), 3), ((26, 400), 3), ((100, 140), 8)], ids=["wide", "long", "crowded"]
)
def test_it_is_the_best_point_of_the_whole_terrain(
    model: str, separation: str, shape: tuple[int, int], columns: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    terrain = cluttered(15, shape, 30)
    high, wide = (size * terrain.point for size in shape)
    along = [0.75 + number for number in range(columns - 1)]
    starts = [Pose(x, y, 0.0) for x in (*along, wide - 0.75) for y in (0.75, high - 0.75)]
    body = {"radius": 0.3, "speed": 1.5, "model": model, "turning_radius": 1.0}
    patrol = {"policy": "agent.policies.commitment:Commitment", "options": {"separation": separation}}
    robots = Robots(prepared_in(terrain, starts, body, patrol=patrol, sensor={"range": 3.0}))
    real, searched = FreeChoice.best, []

    def checked(self: FreeChoice, view: Any, start: Any, rivals: NDArray[np.float64], given_up: GivenUp) -> Best | None:
        leaves_out = given_up.now(view.tick).size
        best = real(self, view, start, rivals, given_up)
        if best is not None and not leaves_out:
            scores = scores_by_looking_everywhere(self, view, start, rivals)
            assert scores[best.point] == pytest.approx(scores.max())
            searched.append(best)
        return best

    monkeypatch.setattr(FreeChoice, "best", checked)
    for _ in range(240 // columns):  # as many decisions, whatever the number of robots
        robots.tick()
    assert len(searched) > 20


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_kernel_finds_what_plain_python_finds(seed: int) -> None:
    dice = np.random.default_rng(seed)
    shape, tick, limit = (12, 14), 50, int(dice.integers(100, 3000))
    last_seen = dice.integers(-1, 52, shape).astype(np.int32)
    looked = np.where(dice.random(shape) < 0.1, tick, last_seen).astype(np.int32)
    patrolled = dice.random(shape) < 0.8

    def lengths(shape: tuple[int, int]) -> NDArray[np.int32]:
        return np.where(dice.random(shape) < 0.8, dice.integers(0, 1000, shape), FAR).astype(np.int32)

    own, rival = (BoxPaths(lengths((8, 9)), NO_BENDS, 2, 3, limit) for _ in range(2))
    posts = np.array([[0, 0, 5, 6], [11, 13, 3, 4], [1, 1, 40, 40]], dtype=np.int32)
    left_out = np.array([[5, 5, 2], [8, 9, 0]], dtype=np.int64)
    worth, near, others = np.arange(60.0) ** 2, 300.0, 0.1

    def score_of(row: int, col: int, stand_row: int, stand_col: int) -> float:
        way = own.length_to(stand_row, stand_col)
        age = tick - max(int(last_seen[row, col]), 0)
        if way > limit or age <= 0 or not patrolled[row, col] or looked[row, col] == tick:
            return 0.0
        if any((stand_row - r) ** 2 + (stand_col - c) ** 2 <= squared for r, c, squared in left_out.tolist()):
            return 0.0
        is_rivals = rival.length_to(stand_row, stand_col) < way
        return float(worth[age] / (way + near)) * (others if is_rivals else 1.0)

    rows = [(row, col, row, col) for row in range(2, 10) for col in range(3, 12)] + list(map(tuple, posts.tolist()))
    paths = own.length, own.row0, own.col0, limit, rival.length
    grids = patrolled, last_seen, looked, tick
    score, *place, length = best_of(posts, *paths, *grids, worth, near, others, left_out)
    scores = [score_of(*row) for row in rows]
    assert score == max(scores)
    if score > 0.0:
        assert tuple(place) == rows[scores.index(max(scores))]
        assert length == own.length_to(*place[2:])


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_bound_holds_for_each_point_and_a_patrolled_one_reaches_it(seed: int) -> None:
    dice = np.random.default_rng(seed)
    shape, tick, near = (9, 150), 50, 300.0
    patrolled, last_seen = dice.random(shape) < 0.7, dice.integers(-1, 52, shape).astype(np.int32)
    row, col, reach, gap = int(dice.integers(0, 9)), int(dice.integers(0, 150)), int(dice.integers(0, 160)), 1
    worth, score, most = np.arange(60.0) ** 2, float(dice.uniform(0.01, 6.0)), int(dice.integers(1, 60))

    around = (patrolled, last_seen, tick, row, col, reach, gap, worth, near, score)
    found, enough = oldest_that_may_win(*around, 60), oldest_that_may_win(*around, most)

    ages = [0]
    for there in np.argwhere(patrolled).tolist():
        up, across = abs(there[0] - row), abs(there[1] - col)
        away = sorted((max(up - gap, 0), max(across - gap, 0)))
        age = tick - max(int(last_seen[there[0], there[1]]), 0)
        if max(up, across) <= reach and age > 0 and worth[age] / (100 * away[1] + 41 * away[0] + near) >= score:
            ages.append(age)
    assert found == max(ages)
    assert enough == found if found < most else enough >= most


def test_an_age_counts_as_many_times_as_its_weight() -> None:
    """A weight draws a robot to a zone that it would not go to yet, and a low one keeps it away."""
    terrain = cluttered(1, (40, 120), 0)
    zone = {"name": "east", "polygon": [[20, 0], [30, 0], [30, 10], [20, 10]], "weight": 3}
    body = {"radius": 0.3, "speed": 1.5, "model": "holonomic"}
    patrol = {"policy": "agent.policies.commitment:Commitment", "options": {"separation": "claims"}}
    best = []
    for zones in ([], [zone], [zone | {"weight": 0.1}]):
        more: dict[str, Any] = {"patrol": patrol, "sensor": {"range": 3.0}, "zones": zones}
        robots = Robots(prepared_in(terrain, [Pose(15.0, 5.0, 0.0)], body, **more))
        for _ in range(3):
            robots.tick()
        mind: Any = robots.minds[0]
        best.append(mind.policy.otherwise.pursuit.target.point[1] * terrain.point)
    plain, heavy, light = best
    assert heavy >= 20.0
    assert light < 20.0
    assert abs(plain - 15.0) < 5.0


@pytest.mark.parametrize("jump", [round(MOST_AGE) - 2, round(MOST_AGE) - 1, round(MOST_AGE), 7 * 10**6])
def test_a_count_of_weeks_makes_no_table_of_weeks(jump: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The robot goes where it goes by the ages themselves."""
    terrain = cluttered(1, (40, 120), 0)
    body = {"radius": 0.3, "speed": 1.5, "model": "holonomic"}
    patrol = {"policy": "agent.policies.commitment:Commitment", "options": {"separation": "claims"}}
    ages: list[list[int]] = []
    targets = []

    def checked(*arguments: Any) -> Any:
        ages[-1].append(arguments[10].size)
        return best_of(*arguments)

    monkeypatch.setattr(choice, "best_of", checked)
    for most in (MOST_AGE, math.inf):
        monkeypatch.setattr(choice, "MOST_AGE", most)
        ages.append([])
        robots = Robots(prepared_in(terrain, [Pose(15.0, 5.0, 0.0)], body, patrol=patrol, sensor={"range": 3.0}))
        robots.k = jump
        for _ in range(3):
            robots.tick()
        mind: Any = robots.minds[0]
        targets.append(mind.policy.otherwise.pursuit.target.point)
    assert targets[0] == targets[1]
    bounded, unbounded = (max(sizes) for sizes in ages)
    assert (bounded, unbounded) == (min(jump + 2, round(MOST_AGE)) + 1, jump + 3)


@given(st.integers(0, 2**32 - 1), st.integers(0, 6))
def test_kernels_over_other_robots_find_what_arrays_find(seed: int, robots: int) -> None:
    dice = np.random.default_rng(seed)
    spots, (x, y, longest) = dice.integers(-4, 5, (robots, 2)).astype(np.float64), dice.integers(-3, 6, 3).tolist()
    away = np.sort(np.abs(spots - (x, y)), axis=1)
    assert any_nearer(spots, x, y, longest) == (away[:, 1] + 0.41 * away[:, 0] < longest).any()
    low, high = np.sort(dice.integers(-4, 5, (2, 2)), axis=0).astype(np.float64)
    inside = ((spots > low) & (spots < high)).all(axis=1)
    assert those_within(spots, *low.tolist(), *high.tolist()).tolist() == np.flatnonzero(inside).tolist()


@given(st.integers(0, 2**32 - 1), st.booleans())
def test_the_longest_way_of_ones_own_is_that_of_the_whole_grid(seed: int, has_rival: bool) -> None:
    dice = np.random.default_rng(seed)
    own, rival = dice.integers(0, 9, (2, 4, 5)).astype(np.int32)
    is_own = (own <= 6) & ((own <= rival) | (not has_rival))
    found = longest_own_way(own, rival if has_rival else np.zeros((0, 0), np.int32), 6)
    assert found == own.max(where=is_own, initial=0)


def test_a_length_just_over_the_limit_is_no_way() -> None:
    own = np.array([[6, 7]], dtype=np.int32)
    assert longest_own_way(own, np.zeros((0, 0), np.int32), 7) == 7
    assert longest_own_way(own, np.array([[5, 6]], dtype=np.int32), 7) == 0
