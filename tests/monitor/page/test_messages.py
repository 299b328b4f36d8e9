"""What a page is told of a source."""

from __future__ import annotations

import json

from monitor.page.messages import static_message
from monitor.replay.player import Player
from patrol.closures.spec import closure_points
from tests.monitor.conftest import Seen


def test_the_points_of_closures_are_told_run_by_run(doors: Seen) -> None:
    run = doors.open()
    static = Player(run).static()
    marks = json.loads(static_message(static, may_control=False))["marks"]
    told = {mark["name"]: mark for mark in marks if mark["section"] == "closures"}
    for closure in run.prepared.scenario.closures:
        points = [at for first, count in told[closure.name]["runs"] for at in range(first, first + count)]
        assert points == closure_points(closure, run.prepared.terrain).tolist()
        assert all(first // 100 == (first + count - 1) // 100 for first, count in told[closure.name]["runs"])
