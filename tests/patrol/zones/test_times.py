"""Zones over time, at the ends of their spans, and what maps and people are told of them."""

from typing import Any

import numpy as np
import pytest

from patrol.areas import has_area, is_in_one_of
from patrol.errors import BadInput
from patrol.ground.marks import Moment
from patrol.ground.terrain import Terrain
from patrol.scenario import load_scenario
from patrol.zones.spec import ZoneSpec, weighing_at, zones_in_force

SQUARE = ((2.0, 2.0), (6.0, 2.0), (6.0, 5.0), (2.0, 5.0))


def at(time_s: float) -> Moment:
    return Moment(time_s, (), ())


def zone(name: str = "vault", **rules: Any) -> ZoneSpec:
    return ZoneSpec.model_validate({"name": name, "polygon": SQUARE, **(rules or {"weight": 10.0})})


@pytest.mark.parametrize(
    ("time_s", "inside"),
    [(0.0, False), (4.99, False), (5.0, True), (9.99, True), (10.0, False), (20.0, True), (30.0, False), (1e9, False)],
)
def test_a_span_includes_its_beginning_and_excludes_its_end(time_s: float, inside: bool) -> None:
    spans = ((5.0, 10.0), (20.0, 30.0))
    assert is_in_one_of(spans, time_s) == inside
    assert zone(weight=2.0, times=spans).holds(time_s) == inside
    assert not is_in_one_of((), time_s)
    assert zone(weight=2.0).holds(time_s)
    assert not zone(weight=2.0, times=()).holds(time_s)


@pytest.mark.parametrize(
    ("time_s", "weight"), [(0.0, 10.0), (6.99, 10.0), (7.0, 3.0), (8.99, 3.0), (9.0, 0.5), (1e9, 0.5)]
)
def test_a_weight_holds_from_its_time_on(time_s: float, weight: float) -> None:
    vault = zone(weight=10.0, weights=((7.0, 3.0), (9.0, 0.5)))
    assert vault.weight_at(time_s) == weight
    assert vault.label_at(time_s) == vault.look(at(time_s)).text == f"vault x{weight:g}"
    assert vault.look(at(time_s)).weight == weight
    assert weighing_at([vault], time_s) == frozenset({("vault", weight)})


def test_zones_in_force_and_those_that_weigh_are_told_apart() -> None:
    zones = [
        zone("early", weight=2.0, times=((0.0, 5.0),)),
        zone("old", age=60.0),
        zone("slow", speed=0.5, times=((5.0, 9.0),)),
        zone("late", weight=4.0, times=((5.0, 9.0),)),
    ]
    assert zones_in_force(zones, 4.0) == {"early", "old"}
    assert zones_in_force(zones, 5.0) == {"old", "slow", "late"}
    assert weighing_at(zones, 4.0) == {("early", 2.0), ("old", None)}
    assert weighing_at(zones, 5.0) == {("old", None), ("late", 4.0)}
    assert [one.look(at(5.0)).holds for one in zones] == [False, True, True, True]


@pytest.mark.parametrize(
    ("rules", "kind", "label"),
    [
        ({"weight": 10.0}, "weight", "vault x10"),
        ({"age": 60.0}, "weight", "vault 60 s"),
        ({"speed": 0.5}, "slow", "vault 0.5 m/s"),
        ({"keep_out": True}, "keepout", "vault: keep out"),
    ],
)
def test_a_zone_is_marked_by_its_kind_with_what_holds_there(rules: dict[str, Any], kind: str, label: str) -> None:
    one = zone(**rules)
    assert (one.kind, one.label, one.label_at(5.0), one.labels) == (kind, label, label, label)
    terrain = Terrain("hall", np.ones((10, 12), dtype=np.bool_), 1.0)
    mark = one.mark(terrain, 1)
    assert mark is not None
    assert (mark.kind, mark.name, mark.label, mark.closes) == (kind, "vault", label, False)
    expected = np.zeros((10, 12), dtype=np.bool_)
    expected[2:5, 2:6] = True
    assert mark.points is not None
    assert np.array_equal(mark.points, expected)
    assert one.mark(Terrain("small", np.ones((2, 2), dtype=np.bool_), 1.0), 1) is None


@pytest.mark.parametrize(
    ("count", "when"),
    [
        (1, "0 to 1 s"),
        (4, "0 to 1 s, 10 to 11 s, 20 to 21 s, 30 to 31 s"),
        (5, "0 to 1 s, 10 to 11 s, 20 to 21 s, 30 to 31 s and 1 times more"),
    ],
)
def test_up_to_four_times_are_named(count: int, when: str) -> None:
    assert zone(weight=2.0, times=tuple((10.0 * n, 10.0 * n + 1.0) for n in range(count))).when == when


@pytest.mark.parametrize(
    ("rules", "sound"),
    [
        ({"weight": 2.0, "times": [[0, 1], [1.5, 2]]}, True),
        ({"weight": 2.0, "times": [[0, 1], [1, 2]]}, False),
        ({"weight": 2.0, "times": [[1, 1]]}, False),
        ({"weight": 2.0, "weights": [[0, 1.0], [5, 2.0]]}, True),
        ({"weight": 2.0, "weights": [[5, 1.0], [5, 2.0]]}, False),
        ({"weight": 0.001}, True),
        ({"weight": 0.00099}, False),
        ({"weight": 1000.0}, True),
        ({"weight": 1000.1}, False),
        ({"weight": 2.0, "age": 60.0}, False),
        ({}, False),
    ],
)
def test_rules_are_taken_up_to_their_limits(rules: dict[str, Any], sound: bool) -> None:
    robots = {"count": 1, "model": "holonomic", "radius": 0.3, "speed": 1.0}
    polygon = [[10, 10], [30, 10], [30, 30], [10, 30]]
    given = {"terrain": {"builtin": "open"}, "robots": robots, "duration": 60}
    given["zones"] = [{"name": "vault", "polygon": polygon, **rules}]
    if sound:
        load_scenario(given)
    else:
        with pytest.raises(BadInput):
            load_scenario(given)


def test_only_corners_on_one_line_have_no_area() -> None:
    assert has_area(SQUARE)
    assert has_area(((0.0, 0.0), (5.0, 0.0), (10.0, 1e-6)))
    assert not has_area(((0.0, 0.0), (5.0, 5.0), (10.0, 10.0), (2.0, 2.0)))
    assert not has_area(((1.0, 1.0),) * 3)
