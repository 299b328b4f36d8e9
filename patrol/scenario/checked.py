"""A scenario and its ground, as the checks of zones, closures and docks see them: types alone.

The model of a scenario calls these checks, so they cannot import it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from patrol.closures.spec import ClosureSpec
from patrol.energy.spec import DockSpec
from patrol.ground.fields import StaticFields
from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.scenario.policies import PatrolSpec
from patrol.scenario.sections import RobotSpec
from patrol.zones.spec import ZoneSpec


class CheckedScenario(Protocol):
    """The sections of a scenario that its zones, closures and docks are held against."""

    @property
    def step(self) -> float:
        """Length of a tick, s."""
        ...

    @property
    def ticks(self) -> int:
        """Length of a run."""
        ...

    @property
    def roster(self) -> tuple[RobotSpec, ...]:
        """The robots, one by one."""
        ...

    @property
    def patrol(self) -> PatrolSpec:
        """The policy by which robots decide, and its options."""
        ...

    @property
    def docks(self) -> tuple[DockSpec, ...]:
        """The places at which robots charge."""
        ...

    @property
    def zones(self) -> tuple[ZoneSpec, ...]:
        """Ground with rules or weights of its own."""
        ...

    @property
    def closures(self) -> tuple[ClosureSpec, ...]:
        """Ground that is closed at times."""
        ...


class CheckedGround(Protocol):
    """The parts of a prepared scenario that are there before its ground is checked."""

    @property
    def scenario(self) -> CheckedScenario:
        """The scenario."""
        ...

    @property
    def terrain(self) -> Terrain:
        """The terrain, with the ground of its zones."""
        ...

    @property
    def starts(self) -> tuple[Pose, ...]:
        """The robots' starts, in roster order."""
        ...

    @property
    def fields(self) -> Mapping[int, StaticFields]:
        """The static fields of each robot's body, by its number."""
        ...
