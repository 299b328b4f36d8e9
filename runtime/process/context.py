"""The context of a process of a fleet, set up in one order: log, ending, figures, signs of life, links.

A process's own file holds its options and its work. For example, a process that does nothing until it is told to leave:

    def main(arguments: Sequence[str] | None = None) -> int:
        options = ProcessParser("python -m idle", "Do nothing.", "").parse_args(arguments)
        return run_with(options, "idle", _idle)

    def _idle(process: ProcessContext) -> int:
        process.follow()
        process.log.info("begins")
        while not process.ending.wait(1.0):
            process.notifier.alive()
        return 0
"""

from __future__ import annotations

import argparse
import math
import os
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from patrol.errors import BadInput
from runtime.process.failures import BAD_INPUT, INTERRUPTED
from runtime.process.lifeline import Ending, InterruptedBySignal, heed
from runtime.process.options import Meeting, meeting
from runtime.reporting.health import HealthLines
from runtime.reporting.logs import Log, begin_log
from runtime.reporting.supervision import Notifier, Supervision, take_supervision
from runtime.reporting.vitals import CONNECTIONS, Vitals
from runtime.starting.readiness import StartFailure, StartReport, report_start

if TYPE_CHECKING:
    from patrol.prepare import Prepared
    from patrol.scenario import Scenario
    from runtime.net.link import Link
    from runtime.net.mailbox import Air
    from runtime.security.mesh import Mesh
    from runtime.security.roles import Kind, Role

WARN_AGAIN_S = 10.0
"""Least time between two warnings of the same certificate, s: its holder may connect as often as it likes."""


class AskedToLeave(Exception):
    """The process was asked to leave while it waited for something that it needs."""


@dataclass(slots=True)
class ProcessContext:
    """The context of a process, from its start to its end."""

    options: argparse.Namespace  # without those that `take_supervision` takes out
    log: Log
    ending: Ending  # true when the process should leave
    supervision: Supervision = field(default_factory=Supervision)
    vitals: Vitals = field(default_factory=Vitals)
    # tells the service manager that the loop turns
    notifier: Notifier = field(default_factory=lambda: Notifier(os.environ))
    closing: ExitStack = field(default_factory=ExitStack)  # closed when the process ends, the latest first

    @property
    def launched(self) -> bool:
        """True where a launcher has started this process, which also ends it."""
        return getattr(self.options, "lifeline", None) is not None

    @property
    def static(self) -> Path | None:
        """The folder that the launcher has prepared; None where this process prepares it."""
        return getattr(self.options, "static", None)

    def leaving(self) -> bool:
        """Return whether the process should leave."""
        return bool(self.ending)

    def follow(self, name: str = "", **labels: str) -> None:
        """Write health lines and answer with metrics from now on, as far as the options ask for it.

        `name` is the process's name from now on; empty leaves it as it is. All metrics get the `labels`.
        """
        if name:
            self.log = begin_log(name, self.supervision.log_format, self.supervision.log_level)
        metrics, health_s = self.supervision.metrics, self.supervision.health
        if metrics is not None:
            from runtime.reporting.metrics import MetricsServer, listen_at  # here: asyncio takes 20 ms to load

            listening = listen_at(metrics, is_open=self.supervision.metrics_open)
            server = MetricsServer(listening, self.vitals, {"process": self.log.owner, **labels})
            self.closing.callback(server.close)
            self.log.info(f"metrics at {server.address}")
        if health_s is not None:
            self.closing.callback(HealthLines(self.vitals, self.log, health_s).close)

    def ready(self, address: str = "") -> None:
        """Tell the launcher, if it waits for that, that this process can be used."""
        report_start(getattr(self.options, "ready", None), StartReport(address))

    def meet(self, *kinds: Kind) -> Meeting:
        """Find out where the options say that the fleet meets."""
        return meeting(self.options.credentials, self.options.router, self.options.fleet, *kinds)

    def open_links(
        self,
        met: Meeting,
        radio: str | None = None,
        callers: Mapping[int, str] = MappingProxyType({}),
        *,
        quiet: bool = False,
        closing: ExitStack | None = None,
    ) -> tuple[Link, Air]:
        """Open the link to the fleet's router and the one for positions; `AskedToLeave` may end the wait.

        Where `radio` is None, both are the same link. `closing` closes them; by default they close when the process
        ends. `callers` are the keys under which the robots send, by their numbers.
        """
        # Imported late, so that processes without a link load no Zenoh.
        from runtime.net.link import Link
        from runtime.net.open_links import open_links

        say: Callable[[str], None] = (lambda _: None) if quiet else self.log.info
        links = open_links(met.router, radio, self.options.wait, say, self.leaving, met.credentials, callers)
        if links is None:
            raise AskedToLeave
        link, air = links
        closing = self.closing if closing is None else closing
        closing.callback(link.close)
        if air is not link:
            closing.callback(air.close)
        if met.credentials is not None and not quiet:
            if link.mesh is not None:
                self.vitals.probe(CONNECTIONS, lambda: len(link.neighbours.names))
                self._follow_mesh(link, link.mesh, met.credentials.role)
            if air is not link and isinstance(air, Link) and air.mesh is not None:
                self._follow_mesh(air, air.mesh, met.credentials.role, " by radio")
        return link, air

    def _follow_mesh(self, link: Link, mesh: Mesh, own: Role, by: str = "") -> None:
        """Say which other members come and go, and by what where they meet in two ways."""
        warned_s: dict[str, float] = {}

        def tell(common_name: str, there: bool) -> None:
            role = mesh.members.get(common_name)
            if role is not None and role != own:
                self.log.info(f"{role.name} is {'connected' if there else 'no longer connected'}{by}")
            elif there and (now_s := time.monotonic()) - warned_s.get(common_name, -math.inf) >= WARN_AGAIN_S:
                warned_s[common_name] = now_s
                if role is None:
                    self.log.warning(f"{common_name} connects: no member, so what it sends is refused")
                elif own.robot:  # a world has two sessions
                    self.log.warning(
                        f"another process is {own.name} as well; end it, or revoke {own.name}: it has a copy"
                    )

        link.neighbours.tell(tell)

    def warm(self, packages: Sequence[str], scenario: Scenario | None = None) -> None:
        """Make sure that the kernels of some packages are compiled.

        Kernels that few runs need are left out, but for those that the scenario needs.
        """
        from runtime.starting.warmup import seldom_kernels, warm

        warm(packages, self.log.info, () if scenario is None else seldom_kernels(scenario))

    def prepare(self, scenario: Scenario) -> Prepared:
        """Prepare the scenario, or load the launcher's preparation; `AskedToLeave` ends the wait for that."""
        from patrol.prepare import Prepared, prepare
        from patrol.scenario.assumptions import assumption_lines

        static = self.static
        if static is None:
            for line in assumption_lines(scenario):
                self.log.info(line)
            return prepare(scenario)
        if self.ending.wait_for(static, self.patience_s):
            return Prepared.load(scenario, static)
        if self.ending:
            raise AskedToLeave
        raise BadInput(f"--static {static}: no such folder; leave the option out to compute the fields here")

    @property
    def patience_s(self) -> float:
        """Longest wait for others, s: without end for a launcher, which may have a large map to work on."""
        return math.inf if self.launched else float(self.options.wait)


def run_with(
    options: argparse.Namespace,
    name: str,
    work: Callable[[ProcessContext], int],
    *,
    prefix: str | None = None,
    on_death: Callable[[], None] = lambda: None,
    patience: int | None = None,
) -> int:
    """Run a process's work, close all that it has opened, and return the exit code.

    That is the code of `work`, 2 for bad input, and 130 where the process was asked to leave before it could begin.
    Lines for people about an error that ends the process begin with `prefix`, by default the name and a colon.
    `on_death` and `patience` are as for `heed`.
    """
    process = ProcessContext(options, Log(name), heed(getattr(options, "lifeline", None), on_death, patience=patience))
    try:
        process.supervision = supervision = take_supervision(options)
        process.log = begin_log(name, supervision.log_format, supervision.log_level)
        with process.closing:
            return work(process)
    except (AskedToLeave, InterruptedBySignal):
        return INTERRUPTED
    except BadInput as bad:
        Log(process.log.owner, prefix).error(str(bad))
        why = StartFailure.PORT_BUSY if isinstance(bad, PortTaken) else StartFailure.OTHER
        # The launcher waits for a report, also of a start that fails.
        report_start(getattr(options, "ready", None), StartReport("", why, str(bad)))
        return BAD_INPUT


class PortTaken(BadInput):
    """Another process listens at a port; the starter of this process may try another port."""
