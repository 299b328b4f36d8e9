"""The true fog of a judged run, for the checks that look at it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from patrol.ground.fog import Fog
from patrol.journal import Status
from patrol.pose import Pose
from patrol.radio.message import as_received
from worldsim.verdict.common.check import JournalReading
from worldsim.verdict.common.closed_ground import ClosedGround
from worldsim.verdict.common.robots_there import RobotsThere

if TYPE_CHECKING:
    from patrol.journal import TickRecord
    from worldsim.verdict.common.check import JudgedRun, Readings


class TrueFog(JournalReading):
    """The fog after the latest tick: recomputed from the poses, or the world's own if it is not verified."""

    needs = (RobotsThere, ClosedGround)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._footprint = readings[ClosedGround].footprint
        self._is_known = run.fog is not None
        self.fog = Fog(run.prepared.patrolled) if run.fog is None else run.fog

    def tick(self, record: TickRecord) -> None:
        """Let the living robots look around."""
        for row in () if self._is_known else record.robots:
            if row.status is Status.ALIVE:
                pose = as_received(Pose(row.x, row.y, row.heading))
                self.fog.observe(self._footprint.visible(pose), record.k)
