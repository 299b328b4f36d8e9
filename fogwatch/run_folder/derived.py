"""The files made from a run's journal when it has ended: a picture, a recording for viewers, a report for people."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from patrol.errors import BadInput
from patrol.journal import Journal
from runtime.process.aside import Aside
from runtime.process.failures import told
from runtime.process.lifeline import InterruptedBySignal
from runtime.security.private_files import fleet_key
from runtime.starting.warmup import warm

if TYPE_CHECKING:
    from fogwatch.run_folder.runfolder import RunFolder
    from fogwatch.run_options import RunChoices
    from fogwatch.terminal.live_table import RunDisplay
    from monitor.recording.run_recorder import Recorder
    from monitor.replay.run import Run
    from patrol.ground.fog import Fog
    from patrol.ground.footprint import View
    from patrol.prepare import Prepared
    from patrol.scenario import Scenario
    from patrol.summary.model import Summary


JUDGING, PICTURE = "judging the run", "drawing fog.png"
"""Steps of a run's end, as people read them."""


def same_scenario(loaded: Scenario, journal: Journal) -> bool:
    """Return whether a scenario is the one that the journal was written for."""
    from patrol.scenario import load_scenario, same_but_for_files

    written, base = journal.header.scenario, loaded.base
    return same_but_for_files(loaded, load_scenario(written, base=base, called="journal", opens_classes=False))


def write_files(
    folder: RunFolder, prepared: Prepared, journal: Journal, summary: Summary, files: RunChoices, display: RunDisplay
) -> bool:
    """Write the files of a run that has ended, and show the progress; False when a signal has ended it."""

    def draw() -> None:
        from fogwatch.pictures.run_end import run_picture
        from monitor.replay.run import read_run

        run_picture(read_run(folder.path, journal, prepared, summary, None), folder.picture)

    try:
        recording = folder.recording if files.recording else None
        report = folder.report if files.report else None
        with Aside(draw) if files.picture else nullcontext() as picture:
            if files.recording or files.report:
                derive(journal, prepared, summary, recording, report, display)
            if picture is not None:
                display.progress(PICTURE)
                try:
                    picture.result()
                except ImportError as error:
                    display.say(f"no picture: {error.name} is not installed (pip install 'fogwatch[sim]')")
                except (BadInput, OSError, MemoryError) as error:
                    display.say(f"no picture: {told(error) if isinstance(error, MemoryError) else error}")
                display.progress(PICTURE, 1.0)
    except InterruptedBySignal:
        commands = f"`fogwatch report {folder.path}` and `fogwatch record {folder.path}` write report and recording"
        display.say(f"interrupted: not all files are written; {commands}")
        return False
    return True


def derive(
    journal: Journal,
    prepared: Prepared,
    summary: Summary,
    recording: Path | None,
    report: Path | None,
    display: RunDisplay,
) -> None:
    """Write a run's recording and its report in one pass over the journal; either may be None.

    A file that cannot be written is reported and does not make the run invalid. An interruption leaves nothing of a
    file that is not complete.
    """
    step = f"writing {' and '.join(file.name for file in (recording, report) if file is not None)}"
    display.progress(step)
    folder = journal.path.parent
    try:
        warm(("patrol", "monitor", "experiments"), display.say)
        from monitor.replay.replay import Watcher, play
        from monitor.replay.run import read_run
        from monitor.report.analysis import analyse
        from monitor.report.document import write_report

        key = None
        with suppress(BadInput):  # it was removed meanwhile; the report says that tags were not checked
            key = fleet_key(prepared.scenario.radio.key)
        run = read_run(folder, journal, prepared, summary, key)
        with nullcontext() if recording is None else recorded(run, recording) as recorder:
            along: list[Watcher] = [
                _Progress(display, step, prepared.scenario.ticks),
                *([recorder] if recorder else []),
            ]
            analysis = None if report is None else analyse(run, along)
            if report is None:
                play(run, along)
        if report is not None and analysis is not None:
            write_report(analysis, report)
    except ImportError as error:
        display.say(f"no recording and no report: {error.name} is not installed (pip install 'fogwatch[monitor]')")
    except (BadInput, MemoryError) as error:
        display.say(f"no recording or no report: {told(error) if isinstance(error, MemoryError) else error}")
    except OSError as error:
        commands = f"`fogwatch record {folder}` and `fogwatch report {folder}`"
        why = f"cannot be written ({error.strerror}); make room, then: {commands}"
        display.say(f"no recording or no report: {why}")
    display.progress(step, 1.0)


@dataclass(frozen=True)
class _Progress:
    """Follows a replay and shows how much of a step is done."""

    display: RunDisplay
    step: str
    ticks: int

    def before(self, k: int, fog: Fog, views: Sequence[View]) -> None:
        """Do nothing."""

    def after(self, k: int, fog: Fog) -> None:
        """Show that a tick is done."""
        del fog
        show_progress(self.display, self.step, k + 1, self.ticks)


def show_progress(display: RunDisplay, step: str, done: int, ticks: int) -> None:
    """Show how many ticks of a step are done; after the last one, more work of unknown length may follow."""
    display.progress(step, done / ticks if done < ticks else None)


@contextmanager
def recorded(run: Run, file: Path) -> Iterator[Recorder]:
    """Give what records a run as it is played; after an error nothing of the file stays."""
    from monitor.recording.run_recorder import Recorder

    recorder = Recorder(run, file)
    try:
        yield recorder
        recorder.close()
    except BaseException:
        recorder.abandon()
        raise
