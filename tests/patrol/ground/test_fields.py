from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from patrol.errors import BadInput
from patrol.ground.cspace import cspace_of, parts_of
from patrol.ground.fields import StaticFields, anchor, compute_fields, proxies_of
from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.pose import Pose
from tests.patrol.ground.masks import line_is_free, masks, random_map


def fields_of(terrain: Terrain, radius: float, sensor_range: float, line_of_sight: bool = True) -> StaticFields:
    """Fields of a robot that starts in the largest part; skips maps on which it has no place."""
    labels, count = parts_of(cspace_of(terrain, radius))
    if count == 0:
        pytest.skip("no place for the body")
    largest = 1 + int(np.argmax(np.bincount(labels.ravel())[1:]))
    row, col = np.argwhere(labels == largest)[0]
    return compute_fields(terrain, radius, sensor_range, line_of_sight, [Pose(*terrain.centre(row, col), 0.0)])


def two_rooms(door: int) -> Terrain:
    """Two rooms of 2 x 2 m and a wall of 0.2 m between them with a door `door` points wide."""
    free = np.ones((20, 42), dtype=np.bool_)
    free[:, 20:22] = False
    free[8 : 8 + door, 20:22] = True
    return Terrain("rooms", free, 0.1)


def test_reach_ends_at_a_door_that_is_too_narrow() -> None:
    start = [Pose(0.5, 0.5, 0.0)]
    assert compute_fields(two_rooms(7), 0.3, 5.0, True, start).reach[10, 30]
    shut = compute_fields(two_rooms(6), 0.3, 5.0, True, start)
    assert not shut.reach[10, 30]
    assert shut.cspace[10, 30]
    assert shut.patrolled[10, 30]
    both = compute_fields(two_rooms(6), 0.3, 5.0, True, [*start, Pose(3.5, 0.5, 0.0)])
    assert np.array_equal(both.reach, both.cspace)


def test_a_start_beside_the_cspace_joins_it_but_not_through_a_wall() -> None:
    terrain = two_rooms(0)
    cspace = cspace_of(terrain, 0.3)
    assert anchor(terrain, cspace, 0.3, 0.3) == (3, 3)
    assert anchor(terrain, cspace, 0.05, 0.05) is None
    thin = np.ones((5, 5), dtype=np.bool_)
    thin[:, 2] = False
    behind = Terrain("thin", thin, 1.0)
    assert anchor(behind, np.eye(5, dtype=np.bool_) & thin & (np.arange(5) > 2), 1.5, 3.5) is None


def test_a_start_where_the_body_does_not_fit_is_refused() -> None:
    with pytest.raises(BadInput, match=r"does not fit at \(0\.05, 0\.05\)"):
        compute_fields(two_rooms(7), 0.3, 5.0, True, [Pose(0.05, 0.05, 0.0)])


def seen_by_force(terrain: Terrain, reach: BoolGrid, radius: float, lenient: bool) -> BoolGrid:
    seen = reach.copy()
    sources = [(int(row), int(col)) for row, col in np.argwhere(reach)]
    for row, col in np.argwhere(terrain.passable & ~reach):
        place = (int(row), int(col))
        seen[place] = any(
            (row - r) ** 2 + (col - c) ** 2 <= radius**2 and line_is_free(terrain.passable, place, (r, c), lenient)
            for r, c in sources
        )
    return seen


@pytest.mark.parametrize(("body", "reach_in_points"), [(0.1, 5.5), (0.15, 10.0), (0.2, 50.0)])
@pytest.mark.parametrize("seed", range(3))
def test_patrolled_is_what_lines_of_sight_from_the_reach_say(seed: int, body: float, reach_in_points: float) -> None:
    terrain = Terrain("field", random_map(seed, 22, 26), 0.1)
    fields = fields_of(terrain, body, 0.1 * reach_in_points)
    assert not (fields.patrolled & ~seen_by_force(terrain, fields.reach, reach_in_points, lenient=True)).any()
    missed = seen_by_force(terrain, fields.reach, reach_in_points, lenient=False) & ~fields.patrolled
    assert np.count_nonzero(missed) <= 1


@pytest.mark.parametrize("seed", range(20, 32))
def test_a_footprint_from_its_proxy_sees_every_patrolled_point(seed: int) -> None:
    terrain = Terrain("field", random_map(seed), 0.1)
    fields = fields_of(terrain, 0.2, 1.2)
    footprint = footprint_of(terrain, 1.2)
    assert np.array_equal(fields.patrolled, fields.reach | (fields.proxy >= 0))
    assert not (fields.reach & (fields.proxy >= 0)).any()
    for row, col in np.argwhere(fields.proxy >= 0):
        at = divmod(int(fields.proxy[row, col]), terrain.width)
        assert fields.reach[at]
        view = footprint.visible(Pose(*terrain.centre(*at), 0.0))
        assert view.mask[row - view.row0, col - view.col0] == 1


@settings(max_examples=40)
@given(free=masks, radius=st.sampled_from([0.05, 0.15]), sensor_range=st.sampled_from([0.1, 0.35, 0.5, 100.0]))
def test_without_line_of_sight_all_in_range_is_patrolled(free: BoolGrid, radius: float, sensor_range: float) -> None:
    terrain = Terrain("field", free, 0.1)
    cspace = cspace_of(terrain, radius)
    if not cspace.any():
        return
    row, col = np.argwhere(cspace)[0]
    fields = compute_fields(terrain, radius, sensor_range, False, [Pose(*terrain.centre(row, col), 0.0)])
    sources = np.argwhere(fields.reach)
    for (r, c), passable in np.ndenumerate(terrain.passable):
        square = ((sources - [r, c]) ** 2).sum(axis=1)
        seen = bool(passable) and float(square.min()) <= (sensor_range / 0.1) ** 2 + 1e-9
        assert fields.patrolled[r, c] == seen
        if seen and not fields.reach[r, c]:
            nearest = sources[np.flatnonzero(square == square.min())]
            assert fields.proxy[r, c] == min(nr * terrain.width + nc for nr, nc in nearest)
        else:
            assert fields.proxy[r, c] == -1


def test_sight_crosses_keep_out_but_not_walls() -> None:
    shut = np.zeros((20, 42), dtype=np.bool_)
    shut[:, 20:22] = True
    start = [Pose(0.5, 0.5, 0.0)]
    kept = Terrain("kept", np.ones((20, 42), dtype=np.bool_), 0.1, keep_out=shut)
    fields = compute_fields(kept, 0.3, 2.0, True, start)
    assert not fields.reach[:, 17:].any()
    assert fields.patrolled[5, 20:36].all()
    assert not fields.patrolled[5, 37:].any()
    walled = compute_fields(Terrain("walled", ~shut, 0.1), 0.3, 2.0, True, start)
    assert not walled.patrolled[:, 20:].any()


def test_fields_survive_saving_memory_mapped_and_read_only(tmp_path: Path) -> None:
    fields = fields_of(Terrain("field", random_map(4), 0.1), 0.2, 1.0)
    fields.save(tmp_path / "body")
    loaded = StaticFields.load(tmp_path / "body")
    for name in ("cspace", "reach", "patrolled", "proxy"):
        before, after = getattr(fields, name), getattr(loaded, name)
        assert np.array_equal(before, after)
        assert before.dtype == after.dtype
        assert not before.flags.writeable
        assert not after.flags.writeable


def test_of_points_as_near_in_one_row_the_first_is_the_proxy_without_line_of_sight() -> None:
    reach = np.zeros((1, 7), dtype=np.bool_)
    reach[0, [1, 5]] = True
    proxy = proxies_of(Terrain("row", np.ones((1, 7), dtype=np.bool_), 0.1), reach, 0.3, False)
    assert proxy.tolist() == [[1, -1, 1, 1, 5, -1, 5]]
