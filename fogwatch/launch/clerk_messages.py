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
    """The question for the verdict, when the run has ended."""

    exit_codes: Mapping[str, int | None]  # as for `worldsim.verdict.judge.judge`


@dataclass(frozen=True, slots=True)
class ReportAsked:
    """The order to write the run's report."""

    out: Path


@dataclass(frozen=True, slots=True)
class Progress:
    """The progress of the clerk with a request."""

    step: str  # as the display calls it
    share: float | None = None  # 0 to 1; None when unknown


@dataclass(frozen=True, slots=True)
class Judged:
    """A run's verdict and summary."""

    verdict: Verdict
    summary: Summary


@dataclass(frozen=True, slots=True)
class ReportWritten:
    """The end of writing the report."""

    problem: str = ""  # why there is none; empty when it is written
