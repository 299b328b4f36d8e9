import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from patrol.kernels import swept_path as sweep

POINT = 0.5
SHAPE = (12, 14)
ORIGIN = (-1.0, 2.0)


def clearance(blocked: np.ndarray, x: float, y: float) -> float:
    """Distance (m) from a place to the nearest blocked square or the terrain's edge (negative beyond it)."""
    height, width = blocked.shape
    ox, oy = ORIGIN
    nearest = min(x - ox, ox + width * POINT - x, y - oy, oy + height * POINT - y)
    for row, col in np.argwhere(blocked):
        left, low = ox + col * POINT, oy + row * POINT
        dx = max(left - x, 0.0, x - left - POINT)
        dy = max(low - y, 0.0, y - low - POINT)
        nearest = min(nearest, math.hypot(dx, dy))
    return float(nearest)


def line(blocked: np.ndarray, x0: float, y0: float, x1: float, y1: float, radius: float) -> float:
    return float(sweep.free_fraction_line(blocked, POINT, *ORIGIN, x0, y0, x1, y1, radius))


def arc(
    blocked: np.ndarray, pose: tuple[float, float, float], distance: float, curvature: float, radius: float
) -> bool:
    return bool(sweep.free_arc(blocked, POINT, *ORIGIN, *pose, distance, distance * curvature, radius))


def squares(*points: tuple[int, int]) -> np.ndarray:
    blocked = np.zeros(SHAPE, dtype=np.uint8)
    for row, col in points:
        blocked[row, col] = 1
    return blocked


terrains = st.lists(st.tuples(st.integers(0, 11), st.integers(0, 13)), max_size=12).map(lambda ps: squares(*ps))
xs = st.floats(-1.0, 6.0)
ys = st.floats(2.0, 8.0)
radii = st.floats(0.05, 1.0)


@settings(max_examples=200, deadline=None)
@given(terrains, xs, ys, xs, ys, radii)
def test_a_line_is_free_up_to_its_fraction_and_no_further(
    blocked: np.ndarray, x0: float, y0: float, x1: float, y1: float, radius: float
) -> None:
    if clearance(blocked, x0, y0) < radius:
        return
    free = line(blocked, x0, y0, x1, y1, radius)
    assert 0.0 <= free <= 1.0
    for part in np.linspace(0.0, free, 60):
        assert clearance(blocked, x0 + part * (x1 - x0), y0 + part * (y1 - y0)) >= radius - 2e-9
    if free < 1.0:
        beyond = np.linspace(free, 1.0, 400)
        assert min(clearance(blocked, x0 + f * (x1 - x0), y0 + f * (y1 - y0)) for f in beyond) < radius


@settings(max_examples=200, deadline=None)
@given(terrains, xs, ys, st.floats(-math.pi, math.pi), st.floats(-3.0, 3.0), st.floats(-1.0, 1.0), radii)
def test_an_arc_is_free_when_dense_samples_are(
    blocked: np.ndarray, x: float, y: float, heading: float, distance: float, curvature: float, radius: float
) -> None:
    if clearance(blocked, x, y) < radius:
        return
    free = arc(blocked, (x, y, heading), distance, curvature, radius)
    steps = [sweep.arc_end(x, y, heading, distance * i / 300, distance * i / 300 * curvature)[:2] for i in range(301)]
    nearest = min(clearance(blocked, *place) for place in steps)
    if free:
        assert nearest >= radius - 2 * sweep.SAGITTA
    elif nearest >= radius:
        # Refused although the samples are free: between samples, or by a chord that lies beside the arc.
        assert nearest < radius + 2 * sweep.SAGITTA + abs(distance) / 300


@given(xs, ys, st.floats(-math.pi, math.pi), st.floats(-9.0, 9.0), st.floats(0.01, 2.0), st.booleans())
def test_an_arc_lies_on_its_circle(
    x: float, y: float, heading: float, distance: float, curvature: float, right: bool
) -> None:
    signed = -curvature if right else curvature
    end_x, end_y, turned = sweep.arc_end(x, y, heading, distance, distance * signed)
    centre = (x - math.sin(heading) / signed, y + math.cos(heading) / signed)
    assert math.dist(centre, (end_x, end_y)) == pytest.approx(1.0 / curvature, rel=1e-9)
    assert -math.pi < turned <= math.pi
    assert math.cos(turned - heading - distance * signed) == pytest.approx(1.0)


@pytest.mark.parametrize("radius", [0.3, 0.9, 1.7])
@pytest.mark.parametrize("outside", [True, False])
@pytest.mark.parametrize("forwards", [True, False])
def test_an_arc_passes_a_corner_that_is_a_radius_away(radius: float, outside: bool, forwards: bool) -> None:
    # A quarter circle of 3.5 m round (0, 0); one square whose corner lies on the diagonal, beside the arc's middle.
    ring = 3.5
    for gap, passes in ((radius + 2 * sweep.SAGITTA, True), (radius - 2 * sweep.SAGITTA, False)):
        corner = (ring + (gap if outside else -gap)) * math.sqrt(0.5)
        row = 20 if outside else 19  # the square grows away from the arc
        blocked = np.zeros((40, 40), dtype=np.uint8)
        blocked[row, row] = 1
        origin = corner - 20 * POINT
        pose = (ring, 0.0, math.pi / 2 if forwards else -math.pi / 2)
        way = (ring * math.pi / 2, math.pi / 2) if forwards else (-ring * math.pi / 2, math.pi / 2)
        assert bool(sweep.free_arc(blocked, POINT, origin, origin, *pose, *way, radius)) == passes


def test_a_straight_arc_is_a_line_and_bends_continuously() -> None:
    assert sweep.arc_end(1.0, 2.0, 0.0, 3.0, 0.0) == (4.0, 2.0, 0.0)
    bent = sweep.arc_end(1.0, 2.0, 0.0, 3.0, 3e-9)
    assert bent == pytest.approx((4.0, 2.0, 0.0), abs=1e-8)


@pytest.mark.parametrize("half", [1e-3, 1.1e-5, 1e-5, 9e-6, 1e-6])
def test_a_chord_has_the_same_length_on_both_sides_of_its_series(half: float) -> None:
    x, y, _ = sweep.arc_end(0.0, 0.0, 0.0, 1.0, 2.0 * half)
    assert math.hypot(x, y) == pytest.approx(math.sin(half) / half, rel=4e-16, abs=0.0)


@pytest.mark.parametrize("turn", [-math.pi, math.pi, -3.0 * math.pi, 3.0 * math.pi])
def test_a_heading_of_half_a_circle_is_positive(turn: float) -> None:
    assert sweep.arc_end(0.0, 0.0, 0.0, 0.0, turn)[2] == pytest.approx(math.pi)
    assert sweep.arc_end(0.0, 0.0, turn, 1.0, 0.0)[2] == pytest.approx(math.pi)


def test_a_disc_stops_where_it_touches_and_then_slides() -> None:
    blocked = squares(*[(row, 8) for row in range(12)])  # a wall whose near face is x = 3
    free = line(blocked, 1.0, 5.0, 4.0, 5.0, 0.5)
    assert 1.0 + 3.0 * free == pytest.approx(2.5, abs=1e-12)
    assert line(blocked, 2.5, 5.0, 2.5, 7.0, 0.5) == 1.0
    assert line(blocked, 2.5, 5.0, 2.6, 5.0, 0.5) == 0.0
    assert arc(blocked, (2.5, 5.0, math.pi / 2), 1.5, 0.0, 0.5)
    assert arc(blocked, (2.5, 5.0, math.pi / 2), 1.5, 0.5, 0.5)
    assert not arc(blocked, (2.5, 5.0, math.pi / 2), 1.5, -0.5, 0.5)


def test_an_overlapping_disc_may_only_leave_and_the_edge_is_a_wall() -> None:
    blocked = squares((6, 8))  # [3, 3.5] x [5, 5.5]
    assert line(blocked, 2.8, 5.2, 2.0, 5.2, 0.5) == 1.0
    assert line(blocked, 2.8, 5.2, 2.8, 6.2, 0.5) == 0.0
    assert line(blocked, 2.8, 5.2, 4.5, 5.2, 0.5) == 0.0
    assert line(blocked, 3.2, 5.2, 2.0, 5.2, 0.5) == 0.0
    assert arc(blocked, (2.8, 5.2, math.pi), 1.0, 0.3, 0.5)
    assert not arc(blocked, (2.8, 5.2, 0.0), 1.0, 0.3, 0.5)
    blocked = squares()
    assert line(blocked, 0.0, 5.0, -1.0, 5.0, 0.5) == pytest.approx(0.5)
    assert line(blocked, 0.0, 5.0, 0.0, 9.0, 0.5) == pytest.approx(2.5 / 4.0)
    assert line(blocked, -0.5, 5.0, -0.5, 6.0, 0.5) == 1.0
    assert line(blocked, -0.8, 5.0, -0.8, 6.0, 0.5) == 0.0
    assert line(blocked, -0.8, 5.0, 0.8, 5.0, 0.5) == 1.0
    assert not arc(blocked, (0.0, 5.0, math.pi), 1.0, 0.1, 0.5)
