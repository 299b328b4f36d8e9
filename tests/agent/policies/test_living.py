"""The robots that live: a silence is weighed against the silences before it."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from agent.policies.living import LEAST_S, QUIET_S, STUCK_S, Living
from patrol.pose import Pose
from patrol.radio.peers import Peer
from tests.agent.plans import plan, prepared_in

STEP = 0.5
SIZE_M = 20.0
ALL = frozenset({1, 2, 3, 4})
FORGOTTEN = 20
"""Ticks after which a robot that is not heard is no longer among those that are."""


class Watch:
    """The first of four robots; a test says in each tick whom it hears. All drive, but for those that a test stops."""

    def __init__(self, spare: int = 0, away_m: float = 17.0, numbers: int = 4) -> None:
        starts = [Pose(2.0 + 2.0 * i, 2.0, 0.0) for i in range(numbers)]
        ready = prepared_in(plan((SIZE_M, 10.0), (0.0, 0.0, SIZE_M, 10.0)), starts, {"radius": 0.2, "speed": 1.0})
        roster = [replace(spec, spare=spec.number == spare) for spec in ready.scenario.roster]
        setup: Any = SimpleNamespace(
            robot=SimpleNamespace(spec=roster[0]),
            ground=SimpleNamespace(terrain=ready.terrain),
            fleet=SimpleNamespace(roster=roster, step=STEP),
        )
        self.living = Living(setup)
        self.tick, self.away_m = -1, dict.fromkeys((2, 3, 4), away_m)
        self.stopped: set[int] = set()
        self.late = 0
        self.charging: frozenset[int] = frozenset()
        self._heard: dict[int, Peer] = {}

    def hear(self, *numbers: int) -> frozenset[int]:
        """Go on by a tick in which some are heard; return those that live."""
        self.tick += 1
        for number in numbers:
            aside = 0.0 if number in self.stopped else 0.6 * (self.tick % 7)
            pose = Pose(2.0 + self.away_m[number], 2.0 + aside, 0.0)
            self._heard[number] = Peer(self.tick - self.late, pose, self.tick)
        peers = {number: peer for number, peer in self._heard.items() if self.tick - peer.tick < FORGOTTEN}
        reported = Pose(2.0, 2.0, 0.0)
        view: Any = SimpleNamespace(tick=self.tick, peers=peers, reported=reported, stride=0.5, charging=self.charging)
        return self.living.note(view)

    def ticks_until_dead(self, number: int, *others: int) -> int:
        """Return how long a robot counts on that is not heard any more, while others are."""
        for ticks in range(1, 10_000):
            if number not in self.hear(*others):
                return ticks
        raise AssertionError("it counts for ever")


def test_where_nothing_is_lost_a_death_is_noticed_soon_and_sooner_once_the_radio_is_known() -> None:
    watch = Watch()
    for _ in range(100):
        assert watch.hear(2, 3, 4) == ALL
    early = watch.ticks_until_dead(2, 3, 4)
    for _ in range(2000):
        watch.hear(2, 3, 4)
    late = watch.ticks_until_dead(2, 3, 4)
    assert late < early <= 60.0 / STEP
    assert LEAST_S <= late * STEP <= 2.0 * LEAST_S


@pytest.mark.parametrize(("loss", "well"), [(0.0, True), (0.005, True), (0.1, False), (0.9, False), (1.0, False)])
def test_robots_that_miss_or_wait_for_positions_do_not_hear_well(loss: float, well: bool) -> None:
    watch, dice = Watch(), np.random.default_rng(5)
    for _ in range(600):
        watch.hear(*[number for number in (2, 3, 4) if dice.random() >= loss])
    assert watch.living.hears_well == well
    for _ in range(2000):
        watch.hear(2, 3, 4)
    assert watch.living.hears_well


def test_where_nothing_is_heard_that_shows_soon() -> None:
    watch, ticks = Watch(), 0
    while watch.living.hears_well:
        watch.hear()
        ticks += 1
    assert ticks * STEP == pytest.approx(QUIET_S, abs=2 * STEP)


def test_a_robot_alone_hears_well() -> None:
    watch = Watch(numbers=1)
    for _ in range(1000):
        assert watch.hear() == {1}
        assert watch.living.hears_well


def test_positions_that_take_their_time_are_not_heard_well() -> None:
    watch = Watch()
    watch.late = 2
    for _ in range(100):
        watch.hear(2, 3, 4)
    assert not watch.living.hears_well


def test_a_death_or_a_time_at_a_dock_is_no_loss() -> None:
    watch = Watch()
    for _ in range(600):
        watch.hear(2, 3, 4)
    for _ in range(400):
        assert watch.hear(3, 4)
        assert watch.living.hears_well
    watch.hear(2, 3, 4)
    assert watch.living.hears_well
    watch.tick += 500
    watch.hear(2, 3, 4)
    assert watch.living.hears_well


@pytest.mark.parametrize(("loss", "most_s"), [(0.6, 60.0), (0.9, 200.0)])
def test_where_much_is_lost_none_dies_by_chance_and_a_death_is_noticed(loss: float, most_s: float) -> None:
    watch, dice = Watch(), np.random.default_rng(5)

    def heard(*numbers: int) -> list[int]:
        return [number for number in numbers if dice.random() > loss]

    for tick in range(8000):
        living = watch.hear(*heard(2, 3, 4))
        assert living == ALL, tick
    ticks = next(ticks for ticks in range(1, 2000) if 2 not in watch.hear(*heard(3, 4)))
    assert FORGOTTEN < ticks <= most_s / STEP


def test_while_none_is_heard_the_radio_is_gone_and_not_the_robots() -> None:
    watch = Watch()
    for _ in range(100):
        watch.hear(2, 3, 4)
    for _ in range(5000):
        assert watch.hear() == ALL
    assert watch.hear(2, 3, 4) == ALL


def test_a_robot_that_was_dead_before_the_radio_was_gone_stays_dead() -> None:
    watch = Watch()
    for _ in range(600):
        watch.hear(2, 3, 4)
    while 4 in watch.hear(2, 3):
        pass
    assert {frozenset(watch.hear()) for _ in range(200)} == {ALL - {4}}
    assert {frozenset(watch.hear(2, 3)) for _ in range(200)} == {ALL - {4}}
    assert watch.hear(2, 3, 4) == ALL


def test_a_robot_that_has_charged_or_was_dead_for_long_does_not_make_deaths_hard_to_notice() -> None:
    watch = Watch()
    for _ in range(2000):
        watch.hear(2, 3, 4)
    watch.charging = frozenset({2})
    for _ in range(2000):
        assert watch.hear(3, 4) == ALL - {2}
    watch.charging = frozenset()
    for _ in range(2000):
        watch.hear(2, 3)
    for _ in range(20):
        watch.hear(2, 3, 4)
    assert watch.ticks_until_dead(3, 2, 4) * STEP <= 60.0


def test_robots_that_were_never_heard_count() -> None:
    watch = Watch()
    assert all(watch.hear() == ALL for _ in range(5000))


def test_one_that_may_have_driven_out_of_reach_counts_for_longer() -> None:
    """The farthest is heard from 5 m, of 22 m that the ground is long."""
    watch = Watch(away_m=5.0)
    watch.away_m[3] = 1.0
    for _ in range(600):
        watch.hear(2, 3, 4)
    nearby_s, far_s = watch.ticks_until_dead(3, 2, 4) * STEP, watch.ticks_until_dead(2, 4) * STEP
    assert nearby_s <= 60.0
    assert 1.5 * nearby_s < far_s <= 300.0


def test_the_radio_at_the_edge_becomes_known() -> None:
    """A robot that is as far away as any, and is silent for up to 100 s again and again."""
    watch = Watch(away_m=1.0)
    watch.away_m[3] = 5.0
    for round_ in range(60):
        for _ in range(round_ % 10 * 21):
            assert 3 in watch.hear(2, 4)
        watch.hear(2, 3, 4)
    assert watch.ticks_until_dead(3, 2, 4) * STEP > 200.0
    for _ in range(6000):
        watch.hear(2, 3, 4)
    assert watch.ticks_until_dead(3, 2, 4) * STEP <= 60.0


def test_one_that_stands_still_for_long_is_stuck_until_it_drives_on() -> None:
    watch = Watch()
    for _ in range(20):
        watch.hear(2, 3, 4)
    watch.stopped = {2}
    stood = sum(2 in watch.hear(2, 3, 4) for _ in range(200))
    assert stood * STEP == pytest.approx(STUCK_S, abs=2.0)
    watch.stopped = set()
    assert 2 in [watch.hear(2, 3, 4) for _ in range(3)][-1]


def test_a_spare_one_counts_once_it_is_heard_and_one_that_charges_does_not() -> None:
    watch = Watch(spare=4)
    assert watch.hear(2, 3) == ALL - {4}
    assert watch.hear(2, 3, 4) == ALL
    watch.charging = frozenset({3})
    assert watch.hear(2, 3, 4) == ALL - {3}
