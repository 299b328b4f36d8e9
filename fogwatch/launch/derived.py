"""The files made from a run's journal when it has ended: a recording for viewers, and a report for people."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from patrol.errors import BadInput
from patrol.journal import Journal
from patrol.process.starting.warmup import warm
from patrol.radio.fleet_key import fleet_key

if TYPE_CHECKING:
    from patrol.ground.fog import Fog
    from patrol.ground.footprint import View
    from patrol.prepare import Prepared


class _Progress:
    """Follows a replay and says how many ticks are done."""

    def __init__(self, progress: Callable[[int], None]) -> None:
        self._progress = progress

    def before(self, k: int, fog: Fog, views: Sequence[View]) -> None:
        """Do nothing."""

    def after(self, k: int, fog: Fog) -> None:
        """Say that a tick is done."""
        del fog
        self._progress(k + 1)


def derive(
    journal: Journal,
    prepared: Prepared,
    summary: Mapping[str, Any],
    recording: Path | None,
    report: Path | None,
    say: Callable[[str], None],
    progress: Callable[[int], None],
) -> None:
    """Write a run's recording and its report in one pass over the journal.

    A file that cannot be written is reported with `say` and does not make the run invalid. An interruption leaves
    nothing of a file that is not complete.

    Args:
        journal: The run's journal.
        prepared: The run's scenario with its static fields.
        summary: The summary, as in summary.json.
        recording: The recording to write, or None.
        report: The report to write, or None.
        say: Takes lines for the user.
        progress: Called again and again with the number of ticks that were replayed.
    """
    try:
        warm(("patrol", "monitor"), say)
        _derive(journal, prepared, summary, recording, report, _Progress(progress))
    except ImportError as error:
        say(f"no recording and no report: {error.name} is not installed (pip install 'fogwatch[monitor]')")
    except BadInput as error:
        say(f"no recording or no report: {error}")
    except OSError as error:
        again = f"`fogwatch record {journal.path.parent}` and `fogwatch report {journal.path.parent}`"
        say(f"no recording or no report: cannot be written ({error.strerror}); make room, then: {again}")


def _derive(
    journal: Journal,
    prepared: Prepared,
    summary: Mapping[str, Any],
    recording: Path | None,
    report: Path | None,
    replayed: _Progress,
) -> None:
    from monitor.recording.run_recorder import Recorder
    from monitor.replay.replay import Watcher, play
    from monitor.replay.run import read_run
    from monitor.report.analysis import analyse
    from monitor.report.document import write_report

    try:
        key = fleet_key(prepared.scenario.radio.key)
    except BadInput:
        key = None  # it was removed meanwhile; the report says that tags were not checked
    run = read_run(journal.path.parent, journal, prepared, summary, key)
    recorder = None if recording is None else Recorder(run, recording)
    along: list[Watcher] = [replayed, *([recorder] if recorder else [])]
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
