from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from patrol.journal import Event, TickRecord
from patrol.measures.stays import Place
from runtime.messages.telemetry import Notice
from tests.worldsim.checks.test_progress import WHOLE, made, rooms
from worldsim.output.live_progress import LiveProgress
from worldsim.world import World


def told(path: Callable[[int], Place], ticks: int = 1600) -> tuple[LiveProgress, list[Notice]]:
    """The notices about a robot that goes along a path, while the other one stands and half of the ground is stale."""
    ready = rooms()
    world = World(ready)
    live = LiveProgress(world, lambda: 0.0)
    notices: list[Notice] = []
    for record in made(ready, ticks, path, WHOLE).ticks:
        world.truth.fog.last_seen[:, :21] = record.k
        notices += live.tick(record)[1]
    return live, notices


def test_a_trapped_robot_is_told_once_and_once_when_it_is_free() -> None:
    _, notices = told(lambda k: (5.0, 5.0) if k < 900 else WHOLE(k))
    last, where = notices[-1].k, "within 3.2 m of (5.0, 5.0)"
    assert notices == [
        Notice(360, "trapped", "r1", f"{where} since 0 s; nobody has seen (10.8, 5.2) in that time"),
        Notice(last, "no longer trapped", "r1", f"after {last / 2:g} s {where}"),
    ]
    assert 900 < last < 930


def test_who_moves_from_one_long_stay_to_the_next_is_not_told_to_be_free() -> None:
    _, notices = told(lambda k: (2.0 + 0.005 * k, 5.0))
    assert len(notices) == 2
    assert {notice.kind for notice in notices} == {"trapped"}


def test_who_gets_on_is_not_told_of() -> None:
    live, notices = told(WHOLE)
    assert notices == []
    assert live.event(Event(3, "dead", 2, "gone")) == Notice(3, "dead", "r2", "gone")


def test_metrics_name_the_stalest_place() -> None:
    ready = rooms()
    world = World(ready)
    live = LiveProgress(world, lambda: 0.0)
    seen = world.truth.fog
    record: TickRecord = next(iter(made(ready, 1, WHOLE, WHOLE).ticks))
    metrics, _ = live.tick(replace(record, k=0))
    assert metrics is not None
    assert metrics.stalest is not None
    point = ready.terrain.point_at(*metrics.stalest)
    assert seen.last_seen[point] == seen.last_seen[np.asarray(ready.patrolled)].min()
    assert metrics.stalest == pytest.approx(ready.terrain.centre(*seen.stalest()))
