"""The true fog of a judged run, for the checks that look at it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from patrol.journal import Status
from patrol.pose import Pose
from worldsim.truth import Truth
from worldsim.verdict.common.check import JournalReading
from worldsim.verdict.common.closed_ground import ClosedGround
from worldsim.verdict.common.robots_there import RobotsThere

if TYPE_CHECKING:
    from patrol.ground.fog import Fog
    from patrol.journal import TickRecord
    from worldsim.verdict.common.check import JudgedRun, Readings


class TrueFog(JournalReading):
    """The fog, recomputed from the poses; or that of the world, where the verdict does not verify it.

    Attributes:
        fog: After the latest tick's observations.
    """

    needs = (RobotsThere, ClosedGround)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._truth: Truth | None = None
        if run.fog is not None:
            self.fog: Fog = run.fog
        else:
            self._truth = Truth(readings[ClosedGround].footprint, run.prepared.patrolled)
            self.fog = self._truth.fog

    def tick(self, record: TickRecord) -> None:
        """Let the living robots look around."""
        if self._truth is not None:
            poses = [(r.number, Pose(r.x, r.y, r.heading)) for r in record.robots if r.status is Status.ALIVE]
            self._truth.observe(record.k, poses)
