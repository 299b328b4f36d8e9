"""A mind as a whole: pure, deterministic, and a patrol."""

from __future__ import annotations

import math
from asyncio import CancelledError
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest

from agent.build import Shared, build_mind
from agent.mind import Mind
from agent.ports import Bearing, Decision, Intent, PolicyFailed, State, Stay, Steer
from agent.view import View
from patrol.ground.terrain import Terrain
from patrol.pose import MODELS, Drive, Pose, Velocity
from patrol.radio.message import Position, decode, encode
from patrol.scenario import Scenario, load_scenario
from tests.agent.minds import at, prepared_on
from tests.agent.plans import Robots


def scenario_of(model: str, **patrol: Any) -> Scenario:
    robots = {"count": 2, "model": model}
    return load_scenario({"terrain": {"builtin": "yards"}, "point": 0.5, "robots": robots, "patrol": patrol})


PAPERS: dict[str, Any] = {"policy": "potential-field", "manoeuvres": False}
"""A direction chosen anew at each tick, as in the paper."""


def rooms() -> Terrain:
    """Two rooms of 24 x 30 m joined by a gap of 6 m."""
    passable = np.ones((60, 100), dtype=np.bool_)
    passable[:, 48:52] = False
    passable[24:36, 48:52] = True
    return Terrain("rooms", passable, 0.5)


HERE = Pose(6.0, 6.0, 0.0)


def mind_of(scenario: Scenario) -> Mind:
    """The mind of the first robot, which starts in the first room."""
    return build_mind(Shared(prepared_on(scenario, rooms(), [HERE])), 1)


def patrol(scenario: Scenario, ticks: int) -> list[list[Decision]]:
    """The decisions of two robots in the rooms, each of which the robots' limits and the walls allow."""
    robots = Robots(prepared_on(scenario, rooms(), [Pose(6.0, 6.0, 0.3), Pose(40.0, 20.0, 2.0)]))
    return [robots.tick() for _ in range(ticks)]


@pytest.mark.parametrize("model", MODELS)
def test_the_same_inputs_give_the_same_decisions(model: str) -> None:
    assert patrol(scenario_of(model), 60) == patrol(scenario_of(model), 60)


@pytest.mark.parametrize("policy", ["mode", "vector", "stochastic", "committed"])
@pytest.mark.parametrize("model", MODELS)
def test_robots_never_command_themselves_into_a_wall(model: str, policy: str) -> None:
    by_force = policy in ("mode", "vector")
    rules = {**PAPERS, "options": {"direction": policy}} if by_force else {"policy": policy}
    decisions = patrol(scenario_of(model, **rules), 200)
    assert all(d.figures for decided in decisions[0 if by_force else 1 :] for d in decided)


def test_a_car_keeps_to_its_speed_and_turning_radius_and_reverses_only_when_stuck() -> None:
    decisions = patrol(scenario_of("car", options={"random_move": 0.0}, **PAPERS), 300)
    for decision in (d for decided in decisions for d in decided):
        assert isinstance(decision.command, Drive)
        assert abs(decision.command.curvature) <= 1 / 3.5
        assert abs(decision.command.speed) <= 4.4
        assert decision.command.speed >= 0.0 or decision.state is State.DEAD_END
    assert any(d.state is State.PATROLLING for decided in decisions for d in decided)


def test_about_one_in_ten_holonomic_moves_is_random_and_none_without_chance() -> None:
    decisions = patrol(scenario_of("holonomic", **PAPERS), 300)
    random = [d for decided in decisions for d in decided if d.goal is None]
    assert 0.05 < len(random) / 600 < 0.16
    decisions = patrol(scenario_of("holonomic", options={"random_move": 0.0}, **PAPERS), 50)
    for decision in (d for decided in decisions for d in decided):
        assert decision.goal is not None
        assert isinstance(decision.command, Velocity)
        assert math.hypot(decision.command.vx, decision.command.vy) <= 4.4 + 1e-9


def test_frames_say_where_the_robot_is_and_nothing_else() -> None:
    mind = mind_of(scenario_of("car"))
    frame = mind.frames(at(7, Pose(6.004, 6.126, -1.0)))[0]
    assert len(frame) <= 32
    position = decode(frame)
    assert (position.robot, position.sequence, position.time_ms) == (1, 7, 3500)
    assert (position.x_cm, position.y_cm) == (600, 613)
    assert position.trail == ()


def test_a_bumped_car_backs_out() -> None:
    mind = mind_of(scenario_of("car", options={"random_move": 0.0}, **PAPERS))
    pose = Pose(12.0, 15.0, 0.0)
    assert mind.step(at(0, pose), []).state is State.PATROLLING
    decision = mind.step(at(1, pose, bumped=True), [])
    assert decision.state is State.DEAD_END
    assert isinstance(decision.command, Drive)
    assert decision.command.speed < 0.0


@pytest.mark.parametrize(
    ("field", "policy"),
    [
        *product(("sensor.range", "patrol.refine_reach"), ("committed", "potential-field")),
        ("patrol.options.dilatation", "potential-field"),
    ],
)
def test_a_reach_beyond_all_measure_is_as_good_as_the_terrains(field: str, policy: str) -> None:
    def decisions(reach: float) -> list[Decision]:
        chosen = {"patrol.policy": policy, field: reach}
        mind = mind_of(load_scenario({"terrain": {"builtin": "open"}, "point": 1.0}, chosen))
        return [mind.step(at(tick, HERE), []) for tick in range(3)]

    # The terrain is smaller than 100 m.
    assert [(one.goal, one.command) for one in decisions(1e6)] == [(one.goal, one.command) for one in decisions(100.0)]


def surrounding(contacts: tuple[tuple[float, float], ...] = (), frames: tuple[bytes, ...] = ()) -> Decision:
    """The decision of a robot at tick 3 in the rooms with another one at (20, 20)."""
    mind = mind_of(scenario_of("holonomic"))
    other = encode(Position.of(2, 3, 1.5, Pose(20.0, 20.0, 0.0)))
    return mind.step(at(3, HERE, contacts=contacts), [other, *frames])


def test_an_intruder_seen_or_heard_of_is_surrounded() -> None:
    seen = surrounding(contacts=((12.0, 14.0),))
    heard = surrounding(frames=(encode(Position.of_contact(3, 1.5, 12.0, 14.0)),))
    assert seen.state is heard.state is State.SURROUNDING
    assert seen.command == heard.command
    assert seen.figures == {}
    assert surrounding().state is State.PATROLLING


def test_hostile_contacts_change_nothing_but_the_count_of_what_was_rejected() -> None:
    hostile = (
        encode(Position.of_contact(3, 1.5, -4.0, 14.0)),
        encode(Position.of_contact(900, 450.0, 12.0, 14.0)),
        encode(Position.of_contact(3, 1.5, 12.0, 14.0))[:-1],
        bytes(64),
    )
    quiet, attacked = surrounding(), surrounding(frames=hostile)
    assert attacked.rejected == quiet.rejected + len(hostile)
    assert (attacked.command, attacked.state) == (quiet.command, State.PATROLLING)


def test_contacts_are_frames_of_their_own_and_at_most_four() -> None:
    mind = mind_of(scenario_of("car"))
    frames = mind.frames(at(7, HERE, contacts=tuple((10.0 + index, 20.0) for index in range(6))))
    assert frames[0] == mind.frames(at(7, HERE))[0]
    assert [decode(frame).robot for frame in frames] == [1, 0, 0, 0, 0]
    first = decode(frames[1])
    assert (first.sequence, first.time_ms, first.x_cm, first.y_cm) == (7, 3500, 1000, 2000)
    assert max(map(len, frames)) <= 32
    assert [decode(frame).robot for frame in mind.frames(at(8, HERE))] == [1]


class Says:
    """A policy that answers, or raises, what it is given."""

    def __init__(self, answer: Any) -> None:
        self._answer = answer

    def decide(self, view: View) -> Intent:
        del view
        if isinstance(self._answer, BaseException):
            raise self._answer
        answer: Intent = self._answer
        return answer


def asked(answer: Any) -> Decision:
    """The decision that a mind makes of a policy's answer."""
    mind = mind_of(scenario_of("holonomic"))
    mind.policy = Says(answer)
    return mind.step(at(0, HERE), [])


class Unspeakable(BaseException):
    """Has no message that could be read."""

    def __str__(self) -> str:
        raise GeneratorExit


@pytest.mark.parametrize(
    "raised",
    [KeyError("no idea"), SystemExit(3), RecursionError("deep"), MemoryError(), CancelledError(), GeneratorExit()],
)
def test_whatever_a_policy_raises_is_its_failure(raised: BaseException) -> None:
    with pytest.raises(PolicyFailed) as failed:
        asked(raised)
    assert str(failed.value) == f"raised {type(raised).__name__}: {raised}"
    assert failed.value.__cause__ is raised


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (Unspeakable(), "raised Unspeakable$"),
        (PolicyFailed("out of ideas"), "out of ideas$"),
        *((answer, "returned ") for answer in (None, Bearing((math.nan,)), Stay(""))),
    ],
    ids=lambda value: value if isinstance(value, str) else type(value).__name__,
)
def test_a_policy_that_answers_nothing_useful_has_failed(answer: Any, says: str) -> None:
    with pytest.raises(PolicyFailed, match=f"^{says}"):
        asked(answer)


def test_who_interrupts_a_policy_interrupts_the_mind() -> None:
    with pytest.raises(KeyboardInterrupt):
        asked(KeyboardInterrupt())


def test_a_decision_carries_the_policys_word_and_figures() -> None:
    decision = asked(Stay("resting", {"hope": 0.5}))
    assert (decision.state, decision.figures) == ("resting", {"hope": 0.5})
    assert (decision.goal, decision.refined, decision.direction) == (None, None, None)


@pytest.mark.parametrize(
    ("k", "zones", "limit"), [(0, None, 0.5), (19, None, 0.5), (20, None, 4.0), (20, (0,), 0.5), (0, (), 4.0)]
)
def test_a_robot_is_slow_where_a_zone_is_in_force(k: int, zones: tuple[int, ...] | None, limit: float) -> None:
    ward = {"name": "ward", "polygon": [[2, 2], [10, 2], [10, 10], [2, 10]], "speed": 0.5, "times": [[0, 10]]}
    robots = {"count": 2, "model": "holonomic", "speed": 4.0}
    scenario = load_scenario({"terrain": {"builtin": "yards"}, "point": 0.5, "robots": robots, "zones": [ward]})
    mind = mind_of(scenario)
    mind.policy = Says(Steer(Velocity(9.0, 0.0)))
    command = mind.step(replace(at(k, HERE), zones=zones), []).command
    assert command.speed_mps == pytest.approx(limit)
    outside = Pose(14.0, 14.0, 0.0)
    assert mind.step(replace(at(k + 1, outside), zones=zones), []).command.speed_mps == pytest.approx(4.0)
