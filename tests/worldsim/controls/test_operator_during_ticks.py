"""What operators ask for while a tick is waited for: the pace at once, all else before the next tick."""

from collections import deque
from typing import Any

import pytest

from patrol.errors import BadInput
from patrol.prepare import prepare
from patrol.scenario import load_scenario
from patrol.scenario.controls import Answer, Pause, read_control
from tests.worldsim.fleet.net import NAMES, heard, lockstep, paced, sensed, tick
from tests.worldsim.test_operator import SMALL, Rests
from worldsim.controls import ControlRequest, Operator
from worldsim.world import World

# Not the product's own, so that a wrong one there is noticed.
MOST_DEFERRED = 64
MOST_DURING = 8


class Asked:
    """Requests that are there, and what was answered."""

    def __init__(self) -> None:
        self.waiting: deque[ControlRequest] = deque()
        self.answers: list[Answer] = []

    def ask(self, **control: Any) -> None:
        try:
            found: Any = read_control(control)
        except BadInput as bad:
            found = bad
        self.waiting.append(ControlRequest(found, self.answers.append))

    def get(self, timeout_s: float) -> ControlRequest | None:
        assert timeout_s == 0.0 or self.waiting
        return self.waiting.popleft() if self.waiting else None


@pytest.fixture
def asked() -> Asked:
    return Asked()


@pytest.fixture
def operator(asked: Asked) -> Operator:
    world = World(prepare(load_scenario({**SMALL, "pace": "realtime"})), operated=True)
    world.begin_tick()
    return Operator(world, Rests(), asked, lambda: 100.0, controls_processes=True)


def test_the_pace_is_obeyed_in_the_tick_and_recorded_before_the_next(operator: Operator, asked: Asked) -> None:
    asked.ask(do="pace", factor=0.001)
    asked.ask(do="explode")
    asked.ask(do="fault", fault={"kind": "loss", "rate": 0.5})
    asked.ask(do="pause")
    operator.during()
    assert operator.state.pace == 0.001
    assert not operator.state.running
    assert [answer.done for answer in asked.answers] == [True, False, True]
    assert asked.answers[2].text == "paused before tick 1"
    events = operator.between(lambda: len(asked.answers) > 3)
    assert [(event.k, event.detail[:12]) for event in events] == [
        (1, '{"do":"pace"'),
        (1, '{"do":"pause'),
        (0, '{"do":"fault'),  # the world of this test has not ended its tick
    ]
    assert asked.answers[3].done


def test_a_flood_takes_a_bounded_part_of_a_tick(operator: Operator, asked: Asked) -> None:
    for _ in range(1000):
        asked.ask(do="pause")
    operator.during()
    assert len(asked.answers) == MOST_DURING
    asked.waiting.clear()
    for _ in range(1000):
        asked.ask(do="heal", id="f1")
    for _ in range(100):
        operator.during()
    assert len(asked.waiting) == 1000 - MOST_DEFERRED
    assert isinstance(read_control({"do": "pause"}), Pause)


def test_a_long_tick_ends_when_it_is_made_short() -> None:
    net, fleet = paced(500.0)
    began = net.time
    asked_at = began + 30.0
    fleet.meanwhile = lambda: fleet.set_step(0.5) if net.time >= asked_at else None
    tick(fleet, 0)
    assert asked_at <= net.time < asked_at + 1.0
    tick(fleet, 1)
    assert net.time < asked_at + 2.0
    assert fleet.slipped_s == 0.0


def test_a_tick_under_way_is_never_made_longer() -> None:
    net, fleet = paced()
    began = net.time
    fleet.phase_a(0, sensed(0))
    fleet.set_step(500.0)
    fleet.phase_b(0, heard())
    assert net.time - began == pytest.approx(0.5)
    tick(fleet, 1)
    assert net.time - began == pytest.approx(500.5)
    assert fleet.slipped_s == 0.0


def test_the_world_serves_others_while_it_waits_for_a_robot() -> None:
    net, fleet = lockstep(5.0)
    served: list[float] = []
    fleet.meanwhile = lambda: served.append(net.time)
    tick(fleet, 0)
    assert served == []
    net.mute = {1}
    began = net.time
    assert sorted(fleet.phase_a(1, sensed(1))) == sorted(NAMES)[1:]
    assert len(served) > 10 * (net.time - began) / 2
