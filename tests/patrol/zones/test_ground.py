import base64
import zlib

import numpy as np
import pytest

from patrol.errors import BadInput
from patrol.ground.marks import middle, outline
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.zones.ground import with_zones
from patrol.zones.spec import MaskSpec, ZoneSpec, points_of

Corners = tuple[tuple[float, float], ...]
ROOM = Terrain("room", np.ones((6, 8), dtype=np.bool_), 0.5, (1.0, 2.0))
"""4 x 3 m."""


def zone(polygon: Corners | None = None, mask: MaskSpec | None = None, keep_out: bool | None = None) -> ZoneSpec:
    weight = None if keep_out else 2.0
    return ZoneSpec(name="vault", polygon=polygon, mask=mask, keep_out=keep_out, weight=weight)


def mask_of(resolution: float, origin: tuple[float, float], marked: BoolGrid) -> MaskSpec:
    rows, columns = marked.shape
    cells = base64.b64encode(zlib.compress(np.packbits(marked).tobytes())).decode()
    return MaskSpec(resolution=resolution, origin=origin, rows=rows, columns=columns, cells=cells)


def box(left: float, low: float, right: float, high: float) -> Corners:
    return (left, low), (right, low), (right, high), (left, high)


def test_a_mask_of_the_same_resolution_lies_where_its_origin_says() -> None:
    marked = np.zeros((3, 3), dtype=np.bool_)
    marked[0, 2] = True
    points = points_of(zone(mask=mask_of(0.5, (1.0, 2.5), marked)), ROOM)
    assert np.argwhere(points).tolist() == [[1, 2]]


@pytest.mark.parametrize("resolution", [0.1, 0.25, 0.5, 1.0, 2.0])
def test_a_mask_of_another_resolution_is_resampled(resolution: float) -> None:
    """A mask whose cells fill a rectangle covers the points that the rectangle touches."""
    cells = np.ones((round(2.0 / resolution), round(2.0 / resolution)), dtype=np.bool_)
    of_mask = points_of(zone(mask=mask_of(resolution, (1.6, 2.2), cells)), ROOM)
    assert np.array_equal(of_mask, points_of(zone(box(1.6, 2.2, 3.6, 4.2)), ROOM))


def test_a_mask_may_reach_past_the_terrain() -> None:
    points = points_of(zone(mask=mask_of(1.0, (-5.0, -5.0), np.ones((20, 7), dtype=np.bool_))), ROOM)
    assert np.array_equal(points, points_of(zone(box(-5.0, -5.0, 2.0, 15.0)), ROOM))


def test_keep_outs_join_those_of_the_terrain_which_stays_as_it_is_without() -> None:
    before = np.zeros(ROOM.shape, dtype=np.bool_)
    before[5, 7] = True
    terrain = Terrain("room", ROOM.passable, ROOM.point, ROOM.origin, before)
    zones = [zone(box(1.0, 2.0, 2.0, 3.0), keep_out=True), zone(box(3.0, 3.0, 4.0, 4.0))]
    kept = with_zones(terrain, zones)
    assert np.argwhere(kept.keep_out).tolist() == [[0, 0], [0, 1], [1, 0], [1, 1], [5, 7]]
    assert kept.passable.all()
    assert with_zones(ROOM, [zone(box(1.0, 2.0, 2.0, 3.0))]) is ROOM


def test_an_outline_is_where_a_zone_ends_and_its_middle_lies_in_it() -> None:
    points = np.zeros(ROOM.shape, dtype=np.bool_)
    points[0:2, 0] = points[0, 1] = True
    edges = {tuple(edge) for edge in outline(points, ROOM).tolist()}
    assert edges == {
        *((1.0, 2.0, 2.0, 2.0), (1.5, 2.5, 2.0, 2.5), (1.0, 3.0, 1.5, 3.0)),
        *((1.0, 2.0, 1.0, 3.0), (1.5, 2.5, 1.5, 3.0), (2.0, 2.0, 2.0, 2.5)),
    }
    points = np.ones(ROOM.shape, dtype=np.bool_)
    points[1:5, 1:7] = False
    row, col = ROOM.point_at(*middle(points, ROOM))
    assert points[row, col]


@pytest.mark.parametrize(
    ("refused", "says"),
    [
        (zone(box(9, 9, 10, 10)), r"\.0: vault lies outside of room, which spans x 1 to 5 m and y 2 to 5 m"),
        (zone(box(0, 0, 9, 9), keep_out=True), ": vault keep robots out of all free space of room; leave"),
    ],
)
def test_what_is_refused(refused: ZoneSpec, says: str) -> None:
    with pytest.raises(BadInput, match=f"zones{says}"):
        with_zones(ROOM, [refused])
