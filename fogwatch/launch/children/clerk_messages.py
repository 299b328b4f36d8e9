"""The messages between a launcher and the clerk of its run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from patrol.summary.model import Summary
    from worldsim.verdict.judge import Verdict

JUDGING, REPORT = "judging the run", "writing report.html"
"""Steps of a run's end, as people read them."""


@dataclass(frozen=True, slots=True)
class VerdictAsked:
    """The question for the verdict, when the run has ended.

    Attributes:
        exit_codes: As for `worldsim.verdict.judge.judge`.
    """

    exit_codes: Mapping[str, int | None]


@dataclass(frozen=True, slots=True)
class ReportAsked:
    """The order to write the run's report.

    Attributes:
        out: The file to write.
    """

    out: Path


@dataclass(frozen=True, slots=True)
class Progress:
    """The progress of the clerk with a request.

    Attributes:
        step: The work, as the display calls it.
        share: The share of it that is done, 0 to 1; None when unknown.
    """

    step: str
    share: float | None = None


@dataclass(frozen=True, slots=True)
class Judged:
    """A run's verdict and summary.

    Attributes:
        verdict: The verdict.
        summary: As from `worldsim.output.summary.summarise`.
    """

    verdict: Verdict
    summary: Summary


@dataclass(frozen=True, slots=True)
class ReportWritten:
    """The end of writing the report.

    Attributes:
        problem: Why there is none; empty when it is written.
    """

    problem: str = ""
