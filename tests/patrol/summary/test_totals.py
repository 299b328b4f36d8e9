"""The figures of a run of five ticks, each recomputed by hand; no two fields have the same value."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from patrol.journal import Event, RobotTick, Status
from patrol.journal.records import DEAD_END, FORGED, FREE
from patrol.summary.totals import RunTotals, count_frames

STEP_S = 0.5
ALIVE, PAUSED, DEAD, ABSENT = Status.ALIVE, Status.PAUSED, Status.DEAD, Status.ABSENT


def row(number: int, status: Status = ALIVE, speed: float = 0.0, **of_row: Any) -> RobotTick:
    given = {
        "c1": 0.0,
        "bumped": False,
        "state": "patrolling",
        "ms": None,
        "rejected": None,
        "refused": False,
        **of_row,
    }
    state, ms, rejected = given["state"], given["ms"], given["rejected"]
    return RobotTick(
        number, status, 0.0, 0.0, 0.0, speed, given["c1"], given["bumped"], state, None, ms, rejected, given["refused"]
    )


def tick(k: int, robots: list[RobotTick], mfow: int, fog: float, seen: int, **radio: Any) -> Any:
    radio = {"frames": (), "deliveries": [], "dropped": [], "copies": (), "forged": (), **radio}
    return SimpleNamespace(k=k, robots=tuple(robots), mfow=mfow, fog_mean=fog, seen=seen, **radio)


TICKS = [
    tick(
        0,
        [row(1, speed=2.0, ms=4.0, rejected=3), row(2, c1=-3.0, ms=1.0, rejected=1), row(3, ABSENT)],
        *(1, 0.5, 10),
        frames=((1, b"four"), (2, b"sevenxx"), (FORGED, b"forged")),
        deliveries=[(1, 2, 0)],
        dropped=[(2, 1, 0, "loss:f1")],
        forged=("f9",),
    ),
    tick(
        1,
        [row(1, speed=-1.0, ms=8.0, rejected=5, state=DEAD_END), row(2, bumped=True, speed=9.0), row(3, ABSENT)],
        *(4, 1.5, 20),
        frames=((1, b"threexxx"), (1, b"x")),
        deliveries=[(1, 2, 1), (FORGED, 2, 1)],
        dropped=[(FORGED, 1, 1, "loss:f1")],
        copies=((1, 2, 1, "f2"), (FORGED, 2, 1, "f2")),
    ),
    tick(
        2,
        [row(1, speed=1.0, ms=2.0, rejected=2), row(2, PAUSED), row(3, ms=16.0, rejected=4, refused=True)],
        *(3, 2.0, 25),
        frames=((3, b"12345"),),
        dropped=[(3, 1, 2, "loss:f1"), (3, 2, 2, "receiver paused"), (3, 1, 2, "loss:f4")],
    ),
    tick(3, [row(1, speed=1.0, ms=6.0, rejected=1, state=FREE), row(2, DEAD), row(3, bumped=True)], 8, 3.0, 30),
    tick(4, [row(1, speed=0.0, rejected=2), row(2, DEAD), row(3, bumped=True, ms=3.0, state=DEAD_END)], 6, 2.5, 32),
]


@pytest.fixture
def found() -> Any:
    return figures_of("committed")


def figures_of(policy: str) -> Any:
    robots = [SimpleNamespace(number=n, name=name, model="holonomic") for n, name in enumerate(("a", "b", "c"), 1)]
    terrain = SimpleNamespace(point=0.25)
    scenario = {"patrol": {"policy": policy}}
    header: Any = SimpleNamespace(robots=robots, terrain=terrain, scenario=scenario, bound_s=7.5, patrolled_area_m2=2.5)
    totals = RunTotals(header, STEP_S, 40)
    for record in TICKS:
        totals.tick(record)
    return totals.figures([Event(4, "dead", 1, ""), Event(5, "left", 3, "")])


def test_the_runs_own_figures(found: Any) -> None:
    assert (found.ticks, found.simulated_s, found.bound_s, found.patrolled_area_m2, found.point_m) == (
        *(5, 2.5, 7.5, 2.5, 0.25),
    )
    assert found.mfow_mean_s == pytest.approx((1 + 4 + 3 + 8 + 6) / 5 * STEP_S)
    assert found.mfow_late_mean_s == pytest.approx((3 + 8 + 6) / 3 * STEP_S)
    assert (found.mfow_max_s, found.mfow_end_s, found.fog_end_s, found.seen_share) == (4.0, 3.0, 1.25, 0.8)
    assert found.fog_mean_s == pytest.approx((0.5 + 1.5 + 2.0 + 3.0 + 2.5) / 5 * STEP_S)


def test_each_robots_figures(found: Any) -> None:
    a, b, c = (found.robots[name] for name in "abc")
    assert [robot.status for robot in (a, b, c)] == ["alive", "dead", "left"]
    assert [robot.distance_m for robot in (a, b, c)] == pytest.approx([(2 + 1 + 1 + 1) * STEP_S, 3 * STEP_S, 0.0])
    assert [robot.dead_end_share for robot in (a, b, c)] == [0.25, 0.0, 0.5]
    assert [robot.collisions for robot in (a, b, c)] == [0, 1, 2]
    assert [robot.decisions for robot in (a, b, c)] == [4, 1, 2]
    assert [robot.missed for robot in (a, b, c)] == [1, 1, 1]
    assert [robot.refused_commands for robot in (a, b, c)] == [0, 0, 1]
    assert [robot.rejected for robot in (a, b, c)] == [5 + 2 + 2, 1, 4]  # two new processes of a count from zero
    assert (a.decision_ms_p50, b.decision_ms_p50) == (5.0, 1.0)
    assert a.decision_ms_p99 == pytest.approx(6.0 + 0.97 * 2.0)


def test_time_in_dead_ends_is_neither_planned_nor_free(found: Any) -> None:
    assert [found.robots[name].planned_share for name in "abc"] == [2 / 3, 1.0, 1.0]
    assert found.planned_share == 0.8
    assert figures_of("guards:Guard").planned_share == 0.8, "a class of one's own, which says that it chose freely"


def test_frames_are_counted_once_and_for_each_receiver(found: Any) -> None:
    a, b, c = (found.robots[name] for name in "abc")
    assert [robot.bytes for robot in (a, b, c)] == [4 + 8 + 1, 7, 5]
    assert [robot.sent for robot in (a, b, c)] == [1 + 2 + 1, 1, 2]
    assert [robot.delivered for robot in (a, b, c)] == [2, 0, 0]
    assert [robot.dropped for robot in (a, b, c)] == [0, 1, 3]
    assert [robot.in_flight for robot in (a, b, c)] == [2, 0, -1]
    sums = found.messages
    assert (sums.frames, sums.bytes, sums.sent, sums.delivered, sums.dropped) == (5, 25, 7, 2, 4)
    assert (sums.in_flight, sums.rejected, sums.forged) == (1, 14, 1)
    assert sums.dropped_by_cause == {"loss": 3, "receiver paused": 1}
    assert sums.bytes_per_robot_s == pytest.approx(25 / ((5 + 2 + 3) * STEP_S))


def test_frames_by_link() -> None:
    place = {FORGED: 0, 1: 1, 2: 2, 3: 3}
    sent, delivered = np.zeros((4, 4), dtype=np.int64), np.zeros((4, 4), dtype=np.int64)
    count_frames(TICKS[1], place, sent, delivered)
    assert sent.tolist() == [[0, 0, 1, 0], [0, 0, 3, 0], [0, 0, 0, 0], [0, 0, 0, 0]]
    assert delivered.tolist() == [[0, 0, 1, 0], [0, 0, 1, 0], [0, 0, 0, 0], [0, 0, 0, 0]]
