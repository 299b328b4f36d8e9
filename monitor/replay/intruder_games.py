"""Intruder games on a finished run: on any point of its ground, and on the vertices of its graph."""

from __future__ import annotations

from collections.abc import Sequence

from monitor.replay.replay import play
from monitor.replay.run import Run
from patrol.ground.fog import Fog
from patrol.ground.footprint import View
from patrol.measures.intruders import Games, Sightings


class _Looks:
    """Writes down which points are in view in each tick, while a run is replayed."""

    def __init__(self, sightings: Sightings) -> None:
        self._to = sightings

    def before(self, k: int, fog: Fog, views: Sequence[View]) -> None:  # noqa: ARG002 - a Watcher gets it
        """See `Watcher`."""
        for view in views:
            rows, cols = self._to.rows - view.row0, self._to.cols - view.col0
            near = (rows >= 0) & (cols >= 0) & (rows < view.mask.shape[0]) & (cols < view.mask.shape[1])
            self._to.seen[k, near] |= view.mask[rows[near], cols[near]] != 0

    def after(self, k: int, fog: Fog) -> None:
        """See `Watcher`."""


def games_of(run: Run, attacks_s: Sequence[float]) -> Games:
    """Play the games on a run.

    Args:
        run: The run.
        attacks_s: Durations of attacks, s.
    """
    sightings = Sightings(run.prepared.scenario, run.prepared.patrolled, run.ticks)
    play(run, [_Looks(sightings)])
    for k in range(run.ticks):
        sightings.visit(k, ((number, (pose.x, pose.y)) for number, pose in run.alive(k)))
    return sightings.games(run.ticks, attacks_s)
