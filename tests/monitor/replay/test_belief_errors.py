from typing import Any

import numpy as np
import pytest

from monitor.replay.belief_errors import BeliefWatcher, chosen_robots, exact_by_construction
from monitor.replay.replay import play
from monitor.report.analysis import analyse
from patrol.ground.fog import Fog
from patrol.prepare import sensor_footprint


@pytest.mark.parametrize("kind", ["faulty", "saving"])
def test_beliefs_are_those_of_the_minds(kind: str, request: pytest.FixtureRequest) -> None:
    """With losses, delays, forged frames, a drift, a pause and a restart: point for point, in every tick."""
    faulty: Any = request.getfixturevalue(kind)
    run = faulty.open()
    watcher = BeliefWatcher(run, sensor_footprint(run.prepared.scenario, run.prepared.terrain))
    checked = set()

    class Compare:
        def before(self, k: int, fog: Fog, views: object) -> None:
            pass

        def after(self, k: int, fog: Fog) -> None:
            watcher.after(k, fog)
            for number in run.numbers:
                if (believed := faulty.beliefs.get((k, number))) is not None:
                    assert np.array_equal(watcher.believed(number).last_seen, believed), (k, number)
                    checked.add((k, number))

    play(run, [Compare()])
    assert len(checked) == len(faulty.beliefs) > 200
    errors = watcher.result()
    assert not exact_by_construction(run)
    assert np.nanmax(errors.mean) > 0.0
    dead = (run.status[errors.ticks] != 1)[:, list(errors.robots)]
    assert np.array_equal(np.isnan(errors.mean), dead)


def test_without_faults_there_is_no_error(quiet: Any) -> None:
    run = quiet.open()
    assert exact_by_construction(run)
    assert analyse(run).beliefs is None
    watcher = BeliefWatcher(run, sensor_footprint(run.prepared.scenario, run.prepared.terrain))
    play(run, [watcher])
    errors = watcher.result()
    assert errors.mean.shape == (80, 3)
    assert np.all(errors.mean == 0.0)
    assert np.array_equal(errors.mfow[:, 0], run.mfow[errors.ticks])


def test_a_large_fleet_is_told_by_those_that_missed_most(faulty: Any) -> None:
    run = faulty.open()
    missed = run.links.lost.sum(axis=0)[1:]
    assert chosen_robots(run) == (0, 1, 2)
    assert chosen_robots(run, work=run.ticks * 3) == (int(np.argmax(missed)),)
