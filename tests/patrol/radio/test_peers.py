"""Other robots in columns, and how a movement goes on."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.radio.peers import Columns, Peer, columns_of, go_on, places_of

PEERS = {n: Peer(10 * n, Pose(float(n), 0.1 * n, 0.2), 100 * n) for n in (9, 2, 5)}


def test_columns_are_by_number_whatever_the_order_in_which_robots_were_heard() -> None:
    numbers, sequences, ticks, places = columns_of(PEERS)
    assert (numbers.tolist(), sequences.tolist(), ticks.tolist()) == ([2, 5, 9], [20, 50, 90], [200, 500, 900])
    assert places.tolist() == places_of(PEERS).tolist() == [[2.0, 0.2], [5.0, 0.5], [9.0, 0.9]]
    assert [column.shape for column in columns_of({})] == [(0,), (0,), (0,), (0, 2)]


def test_columns_that_a_mapping_has_are_taken_as_they_are() -> None:
    ones = np.ones(1, dtype=np.int64)
    has: Any = SimpleNamespace(columns=Columns(ones, ones, ones, np.array([[1.0, 2.0]])))
    assert columns_of(has) is has.columns
    assert places_of(has) is has.columns.places


@pytest.mark.parametrize(
    ("start", "moved", "ahead", "end"),
    [
        ((2.0, 3.0), (1.0, 0.0), 2.5, (4.5, 3.0)),
        ((2.0, 3.0), (0.0, -1.0), 2.0, (2.0, 1.0)),
        ((2.0, 3.0), (2.0, 1.0), 1.5, (5.0, 4.5)),
        ((2.0, 3.0), (4.0, 2.0), 2.0, (6.0, 5.0)),  # half of the way to a wall at 6 m
        ((8.0, 3.0), (0.0, 4.0), 3.0, (8.0, 10.0)),  # the upper edge
    ],
)
def test_a_movement_goes_on_in_a_straight_line_to_the_first_wall(
    start: tuple[float, float], moved: tuple[float, float], ahead: float, end: tuple[float, float]
) -> None:
    passable = np.ones((10, 12), dtype=np.bool_)
    passable[:, 6] = False
    pose = go_on(Terrain("field", passable, 1.0), Pose(*start, 0.7), moved, ahead)
    assert (pose.x, pose.y) == pytest.approx(end, abs=1e-4)
    assert pose.heading == 0.7
