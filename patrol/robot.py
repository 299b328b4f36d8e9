"""A robot of the roster, as parts of a scenario that stand below it may know it."""

from __future__ import annotations

from typing import Protocol


class RosterRobot(Protocol):
    """A robot of the roster; see `patrol.scenario.sections.RobotSpec`."""

    @property
    def number(self) -> int:
        """From 1."""
        ...

    @property
    def name(self) -> str:
        """Unique in its scenario."""
        ...

    @property
    def model(self) -> str:
        """The kind of its body."""
        ...

    @property
    def speed(self) -> float:
        """Its top speed, m/s."""
        ...

    @property
    def radius(self) -> float:
        """Of its body, m."""
        ...
