import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.radio.message import MAX_CM, MAX_TRAIL, Position
from patrol.radio.peers import Predictor


def field() -> Terrain:
    """20 x 20 m with a wall from (12, 0) to (13, 10)."""
    passable = np.ones((20, 20), dtype=np.bool_)
    passable[:10, 12] = False
    return Terrain("field", passable, 1.0)


def said(x: float, y: float, *trail: tuple[int, int], k: int = 10) -> Position:
    return Position.of(2, k, 0.5 * k, Pose(x, y, 0.25), trail)


@pytest.mark.parametrize(
    ("trail", "ticks", "expected"),
    [
        ((), 3, (2.0, 5.0)),
        (((-100, 0),), 0, (2.0, 5.0)),
        (((-100, 0),), 3, (5.0, 5.0)),
        (((-100, 50), (7, 7)), 2, (4.0, 4.0)),
        (((-100, 0),), 8, (10.0, 5.0)),
        (((-100, 0),), 999, (10.0, 5.0)),
        (((-200, 0),), 8, (12.0, 5.0)),
        (((200, 0),), 8, (0.0, 5.0)),
    ],
    ids=["standing", "now", "straight", "slanting", "horizon", "beyond", "wall", "edge"],
)
def test_a_robot_goes_on_as_its_trail_shows_to_the_first_wall(
    trail: tuple[tuple[int, int], ...], ticks: int, expected: tuple[float, float]
) -> None:
    pose = Predictor(field(), 1, horizon=8).pose(said(2.0, 5.0, *trail), ticks)
    assert (pose.x, pose.y) == pytest.approx(expected, abs=1e-4)
    assert pose.heading == pytest.approx(0.25)


def test_places_may_be_several_ticks_apart_and_the_error_is_the_distance_to_the_robot() -> None:
    pose = Predictor(field(), 3, horizon=8).pose(said(2.0, 15.0, (-300, 0)), 2)
    assert (pose.x, pose.y) == pytest.approx((4.0, 15.0))
    pose = Predictor(field(), 3, horizon=6).pose(said(2.0, 15.0, (-150, 0)), 99)
    assert (pose.x, pose.y) == pytest.approx((5.0, 15.0)), "the horizon is in ticks: two steps of the trail"
    predictor = Predictor(field(), 1, horizon=8)
    last = said(2.0, 15.0, (-100, 0))
    assert predictor.error(last, said(5.0, 15.0, k=13)) == pytest.approx(0.0)
    assert predictor.error(last, said(5.0, 18.0, k=13)) == pytest.approx(3.0)


steps = st.tuples(st.integers(-(2**15), 2**15 - 1), st.integers(-(2**15), 2**15 - 1))
anywhere = st.integers(-MAX_CM, MAX_CM) | st.integers(-100, 2100)


@given(anywhere, anywhere, st.lists(steps, max_size=MAX_TRAIL), st.integers(-(2**32), 2**32))
def test_whatever_a_frame_says_the_prediction_is_a_place(
    x_cm: int, y_cm: int, trail: list[tuple[int, int]], ticks: int
) -> None:
    position = Position(2, 10, 5000, x_cm, y_cm, 250, tuple(trail))
    pose = Predictor(field(), 1, horizon=8).pose(position, ticks)
    assert math.isfinite(pose.x)
    assert math.isfinite(pose.y)
    assert math.hypot(pose.x - position.pose.x, pose.y - position.pose.y) <= 8 * 0.01 * math.hypot(2**15, 2**15) + 1e-6
