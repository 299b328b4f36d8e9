"""What lets somebody follow a process from outside: its log, its health lines and its metrics, as its options say."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from patrol.errors import BadInput
from patrol.process.reporting.health import HealthLines
from patrol.process.reporting.logs import LEVELS, Format, Log, begin_log
from patrol.process.reporting.metrics import OPEN_OPTION, OPTION, MetricsServer, listen_at
from patrol.process.reporting.vitals import Vitals

LEAST_S, MOST_S = 0.1, 86_400.0
"""Time between two health lines, s."""


@dataclass(frozen=True, slots=True)
class Supervision:
    """How a process is followed.

    Attributes:
        log_format: How its log is written.
        log_level: The least level that is written.
        health: Time between two health lines, s; None for none.
        metrics: ``HOST:PORT`` of its metrics; None for none.
        metrics_open: Whether other machines may read them.
    """

    log_format: Format = Format.TEXT
    log_level: str = "info"
    health: float | None = None
    metrics: str | None = None
    metrics_open: bool = False

    @property
    def counts(self) -> bool:
        """Whether anybody wants to know each tick's figures."""
        return self.health is not None or self.metrics is not None or self.log_level == "debug"

    def begin_log(self, process: str) -> Log:
        """Write this process's log as the options say, from now on.

        Args:
            process: Its name.

        Returns:
            The process's log.
        """
        return begin_log(process, self.log_format, self.log_level)


def add_supervision(parser: argparse.ArgumentParser) -> None:
    """Add the options of a process that can be followed.

    Args:
        parser: Of the process's command line.
    """
    add = parser.add_argument_group("what others see of this process (docs/operations.md)").add_argument
    add("--log-format", choices=[str(form) for form in Format], default="text", help="of the log (%(default)s)")
    add("--log-level", choices=LEVELS, default="info", help="the least level in the log (%(default)s)")
    add("--health", type=float, metavar="S", help="a line about how this process does, every S seconds")
    add(OPTION, metavar="HOST:PORT", help="answer with metrics for Prometheus at http://HOST:PORT/metrics")
    add(OPEN_OPTION, action="store_true", help=f"allow a host for {OPTION} that other machines can reach")


def take_supervision(options: argparse.Namespace) -> Supervision:
    """Take what `add_supervision` added out of parsed options.

    Args:
        options: They lose these fields.

    Raises:
        BadInput: An option does not fit.
    """
    told = {name: vars(options).pop(name) for name in ("log_format", "log_level", "health", "metrics", "metrics_open")}
    supervision = Supervision(**{**told, "log_format": Format(told["log_format"])})
    every_s = supervision.health
    if every_s is not None and not (math.isfinite(every_s) and LEAST_S <= every_s <= MOST_S):
        raise BadInput(f"--health {every_s:g}: give from {LEAST_S:g} to {MOST_S:g} seconds")
    if supervision.metrics_open and supervision.metrics is None:
        raise BadInput(f"{OPEN_OPTION}: means nothing without {OPTION}; give both, or neither")
    return supervision


@contextmanager
def followed(supervision: Supervision, log: Log, labels: Mapping[str, str]) -> Iterator[Vitals]:
    """Write health lines and answer with metrics meanwhile, as far as the options ask for it.

    Args:
        supervision: What the options say.
        log: Of the process.
        labels: That all of its metrics get besides its name, such as its fleet.

    Yields:
        Where the process leaves its figures.

    Raises:
        BadInput: The metrics cannot be where the option says.
    """
    vitals = Vitals()
    with ExitStack() as parts:
        if supervision.metrics is not None:
            listening = listen_at(supervision.metrics, is_open=supervision.metrics_open)
            server = MetricsServer(listening, vitals, {"process": log.process, **labels})
            parts.callback(server.close)
            log.info(f"metrics at {server.address}")
        if supervision.health is not None:
            parts.callback(HealthLines(vitals, log, supervision.health).close)
        yield vitals
