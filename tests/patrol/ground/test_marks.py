"""Outlines and middles of some ground, by hand."""

import numpy as np
import pytest

from patrol.ground.marks import mark_ground, middle, outline
from patrol.ground.terrain import BoolGrid, Terrain

TERRAIN = Terrain("hall", np.ones((4, 5), dtype=np.bool_), 0.5, (10.0, 20.0))


def points(*rows: str) -> BoolGrid:
    """Points drawn with the upper row first."""
    return np.array([[character == "x" for character in row] for row in rows[::-1]], dtype=np.bool_)


ELL = points(".....", ".x...", ".xx..", ".....")
EDGES = {
    ((10.5, 20.5), (11.5, 20.5)),
    ((11.0, 21.0), (11.5, 21.0)),
    ((10.5, 21.5), (11.0, 21.5)),
    ((10.5, 20.5), (10.5, 21.5)),
    ((11.0, 21.0), (11.0, 21.5)),
    ((11.5, 20.5), (11.5, 21.0)),
}
CORNER = points("....x", ".....", ".....", "x....")
CORNERS = {
    ((10.0, 20.0), (10.5, 20.0)),
    ((10.0, 20.5), (10.5, 20.5)),
    ((10.0, 20.0), (10.0, 20.5)),
    ((10.5, 20.0), (10.5, 20.5)),
    ((12.0, 21.5), (12.5, 21.5)),
    ((12.0, 22.0), (12.5, 22.0)),
    ((12.0, 21.5), (12.0, 22.0)),
    ((12.5, 21.5), (12.5, 22.0)),
}


@pytest.mark.parametrize(("ground", "edges"), [(ELL, EDGES), (CORNER, CORNERS), (points(*["....."] * 4), set())])
def test_an_outline_has_each_straight_edge_once(ground: BoolGrid, edges: set[tuple[tuple[float, float], ...]]) -> None:
    found = outline(ground, TERRAIN)
    assert found.shape == (len(edges), 4)
    assert {((x, y), (to_x, to_y)) for x, y, to_x, to_y in found.tolist()} == edges


@pytest.mark.parametrize(
    ("ground", "place"),
    [
        (ELL, (10.75, 20.75)),
        (points("xxxxx", "x...x", "x...x", "xxxxx"), (11.25, 20.25)),  # the middle of a ring is no point of it
        (points(".....", ".....", "....x", "....."), (12.25, 20.75)),
    ],
)
def test_the_middle_is_the_point_nearest_to_it(ground: BoolGrid, place: tuple[float, float]) -> None:
    assert middle(ground, TERRAIN) == place
    mark = mark_ground("weight", "vault", "vault x2", ground, TERRAIN, closes=True)
    assert mark is not None
    assert (mark.kind, mark.name, mark.label, mark.at, mark.closes) == ("weight", "vault", "vault x2", place, True)


def test_ground_without_a_point_has_no_mark() -> None:
    assert mark_ground("weight", "vault", "vault x2", points(*["....."] * 4), TERRAIN) is None
