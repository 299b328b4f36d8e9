"""Since when a robot has been trapped, by what its viewer has seen of it."""

from itertools import islice

import pytest

from monitor.observation.source import Trapped
from monitor.observation.traps import TrapWatch
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
