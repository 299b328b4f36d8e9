"""The moving intruder in a report: how often it gets in, and one attempt that succeeded beside one that did not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from experiments.intruders.game import Attempt, Infiltration, Percent, infiltration
from experiments.intruders.ground import IntruderGround
from experiments.intruders.infiltrator import KNOWLEDGE, WATCHING, Infiltrator
from experiments.intruders.on_run import moving_game
from monitor.figures.style import ALERT, INK, colour
from monitor.replay.run import Run
from monitor.report import html
from monitor.report.map_charts import PANEL_WIDTH, ground_panels
from patrol.journal.records import Status

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


REPORTED = Infiltrator(attempts=30)
"""The intruder of reports: fewer attempts, as a report is written at the end of every run."""


@dataclass(frozen=True, eq=False)
class MovingIntruder:
    """The game on a run, played."""

    outcome: Infiltration
    examples: Sequence[Attempt]  # the first that succeeded and the first that did not, of the predictor that watches
    ground: IntruderGround

    def table(self) -> str:
        """Return the table of successes as HTML."""
        outcome = self.outcome
        rows = [(words, *_share_cells(outcome.once[name])) for name, words in KNOWLEDGE.items() if name in outcome.once]
        gain = _share_cells(outcome.gain.watching)
        rows.append(("gain of watching: the one that watches, less the last", *gain))
        heads = ("an intruder that", "gets in (%)", "95 % interval")
        note = (
            f"{outcome.attempts} attempts in the second half of the run, planned once: at {outcome.speed:.3g} m/s from "
            f"the edge to a random place at least {outcome.depth_m:.0f} m inside, and {REPORTED.stay_s:g} s there, "
            f"within {REPORTED.within_s:g} s. `fogwatch intruder` makes more attempts, and plays other intruders."
        )
        return html.table(heads, rows, numbers=(1, 2)) + html.text(note, "note")

    def chart(self, run: Run) -> Figure:
        """Draw the examples."""
        chart, panels = ground_panels(run.prepared.terrain, len(self.examples), PANEL_WIDTH)
        for axes, attempt in zip(panels, self.examples, strict=True):
            self._draw_attempt(axes, attempt, run)
        return chart

    def _draw_attempt(self, axes: Axes, attempt: Attempt, run: Run) -> None:
        ground, terrain = self.ground, run.prepared.terrain
        last = attempt.now + len(attempt.way)
        for index in range(len(run.names)):
            track = run.poses[attempt.now : last + 1, index, :2].copy()
            track[run.status[attempt.now : last + 1, index] != Status.ALIVE] = np.nan
            axes.plot(*track.T, color=colour(index), linewidth=1.0, alpha=0.8)
            axes.plot(*track[-1], color=colour(index), marker="o", markersize=4)
        points = np.append(attempt.way[attempt.way >= 0], attempt.target)
        x = terrain.origin[0] + (ground.cols[points] + 0.5) * terrain.point
        y = terrain.origin[1] + (ground.rows[points] + 0.5) * terrain.point
        axes.plot(x[:-1], y[:-1], color=INK, linewidth=1.6, linestyle=(0, (3, 1)))
        axes.plot(x[-1], y[-1], marker="*", markersize=10, color=INK)
        if attempt.seen is None:
            axes.set_title(f"gets in: {attempt.now * run.step:g} to {last * run.step:g} s", color=INK)
        else:
            axes.plot(x[-2], y[-2], marker="X", markersize=9, color=ALERT, markeredgecolor=INK)
            axes.set_title(f"fails: seen at {attempt.seen * run.step:g} s", color=INK)


def play_on(run: Run, infiltrator: Infiltrator = REPORTED) -> MovingIntruder:
    """Play the game on a run; raise BadInput where it cannot be played."""
    game = moving_game(run, infiltrator)
    outcome = infiltration(game)
    examples: dict[bool, Attempt] = {}
    for now, target in game.trials:
        attempt = game.once(game.predictors[WATCHING], now, target)
        # Without a way in time there is nothing to draw.
        if attempt.way.size:
            examples.setdefault(attempt.succeeded, attempt)
        if len(examples) == 2:
            break
    shown = [examples[succeeded] for succeeded in (True, False) if succeeded in examples]
    return MovingIntruder(outcome, shown, game.watch.ground)


def _share_cells(value: Percent) -> tuple[str, str]:
    return f"{value.percent:.0f}", f"{value.low:.0f} to {value.high:.0f}"
