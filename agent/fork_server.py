"""``python -m agent.fork_server``: the agents of one run from one process that has loaded the modules that all need.

The launcher starts it (`fogwatch.launch.children`) and asks it for each robot's process. Its limits are in
`runtime.starting.forking`.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Sequence

from runtime.process.lifeline import die_when_orphaned, run_process
from runtime.starting.environment import keep_freed_memory, show_as
from runtime.starting.forking import count_threads, serve_forks
from runtime.starting.readiness import StartFailure, StartReport, report_start

NEEDED = (
    "numba.np.arraymath",  # numba itself loads it when the first array meets a kernel
    "agent.process",
    "agent.mind_loop",
    "agent.policies.stochastic",
    "patrol.kernels.clearance",
    "patrol.kernels.ways",
    "runtime.messages.phases",
)
"""Modules without Zenoh that every agent loads and the kernels do not bring along."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Load the agent, then fork until the launcher has gone; each fork runs as an agent.

    Returns the exit code, of the server or of an agent.
    """
    options = _parse_options(arguments)
    die_when_orphaned(options.lifeline)
    _load_modules(options.kernels.split(",") if options.kernels else [])
    if (count := count_threads()) > 1:
        why = f"cannot fork: a library runs threads ({count} in all)"
        report_start(options.ready, StartReport("", StartFailure.OTHER, why))
        return 1
    sys.stdout.flush()  # what waits to be written would be written by each agent too
    report_start(options.ready, StartReport())
    if (forked := serve_forks(options.control)) is None:
        return 0
    from agent.process import main as be_agent

    orders, output = forked
    for stream in (1, 2):
        os.dup2(output, stream)
    os.close(output)
    os.environ.update(orders.environment)
    show_as(orders.command)
    return be_agent(orders.command[orders.command.index("-m") + 2 :])


def _load_modules(kernels: Sequence[str]) -> None:
    """Load the modules that agents need, and some kernels beside. None may open a connection or start a thread."""
    importlib.import_module("agent.build")
    for module in (*NEEDED, *kernels):
        importlib.import_module(module)


def _parse_options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m agent.fork_server", description="Used by the launcher only.")
    for name, text in (
        ("--control", "descriptor on which the launcher asks for processes"),
        ("--ready", "descriptor on which this process reports that it is ready"),
        ("--lifeline", "descriptor that ends with the launcher, and that the agents inherit"),
    ):
        parser.add_argument(name, type=int, metavar="FD", help=text)
    parser.add_argument("--kernels", default="", help="kernel modules that this scenario's agents need, with commas")
    parser.add_argument("--room", help="blanks, in the place of which the agents show their command lines")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    keep_freed_memory()
    run_process(main)
