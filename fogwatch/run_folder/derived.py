"""The files made from a run's journal when it has ended: a picture, a recording for viewers, a report for people."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from patrol.errors import BadInput
from patrol.journal import Journal
from patrol.process.exhausted import told
from patrol.process.lifeline import InterruptedBySignal
from patrol.radio.fleet_key import fleet_key
from patrol.starting.warmup import warm

if TYPE_CHECKING:
    from fogwatch.launch.clerk_child import ClerkChild
    from fogwatch.run_folder.runfolder import RunFolder
    from fogwatch.run_options import RunChoices
    from fogwatch.terminal.live_table import RunDisplay
    from patrol.ground.fog import Fog
    from patrol.ground.footprint import View
    from patrol.prepare import Prepared
    from patrol.summary.model import Summary


PICTURE = "drawing fog.png"
"""A step of a run's end, as people read it."""


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


def write_files(
    folder: RunFolder,
    prepared: Prepared,
    journal: Journal,
    summary: Summary,
    files: RunChoices,
    display: RunDisplay,
    clerk: ClerkChild | None,
) -> bool:
    """Write the files of a run that has ended, and show the progress; False when a signal has ended it.

    The clerk writes the report meanwhile, if there is one that can.
    """
    try:
        recording = folder.recording if files.recording else None
        report = folder.report if files.report else None
        by_clerk = report is not None and clerk is not None and clerk.begin_report()
        _shown(journal, prepared, summary, recording, None if by_clerk else report, display)
        if files.picture:
            display.progress(PICTURE)
            _draw(folder, prepared, display.say)
            display.progress(PICTURE, 1.0)
        if by_clerk and clerk is not None:
            outcome = clerk.report_written()
            if outcome is None:
                _shown(journal, prepared, summary, None, report, display)
            elif outcome.problem:
                display.say(outcome.problem)
    except InterruptedBySignal:
        commands = f"`fogwatch report {folder.path}` and `fogwatch record {folder.path}` write report and recording"
        display.say(f"interrupted: not all files are written; {commands}")
        return False
    return True


def load() -> None:
    """Import what the files are made with, which takes a second or two: for a process that has to wait anyway.

    What is wrong with a library is reported when a file is to be made.
    """
    drawing = ("matplotlib.backends.backend_agg", "matplotlib.backends.backend_svg")
    with suppress(Exception):
        for name in (*drawing, "monitor.recording.run_recorder", "monitor.report.document"):
            import_module(name)


def derive(
    journal: Journal,
    prepared: Prepared,
    summary: Summary,
    recording: Path | None,
    report: Path | None,
    say: Callable[[str], None],
    progress: Callable[[int], None],
) -> None:
    """Write a run's recording and its report in one pass over the journal; either may be None.

    A file that cannot be written is reported with `say` and does not make the run invalid. An interruption leaves
    nothing of a file that is not complete. `progress` is called again and again with the number of ticks that were
    replayed.
    """
    try:
        warm(("patrol", "monitor", "experiments"), say)
        _derive(journal, prepared, summary, recording, report, _Progress(progress))
    except ImportError as error:
        say(f"no recording and no report: {error.name} is not installed (pip install 'fogwatch[monitor]')")
    except (BadInput, MemoryError) as error:
        say(f"no recording or no report: {told(error) if isinstance(error, MemoryError) else error}")
    except OSError as error:
        commands = f"`fogwatch record {journal.path.parent}` and `fogwatch report {journal.path.parent}`"
        say(f"no recording or no report: cannot be written ({error.strerror}); make room, then: {commands}")


def _derive(
    journal: Journal,
    prepared: Prepared,
    summary: Summary,
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


def _shown(
    journal: Journal,
    prepared: Prepared,
    summary: Summary,
    recording: Path | None,
    report: Path | None,
    display: RunDisplay,
) -> None:
    """Write a recording and a report, each unless it is None, and show how far that is."""
    files = [file.name for file in (recording, report) if file is not None]
    if not files:
        return
    step, ticks = f"writing {' and '.join(files)}", prepared.scenario.ticks

    def progress(k: int) -> None:
        display.progress(step, k / ticks if k < ticks else None)

    derive(journal, prepared, summary, recording, report, display.say, progress)
    display.progress(step, 1.0)


def _draw(folder: RunFolder, prepared: Prepared, say: Callable[[str], None]) -> None:
    try:
        from fogwatch.pictures.run_end import run_picture

        run_picture(folder.path, folder.picture, prepared)
    except ImportError as error:
        say(f"no picture: {error.name} is not installed (pip install 'fogwatch[sim]')")
    except (BadInput, OSError, MemoryError) as error:
        say(f"no picture: {told(error) if isinstance(error, MemoryError) else error}")
