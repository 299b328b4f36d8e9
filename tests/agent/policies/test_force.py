"""The forces: Table 1, formula (1), their sums, and the horizon."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from agent.belief.dilated import Posts
from agent.policies.forces import (
    PAPER_AREA,
    ForceLaw,
    bearings_by_force,
    bearings_by_vector,
    distance_force,
    fow_force,
    reach_scale,
    sector_table,
)
from agent.policies.potential_field import Field, Pull
from agent.routes.ground import Ground
from patrol.ground.fields import StaticFields
from patrol.ground.terrain import Terrain
from patrol.prepare import prepare
from patrol.scenario import PotentialFieldOptions, load_scenario
from tests.agent.minds import setup_of

Bools = NDArray[np.bool_]


@pytest.mark.parametrize(
    ("name", "expected"),
    [("f1", 0.5), ("f2", 0.25), ("f3", math.exp(40 * 0.5)), ("f4", math.exp(40 * 0.25)), ("f5", math.exp(40 * 0.0625))],
)
def test_functions_of_the_fog_are_those_of_table_1(name: str, expected: float) -> None:
    assert fow_force(name, np.array([0.5]), 40.0)[0] == pytest.approx(expected)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("g1", 1 / 50),
        ("g2", 1 / 2500),
        ("g3", math.exp(-800 * 50 / 4000)),
        ("g4", math.exp(-2500 / 4000)),
        ("g5", math.exp(-(50**4) / (4000 * 800**2))),
    ],
)
def test_functions_of_the_length_are_those_of_table_1(name: str, expected: float) -> None:
    assert distance_force(name, np.array([50.0]), 4000.0, 800.0)[0] == pytest.approx(expected)


@pytest.mark.parametrize("function", [fow_force, distance_force])
def test_there_is_no_sixth_function(function: object) -> None:
    assert callable(function)
    with pytest.raises(ValueError, match="no function x6"):
        function("x6", np.ones(1), 40.0, *([800.0] if function is distance_force else []))


@pytest.mark.parametrize("point", [0.1, 0.5])
def test_lengths_count_in_points_of_a_tenth_of_a_metre_whatever_the_point(point: float) -> None:
    law = ForceLaw(PotentialFieldOptions(), point, 1000, 100_000)
    five_metres = round(5.0 / point) * 100
    assert law.decay[five_metres] == pytest.approx(math.exp(-(50.0**2) / 4000.0))
    assert law.decay[0] == 0.0


def test_the_horizon_of_the_papers_function_is_about_sixty_metres() -> None:
    law = ForceLaw(PotentialFieldOptions(), 0.1, 1_000_000, 400_000)
    assert law.limit / 100 == pytest.approx(math.sqrt(4000 * (40 + 36.84 + math.log(1e6))), rel=0.01)


def test_functions_without_a_horizon_follow_every_path() -> None:
    assert ForceLaw(PotentialFieldOptions(distance="g1"), 0.1, 10_000, 400_000).limit == 400_000


@pytest.mark.parametrize("distance", ["g1", "g2", "g3", "g4", "g5"])
def test_with_reach_area_the_law_is_the_papers_at_lengths_divided_by_the_scale(distance: str) -> None:
    """Four times the reference's ground per robot: twice the reach."""
    points = round(4 * PAPER_AREA / 0.25)
    paper = ForceLaw(PotentialFieldOptions(distance=distance), 0.5, points, 100_000, team=1)
    scaled = ForceLaw(PotentialFieldOptions(distance=distance, reach="area"), 0.5, points, 100_000, team=1)
    for metres in (1, 5, 20, 30):
        assert scaled.decay[metres * 400] == pytest.approx(paper.decay[metres * 200], rel=1e-9)
    shared = ForceLaw(PotentialFieldOptions(distance=distance, reach="area"), 0.5, points, 100_000, team=4)
    assert np.array_equal(shared.decay, paper.decay)


def test_the_reach_is_the_papers_on_its_own_ground_and_never_shorter() -> None:
    prepared = prepare(load_scenario({"terrain": {"builtin": "open"}, "point": 0.5, "robots": {"count": 5}}))
    area = np.count_nonzero(prepared.fields[1].patrolled) * 0.25 / 5
    assert area == pytest.approx(PAPER_AREA)
    assert reach_scale("area", area) == pytest.approx(1.0)
    assert reach_scale("area", area / 100) == 1.0
    assert reach_scale("area", 9 * PAPER_AREA) == pytest.approx(3.0)
    assert reach_scale("paper", 9 * PAPER_AREA) == 1.0


def test_spare_robots_share_no_ground() -> None:
    """The area per robot counts those that patrol from the start."""
    robots = {"count": 1, "spare": 3, "model": "holonomic"}
    given = {
        "terrain": {"builtin": "open"},
        "point": 1.0,
        "robots": robots,
        "patrol": {"policy": "potential-field", "options": {"reach": "area"}},
    }
    assert setup_of(prepare(load_scenario(given))).fleet.team == 1


def room(seed: int, height: int, width: int, density: float) -> tuple[Terrain, StaticFields, Ground, tuple[int, int]]:
    """A random terrain whose every passable point can be stood on, and an open start."""
    rng = np.random.default_rng(seed)
    passable = rng.random((height, width)) >= density
    row, col = int(rng.integers(height)), int(rng.integers(width))
    passable[row, col] = True
    terrain = Terrain("room", passable, 0.5)
    proxy = np.full(passable.shape, -1, dtype=np.int32)
    fields = StaticFields(passable, passable, passable, proxy)
    return terrain, fields, Ground(terrain, passable), (row + 1, col + 1)


def pull_of(patrol: PotentialFieldOptions, seed: int, density: float = 0.1) -> Pull:
    terrain, fields, ground, start = room(seed, 60, 70, density)
    seen = np.random.default_rng(seed + 1).integers(0, 200, terrain.shape).astype(np.int32)
    field = Field(patrol, fields, Posts(fields.proxy), terrain.point, {})
    return field.pull(ground, *start, seen, lambda _: seen, 200, 200 - int(seen[fields.patrolled].min()))


@settings(max_examples=25)
@given(seed=st.integers(0, 10**6), direction=st.sampled_from(["mode", "vector"]), f=st.sampled_from(["f1", "f3", "f4"]))
def test_leaving_out_what_lies_beyond_the_horizon_changes_no_decision(seed: int, direction: str, f: str) -> None:
    settings_ = {"direction": direction, "fow": f}
    cut = pull_of(PotentialFieldOptions(**settings_), seed)
    whole = pull_of(PotentialFieldOptions(**settings_, tolerance=0.0), seed)
    scale = whole.sums[2] if direction == "vector" else whole.sums.sum()
    assert np.allclose(cut.sums, whole.sums, rtol=0.0, atol=1e-12 * scale)
    if direction == "mode":
        assert bearings_by_force(cut.sums)[:1] == bearings_by_force(whole.sums)[:1]


def test_sums_equal_the_formula_point_by_point_on_an_open_field() -> None:
    terrain, fields, ground, start = room(3, 40, 50, 0.0)
    row, col = start[0] - 1, start[1] - 1
    seen = np.random.default_rng(5).integers(0, 100, terrain.shape).astype(np.int32)
    mfow = 100 - int(seen.min())
    expected = np.zeros(8)
    strongest, place = 0.0, (0, 0)
    for r, c in np.ndindex(terrain.shape):
        if (r, c) == (row, col):
            continue
        across, up = abs(c - col), abs(r - row)
        length = 5.0 * (abs(across - up) + 1.41 * min(across, up))
        force = math.exp(40 * (100 - seen[r, c]) / mfow) * math.exp(-(length**2) / 4000)
        sector = round(math.atan2(r - row, c - col) / (math.pi / 4)) % 8
        expected[sector] += force
        if force > strongest:
            strongest, place = force, (r, c)
    pull = Field(PotentialFieldOptions(), fields, Posts(fields.proxy), 0.5, {}).pull(
        ground, *start, seen, lambda _: seen, 100, mfow
    )
    assert pull.sums == pytest.approx(expected, rel=1e-9)
    assert pull.near is None or pull.near == (place[0] + 1, place[1] + 1)


def test_the_robots_own_point_exerts_no_force() -> None:
    terrain, fields, ground, start = room(3, 21, 21, 0.0)
    seen = np.full(terrain.shape, 100, dtype=np.int32)
    field = Field(PotentialFieldOptions(), fields, Posts(fields.proxy), 0.5, {})
    before = field.pull(ground, *start, seen, lambda _: seen, 100, 100)
    seen[start[0] - 1, start[1] - 1] = 0
    after = field.pull(ground, *start, seen, lambda _: seen, 100, 100)
    assert np.array_equal(before.sums, after.sums)


def test_a_point_where_no_body_fits_pulls_through_the_pose_that_sees_it() -> None:
    reach = np.zeros((30, 40), dtype=np.bool_)
    reach[10:20, 5:30] = True
    patrolled = reach.copy()
    patrolled[12, 35] = True
    proxy = np.full(reach.shape, -1, dtype=np.int32)
    proxy[12, 35] = 12 * 40 + 29
    terrain = Terrain("slit", np.ones_like(reach), 0.5)
    fields = StaticFields(reach, reach, patrolled, proxy)
    seen = np.full(reach.shape, 100, dtype=np.int32)
    seen[12, 35] = 0
    field = Field(PotentialFieldOptions(), fields, Posts(fields.proxy), 0.5, {})
    far = field.pull(Ground(terrain, reach), 13, 16, seen, lambda _: seen, 100, 100)
    assert bearings_by_force(far.sums)[0] == 0.0
    assert far.near is None
    close = field.pull(Ground(terrain, reach), 15, 25, seen, lambda _: seen, 100, 100)
    assert close.near == (13, 30)
    assert close.bend == (13, 30)


def test_a_place_close_by_counts_without_its_dilatation() -> None:
    terrain, fields, ground, _ = room(3, 41, 41, 0.0)
    seen = np.full(terrain.shape, 100, dtype=np.int32)
    seen[20, 24] = 0
    dilated = np.full(terrain.shape, 100, dtype=np.int32)
    dilated[14:27, 18:31] = 0
    pull = Field(PotentialFieldOptions(), fields, Posts(fields.proxy), 0.5, {}).pull(
        ground, 21, 21, seen, lambda _: dilated, 100, 100
    )
    assert pull.near == (21, 25)
    fresh = np.full(terrain.shape, 100, dtype=np.int32)
    pull = Field(PotentialFieldOptions(), fields, Posts(fields.proxy), 0.5, {}).pull(
        ground, 21, 21, fresh, lambda _: dilated, 100, 100
    )
    assert pull.near is None


def test_the_sector_table_centres_each_sector_on_its_bearing() -> None:
    for sectors in (4, 8, 36):
        table = sector_table(sectors, 30)
        for up, across in np.ndindex(61, 61):
            bearing = math.atan2(up - 30, across - 30) % (2 * math.pi)
            off = math.remainder(bearing - int(table[up, across]) * 2 * math.pi / sectors, 2 * math.pi)
            assert abs(off) <= math.pi / sectors + 1e-12


def test_mode_prefers_the_strongest_sector_and_of_equals_the_lowest() -> None:
    assert bearings_by_force(np.array([1.0, 0.0, 5.0, 5.0])) == [math.pi, -math.pi / 2, 0.0]
    assert bearings_by_force(np.zeros(8)) == []


def test_vector_sum_points_along_the_sum_first() -> None:
    bearings = bearings_by_vector(0.0, -2.0, 8)
    assert bearings[0] == pytest.approx(-math.pi / 2)
    assert len(bearings) == 8
    assert len({round(b, 9) for b in bearings}) == 8
    assert bearings_by_vector(0.0, 0.0, 8) == []


@pytest.mark.parametrize("mfow", [9, 100])
@pytest.mark.parametrize("direction", ["mode", "vector"])
def test_straight_paths_lead_to_no_obstacle(direction: str, mfow: int) -> None:
    """An obstacle was never seen; taken for ground it would be as old as the run, beyond the ages that there are."""
    passable = np.ones((60, 60), dtype=np.bool_)
    passable[30:32, 36:38] = False
    terrain = Terrain("block", passable, 0.5)
    fields = StaticFields(passable, passable, passable, np.full(passable.shape, -1, dtype=np.int32))
    seen = np.where(passable, np.int32(95), np.int32(-1))
    seen[31, 20] = 91
    patrol = PotentialFieldOptions.model_validate({"paths": "straight", "direction": direction})
    field = Field(patrol, fields, Posts(np.full_like(fields.proxy, -1)), terrain.point, {})
    tick = 100
    pull = field.pull(Ground(terrain, passable), 31, 31, seen, lambda _: seen, tick, mfow)
    law = ForceLaw(patrol, terrain.point, int(passable.sum()), 10**5)
    by_age = law.pull(mfow)
    expected = np.zeros(3 if direction == "vector" else 8)
    for row, col in np.argwhere(passable):
        up, across = row - 30, col - 30
        length = int(100.0 * math.hypot(up, across) + 0.5)
        if 0 < length <= law.limit:
            force = by_age[tick - seen[row, col]] * law.decay[length]
            if direction == "vector":
                expected += force * np.array([across, up, 0.0]) / math.hypot(up, across) + [0.0, 0.0, force]
            else:
                expected[sector_table(8, 60)[up + 60, across + 60]] += force
    assert np.allclose(pull.sums, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    assert pull.near == (32, 21)


def test_a_place_in_view_is_no_reason_to_stop_where_a_look_leaves_some_age() -> None:
    terrain, fields, ground, _ = room(3, 41, 41, 0.0)
    seen = np.full(terrain.shape, 100, dtype=np.int32)
    seen[20, 24] = 0
    looked = np.full(terrain.shape, 100, dtype=np.int32)
    field = Field(PotentialFieldOptions(), fields, Posts(fields.proxy), 0.5, {})
    assert field.pull(ground, 21, 21, seen, lambda _: seen, 100, 100, (), looked).near is None
    looked[20, 24] = 99
    assert field.pull(ground, 21, 21, seen, lambda _: seen, 100, 100, (), looked).near == (21, 25)
