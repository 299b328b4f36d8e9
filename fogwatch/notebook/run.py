"""A run as a notebook sees it: tables, fog, figures and verdict, from the folder that the run has left or is writing.

    run = fogwatch.load("runs/yards-20260101-120000")
    run.robots.to_pandas().groupby("robot").driven_m.sum()

Nothing is read before it is asked for, and then once: a run that goes on while it is looked at stays as it was when it
was first read; `load` it again for the rest.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fogwatch.notebook.arguments import checked_arguments
from monitor.replay.run_files import SUMMARY, journal_in, read_summary
from patrol.errors import BadInput, did_you_mean
from patrol.extras import study
from patrol.summary.model import Summary
from runtime.starting.warmup import warm

if TYPE_CHECKING:
    import pyarrow as pa
    from matplotlib.figure import Figure

    from experiments.intruders.game import Infiltration
    from monitor.figures.style import Drawing
    from monitor.replay.replay import Replay
    from monitor.replay.run import Run as ReplayedRun
    from patrol.scenario import Scenario
    from worldsim.verdict.judge import Verdict

__all__ = ["Run", "load"]


class Run:
    """A run that has ended, was killed, or still goes on.

    Tables are `pyarrow.Table`; ``.to_pandas()`` and ``polars.from_arrow()`` take them further. Names of columns end
    with their unit, which the fields' metadata have as well; docs/python-api.md lists all columns.

    Attributes:
        folder: The run's folder.
        interrupted: Whether the run, or the writing of its files, was stopped before its end.
        announced: What the run said before its first tick: what was given and assumed, its patrol, and warnings. Empty
            for a run that was loaded.
    """

    def __init__(
        self,
        folder: Path,
        *,
        key: Path | None = None,
        summary: Summary | None = None,
        verdict: Verdict | None = None,
        interrupted: bool = False,
        announced: tuple[str, ...] = (),
    ) -> None:
        """Read nothing yet.

        Args:
            folder: The run's folder.
            key: The file of the fleet's key, to check the tags of messages; None to leave them unchecked.
            summary: The run's summary; None for what its folder says.
            verdict: Its verdict; None for what the summary says.
            interrupted: Whether it was stopped before its end.
            announced: What it said before its first tick.
        """
        self.folder = folder
        self.announced = announced
        self.interrupted = interrupted
        self._key = key
        self._given_summary = summary
        self._given_verdict = verdict

    @cached_property
    def summary(self) -> Mapping[str, Any]:
        """The content of summary.json (docs/run-folder.md); without that file, the metrics that the journal gives."""
        return self._figures.document()

    @property
    def trace_hash(self) -> str:
        """The hash of all that happened, SHA-256 in hex; equal for equal runs, in one process or as many.

        A run that has not ended has the hash of its ticks so far.
        """
        return self._figures.trace_hash or self._replayed.trace

    @cached_property
    def verdict(self) -> Verdict:
        """The verdict on the run, check by check; unknown without any check if it has not been judged."""
        if self._given_verdict is not None:
            return self._given_verdict
        warm(("patrol", "worldsim"), _be_silent)
        from worldsim.verdict.judge import stated_verdict

        return stated_verdict(self._figures.verdict)

    @property
    def scenario(self) -> Scenario:
        """The scenario, with what operators added while the run went on."""
        return self._replayed.prepared.scenario

    @property
    def state(self) -> str:
        """The run's end: completed, interrupted, ...; "still going", or "cut off" if nothing writes it any more."""
        from monitor.report.analysis import state_of

        return state_of(*self._opened)[0]

    @property
    def mfow_s(self) -> NDArray[np.float64]:
        """MFoW after each tick, s; float64 (ticks,)."""
        return self._replayed.mfow.astype(np.float64) * self._replayed.step

    @cached_property
    def ticks(self) -> pa.Table:
        """Table with a row a tick: MFoW, mean fog, robots by status, frames."""
        return self._read_table("ticks")

    @cached_property
    def robots(self) -> pa.Table:
        """Table with a row a tick and robot: pose, command, status, state, goal, frames, charge."""
        return self._read_table("robots")

    @cached_property
    def links(self) -> pa.Table:
        """Table with a row a tick, sender and receiver that had frames: sent, delivered, dropped and why."""
        return self._read_table("links")

    @cached_property
    def events(self) -> pa.Table:
        """Table with a row an event: faults, deaths, controls."""
        return self._read_table("events")

    @cached_property
    def visits(self) -> pa.Table:
        """Table with a row a visit to a vertex of the scenario's graph; empty without a graph."""
        return self._read_table("visits")

    @cached_property
    def ground(self) -> pa.Table:
        """Table with a row a patrolled point: its place, its mean and greatest age, and whether it was ever seen."""
        return self._read_table("ground")

    def fog(self, time_s: float = math.inf) -> NDArray[np.float64]:
        """Compute the true age of every point at a time.

        Args:
            time_s: Simulated time, s; the last tick that is not later counts. The run's end unless given.

        Returns:
            float64 (h, w), s; NaN off the patrolled ground. Row 0 is the southernmost: ``imshow(run.fog(300),
            origin="lower", extent=run.extent)``.

        Raises:
            BadInput: The time is before the run, or is not a number.
        """
        replay = self._replay
        if not time_s >= 0.0:
            raise BadInput(f"time_s = {time_s:g}: expected a time from 0 on, in s")
        run = replay.run
        # The tick at 0.3 s is that of 0.1 s steps, although 0.3 / 0.1 is less than 3.
        k = min(math.floor(time_s / run.step + 1e-9), run.ticks - 1) if math.isfinite(time_s) else run.ticks - 1
        return np.where(run.prepared.patrolled, replay.fog(k).age(k) * run.step, np.nan)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """The sides of the grid, as imshow takes them: west, east, south and north, m."""
        terrain = self._replayed.prepared.terrain
        west, south = terrain.origin
        return west, west + terrain.width * terrain.point, south, south + terrain.height * terrain.point

    def infiltration(self, *, again: bool = False, code: bool = False, **settings: Any) -> Infiltration:
        """Play a moving intruder that watches the patrol, predicts it, and plans a way in.

        For example ``run.infiltration(speed=3.0).gain.watching.percent``: how many more attempts in a hundred succeed
        because the intruder watches.

        Args:
            again: Whether it also plans again every second from what is then seen, which takes minutes.
            code: Whether one plays too that has the scenario and the code, but not the secret of the draws. For that,
                the scenario is run again, with its policy and its key.
            settings: Of the intruder, as `experiments.intruders.game.Infiltrator` has them: speed, stay_s,
                within_s, depth_m, attempts, seed, entries, zone.

        Returns:
            The success of each predictor and the gain of watching, with their intervals.

        Raises:
            BadInput: There is no such setting, or the game cannot be played on this run; or its scenario does not give
                the same run again.
        """
        on_run = study("intruders.on_run")
        setting_names = [setting.name for setting in fields(on_run.Infiltrator)]
        for name in settings:
            if name not in setting_names:
                raise BadInput(f"{name}: the moving intruder has no such setting; {did_you_mean(name, setting_names)}")
        game = on_run.moving_game(self._replayed, on_run.Infiltrator(**settings))
        if code:
            study("intruders.simulated_futures").add_code(game, self._replayed.prepared)
        played: Infiltration = on_run.infiltration(game, again)
        return played

    @property
    def figure_names(self) -> list[str]:
        """The names of the figures that `figure` draws for this run."""
        return list(self._drawings)

    def figure(self, name: str) -> Figure:
        """Draw a figure of the run's report anew.

        Args:
            name: One of `figure_names`, such as ``mfow``, ``paths`` or ``links``.

        Returns:
            A matplotlib figure, to change or to save.

        Raises:
            BadInput: The run has no such figure, or matplotlib is not installed.
        """
        if name not in self._drawings:
            raise BadInput(f"figure {name}: this run has no such figure; {did_you_mean(name, self.figure_names)}")
        return self._drawings[name].draw()

    def __repr__(self) -> str:
        figures = self._figures
        mean, bound = figures.mfow_mean_s, figures.bound_s
        mfow = "no ticks" if mean is None else f"MFoW mean {mean:.1f} s (bound {bound:.1f} s)"
        simulated = f"{figures.simulated_s:g} s simulated{', interrupted' if self.interrupted else ''}"
        judged = figures.verdict
        verdict = "unknown" if judged is None else f"{judged.outcome}{', with warnings' if judged.warnings else ''}"
        return f"<Run {figures.name}: {mfow}, {simulated}, verdict {verdict}, in {self.folder}>"

    def _repr_html_(self) -> str:
        """Show the run in a notebook: its main figures, its verdict, and its final fog if that was drawn."""
        from fogwatch.notebook.html import run_html

        return run_html(self._figures, self.folder, self.announced)

    def _read_table(self, name: str) -> pa.Table:
        from monitor.tables.arrow import arrow_table
        from monitor.tables.table import check_pyarrow

        check_pyarrow()  # before a long run is read
        return arrow_table(self._replayed, name)

    @cached_property
    def _figures(self) -> Summary:
        """The summary; of a run that left none, what its journal gives."""
        summary = self._given_summary or read_summary(self.folder / SUMMARY)
        if summary is not None:
            return summary
        run = self._replayed
        end = run.journal.end
        facts = {
            "name": run.title,
            "scenario_hash": run.journal.header.scenario_hash,
            "trace_hash": None if end is None else run.trace,
            "ended": run.ended,
        }
        return run.figures.model_copy(update=facts)

    @cached_property
    def _opened(self) -> tuple[ReplayedRun, bool]:
        from fogwatch.cli.open_run import open_folder

        return open_folder(self.folder, self._key, _be_silent)

    @property
    def _replayed(self) -> ReplayedRun:
        return self._opened[0]

    @cached_property
    def _replay(self) -> Replay:
        from monitor.replay.replay import Replay

        return Replay(self._replayed)

    @cached_property
    def _drawings(self) -> dict[str, Drawing]:
        from monitor.report.analysis import analyse
        from monitor.report.document import drawings

        return {drawing.name: drawing for drawing in drawings(analyse(self._replayed))}


@checked_arguments
def load(folder: str | Path, *, key: str | Path | None = None) -> Run:
    """Load a run from its folder: one that has ended, was killed, or still goes on.

    Args:
        folder: The run's folder, such as ``runs/yards-20260101-120000``.
        key: The file of the fleet's key, to check the tags of messages; unchecked unless given.

    Returns:
        The run. Its folder may be a stranger's: nothing of it is executed, and no file outside of it is opened.

    Raises:
        BadInput: It is not the folder of a run.
    """
    journal_in(Path(folder))
    return Run(Path(folder), key=None if key is None else Path(key))


def _be_silent(_: str) -> None:
    """Say nothing: a cell's output is its result."""
