"""The clerk of a run as processes: it judges the run while that goes on, and writes its report when it has ended.

    python -m fogwatch.clerk --run FOLDER --talk FD

The launcher starts it and asks it two things over a socket: for the verdict, once it knows the processes' exit codes,
and for the report. It runs at a low priority, and nothing depends on it: where it has died or says nothing, the
launcher does the same from the finished journal.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING

from fogwatch.launch.clerk_messages import (
    JUDGING,
    REPORT,
    Judged,
    Progress,
    ReportAsked,
    ReportWritten,
    VerdictAsked,
)
from fogwatch.launch.runfolder import RunFolder
from patrol.errors import BadInput
from patrol.process.exit_codes import BAD_INPUT, INTERRUPTED
from patrol.process.lifeline import Interrupted, heed, run_process
from patrol.process.starting.readiness import report_ready

if TYPE_CHECKING:
    from worldsim.verdict.live import LiveJudge

PERIOD_S = 0.5
"""Time between two looks at the journal, s."""
NEWS_S = 0.2
"""Time between two messages about the progress, s."""


class News:
    """Sends the progress of a step now and then."""

    def __init__(self, connection: Connection, step: str, total: int) -> None:
        """Say that a step begins.

        Args:
            connection: To the launcher.
            step: As in `Progress`.
            total: How many ticks the step takes.
        """
        self._connection = connection
        self._step = step
        self._total = max(total, 1)
        self._due = time.monotonic()
        self(0)

    def __call__(self, done: int) -> None:
        """Say how many ticks are done, if the last message was long enough ago."""
        if time.monotonic() >= self._due:
            self._due = time.monotonic() + NEWS_S
            self._connection.send(Progress(self._step, done / self._total if done < self._total else None))


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve the launcher until it hangs up.

    Args:
        arguments: The command line; this process's own unless given.

    Returns:
        The exit code: 0 when the launcher has hung up, 2 for a journal that cannot be judged, 130 interrupted.
    """
    options = _options(arguments)
    os.nice(options.nice)
    heed(options.lifeline, patience=0)
    try:
        with Connection(options.talk) as connection:
            _serve(options, connection)
    except (EOFError, BrokenPipeError, ConnectionResetError):
        return 0
    except Interrupted:
        return INTERRUPTED
    except BadInput as bad:
        print(bad)
        return BAD_INPUT
    return 0


def _serve(options: argparse.Namespace, connection: Connection) -> None:
    from patrol.best_tour import best_tour
    from patrol.prepare import Prepared
    from worldsim.verdict.live import LiveJudge

    folder = RunFolder(options.run)
    prepared = Prepared.load(folder.load(), folder.static)
    report_ready(options.ready, "")
    best_tour(prepared)  # summary and report show it, and on new ground it takes long
    live = LiveJudge(folder.journal, prepared)
    while not connection.poll(PERIOD_S):
        live.read_on()
    connection.send(_judged(live, connection.recv(), connection))
    connection.send(_report_written(live, connection.recv(), connection))
    connection.recv()  # nothing comes but the end


def _judged(live: LiveJudge, asked: VerdictAsked, connection: Connection) -> Judged:
    """Judge the rest of a run that has ended."""
    from worldsim.output.summary import summarise

    verdict = live.verdict(asked.exit_codes, News(connection, JUDGING, live.prepared.scenario.ticks))
    end = live.journal.end
    summary = summarise(live.journal, verdict, end.notes.get("wall_s") if end else None, live.prepared)
    return Judged(verdict, summary)


def _report_written(live: LiveJudge, asked: ReportAsked, connection: Connection) -> ReportWritten:
    """Write a run's report."""
    from fogwatch.launch.derived import derive

    problems: list[str] = []
    progress = News(connection, REPORT, live.prepared.scenario.ticks)
    derive(live.journal, live.prepared, asked.summary, None, asked.out, problems.append, progress)
    return ReportWritten("; ".join(problems))


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m fogwatch.clerk", description="Judge a run that goes on.")
    parser.add_argument("--run", type=Path, required=True, metavar="DIR", help="run folder")
    parser.add_argument("--talk", type=int, required=True, metavar="FD", help="socket to the launcher")
    parser.add_argument("--nice", type=int, default=0, metavar="N", help="how much lower its priority is")
    parser.add_argument("--lifeline", type=int, metavar="FD", help="leave when this pipe ends (set by the launcher)")
    parser.add_argument("--ready", type=int, metavar="FD", help="report the start on this pipe (set by the launcher)")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    run_process(main)
