"""The options by which a process is followed from outside: its log, its health lines and its metrics."""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass

from patrol.errors import BadInput
from patrol.process.reporting.logs import LEVELS, Format
from patrol.process.reporting.metrics import OPEN_OPTION, OPTION

LEAST_S, MOST_S = 0.1, 86_400.0
"""Time between two health lines, s."""


@dataclass(frozen=True, slots=True)
class Supervision:
    """Settings for following a process."""

    log_format: Format = Format.TEXT
    log_level: str = "info"  # the least that is written
    health: float | None = None  # s between two health lines; None for none
    metrics: str | None = None  # ``HOST:PORT``; None for none
    metrics_open: bool = False  # other machines may read them

    @property
    def counts(self) -> bool:
        """True if each tick's figures are wanted."""
        return self.health is not None or self.metrics is not None or self.log_level == "debug"


def add_supervision(parser: argparse.ArgumentParser) -> None:
    """Add the options of a process that can be followed."""
    add = parser.add_argument_group("what others see of this process (docs/operations.md)").add_argument
    add("--log-format", type=Format, choices=[*Format], default=Format.TEXT, help="of the log (%(default)s)")
    add("--log-level", choices=LEVELS, default="info", help="the least level in the log (%(default)s)")
    add("--health", type=float, metavar="S", help="a line about how this process does, every S seconds")
    add(OPTION, metavar="HOST:PORT", help="answer with metrics for Prometheus at http://HOST:PORT/metrics")
    add(OPEN_OPTION, action="store_true", help=f"allow a host for {OPTION} that other machines can reach")


def take_supervision(options: argparse.Namespace) -> Supervision:
    """Take what `add_supervision` added out of parsed options, which lose these fields.

    A process without these options is not followed.
    """
    names = ("log_format", "log_level", "health", "metrics", "metrics_open")
    supervision = Supervision(**{name: vars(options).pop(name) for name in names if name in options})
    every_s = supervision.health
    if every_s is not None and not (math.isfinite(every_s) and LEAST_S <= every_s <= MOST_S):
        raise BadInput(f"--health {every_s:g}: give from {LEAST_S:g} to {MOST_S:g} seconds")
    if supervision.metrics_open and supervision.metrics is None:
        raise BadInput(f"{OPEN_OPTION}: means nothing without {OPTION}; give both, or neither")
    return supervision
