from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import patrol.tours.round
import patrol.tours.search
from patrol.ground.fields import compute_fields
from patrol.ground.terrain import Terrain
from patrol.measures import best_tour as module
from patrol.measures.best_tour import BestTour, PartTour, TourFinder, best_tour, rounds_of
from patrol.own_sensor import allow_sensor
from patrol.pose import Pose
from patrol.prepare import Prepared, prepare
from patrol.scenario import BUILTINS, load_scenario, open_scenario
from patrol.tours.round import ARRAYS, Round
from tests.present import present

ALIKE = (1.0, 1.0)


def prepared(
    door: bool = True,
    radii: tuple[float, float] = (0.3, 0.3),
    speeds: tuple[float, float] = (1.0, 2.0),
    origin: tuple[float, float] = (0.0, 0.0),
    model: str = "holonomic",
    **sensor: Any,
) -> Prepared:
    """Two rooms of 10 x 10 m and a robot in each."""
    free = np.ones((20, 41), dtype=np.bool_)
    free[:, 20] = False
    if door:
        free[8:12, 20] = True
    terrain = Terrain("rooms", free, 0.5, origin=origin)
    starts = tuple(Pose(origin[0] + x, origin[1] + 5.0, 0.0) for x in (5.0, 15.0))
    robots = [
        {"name": f"r{number}", "model": model, "radius": radius, "speed": speed}
        for number, (radius, speed) in enumerate(zip(radii, speeds, strict=True), start=1)
    ]
    facts = {"terrain": {"builtin": "open"}, "point": 0.5, "robots": robots, "sensor": {"range": 3.0, **sensor}}
    of_radius = {radius: [start for start, own in zip(starts, radii, strict=True) if own == radius] for radius in radii}
    fields = {radius: compute_fields(terrain, radius, 3.0, True, own) for radius, own in of_radius.items()}
    return Prepared(load_scenario(facts), terrain, starts, {n: fields[radius] for n, radius in enumerate(radii, 1)}, {})


def metres(length_m: float | None) -> float:
    assert length_m is not None
    return length_m


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(module, "_known", {})
    return tmp_path / "fogwatch" / "tours"


def test_robots_of_one_part_share_a_tour_each_at_its_speed() -> None:
    tour = best_tour(prepared())
    (part,) = tour.parts
    assert part.speeds == {1: 1.0, 2: 2.0}
    assert tour.length_m == part.length_m
    assert tour.bound_s({1: 1.0, 2: 1.0}) == metres(part.length_m) / 3.0
    assert tour.bound_s({1: 1.0, 2: 0.5}) == metres(part.length_m) / 2.0
    assert tour.bound_s({}) is None


@pytest.mark.parametrize("origin", [(0.5, 0.0), (0.0, -0.5), (-64.0, 32.0)])
def test_a_tour_lies_where_its_map_does(origin: tuple[float, float], monkeypatch: pytest.MonkeyPatch) -> None:
    """Also if the same ground elsewhere is known, to this process or from the cache."""
    (there,) = best_tour(prepared()).parts
    for known in (module._known, {}):
        monkeypatch.setattr(module, "_known", known)
        (here,) = best_tour(prepared(origin=origin)).parts
        assert here.length_m == pytest.approx(there.length_m)
        assert here.way == pytest.approx(np.array(there.way) + np.array(origin))


SQUARE = """
import numpy as np

from patrol.ground.footprint import View
from patrol.ground.sensors import Disc

class Square(Disc):
    def visible(self, pose):
        view = super().visible(pose)
        middle = len(view.mask) // 2
        near = np.abs(np.arange(len(view.mask)) - middle) <= 0.7 * middle
        return View(view.row0, view.col0, view.mask * (near & near[:, None]))
"""


def test_a_sensor_of_ones_own_has_a_tour_of_its_own(tmp_path: Path) -> None:
    """It sees less than a disc of its range, so its tour is longer, and the two are kept apart."""
    file = tmp_path / "square.py"
    file.write_text(SQUARE, encoding="utf-8")
    square = prepared(kind=f"{file}:Square")
    allow_sensor(square.scenario.sensor)
    of_disc, of_square = metres(best_tour(prepared()).length_m), metres(best_tour(square).length_m)
    assert of_square > of_disc
    assert best_tour(prepared()).length_m == of_disc
    assert best_tour(square).length_m == of_square


def test_parts_that_nobody_can_change_between_have_a_tour_each() -> None:
    tour = best_tour(prepared(door=False))
    first, second = tour.parts
    assert (list(first.speeds), list(second.speeds)) == ([1], [2])
    assert tour.bound_s({1: 1.0, 2: 1.0}) == max(metres(first.length_m), metres(second.length_m) / 2.0)
    assert tour.bound_s({1: 1.0}) is None


def test_of_two_bodies_the_larger_sees_what_it_can() -> None:
    ready = prepared(radii=(0.6, 0.3))
    more = ready.fields[2].patrolled & ~ready.fields[1].patrolled
    assert more.any()
    large, small = best_tour(ready).parts
    assert (list(large.speeds), list(small.speeds)) == ([1], [2])
    assert metres(small.length_m) < metres(large.length_m)


def test_a_sensor_that_looks_ahead_has_a_longer_tour_unless_the_body_looks_aside_as_it_drives() -> None:
    whole, sector, narrow = (
        metres(best_tour(prepared(model="differential", angle=angle)).length_m) for angle in (360.0, 120.0, 60.0)
    )
    assert whole < sector < narrow
    assert metres(best_tour(prepared(model="holonomic", angle=60.0)).length_m) == whole


def test_a_sector_too_narrow_for_its_looks_has_no_tour() -> None:
    assert best_tour(prepared(model="differential", angle=40.0)).length_m is not None
    ready = prepared(model="differential", angle=39.0)
    assert best_tour(ready).length_m is None
    assert "sees less than 40 degrees" in TourFinder(ready).why_no_rounds


@pytest.mark.parametrize("looks", [[[-1.0, 0.0]], [[1e9, 0.0]], [[3.0, 0.0], [2.0, 0.0]], [[10**400, 0.0]], [[1.0]], 7])
def test_a_file_whose_looks_are_not_on_its_tour_is_made_again(
    looks: object, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ready = prepared(model="differential", angle=120.0)
    tour = best_tour(ready)
    for file in cache.glob("*.json"):
        file.write_text(json.dumps(json.loads(file.read_text()) | {"looks": looks}), encoding="utf-8")
    monkeypatch.setattr(module, "_known", {})
    assert best_tour(ready) == tour


def test_ground_seen_from_one_place_is_read_again(monkeypatch: pytest.MonkeyPatch) -> None:
    ready = prepared(range=60.0, line_of_sight=False)
    assert best_tour(ready).length_m == 0.0
    monkeypatch.setattr(module, "_known", {})
    monkeypatch.setattr(patrol.tours.search, "find_tour", None)
    assert best_tour(ready).length_m == 0.0


def test_a_car_cannot_look_aside() -> None:
    ready = prepared(model="car", angle=120.0)
    assert best_tour(ready).length_m is None
    assert rounds_of(ready) == {1: None, 2: None}
    assert TourFinder(ready).why_no_rounds == "its sensor does not look all around, and a car cannot turn on the spot"


def test_only_a_body_that_faces_where_it_goes_is_told_where_to_look_unless_its_steps_are_long() -> None:
    def round_of(model: str, speed: float, angle: float = 120.0) -> Round:
        return present(rounds_of(prepared(model=model, speeds=(speed, speed), angle=angle))[1])

    # Steps last 0.5 s, and the sensor sees 3 m.
    freely, ahead, in_long_steps = (
        round_of("holonomic", 0.6),
        round_of("differential", 0.6),
        round_of("differential", 0.7),
    )
    assert not freely.headings.size
    assert len(ahead.headings) == len(ahead.places)
    assert not in_long_steps.headings.size
    assert in_long_steps.length_m == freely.length_m > round_of("differential", 0.7, 360.0).length_m


@pytest.mark.parametrize("speeds", [(0.6, 0.7), (0.7, 0.6)])
def test_the_round_of_a_robot_does_not_depend_on_the_speed_of_another(speeds: tuple[float, float]) -> None:
    rounds = rounds_of(prepared(model="differential", speeds=speeds, angle=120.0))
    alone = {
        number: rounds_of(prepared(model="differential", speeds=(speed, speed), angle=120.0))[number]
        for number, speed in enumerate(speeds, 1)
    }
    for number, own in rounds.items():
        assert_same_round(own, alone[number])
    assert rounds[1] is not rounds[2]


def test_a_sensor_that_leaves_age_has_no_tour() -> None:
    tour = best_tour(prepared(quality=0.5))
    assert tour == BestTour(())
    assert tour.length_m is None
    assert tour.bound_s({1: 1.0}) is None


def test_ground_too_large_for_a_tour_has_no_bound() -> None:
    tour = BestTour((PartTour({1: 1.0}, 9.0), PartTour({2: 1.0}, None)))
    assert tour.length_m is None
    assert tour.bound_s({1: 1.0, 2: 1.0}) is None


def test_a_tour_is_found_once_and_read_afterwards(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tour = best_tour(prepared())
    (file,) = cache.iterdir()
    kept = json.loads(file.read_text())
    assert kept["length_m"] == tour.length_m
    around = [*kept["way"][1:], kept["way"][0]]
    assert sum(map(math.dist, kept["way"], around)) == pytest.approx(tour.length_m)
    monkeypatch.setattr(module, "_known", {})
    monkeypatch.setattr(patrol.tours.search, "find_tour", None)
    assert best_tour(prepared()) == tour


@pytest.mark.parametrize("terrain", BUILTINS)
def test_the_tour_of_a_built_in_terrain_comes_with_the_code_and_nothing_is_stored(
    terrain: str, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_known", {})
    monkeypatch.setattr(patrol.tours.search, "find_tour", None)
    assert best_tour(prepare(open_scenario(terrain, {}))).length_m
    assert not cache.exists()


@pytest.mark.parametrize(
    "text",
    [
        *("", "{}", "[]", "\x00", '{"length_m": null}', '{"length_m": "far"}', '{"length_m": 5.0, "way": []}'),
        *(f'{{"length_m": {length}, "way": [[5.25, 5.25]]}}' for length in ("-1.0", "NaN")),
        *(f'{{"length_m": 5.0, "way": {way}}}' for way in ("[[1e9, 5.25]]", "[5.25]", "[[0.01, 0.01]]")),
    ],
)
def test_a_damaged_file_is_made_again(cache: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    tour = best_tour(prepared())
    (file,) = cache.iterdir()
    whole = file.read_text()
    file.write_text(text)
    monkeypatch.setattr(module, "_known", {})
    assert best_tour(prepared()) == tour
    assert file.read_text() == whole


def test_a_round_is_laid_out_once_and_read_afterwards(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = rounds_of(prepared(speeds=ALIKE))[1]
    (file,) = cache.glob("*.npz")
    for content in (file.read_bytes(), b"damaged", file.read_bytes()[:-40]):
        file.write_bytes(content)
        again = rounds_of(prepared(speeds=ALIKE))[1]
        assert_same_round(first, again)
    monkeypatch.setattr(patrol.tours.round, "_assign_stops", None)
    monkeypatch.setattr(patrol.tours.round, "ways_between", None)
    assert_same_round(first, rounds_of(prepared(speeds=ALIKE))[1])


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        ("stops", lambda stops: np.where(stops == 0, len(stops), stops)),
        ("stops", lambda stops: np.full_like(stops, -2)),
        ("stops", lambda stops: np.full_like(stops, -1)),
        ("stops", lambda stops: stops[0]),
        ("stops", lambda stops: stops.astype(np.float64)),
        ("apart_m", lambda apart_m: apart_m[:-1, :-1]),
        ("apart_m", lambda apart_m: apart_m.reshape(-1)),
        ("apart_m", lambda apart_m: np.full_like(apart_m, np.nan)),
        ("apart_m", lambda apart_m: -1.0 - apart_m),
        ("apart_m", lambda apart_m: apart_m.astype(np.str_)),
    ],
)
def test_a_round_in_a_file_that_cannot_be_one_is_made_again(
    cache: Path, name: str, damage: Callable[[NDArray[Any]], NDArray[Any]]
) -> None:
    first = rounds_of(prepared(speeds=ALIKE))[1]
    (file,) = cache.glob("*.npz")
    arrays = dict(np.load(file))
    np.savez_compressed(file, **{**arrays, name: damage(arrays[name])})
    assert_same_round(first, rounds_of(prepared(speeds=ALIKE))[1])
    for key, array in np.load(file).items():
        np.testing.assert_array_equal(array, arrays[key])


def assert_same_round(first: Round | None, other: Round | None) -> None:
    assert first is not None
    assert other is not None
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(first, name), getattr(other, name), strict=True)


def test_a_cache_that_cannot_be_written_is_done_without(cache: Path) -> None:
    cache.parent.parent.mkdir(exist_ok=True)
    cache.parent.write_text("a file where the folder would be")
    assert best_tour(prepared()).length_m is not None


def test_ground_that_is_seen_from_one_place_has_no_round() -> None:
    rooms = prepared(door=False, speeds=ALIKE, range=30.0)
    assert [part.length_m for part in best_tour(rooms).parts] == [0.0, 0.0]
    assert rounds_of(rooms)[1] is None
    assert rounds_of(prepared(speeds=ALIKE))[1] is not None
    assert rounds_of(prepared())[1] is not None, "robots of several speeds"
