"""Since when a robot has been trapped, by what its viewer has seen of it."""

from itertools import islice

import numpy as np
import pytest

from fogwatch.inprocess import run_in_process
from monitor.observation.source import Trapped
from monitor.observation.traps import TrapWatch
from patrol.pose import Pose
from tests.agent.plans import plan, prepared_in
from tests.monitor.conftest import Seen


@pytest.mark.parametrize(
    ("from_start", "first", "exact"), [(True, 0, True), (False, 0, False), (True, 2, False), (False, 2, False)]
)
def test_a_stay_from_the_first_tick_on_is_known_only_from_the_runs_start(
    trapped: Seen, from_start: bool, first: int, exact: bool
) -> None:
    run = trapped.open()
    watch = TrapWatch(run.prepared, from_start=from_start)
    events = []
    for record in islice(run.journal.ticks, first, 389):
        events += watch.tick(record, lambda: trapped.truth[record.k])  # noqa: B023
    since_s = first * run.step if first else 0.0
    assert watch.trapped(2) == Trapped(since_s, exact)
    assert watch.open == {2: Trapped(since_s, exact)}
    assert watch.trapped(1) is None
    (event,) = events
    assert ("since before " in event.detail) != exact


@pytest.mark.parametrize("status", ["kill", "pause"])
def test_a_robot_that_a_wreck_shuts_in_is_not_trapped(status: str) -> None:
    rooms = plan((18.0, 8.0), (0.0, 2.0, 4.0, 6.0), (4.0, 3.4, 10.0, 4.6), (10.0, 0.0, 18.0, 8.0), point=0.2)
    starts, robots = [Pose(2.0, 4.0, 0.0), Pose(7.0, 4.0, 0.0)], {"model": "holonomic", "radius": 0.3, "speed": 1.0}
    fault = {"kind": status, "who": ["r2"], "at": 0.5}
    given = prepared_in(rooms, starts, robots, sensor={"range": 3.0}, duration=500.0, faults=[fault])
    patrolled, east = given.patrolled, np.arange(given.terrain.width) > 50
    watch, shut_in = TrapWatch(given), set[int]()
    for record in run_in_process(given).journal.ticks:
        seen = np.where(patrolled, np.where(east, -1, record.k), 2**31 - 1).astype(np.int32)
        watch.tick(record, lambda: seen)  # noqa: B023
        shut_in.update(watch.open)
    assert not shut_in
