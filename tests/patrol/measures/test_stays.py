import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.measures.stays import TRAPPED_S, Place, Stay, Stays, roaming_radius
from patrol.scenario import load_scenario
from tests.present import present

R = 3.0001234567  # which no sum of round numbers hits, so that rounding decides nothing
LONG = int(TRAPPED_S)


def tracked(path: list[Place], radius: float = R, step: float = 1.0) -> list[Stay]:
    """The stay after each position of one robot that is looked at in each tick."""
    stays = Stays({1: radius}, step)
    found = []
    for k, place in enumerate(path):
        stays.tick(k, {1: place})
        stay = stays.stay(1)
        assert stay is not None
        assert stays.since(1) == stay.since
        assert (1 in stays.long(k)) == (k - stay.since >= LONG)
        found.append(stay)
    return found


def fits(places: list[Place], radius: float) -> bool:
    x = (min(x for x, _ in places) + max(x for x, _ in places)) / 2.0
    y = (min(y for _, y in places) + max(y for _, y in places)) / 2.0
    return all(math.dist((x, y), place) <= radius for place in places)


def slowly(path: list[Place], radius: float) -> list[int]:
    """Return when each stay began, by the rule and nothing else."""
    since, circle = 0, None
    found = []
    for k, place in enumerate(path):
        if circle is not None and math.dist(circle, place) > radius:
            corners = [(min(x), min(y)) for x, y in [zip(*path[since : k + 1], strict=True)]]
            corners += [(max(x), max(y)) for x, y in [zip(*path[since : k + 1], strict=True)]]
            if math.dist(*corners) <= 2.0 * radius:
                circle = ((corners[0][0] + corners[1][0]) / 2.0, (corners[0][1] + corners[1][1]) / 2.0)
            else:
                circle, since = None, max(since, k - LONG)
        if circle is None:
            while not fits(path[since : k + 1], radius):
                since += 1
            if k - since >= LONG:
                xs, ys = zip(*path[since : k + 1], strict=True)
                circle = ((min(xs) + max(xs)) / 2.0, (min(ys) + max(ys)) / 2.0)
        found.append(since)
    return found


@st.composite
def walks(draw: st.DrawFn) -> list[Place]:
    """Ways of a robot that stays for a while, swings, moves on, or jumps."""
    path: list[Place] = []
    x = y = 0.0
    for _ in range(draw(st.integers(1, 5))):
        ticks = draw(st.integers(1, 250))
        kind = draw(st.sampled_from(["stands", "swings", "circles", "drives", "jumps"]))
        size = draw(st.floats(0.0, 5.0))
        for i in range(ticks):
            match kind:
                case "stands":
                    path.append((x, y))
                case "swings":
                    path.append((x + size * math.sin(i), y))
                case "circles":
                    path.append((x + size * math.cos(0.3 * i), y + size * math.sin(0.3 * i)))
                case "drives":
                    path.append((x + 0.05 * size * i, y))
                case _:
                    path.append((x + size * (i * 7 % 5), y + size * (i * 3 % 4)))
        x, y = path[-1]
    return path


@given(walks())
def test_a_stay_begins_where_the_rule_says(path: list[Place]) -> None:
    assert [stay.since for stay in tracked(path)] == slowly(path, R)


@given(walks())
def test_the_circle_holds_all_positions_since_the_stay_began(path: list[Place]) -> None:
    for k, stay in enumerate(tracked(path)):
        assert all(math.dist((stay.x, stay.y), place) <= R * (1 + 1e-12) for place in path[stay.since : k + 1])


@given(walks())
def test_nobody_who_keeps_to_one_place_for_long_is_overlooked(path: list[Place]) -> None:
    for k, stay in enumerate(tracked(path)):
        xs, ys = zip(*path[max(k - LONG, 0) : k + 1], strict=True)
        if k >= LONG and math.hypot(max(xs) - min(xs), max(ys) - min(ys)) < 2.0 * R * (1 - 1e-9):
            assert k - stay.since >= LONG


def test_a_robot_that_swings_stays_though_it_leaves_where_it_began() -> None:
    swing = [(2.9 * math.sin(0.4 * k), 0.0) for k in range(400)]
    stay = tracked([(-2.9, 0.0), *swing])[-1]
    assert (stay.since, stay.radius) == (0, R)
    assert (stay.x, stay.y) == pytest.approx((0.0, 0.0), abs=0.01)


def test_a_long_stay_ends_when_the_robot_leaves_its_circle() -> None:
    path = [(0.0, 0.0)] * 300 + [(1.0 * i, 0.0) for i in range(30)]
    stays = tracked(path)
    assert stays[303].since == 0  # 3 m from where it stood
    assert stays[307].since > 290  # more than a circle away
    assert stays[-1].since >= len(path) - 8


def test_positions_are_looked_at_once_a_second() -> None:
    stays = Stays({1: R}, 0.1)
    for k in range(1900):
        away = 50.0 if k % 10 else 0.0  # between two looks
        stays.tick(k, {1: (away, 0.0)})
    assert stays.long(1899)[1].since == 0


def test_a_free_robot_begins_anew() -> None:
    stays = Stays({1: R, 2: R}, 1.0)
    for k in range(LONG + 1):
        stays.tick(k, {1: (0.0, 0.0), 2: (9.0, 9.0)}, free=[2] if k == 100 else [])
    assert set(stays.long(LONG)) == {1}
    second = stays.stay(2)
    assert second is not None
    assert second.since == 101
    stays.tick(LONG + 1, {2: (9.0, 9.0)})
    assert stays.stay(1) is None


def test_the_radius_counts_radii_and_strides() -> None:
    spec = load_scenario({"terrain": {"builtin": "open"}, "robots": {"speed": 1.0, "radius": 0.3}}).roster[0]
    assert roaming_radius(spec, 0.5) == pytest.approx(3.2)


def test_a_robot_at_just_the_diameter_from_where_it_stood_still_stays() -> None:
    path = [(0.0, 0.0)] * (3 * LONG) + [(6.0, 0.0)]
    assert tracked(path, radius=3.0)[-1] == Stay(0, 3.0, 0.0, 3.0)
    assert tracked([*path[:-1], (6.01, 0.0)], radius=3.0)[-1].since == 3 * LONG


@pytest.mark.parametrize("gone", [False, True])
def test_a_robot_that_is_free_or_gone_between_two_looks_begins_anew(gone: bool) -> None:
    stays = Stays({1: R}, 0.25)  # looked at in each fourth tick
    for k in range(13):
        between = k == 6
        stays.tick(k, {} if between and gone else {1: (0.0, 0.0)}, free=[1] if between and not gone else [])
    assert present(stays.stay(1)).since == 8
