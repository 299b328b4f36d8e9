"""The forces: Table 1, formula (1), their sums, and the horizon."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from agent.policies import forces
from patrol.ground.fields import StaticFields
from patrol.prepare import prepare
from patrol.scenario import PotentialFieldOptions, load_scenario
from tests.agent.minds import fields_of, pull_on, setup_of


@pytest.mark.parametrize(
    ("name", "expected"),
    [("f1", 0.5), ("f2", 0.25), ("f3", math.exp(40 * 0.5)), ("f4", math.exp(40 * 0.25)), ("f5", math.exp(40 * 0.0625))],
)
def test_functions_of_the_fog_are_those_of_table_1(name: str, expected: float) -> None:
    assert forces.fow_force(name, np.array([0.5]), 40.0)[0] == pytest.approx(expected)


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
    assert forces.distance_force(name, np.array([50.0]), 4000.0, 800.0)[0] == pytest.approx(expected)


@pytest.mark.parametrize("function", [forces.fow_force, forces.distance_force])
def test_there_is_no_sixth_function(function: object) -> None:
    assert callable(function)
    with pytest.raises(ValueError, match="no function x6"):
        function("x6", np.ones(1), 40.0, *([800.0] if function is forces.distance_force else []))


@pytest.mark.parametrize("point", [0.1, 0.5])
def test_lengths_count_in_points_of_a_tenth_of_a_metre_whatever_the_point(point: float) -> None:
    law = forces.ForceLaw(PotentialFieldOptions(), point, 1000, 100_000)
    five_metres = round(5.0 / point) * 100
    assert law.decay[five_metres] == pytest.approx(math.exp(-(50.0**2) / 4000.0))
    assert law.decay[0] == 0.0


def test_the_horizon_of_the_papers_function_is_about_sixty_metres() -> None:
    law = forces.ForceLaw(PotentialFieldOptions(), 0.1, 1_000_000, 400_000)
    assert law.limit / 100 == pytest.approx(math.sqrt(4000 * (40 + 36.84 + math.log(1e6))), rel=0.01)


def test_functions_without_a_horizon_follow_every_path() -> None:
    assert forces.ForceLaw(PotentialFieldOptions(distance="g1"), 0.1, 10_000, 400_000).limit == 400_000


@pytest.mark.parametrize("distance", ["g1", "g2", "g3", "g4", "g5"])
def test_with_reach_area_the_law_is_the_papers_at_lengths_divided_by_the_scale(distance: str) -> None:
    """Four times the reference's ground per robot: twice the reach."""
    points = round(4 * forces.PAPER_AREA / 0.25)
    paper = forces.ForceLaw(PotentialFieldOptions(distance=distance), 0.5, points, 100_000, team=1)
    scaled = forces.ForceLaw(PotentialFieldOptions(distance=distance, reach="area"), 0.5, points, 100_000, team=1)
    for metres in (1, 5, 20, 30):
        assert scaled.decay[metres * 400] == pytest.approx(paper.decay[metres * 200], rel=1e-9)
    shared = forces.ForceLaw(PotentialFieldOptions(distance=distance, reach="area"), 0.5, points, 100_000, team=4)
    assert np.array_equal(shared.decay, paper.decay)


def test_the_reach_is_the_papers_on_its_own_ground_and_never_shorter() -> None:
    prepared = prepare(load_scenario({"terrain": {"builtin": "open"}, "point": 0.5, "robots": {"count": 5}}))
    area = np.count_nonzero(prepared.fields[1].patrolled) * 0.25 / 5
    assert area == pytest.approx(forces.PAPER_AREA)
    assert forces.reach_scale("area", area) == pytest.approx(1.0)
    assert forces.reach_scale("area", area / 100) == 1.0
    assert forces.reach_scale("area", 9 * forces.PAPER_AREA) == pytest.approx(3.0)
    assert forces.reach_scale("paper", 9 * forces.PAPER_AREA) == 1.0


def test_spare_robots_share_no_ground() -> None:
    """The area per robot counts those that patrol from the start."""
    robots = {"count": 1, "spare": 3, "model": "holonomic"}
    patrol = {"policy": "potential-field", "options": {"reach": "area"}}
    given = {"terrain": {"builtin": "open"}, "point": 1.0, "robots": robots, "patrol": patrol}
    assert setup_of(prepare(load_scenario(given))).fleet.team == 1


def room(seed: int, height: int, width: int, density: float) -> tuple[StaticFields, tuple[int, int]]:
    """Random ground, and a start on it."""
    rng = np.random.default_rng(seed)
    passable = rng.random((height, width)) >= density
    row, col = int(rng.integers(height)), int(rng.integers(width))
    passable[row, col] = True
    return fields_of(passable), (row + 1, col + 1)


def ticks(side: int, *stale: tuple[int | slice, int | slice]) -> NDArray[np.int32]:
    """Ticks at which points of a square were last seen: now, except stale ones."""
    seen = np.full((side, side), 100, dtype=np.int32)
    for place in stale:
        seen[place] = 0
    return seen


@pytest.mark.parametrize("mfow", [forces.OLDEST - 1, forces.OLDEST, forces.OLDEST + 1, 7 * 10**6])
def test_ages_count_up_to_a_bound(mfow: int) -> None:
    """A count of ticks that jumps by weeks makes no table of weeks; up to the bound, nothing is changed."""
    law = forces.ForceLaw(PotentialFieldOptions(fow="f1"), 0.5, 100, 10**4)
    table = law.pull(mfow)
    oldest = min(mfow, forces.OLDEST)
    assert table.tolist() == (np.arange(oldest + 1) / oldest).tolist()

    def pull_of(age: int) -> float:
        seen = np.full((21, 21), mfow, dtype=np.int32)
        seen[5, 5] = mfow - age
        pull = pull_on(fields_of(np.ones((21, 21), dtype=np.bool_)), (11, 11), seen, tick=mfow, mfow=mfow, fow="f1")
        return float(pull.sums.max())

    assert pull_of(mfow) == pull_of(oldest)
    assert 0.0 < pull_of(oldest - 1) < pull_of(oldest)


@settings(max_examples=25)
@given(seed=st.integers(0, 10**6), direction=st.sampled_from(["mode", "vector"]), f=st.sampled_from(["f1", "f3", "f4"]))
def test_leaving_out_what_lies_beyond_the_horizon_changes_no_decision(seed: int, direction: str, f: str) -> None:
    fields, start = room(seed, 60, 70, 0.1)
    seen = np.random.default_rng(seed + 1).integers(0, 100, fields.reach.shape).astype(np.int32)
    mfow = 100 - int(seen[fields.patrolled].min())
    settings_: list[dict[str, Any]] = [{}, {"tolerance": 0.0}]
    cut, whole = (pull_on(fields, start, seen, mfow=mfow, direction=direction, fow=f, **more) for more in settings_)
    scale = whole.sums[2] if direction == "vector" else whole.sums.sum()
    assert np.allclose(cut.sums, whole.sums, rtol=0.0, atol=1e-12 * scale)
    if direction == "mode":
        assert forces.bearings_by_force(cut.sums)[:1] == forces.bearings_by_force(whole.sums)[:1]


def test_sums_equal_the_formula_point_by_point_on_an_open_field() -> None:
    fields, start = room(3, 40, 50, 0.0)
    row, col = start[0] - 1, start[1] - 1
    seen = np.random.default_rng(5).integers(0, 100, fields.reach.shape).astype(np.int32)
    mfow = 100 - int(seen.min())
    expected = np.zeros(8)
    strongest, place = 0.0, (0, 0)
    for r, c in np.ndindex(seen.shape):
        if (r, c) == (row, col):
            continue
        across, up = abs(c - col), abs(r - row)
        length = 5.0 * (abs(across - up) + 1.41 * min(across, up))
        force = math.exp(40 * (100 - seen[r, c]) / mfow) * math.exp(-(length**2) / 4000)
        sector = round(math.atan2(r - row, c - col) / (math.pi / 4)) % 8
        expected[sector] += force
        if force > strongest:
            strongest, place = force, (r, c)
    pull = pull_on(fields, start, seen, mfow=mfow)
    assert pull.sums == pytest.approx(expected, rel=1e-9)
    assert pull.near is None or pull.near == (place[0] + 1, place[1] + 1)


def test_the_robots_own_point_exerts_no_force() -> None:
    fields, (row, col) = room(3, 21, 21, 0.0)
    before, after = (pull_on(fields, (row, col), seen) for seen in (ticks(21), ticks(21, (row - 1, col - 1))))
    assert np.array_equal(before.sums, after.sums)


def test_a_point_where_no_body_fits_pulls_through_the_pose_that_sees_it() -> None:
    reach = np.zeros((30, 40), dtype=np.bool_)
    reach[10:20, 5:30] = True
    patrolled = reach.copy()
    patrolled[12, 35] = True
    fields = replace(fields_of(reach), patrolled=patrolled)
    fields.proxy[12, 35] = 12 * 40 + 29
    seen = ticks(40, (12, 35))[:30]
    far, close = (pull_on(fields, start, seen) for start in ((13, 16), (15, 25)))
    assert forces.bearings_by_force(far.sums)[0] == 0.0
    assert far.near is None
    assert close.near == close.bend == (13, 30)


def test_a_place_close_by_counts_without_its_dilatation() -> None:
    fields, dilated = fields_of(np.ones((41, 41), dtype=np.bool_)), ticks(41, (slice(14, 27), slice(18, 31)))
    assert pull_on(fields, (21, 21), ticks(41, (20, 24)), dilated=dilated).near == (21, 25)
    assert pull_on(fields, (21, 21), ticks(41), dilated=dilated).near is None


def test_the_sector_table_centres_each_sector_on_its_bearing() -> None:
    for sectors in (4, 8, 36):
        table = forces.sector_table(sectors, 30)
        for up, across in np.ndindex(61, 61):
            bearing = math.atan2(up - 30, across - 30) % (2 * math.pi)
            off = math.remainder(bearing - int(table[up, across]) * 2 * math.pi / sectors, 2 * math.pi)
            assert abs(off) <= math.pi / sectors + 1e-12


def test_mode_prefers_the_strongest_sector_and_of_equals_the_lowest() -> None:
    assert forces.bearings_by_force(np.array([1.0, 0.0, 5.0, 5.0])) == [math.pi, -math.pi / 2, 0.0]
    assert forces.bearings_by_force(np.zeros(8)) == []


def test_vector_sum_points_along_the_sum_first() -> None:
    bearings = forces.bearings_by_vector(0.0, -2.0, 8)
    assert bearings[0] == pytest.approx(-math.pi / 2)
    assert len(bearings) == 8
    assert len({round(b, 9) for b in bearings}) == 8
    assert forces.bearings_by_vector(0.0, 0.0, 8) == []


@pytest.mark.parametrize("mfow", [9, 100])
@pytest.mark.parametrize("direction", ["mode", "vector"])
def test_straight_paths_lead_to_no_obstacle(direction: str, mfow: int) -> None:
    """An obstacle was never seen; taken for ground it would be as old as the run, beyond the ages that there are."""
    passable = np.ones((60, 60), dtype=np.bool_)
    passable[30:32, 36:38] = False
    seen = np.where(passable, np.int32(95), np.int32(-1))
    seen[31, 20] = 91
    options: dict[str, Any] = {"paths": "straight", "direction": direction}
    pull = pull_on(fields_of(passable), (31, 31), seen, mfow=mfow, **options)
    law = forces.ForceLaw(PotentialFieldOptions.model_validate(options), 0.5, int(passable.sum()), 10**5)
    by_age = law.pull(mfow)
    expected = np.zeros(3 if direction == "vector" else 8)
    for row, col in np.argwhere(passable):
        up, across = row - 30, col - 30
        length = int(100.0 * math.hypot(up, across) + 0.5)
        if 0 < length <= law.limit:
            force = by_age[100 - seen[row, col]] * law.decay[length]
            if direction == "vector":
                expected += force * np.array([across, up, 0.0]) / math.hypot(up, across) + [0.0, 0.0, force]
            else:
                expected[forces.sector_table(8, 60)[up + 60, across + 60]] += force
    assert np.allclose(pull.sums, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    assert pull.near == (32, 21)


def test_a_place_in_view_is_no_reason_to_stop_where_a_look_leaves_some_age() -> None:
    fields, seen, looked = fields_of(np.ones((41, 41), dtype=np.bool_)), ticks(41, (20, 24)), ticks(41)
    assert pull_on(fields, (21, 21), seen, looked=looked).near is None
    looked[20, 24] = 99
    assert pull_on(fields, (21, 21), seen, looked=looked).near == (21, 25)
