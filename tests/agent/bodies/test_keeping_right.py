"""Robots that are about to meet pass each other on the right, or stop before they touch."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agent.bodies.keeping_right import KeepingRight, Motion, Motions
from agent.ports import Place
from agent.routes.ground import Ground, Spot
from patrol.ground.terrain import Terrain
from patrol.pose import Pose, Velocity
from patrol.radio.peers import Columns, go_on
from patrol.random import Purpose, draw
from tests.agent.plans import Robots, Says, plan, prepared_in

RADIUS = 0.2
LEFT, RIGHT = (1.5, 2.0), (13.5, 2.0)


def meeting(model: str, bodies: float, *, gives_room: bool = True, speeds: tuple[float, float] = (1.0, 1.0)) -> Robots:
    """Two robots at the ends of a corridor of so many bodies' width, each of which wants to be where the other is."""
    low, high = 2.0 - bodies * RADIUS, 2.0 + bodies * RADIUS
    terrain = plan((15.0, 4.0), (0.0, 0.0, 3.0, 4.0), (3.0, low, 12.0, high), (12.0, 0.0, 15.0, 4.0), point=0.05)
    body = {"radius": RADIUS, "model": model, "turning_radius": 0.5}
    prepared = prepared_in(terrain, [Pose(*LEFT, 0.0), Pose(*RIGHT, 3.14)], body, speeds=speeds)
    return Robots(prepared, Place(*RIGHT, gives_room=gives_room), Place(*LEFT, gives_room=gives_room))


def collisions(robots: Robots) -> int:
    return sum(body.collisions for body in robots.bodies)


@pytest.mark.parametrize("model", ["holonomic", "differential", "car"])
@pytest.mark.parametrize("bodies", [2.5, 3.0, 4.0, 6.0])
def test_two_robots_pass_on_the_right_without_a_touch(model: str, bodies: float) -> None:
    robots = meeting(model, bodies)
    robots.until(lambda: robots.bodies[0].pose.x > robots.bodies[1].pose.x, 30)
    # Each has the other on its left.
    assert robots.bodies[0].pose.y < robots.bodies[1].pose.y
    robots.until(lambda: robots.apart(RIGHT) < 0.5 and robots.apart(LEFT, 1) < 0.5, 30)
    assert collisions(robots) == 0


@pytest.mark.parametrize("model", ["holonomic", "differential", "car"])
@pytest.mark.parametrize("bodies", [2.5, 4.0])
def test_a_slow_robot_foresees_a_fast_one(model: str, bodies: float) -> None:
    robots = meeting(model, bodies, speeds=(0.3, 1.0))
    robots.until(lambda: robots.bodies[0].pose.x > robots.bodies[1].pose.x, 60)
    # The slow one has moved aside as well.
    assert robots.bodies[0].pose.y < 2.0 - 0.25 * RADIUS < robots.bodies[1].pose.y
    assert collisions(robots) == 0


@pytest.mark.parametrize("model", ["holonomic", "differential", "car"])
def test_robots_that_are_heard_in_every_second_tick_pass_as_well(model: str) -> None:
    robots = meeting(model, 3.0)
    robots.is_lost = lambda k, _sender, _hearer: k % 2 != 0
    robots.until(lambda: robots.apart(RIGHT) < 0.5 and robots.apart(LEFT, 1) < 0.5, 60)
    assert collisions(robots) == 0


@pytest.mark.parametrize("model", ["holonomic", "differential", "car"])
def test_where_they_cannot_pass_one_goes_back_and_they_do_not_touch(model: str) -> None:
    robots = meeting(model, 1.5)
    robots.until(lambda: robots.bodies[0].pose.x > robots.bodies[1].pose.x, 200)
    assert collisions(robots) == 0


def test_a_robot_that_does_not_give_room_bumps_first() -> None:
    robots = meeting("holonomic", 3.0, gives_room=False)
    robots.until(lambda: robots.bodies[0].bumped, 30)


@pytest.mark.parametrize("model", ["holonomic", "differential", "car"])
def test_a_robot_that_stands_is_gone_round(model: str) -> None:
    robots = meeting(model, 6.0)
    robots.bodies[1].pose = Pose(8.0, 2.0, 0.0)
    robots.minds[1].policy = Says(Place(8.0, 2.0))
    robots.until_near(RIGHT, 0.5, 40)
    assert collisions(robots) == 0


def test_a_wrong_position_in_the_way_does_not_hold_a_robot_for_good() -> None:
    robots = meeting("holonomic", 1.5)
    robots.bodies[1].away = True  # it is heard there, and is not
    robots.bodies[1].pose = Pose(8.0, 2.0, 0.0)
    robots.minds[1].policy = Says(Place(8.0, 2.0))
    robots.until_near(RIGHT, 0.5, 400)


def test_steps_that_are_cut_never_touch_whatever_robots_did_before() -> None:
    terrain = plan((20.0, 20.0), (0.0, 0.0, 20.0, 20.0))
    ground, strides, radii = Ground(terrain, terrain.passable), {1: 0.5, 2: 0.5}, {1: 0.3, 2: 0.3}
    for number in range(400):
        share = [draw(number, Purpose.START, index) for index in range(6)]
        gap, turns = 0.6 + 0.05 + 0.8 * share[0], [math.tau * part for part in share[1:5]]
        before = [Pose(5.0, 5.0, 0.0), Pose(5.0 + gap, 5.0, 0.0)]
        here = [moved(pose, 0.5 * share[5], turn) for pose, turn in zip(before, turns[:2], strict=True)]
        if math.dist((here[0].x, here[0].y), (here[1].x, here[1].y)) < 0.65:
            continue
        ends = []
        for own, other in ((0, 1), (1, 0)):
            right = KeepingRight(own + 1, radii, strides, ground, 0.5)
            view: Any = None
            for tick, poses in enumerate((before, here), 1):
                heard = {other + 1: SimpleNamespace(pose=poses[other], sequence=tick, tick=tick)}
                view = SimpleNamespace(tick=tick, pose=poses[own], reported=poses[own], peers=heard, obstacles=())
                right.note(view)
            bearing = turns[2 + own]
            part = right.room(Velocity(math.cos(bearing), math.sin(bearing)), view)
            ends.append(moved(here[own], 0.5 * part, bearing))
        assert math.dist((ends[0].x, ends[0].y), (ends[1].x, ends[1].y)) >= 0.6, number


def test_robots_that_hear_each_other_late_keep_to_the_same_line() -> None:
    terrain = plan((20.0, 20.0), (0.0, 0.0, 20.0, 20.0))
    ground, strides, radii = Ground(terrain, terrain.passable), {1: 0.5, 2: 0.5}, {1: 0.3, 2: 0.3}
    # Both stood in the first ticks and now drive towards each other, of which neither has heard.
    ways = [5.5, 5.5, 5.5, 6.0], [7.5, 7.5, 7.5, 7.0]
    ends = []
    for own, other in ((0, 1), (1, 0)):
        right, ahead = KeepingRight(own + 1, radii, strides, ground, 0.5), 1.0 - 2.0 * own
        view: Any = None
        for tick in range(1, 4):
            pose, peer = Pose(ways[own][tick], 5.0, 0.0), Pose(ways[other][tick - 1], 5.0, 0.0)
            heard = {other + 1: SimpleNamespace(pose=peer, sequence=tick - 1, tick=tick)}
            view = SimpleNamespace(tick=tick, pose=pose, reported=pose, peers=heard, obstacles=())
            right.note(view)
        ends.append(view.pose.x + 0.5 * ahead * right.room(Velocity(ahead, 0.0), view))
    assert 0.6 <= ends[1] - ends[0] < 0.75


def moved(pose: Pose, way: float, bearing: float) -> Pose:
    return Pose(pose.x + way * math.cos(bearing), pose.y + way * math.sin(bearing), bearing)


FASTEST_M = 3.0
REACH_M = 4.0


def columns(rows: list[tuple[int, int, int, float, float]]) -> Columns:
    numbers, sequences, ticks = np.array([row[:3] for row in rows], dtype=np.int64).reshape(-1, 3).T.copy()
    return Columns(numbers, sequences, ticks, np.array([row[3:] for row in rows], dtype=np.float64).reshape(-1, 2))


@pytest.mark.parametrize(("sequence", "moved"), [(4, 1.0), (5, 0.5), (8, 0.2)])
def test_a_way_that_took_several_ticks_of_silence_is_that_of_all_of_them(sequence: int, moved: float) -> None:
    motions = Motions(0, np.full(2, 1.0), np.full(2, REACH_M))
    motions.note(columns([(1, 3, 3, 0.0, 0.0)]), 3, (0.0, 0.0))
    heard = motions.note(columns([(1, sequence, sequence, 1.0, 0.0)]), sequence, (0.0, 0.0))
    assert heard == {1: Motion((1.0, 0.0), (moved, 0.0)), 0: Motion((0.0, 0.0), (0.0, 0.0))}


LOOK = st.tuples(st.integers(0, 9), st.integers(0, 2), st.integers(-6, 6), st.integers(-6, 6))
NOTES = st.lists(st.dictionaries(st.integers(1, 5), LOOK, max_size=5), min_size=1, max_size=12)


@given(NOTES)
def test_motions_are_those_of_each_robot_followed_by_itself(notes: list[dict[int, tuple[int, int, int, int]]]) -> None:
    """A sequence may lag behind, stay, or jump; a robot may be away; movements may be too fast to be true."""
    motions = Motions(0, np.full(6, FASTEST_M), np.full(6, REACH_M))
    known: dict[int, tuple[int, int, float, float, float, float]] = {}
    for now, heard in enumerate(notes):
        before, known = known, {}
        near = {}
        for number, (sequence, late, x, y) in sorted(heard.items()):
            was = before.get(number)
            if was is None:
                known[number] = sequence, sequence, x, y, 0.0, 0.0
            elif was[0] == sequence and was[2:4] == (x, y):
                known[number] = was
            else:
                tick = was[1] + 1 if sequence == was[0] else max(sequence, was[1] + 1)
                right, up = (x - was[2]) / (tick - was[1]), (y - was[3]) / (tick - was[1])
                true = math.hypot(right, up) <= FASTEST_M
                known[number] = sequence, tick, x, y, right if true else 0.0, up if true else 0.0
            if late > 0 or math.hypot(x - 1.0, y + 1.0) <= REACH_M:
                near[number] = Motion((x, y), known[number][4:])
        rows = [
            (n, sequence, sequence + late, float(x), float(y)) for n, (sequence, late, x, y) in sorted(heard.items())
        ]
        assert motions.note(columns(rows), now, (1.0, -1.0)) == {**near, 0: Motion((1.0, -1.0), (0.0, 0.0))}


Followed = tuple[int, int, Spot, Spot]  # sequence, tick, place and movement in a tick


def followed(was: Followed, sequence: int, place: Spot) -> Followed:
    """A motion a tick later, in plain Python."""
    if sequence == was[0] and place == was[2]:
        return was
    tick = was[1] + 1 if sequence == was[0] else max(sequence, was[1] + 1)
    right, up = ((there - here) / (tick - was[1]) for here, there in zip(was[2], place, strict=True))
    return sequence, tick, place, (right, up) if math.hypot(right, up) <= 1.0 else (0.0, 0.0)


LATE = st.lists(st.dictionaries(st.integers(2, 4), st.integers(0, 3), max_size=3), min_size=4, max_size=14)


@given(LATE, st.integers(0, 2**32 - 1))
def test_own_motion_is_what_each_robot_that_is_heard_late_predicts(heard: list[dict[int, int]], seed: int) -> None:
    """Robots may be late in one tick and not in the next, away for a while, or late by more or less than before."""
    dice = np.random.default_rng(seed)
    terrain = Terrain("t", np.ones((40, 40), dtype=np.bool_), 0.5)
    strides = dict.fromkeys((1, 2, 3, 4), 0.5)
    right = KeepingRight(1, dict.fromkeys(strides, 0.3), strides, Ground(terrain, terrain.passable), 1.0)
    places: dict[int, Spot] = {}
    own: Followed = (0, 0, (0.0, 0.0), (0.0, 0.0))
    predicted: dict[int, Followed] = {}
    x, y = 8.0, 8.0
    for tick, lateness in enumerate(heard):
        x, y = x + dice.integers(-3, 4) / 10.0, y + dice.integers(-3, 4) / 10.0
        places[tick] = x, y
        own = followed(own, tick, (x, y))
        before, predicted = predicted, {}
        for number, late in lateness.items():
            sent = tick - late
            if late == 0 or sent - 1 not in places:
                continue
            moved = tuple(now - then for now, then in zip(places[sent], places[sent - 1], strict=True))
            end = go_on(terrain, Pose(*places[sent], 0.0), (moved[0], moved[1]), late)
            predicted[number] = followed(
                before.get(number, (sent, sent, places[sent], (0.0, 0.0))), sent, (end.x, end.y)
            )
        peers = {
            number: SimpleNamespace(pose=Pose(9.0 + number, 9.0, 0.0), sequence=tick - late, tick=tick)
            for number, late in lateness.items()
        }
        pose = Pose(x, y, 0.0)
        note: Any = SimpleNamespace(tick=tick, pose=pose, reported=pose, peers=peers, obstacles=())
        right.note(note)
        state = vars(right)
        assert state["_own"] == Motion(own[2], own[3])
        ahead = {number: motion for number, motion in state["_predicted"].items() if number != 1}
        assert ahead == {number: Motion(motion[2], motion[3]) for number, motion in sorted(predicted.items())}
