"""Pursuit: when a target is given up, when it counts as seen, and for how long its surroundings are left out."""

from types import SimpleNamespace
from typing import Any

import pytest

from agent.policies.pursuit import GivenUp, Pursuit, Target

STRIDE_M = 0.5
STAND = (10, 10)
BEGIN = 1000
"""The tick at which the target is chosen; the others count from it."""


class Scene:
    """A robot of 1 m/s that decides each half second, or at another step, and its target."""

    def __init__(self, step: float = 0.5, age: int = 100) -> None:
        spec = SimpleNamespace(radius=0.4, speed=STRIDE_M / step)
        ground = SimpleNamespace(terrain=SimpleNamespace(point=0.5))
        setup: Any = SimpleNamespace(robot=SimpleNamespace(spec=spec), ground=ground, fleet=SimpleNamespace(step=step))
        self.pursuit = Pursuit(setup)
        self.age = age
        assert self.pursuit.go_to(self.view(0, 10.0, age), (0, 0), Target(STAND, STAND, age)) is not None

    def view(self, tick: int, length_m: float, age: int) -> Any:
        way = SimpleNamespace(place=STAND, length=length_m)
        return SimpleNamespace(
            tick=BEGIN + tick,
            stride=STRIDE_M,
            routes=SimpleNamespace(way=lambda *_: way),
            place_of=lambda stand: stand,
            fog=SimpleNamespace(last_seen=SimpleNamespace(item=lambda _: BEGIN + tick - age)),
        )

    def keeps(self, tick: int, length_m: float, age: int | None = None) -> bool:
        view = self.view(tick, length_m, self.age + tick if age is None else age)
        return self.pursuit.keep(view, (0, 0)) is not None

    def gives_up_at(self, length_m: float) -> int:
        """The tick at which it gives up a way that gets no shorter from tick 0 on."""
        return next(tick for tick in range(1000) if not self.keeps(tick, length_m))


@pytest.mark.parametrize(
    ("step", "length_m", "ticks"),
    [
        (0.5, 10.0, 30),  # 15 s
        (0.5, STRIDE_M + 0.01, 30),
        (0.5, STRIDE_M, 6),  # 3 s
        (0.5, 0.0, 6),
        (1.0, 0.0, 3),
        (2.0, 0.0, 3),  # three steps, which are more than 3 s
        (2.0, 10.0, 7),
    ],
)
def test_a_robot_that_comes_no_nearer_gives_up_after_so_long(step: float, length_m: float, ticks: int) -> None:
    assert Scene(step).gives_up_at(length_m) == ticks + 1


@pytest.mark.parametrize(("nearer_m", "is_progress"), [(0.049, False), (0.051, True)])
def test_a_tenth_of_a_stride_is_progress(nearer_m: float, is_progress: bool) -> None:
    scene = Scene()
    assert all(scene.keeps(tick, 10.0) for tick in range(30))
    assert scene.keeps(30, 10.0 - nearer_m)
    assert scene.keeps(31, 10.0 - nearer_m) is is_progress


def test_small_steps_add_up_to_progress() -> None:
    scene = Scene()
    assert all(scene.keeps(tick, 10.0 - 0.02 * tick) for tick in range(100))


def test_a_look_that_leaves_some_of_the_age_is_progress() -> None:
    scene = Scene()
    assert all(scene.keeps(tick, 10.0) for tick in range(30))
    assert scene.keeps(30, 12.0, age=80)  # though its way got longer
    assert all(scene.keeps(tick, 10.0, age=50 + tick) for tick in range(31, 61))
    assert not scene.keeps(61, 10.0, age=111)


def test_a_wait_does_not_count() -> None:
    scene = Scene()
    assert all(scene.keeps(tick, 10.0) for tick in range(30))
    scene.pursuit.rest(BEGIN + 30)
    assert all(scene.keeps(tick, 10.0) for tick in range(31, 61))
    assert not scene.keeps(61, 10.0)


@pytest.mark.parametrize(("age", "is_seen"), [(50, False), (49, True)])
def test_a_target_is_seen_below_half_of_the_age_that_it_had(age: int, is_seen: bool) -> None:
    assert Scene(age=100).keeps(1, 10.0, age=age) is not is_seen


def test_what_is_given_up_again_is_left_out_twice_as_long_up_to_a_bound() -> None:
    """20 s at first, 960 s at most; a place that was left in peace for that long begins anew."""
    given_up, tick = GivenUp(0.4, 0.5, 0.5), 0
    for spell_s in (20, 40, 80, 160, 320, 640, 960, 960):
        given_up.add(tick, STAND)
        spell = 2 * spell_s
        assert [len(given_up.now(tick + after)) for after in (0, spell - 1, spell)] == [1, 1, 0]
        tick += spell
    for after, spell_s in ((1919, 960), (1920, 20)):
        again = GivenUp(0.4, 0.5, 0.5)
        again.places = list(given_up.places)
        again.add(tick + after, STAND)
        assert again.places[0][3] == 2 * spell_s


@pytest.mark.parametrize(("radius", "squared"), [(0.4, 4), (0.5, 4), (0.6, 6), (1.0, 16)])
def test_the_surroundings_reach_two_radii_or_points(radius: float, squared: int) -> None:
    given_up = GivenUp(radius, 0.5, 0.5)
    given_up.add(0, STAND)
    assert given_up.now(0).tolist() == [[*STAND, squared]]


def test_the_oldest_of_many_places_are_forgotten_first() -> None:
    given_up = GivenUp(0.4, 0.5, 0.5)
    for number in range(65):
        given_up.add(0, (0, 10 * number))
    assert [place[1] for place in given_up.places] == list(range(10, 650, 10))
    given_up.forgive((0, 12))
    assert [place[1] for place in given_up.places] == list(range(20, 650, 10))
