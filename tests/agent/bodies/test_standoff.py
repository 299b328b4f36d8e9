"""Stand-offs: which role a robot takes that does not get on, and that two that block each other both come through."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from agent.bodies.standoff import ROLES, Moves, Role, Situation, StandOff, nearest
from agent.chance import Chance
from agent.ports import Bearing, Place
from agent.routes.ground import Disc, Ground, Spot
from patrol.ground.swept_path import advance
from patrol.pose import MODELS, Pose
from patrol.radio.peers import Peer
from tests.agent.minds import STEP
from tests.agent.plans import Robots, plan, prepared_in
from tests.present import present
from tests.swaps import TEAMS, random_passage, swap

# Not the product's own, so that a wrong one there is noticed.
BACKS_OFF_S = 3.0
CALM_S = 3.0
GIVES_WAY_S = 3.0, 10.0
OFTEN = 3
STILL_S = 4.0

MOST_COLLISIONS = 25
RADIUS = 0.3
HERE = Pose(5.0, 5.0, 0.0)
PATIENT = round(STILL_S / STEP)
"""Bumps in a row that a robot with a lower number bears."""


def peers(**places: tuple[float, float]) -> dict[int, Peer]:
    return {int(name[1:]): Peer(0, Pose(x, y, 0.0), 0) for name, (x, y) in places.items()}


class Alone:
    """Robot 2 in a hall, with its moves."""

    def __init__(self, moves: Moves = Moves.SIDEWAYS) -> None:
        terrain = plan((10.0, 10.0), (0.0, 0.0, 10.0, 10.0))
        setup = SimpleNamespace(
            spec=SimpleNamespace(number=2, speed=1.0),
            radii={1: RADIUS, 2: RADIUS, 3: RADIUS},
            step=STEP,
            ground=Ground(terrain, terrain.passable),
            chance=Chance(7).of_robot(2, 1),
            patrol=SimpleNamespace(give_way=True),
        )
        self.rule = StandOff(setup, moves)  # type: ignore[arg-type]

    def tick(self, k: int, others: dict[int, Peer], *, bumped: bool = True) -> list[Disc]:
        return self.rule.obstacles(k, HERE, bumped, others)

    def backs_off_to(self, k: int, others: dict[int, Peer]) -> Spot | None:
        view = SimpleNamespace(tick=k, pose=HERE, peers=others)
        return self.rule.backs_off_to(view, lambda _spot: 0.5)  # type: ignore[arg-type]


# --- the table --------------------------------------------------------------------------------------------------------


def test_there_is_a_role_in_each_situation_for_all_moves() -> None:
    assert set(ROLES) == {(situation, moves) for situation in Situation for moves in Moves}


def test_what_follows_from_another_robot_is_the_same_for_all_bodies() -> None:
    for situation in set(Situation) - {Situation.DEAD_END, Situation.OFTEN}:
        assert len({ROLES[situation, moves] for moves in Moves}) == 1
        assert ROLES[situation, Moves.SIDEWAYS] not in (Role.BACKS_OFF, Role.TURNS_OUT)


# --- giving way -------------------------------------------------------------------------------------------------------


def test_the_higher_number_gives_way_for_a_while() -> None:
    alone, others, (shortest_s, longest_s) = Alone(), peers(r1=(5.7, 5.0), r3=(9.0, 5.0)), GIVES_WAY_S
    ((x, y, radius),) = alone.tick(10, others)
    assert (x, y) == (5.7, 5.0)
    assert radius == pytest.approx(0.6)
    assert alone.tick(10 + round(shortest_s / STEP) - 1, others, bumped=False)
    after = 10 + round(longest_s / STEP) + 1
    assert alone.tick(after, others, bumped=False) == []
    assert alone.tick(after + 1, {}, bumped=False) == []  # once the while is over the other is not asked for


def test_the_lower_number_goes_on_until_its_patience_ends() -> None:
    alone, others = Alone(), peers(r3=(5.7, 5.0))
    assert all(alone.tick(k, others) == [] for k in range(PATIENT))
    assert len(alone.tick(PATIENT, others)) == 1


def test_a_move_that_succeeds_restores_patience() -> None:
    alone, others = Alone(), peers(r3=(5.7, 5.0))
    assert all(alone.tick(k, others, bumped=k % 4 != 0) == [] for k in range(4 * PATIENT))


def test_a_robot_gives_way_neither_to_a_distant_peer_nor_to_none() -> None:
    alone = Alone()
    assert alone.tick(0, peers(r1=(8.0, 5.0))) == []
    assert alone.tick(1, {}) == []


def test_the_obstacle_never_covers_the_robot_itself() -> None:
    ((_, _, radius),) = Alone().tick(0, peers(r1=(5.45, 5.0)))
    assert radius < 0.45


@pytest.mark.parametrize("seed", range(20))
def test_the_nearest_is_whose_body_is_nearest_and_of_several_the_first(seed: int) -> None:
    dice = np.random.default_rng(seed)
    places = dice.integers(0, 4, (int(dice.integers(1, 40)), 2)).astype(np.float64) + seed / 3.0
    numbers = (dice.permutation(len(places)) + 1).tolist()
    others = peers(**{f"r{number}": (x, y) for number, (x, y) in zip(numbers, places.tolist(), strict=True)})
    radii = {number: float(dice.choice([0.2, 0.3, 0.45])) for number in others}
    here = Pose(seed / 3.0 + 1.0, seed / 3.0 + 2.0, 0.0)
    gaps = [(math.hypot(at.pose.x - here.x, at.pose.y - here.y) - radii[n], n) for n, at in others.items()]
    assert nearest(here, others, radii) == min(gaps)
    assert nearest(HERE, {}, {}) == (math.inf, 0)


@pytest.mark.parametrize(("width", "gives_way"), [(1.0, False), (3.0, True)])
def test_a_robot_gives_way_only_where_a_way_leads_round_the_other(width: float, gives_way: bool) -> None:
    corridor = plan((12.0, 4.0), (0.0, 0.0, 3.0, 4.0), (3.0, 0.5, 9.0, 0.5 + width), (9.0, 0.0, 12.0, 4.0))
    middle = 0.5 + 0.5 * width
    starts = [Pose(4.0, middle, 0.0), Pose(8.0, middle, 0.0)]
    prepared = prepared_in(corridor, starts, {"radius": 0.3, "speed": 1.0, "model": "holonomic"})
    robots = Robots(prepared, Place(11.0, 2.0), Place(1.0, 2.0))
    given: list[tuple[int, object]] = []
    for number, mind in enumerate(robots.minds, 1):
        own = mind.body.obstacles

        def noted(*sensed: object, own: object = own, number: int = number) -> object:
            discs = own(*sensed)  # type: ignore[operator]
            given.extend((number, disc) for disc in discs)
            return discs

        mind.body.obstacles = noted  # type: ignore[method-assign, assignment]
    robots.until(lambda: all(body.bumped for body in robots.bodies), 20)
    robots.tick()
    # Robot 2 has the higher number.
    assert {number for number, _ in given} == ({2} if gives_way else set())
    robots.until(lambda: robots.apart((11.0, 2.0)) < 0.6 and robots.apart((1.0, 2.0), 1) < 0.6, 200)


# --- backing off ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("moves", [Moves.ON_THE_SPOT, Moves.ALONG_ARCS])
def test_a_robot_that_keeps_bumping_backs_off_away_from_the_nearest(moves: Moves) -> None:
    alone, others = Alone(moves), peers(r3=(5.7, 5.0))
    for k in range(OFTEN):
        assert alone.backs_off_to(k, others) is None
        alone.tick(k, others)
    spot = present(alone.backs_off_to(OFTEN - 1, others))
    assert spot[0] <= HERE.x
    assert math.dist(spot, (HERE.x, HERE.y)) <= BACKS_OFF_S
    assert alone.backs_off_to(OFTEN + round(BACKS_OFF_S / STEP), others) is None


@pytest.mark.parametrize("moves", [Moves.SIDEWAYS, Moves.AS_PRINTED])
def test_a_robot_that_steps_aside_by_itself_or_follows_the_letter_backs_off_never(moves: Moves) -> None:
    alone, others = Alone(moves), peers(r3=(5.7, 5.0))
    for k in range(4 * OFTEN):
        alone.tick(k, others)
        assert alone.rule.meet_dead_end(k) is not Role.BACKS_OFF
        assert alone.backs_off_to(k, {}) is None


def test_bumps_and_dead_ends_far_apart_do_not_add_up() -> None:
    alone = Alone(Moves.ALONG_ARCS)
    for k in range(0, 100, 10):
        alone.tick(k, {})
        assert alone.backs_off_to(k, {}) is None
    for apart, add_up in ((round(CALM_S / STEP), True), (round(CALM_S / STEP) + 1, False)):
        alone = Alone(Moves.ALONG_ARCS)
        roles = [alone.rule.meet_dead_end(k * apart) for k in range(OFTEN)]
        assert (roles[-1] is Role.BACKS_OFF) is add_up
        last = (OFTEN - 1) * apart
        assert alone.rule.keeps_happening(last + round(CALM_S / STEP)) is add_up
        assert not alone.rule.keeps_happening(last + round(CALM_S / STEP) + 1)


def test_a_car_turns_out_of_a_dead_end_until_it_is_in_one_again_and_again() -> None:
    alone = Alone(Moves.ALONG_ARCS)
    assert [alone.rule.meet_dead_end(k) for k in range(OFTEN)] == [Role.TURNS_OUT] * (OFTEN - 1) + [Role.BACKS_OFF]


def test_a_bump_ends_backing_off() -> None:
    alone = Alone(Moves.ON_THE_SPOT)
    assert alone.rule.meet_dead_end(0) is Role.BACKS_OFF
    alone.tick(1, {})
    assert alone.backs_off_to(1, {}) is None


# --- robots that block each other -------------------------------------------------------------------------------------


@pytest.mark.parametrize("team", [team for team in TEAMS if "," not in team])
def test_two_robots_swap_rooms_through_a_corridor_in_which_they_cannot_pass(team: str) -> None:
    seed = next(seed for seed in range(100) if random_passage(seed, team).width < 1.25)
    result = present(swap(seed, team))
    assert result.passed, result
    # Robots that only push against each other collide many times before one is through by chance.
    assert result.collisions <= MOST_COLLISIONS, result


@pytest.mark.parametrize("corridor", [2.0, 6.0])
def test_two_cars_that_meet_in_a_corridor_both_come_through(corridor: float) -> None:
    """In it they cannot pass."""
    width, car = 14.0 + corridor, {"model": "car", "radius": 0.4, "turning_radius": 0.8, "speed": 1.0}
    rooms = (0.0, 0.0, 7.0, 7.0), (7.0, 3.0, 7.0 + corridor, 4.0), (7.0 + corridor, 0.0, width, 7.0)
    starts = [Pose(5.5, 3.5, 0.0), Pose(width - 5.5, 3.5, math.pi)]
    prepared = prepared_in(plan((width, 7.0), *rooms), starts, car)
    robots = Robots(prepared, Place(width - 2.0, 2.0), Place(2.0, 5.0))
    came = [False, False]
    for _ in range(600):
        robots.tick()
        came[0] |= robots.apart((width - 2.0, 2.0), 0) < 1.0
        came[1] |= robots.apart((2.0, 5.0), 1) < 1.0
    assert came == [True, True], [body.pose for body in robots.bodies]
    assert sum(body.collisions for body in robots.bodies) > 0, "they never met"


@pytest.mark.parametrize("model", [model for model in MODELS if model != "holonomic"])
def test_two_that_only_have_directions_part_as_well(model: str) -> None:
    terrain = plan((14.0, 1.0), (0.0, 0.1, 14.0, 0.9))
    starts = [Pose(6.0, 0.5, 0.0), Pose(8.0, 0.5, math.pi)]
    body = {"model": model, "radius": RADIUS, "speed": 1.0, "turning_radius": 0.6}
    pair = Robots(prepared_in(terrain, starts, body), Bearing((0.0,)), Bearing((math.pi,)))
    gaps = []
    for _ in range(120):
        pair.tick()
        gaps.append(pair.bodies[1].pose.x - pair.bodies[0].pose.x - 2.0 * RADIUS)
    met = next(k for k, gap in enumerate(gaps) if gap < 0.5)
    assert max(gaps[met:]) > 1.5
    assert all(body.collisions < 60 for body in pair.bodies)


def test_between_a_wall_and_a_wreck_a_car_gets_out() -> None:
    """A full step ahead always ends in the wreck, of which steering knows nothing, and behind there is the wall."""
    hall = plan((60.0, 60.0), (0.0, 0.0, 60.0, 60.0), point=0.5)
    start, wreck = Pose(30.0, 1.1, math.pi / 2), (30.5, 4.5)
    alone = Robots(prepared_in(hall, [start], {"model": "car"}), Bearing((0.0,)))
    body, radius = alone.bodies[0], alone.bodies[0].spec.radius
    for _ in range(1000):
        before = body.pose
        alone.tick()
        ways = [advance(before, body.command, STEP * part / 8) for part in range(1, 9)]
        body.bumped = any(math.dist(wreck, (way.x, way.y)) < 2.0 * radius for way in ways)
        body.pose = before if body.bumped else body.pose
        if alone.apart((start.x, start.y)) > 4.0:
            return
    pytest.fail("it stays there for ever")
