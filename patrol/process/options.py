"""The command-line options that the processes of a fleet, its world and its robots, have in common."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from patrol.errors import BadInput
from patrol.process.lifeline import Ending

if TYPE_CHECKING:
    from patrol.prepare import Prepared
    from patrol.scenario import Scenario

TOGETHER = """All processes are given the same scenario file and the same
name for the fleet:

  python -m fogwatch.router --listen tcp/0.0.0.0:7447
  python -m worldsim --router tcp/192.168.1.10:7447 --fleet yards-1 --scenario yards.yaml --out runs/yards-1
  python -m agent    --router tcp/192.168.1.10:7447 --fleet yards-1 --scenario yards.yaml --robot r1
  python -m agent    --router tcp/192.168.1.10:7447 --fleet yards-1 --scenario yards.yaml --robot r2"""
"""For the help of each: how a fleet is started by hand."""


def fleet_parser(package: str, description: str, epilog: str, others: str) -> argparse.ArgumentParser:
    """A parser of the options that all have; the caller adds its own.

    Args:
        package: run with ``python -m``.
        description: first lines of the help.
        epilog: last lines of the help.
        others: the processes that this one waits for.
    """
    parser = argparse.ArgumentParser(
        prog=f"python -m {package}",
        description=description,
        epilog=epilog,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--router", required=True, metavar="tcp/HOST:PORT", help="the router that the fleet meets at")
    add("--fleet", required=True, metavar="NAME", help="the fleet's name, the same for all its processes")
    add("--scenario", required=True, type=Path, metavar="FILE", help="the scenario, the same for all processes")
    add("--radio", metavar="LOCATOR", help="direct radio: a multicast group or a router (default: the fleet's router)")
    add("--static", type=Path, metavar="DIR", help="static fields made by the launcher (default: make them here)")
    add("--wait", type=float, default=60.0, metavar="S", help=f"how long to wait for {others} (%(default)g s)")
    add("--lifeline", type=int, metavar="FD", help="leave when this pipe ends (set by the launcher)")
    return parser


class StaticOptions(Protocol):
    """Those of the options that say where the static fields come from."""

    @property
    def static(self) -> Path | None:
        """The launcher's folder, None to compute them here."""
        ...

    @property
    def wait(self) -> float:
        """How long to wait without a launcher, s."""
        ...

    @property
    def lifeline(self) -> int | None:
        """File descriptor of the launcher's pipe, None without one."""
        ...


def prepared_as_told(
    scenario: Scenario, options: argparse.Namespace | StaticOptions, ending: Ending
) -> Prepared | None:
    """Prepare the scenario, or load what the launcher has prepared.

    Args:
        scenario: the one that all processes run.
        options: from `fleet_parser`.
        ending: whether to leave.

    Returns:
        the prepared scenario, or None when asked to leave.

    Raises:
        BadInput: when the launcher's static fields do not come.
    """
    from patrol.prepare import Prepared, prepare

    static: Path | None = options.static
    if static is None:
        return prepare(scenario)
    limit_s = options.wait if options.lifeline is None else math.inf  # a launcher may have a large map to work on
    if ending.wait_for(static, limit_s):
        return Prepared.load(scenario, static)
    if ending:
        return None
    raise BadInput(f"--static {static}: no such folder; leave the option out to compute the fields here")
