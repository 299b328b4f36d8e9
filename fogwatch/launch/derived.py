"""What is derived from a run's journal when it is over: a recording for viewers, and a report for people."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from patrol.errors import BadInput
from patrol.journal import Journal
from patrol.process.warmup import warm

if TYPE_CHECKING:
    from patrol.ground.fog import Fog
    from patrol.ground.footprint import View
    from patrol.prepare import Prepared


class _Hurry(Exception):
    """Somebody does not want to wait."""


class _Impatience:
    """Goes along with a replay and ends it when nobody wants it any more."""

    def __init__(self, hurry: Callable[[], bool]) -> None:
        self._hurry = hurry

    def before(self, k: int, fog: Fog, views: Sequence[View]) -> None:
        """Ask."""
        del k, fog, views
        if self._hurry():
            raise _Hurry

    def after(self, k: int, fog: Fog) -> None:
        """Nothing."""


def derive(
    journal: Journal,
    prepared: Prepared,
    summary: Mapping[str, Any],
    recording: Path | None,
    report: Path | None,
    hurry: Callable[[], bool],
    say: Callable[[str], None],
) -> None:
    """Write a run's recording and its report, those that are named, in one pass over the journal.

    hurry: asked in between; once it says yes, nothing more is written. Whatever cannot be written is said, and is
    no reason to doubt the run.
    """
    try:
        warm(("patrol", "monitor"), say)
        _derive(journal, prepared, summary, recording, report, _Impatience(hurry))
    except _Hurry:
        say("no recording and no report: not waited for; `fogwatch record` and `fogwatch report` make them")
    except ImportError as error:
        say(f"no recording and no report: {error.name} is not installed (pip install 'fogwatch[monitor]')")
    except (BadInput, OSError) as error:
        say(f"no recording or no report: {error}")


def _derive(
    journal: Journal,
    prepared: Prepared,
    summary: Mapping[str, Any],
    recording: Path | None,
    report: Path | None,
    impatience: _Impatience,
) -> None:
    from monitor.recording.run_recorder import Recorder
    from monitor.replay.replay import Watcher, play
    from monitor.replay.run import read_run
    from monitor.report.analysis import analyse
    from monitor.report.document import write_report

    run = read_run(journal.path.parent, journal, prepared, summary)
    recorder = None if recording is None else Recorder(run, recording)
    along: list[Watcher] = [impatience, *([recorder] if recorder else [])]
    try:
        analysis = None
        if report is None:
            play(run, along)
        else:
            analysis = analyse(run, along)
        if recorder is not None:
            recorder.close()
    except BaseException:
        if recorder is not None:
            recorder.abandon()
        raise
    if report is not None and analysis is not None:
        write_report(analysis, report)
