"""What the search for the point that pulls hardest works with."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.policies.potential_field.pull.force import PAPER_POINT, log_distance_force

if TYPE_CHECKING:
    from agent.routes.path_window import PathWindow
    from agent.routes.routes import Element
    from patrol.scenario import FieldOptions

NO_RIVALS = np.zeros((0, 0), dtype=np.int32)
"""The lengths of rivals' paths where there are no rivals."""


class Laid(NamedTuple):
    """Paths of a window, laid from where a robot and its rivals stand. Lengths are in hundredths of a point.

    Attributes:
        rival: int32 (m, n), the lengths of the rivals' paths; `NO_RIVALS` without any.
        part: First and end row, first and end column of the window's part that holds all of the robot's paths.
        longest: Of the robot's paths.
        claimed: The longest to a point that no rival is nearer to; 0 without such a point.
        handed: The longest to a point that is not handed over to a rival; 0 without such a point.
    """

    rival: NDArray[np.int32]
    part: tuple[int, int, int, int]
    longest: int
    claimed: int
    handed: int


class Law(NamedTuple):
    """How hard points pull, along the paths of a window.

    Attributes:
        pull: As log_pull of `agent.policies.committed.kernels.hardest.hardest`.
        decay: As its log_decay.
        beyond: The hardest that a point without a known path could pull.
    """

    pull: NDArray[np.float64]
    decay: NDArray[np.float64]
    beyond: float


class Decay:
    """The logarithm of g by length, with a unit of length that may be stretched."""

    def __init__(self, options: FieldOptions, point: float) -> None:
        """Compute nothing yet.

        Args:
            options: The policy's, with the function's name and constants.
            point: Side of the terrain's points, m.
        """
        self._options = options
        self._point = point
        self._stretch = 1.0
        self._table = np.zeros(0)
        self._from_on: dict[tuple[int, int, int], NDArray[np.float64]] = {}

    def stretch(self, by: float) -> None:
        """Choose the unit of length.

        Args:
            by: How many times as long it is as the paper's.
        """
        if by != self._stretch:
            self._stretch, self._table = by, self._table[:0]
            self._from_on.clear()

    def of(self, lengths: NDArray[np.int64]) -> NDArray[np.float64]:
        """By lengths above 0.

        Args:
            lengths: In hundredths of a point.
        """
        unit, law = self._point / PAPER_POINT / 100.0 / self._stretch, self._options
        return log_distance_force(law.distance, lengths.astype(np.float64) * unit, law.beta, law.length)

    def from_on(self, first: int, end: int, step: int) -> NDArray[np.float64]:
        """By some lengths at equal distances, remembered for the present unit.

        Args:
            first: The first length, above 0, in hundredths of a point; one of a few that are asked for.
            end: Their end, exclusive.
            step: From one to the next.

        Returns:
            float64, not to be changed.
        """
        asked = first, end, step
        if asked not in self._from_on:
            self._from_on[asked] = self.of(np.arange(first, end, step))
        return self._from_on[asked]

    def table(self, longest: int) -> NDArray[np.float64]:
        """By length in hundredths of a point; 0 counts as 1.

        Args:
            longest: The last length.

        Returns:
            float64 (longest + 1,), read-only.
        """
        if self._table.size <= longest:
            self._table = self.of(np.arange(max(longest + 1, 2 * self._table.size)).clip(1))
            self._table.flags.writeable = False
        return self._table[: longest + 1]


def least_ways(start: Element, others: NDArray[np.int64]) -> NDArray[np.int64]:
    """The lengths of the ways between elements if nothing is in between.

    Args:
        start: Row and column.
        others: int64 (n, 2), rows and columns.

    Returns:
        int64 (n,), hundredths of a point: 141 for a diagonal step, 100 for any other.
    """
    steps = np.abs(others - np.array(start, dtype=np.int64))
    return least_lengths(steps[:, 0], steps[:, 1])


def least_lengths(rows: NDArray[np.int64], cols: NDArray[np.int64]) -> NDArray[np.int64]:
    """The lengths of ways over so many rows and columns if nothing is in between.

    Args:
        rows: int64 (n,), not negative.
        cols: int64 (n,), likewise.

    Returns:
        int64 (n,), hundredths of a point: 141 for a diagonal step, 100 for any other.
    """
    lengths: NDArray[np.int64] = 100 * np.maximum(rows, cols) + 41 * np.minimum(rows, cols)
    return lengths


def part_within(paths: PathWindow, start: Element, limit: int) -> tuple[int, int, int, int]:
    """The part of a window that paths of a length can lead to.

    Args:
        paths: The window.
        start: Where the paths begin, row and column of the ground.
        limit: In hundredths of a point.

    Returns:
        First and end row, first and end column of the window; ends are exclusive.
    """
    (rows, cols), span = paths.state.shape, limit // 100
    row, col = start[0] - 1 - paths.row0, start[1] - 1 - paths.col0
    return max(0, row - span), min(rows, row + span + 1), max(0, col - span), min(cols, col + span + 1)
