"""The clerk of a run as processes: it judges the run while that goes on, and writes its report when it has ended.

    python -m fogwatch.clerk --run FOLDER --talk FD

The launcher starts it and asks it two things over a socket: for the verdict, once it knows the processes' exit codes,
and for the report. It runs at a low priority, and nothing depends on it: where it has died or says nothing, the
launcher does the same from the finished journal.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fogwatch.launch.clerk_messages import (
    JUDGING,
    REPORT,
    Judged,
    Progress,
    ReportAsked,
    ReportWritten,
    VerdictAsked,
)
from fogwatch.run_folder.runfolder import RunFolder
from patrol.process.context import ProcessContext, run_with
from patrol.process.lifeline import run_process
from patrol.process.options import ProcessParser

if TYPE_CHECKING:
    from patrol.summary.model import Summary
    from worldsim.verdict.live import LiveJudge

PERIOD_S = 0.5
"""Time between two looks at the journal, s."""
NEWS_S = 0.2
"""Time between two messages about the progress, s."""


class News:
    """Tells the launcher how far the clerk is, again and again from a question until its answer.

    A thread sends it, so that a busy clerk is heard too. Without a question it sends nothing: the launcher does not
    listen then, and the socket would fill up.
    """

    def __init__(self, connection: Connection, total: int) -> None:
        """Begin with the judging; each step takes `total` ticks."""
        self._connection = connection
        self._total = max(total, 1)
        self._sending = threading.Lock()
        self._latest = Progress(JUDGING)
        self._asked = False
        threading.Thread(target=self._tell, daemon=True).start()

    def __call__(self, done: int) -> None:
        """Take note of how many ticks of the step are done."""
        self._latest = Progress(self._latest.step, done / self._total if done < self._total else None)

    def question(self) -> Any:
        """Wait for the launcher's next question."""
        question = self._connection.recv()
        self._asked = True
        return question

    def answer(self, message: Judged | ReportWritten, following: str) -> None:
        """Answer the question; `following` is the step that the next question asks for."""
        with self._sending:
            self._connection.send(message)
            self._latest, self._asked = Progress(following), False

    def _tell(self) -> None:
        try:
            while True:
                time.sleep(NEWS_S)
                with self._sending:
                    if self._asked or self._connection.poll():
                        self._connection.send(self._latest)
        except (OSError, EOFError):
            return  # the launcher has hung up


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve the launcher until it hangs up, and return the exit code.

    0 when the launcher has hung up, 2 for a journal that cannot be judged, 130 when interrupted.
    """
    return run_with(_parser().parse_args(arguments), "clerk", _work, patience=0)


def _work(process: ProcessContext) -> int:
    process.follow()
    os.nice(process.options.nice)
    try:
        with Connection(process.options.talk) as connection:
            _serve(process, connection)
    except (EOFError, BrokenPipeError, ConnectionResetError):
        pass
    return 0


def _serve(process: ProcessContext, connection: Connection) -> None:
    from fogwatch.run_folder.derived import load
    from patrol.measures.best_tour import best_tour
    from patrol.prepare import Prepared
    from worldsim.verdict.live import LiveJudge

    folder = RunFolder(process.options.run)
    prepared = Prepared.load(folder.load(), folder.static)
    process.ready()
    news = News(connection, prepared.scenario.ticks)
    best_tour(prepared)  # summary and report show it, and on new ground it takes long
    live = LiveJudge(folder.journal, prepared)
    load()
    while not connection.poll(PERIOD_S):
        live.read_on(news)
    question: VerdictAsked = news.question()
    judged = _judged(live, question, news)
    news.answer(judged, REPORT)
    summary = judged.summary.model_copy(update={"exit_codes": dict(question.exit_codes)})
    news.answer(_report_written(live, summary, news.question(), news), REPORT)
    connection.recv()  # nothing comes but the end


def _judged(live: LiveJudge, question: VerdictAsked, news: News) -> Judged:
    """Judge the rest of a run that has ended."""
    from worldsim.output.summary import summarise

    verdict = live.verdict(question.exit_codes, news)
    return Judged(verdict, summarise(live.journal, verdict, live.prepared))


def _report_written(live: LiveJudge, summary: Summary, question: ReportAsked, news: News) -> ReportWritten:
    """Write a run's report."""
    from fogwatch.run_folder.derived import derive

    problems: list[str] = []
    derive(live.journal, live.prepared, summary, None, question.out, problems.append, news)
    return ReportWritten("; ".join(problems))


def _parser() -> ProcessParser:
    parser = ProcessParser("python -m fogwatch.clerk", "Judge a run that goes on.", "", reports_start=True)
    parser.add_argument("--run", type=Path, required=True, metavar="DIR", help="run folder")
    parser.add_argument("--talk", type=int, required=True, metavar="FD", help="socket to the launcher")
    parser.add_argument("--nice", type=int, default=0, metavar="N", help="how much lower its priority is")
    return parser


if __name__ == "__main__":
    run_process(main)
