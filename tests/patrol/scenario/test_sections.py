"""The sections terrain, robots, sensor and intruders at their limits."""

import math
from typing import Any

import numpy as np
import pytest

from patrol.errors import BadInput
from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.scenario import load_scenario
from patrol.scenario.sections import IntruderSpec

OPEN: dict[str, Any] = {"terrain": {"builtin": "open"}}


@pytest.mark.parametrize(
    ("stay", "time_s", "there"),
    [(None, 4.9, False), (None, 5.0, True), (None, 1e9, True), (3.0, 7.9, True), (3.0, 8.0, False), (3.0, 4.9, False)],
)
def test_an_intruder_is_there_from_its_coming_until_before_it_goes(
    stay: float | None, time_s: float, there: bool
) -> None:
    assert IntruderSpec.model_validate({"place": (1.0, 2.0), "at": 5.0, "for": stay}).is_there(time_s) == there


@pytest.mark.parametrize(
    ("place", "problem"),
    [
        ((0.0, 0.0), ""),
        ((3.99, 1.99), ""),
        ((4.0, 1.0), "not on hall, which spans x 0 to 4 m and y 0 to 2 m"),
        ((1.0, 2.0), "not on hall"),
        ((-0.01, 1.0), "not on hall"),
        ((2.5, 0.5), "in an obstacle of hall"),
    ],
)
def test_an_intruder_stands_on_passable_ground(place: tuple[float, float], problem: str) -> None:
    passable = np.ones((2, 4), dtype=np.bool_)
    passable[0, 2] = False
    terrain = Terrain("hall", passable, 1.0)
    spec = IntruderSpec(place=place)
    if not problem:
        spec.check_place(terrain, "intruders.0.place")
        return
    with pytest.raises(BadInput, match=rf"^intruders\.0\.place = \[{place[0]:g}, {place[1]:g}\]: {problem}"):
        spec.check_place(terrain, "intruders.0.place")


def test_a_roster_has_each_robots_own_values_in_order() -> None:
    robots = [
        {"name": "one", "model": "car", "speed": 1.5, "radius": 0.5, "turning_radius": 2.5, "start": [1.0, 2.0, 4.0]},
        {"model": "holonomic", "speed": 2.5, "radius": 0.25, "start": [3.0, 4.0]},
        {"model": "differential", "spare": True},
    ]
    one, two, three = load_scenario({**OPEN, "robots": robots}).roster
    assert (one.number, one.name, one.section, one.spare) == (1, "one", "robots.0", False)
    assert (one.model, one.speed, one.radius, one.turning_radius) == ("car", 1.5, 0.5, 2.5)
    assert one.start is not None
    assert (one.start.x, one.start.y, one.start.heading) == pytest.approx((1.0, 2.0, 4.0 - math.tau))
    assert (two.number, two.name, two.speed, two.radius) == (2, "r2", 2.5, 0.25)
    assert two.start == Pose(3.0, 4.0, 0.0)
    assert (three.name, three.spare, three.start, three.section) == ("r3", True, None, "robots.2")
    group = {"count": 2, "spare": 1, "model": "holonomic", "starts": [[1.0, 2.0], [3.0, 4.0, 0.5]]}
    roster = load_scenario({**OPEN, "robots": group}).roster
    assert [(spec.name, spec.spare, spec.section) for spec in roster] == [
        ("r1", False, "robots"),
        ("r2", False, "robots"),
        ("r3", True, "robots"),
    ]
    assert [spec.start for spec in roster] == [Pose(1.0, 2.0, 0.0), Pose(3.0, 4.0, 0.5), None]


@pytest.mark.parametrize(
    ("robots", "problem"),
    [
        ({"count": 2, "spare": 1, "starts": [[1, 1]] * 3}, ""),
        ({"count": 2, "spare": 1, "starts": [[1, 1]] * 4}, "4 starts for 3 robots"),
        ({"count": 64_999, "spare": 2}, "there may be 65000 robots in all; give at most 1"),
    ],
)
def test_a_group_has_no_more_starts_than_robots_and_no_more_robots_than_there_may_be(
    robots: dict[str, Any], problem: str
) -> None:
    if problem:
        with pytest.raises(BadInput, match=problem):
            load_scenario({**OPEN, "robots": robots})
    else:
        assert len(load_scenario({**OPEN, "robots": robots}).roster) == 3


@pytest.mark.parametrize("degrees", [90, 180, 270, 360])
@pytest.mark.parametrize("off", [0.0049, -0.0049, 0.0051, -0.0051])
def test_an_angle_is_taken_for_radians_within_five_thousandths(degrees: int, off: float) -> None:
    sensor = {"angle": math.radians(degrees) + off}
    if abs(off) < 0.005:
        with pytest.raises(BadInput, match=f"is {degrees} degrees in radians"):
            load_scenario({**OPEN, "sensor": sensor})
    else:
        assert load_scenario({**OPEN, "sensor": sensor}).sensor.angle == sensor["angle"]


@pytest.mark.parametrize(
    ("edge", "joins"), [([0, 1], True), ([1, 0], True), ([0, 0], False), ([0, 2], False), ([-1, 0], False)]
)
def test_an_edge_joins_two_vertices(edge: list[int], joins: bool) -> None:
    graph = {"vertices": [[1.0, 1.0], [5.0, 1.0]], "edges": [[*edge, 4.0]]}
    given = {"terrain": {"builtin": "open", "graph": graph}}
    if joins:
        assert load_scenario(given).terrain.graph is not None
    else:
        with pytest.raises(BadInput, match=r"joins no two of the 2 vertices"):
            load_scenario(given)
