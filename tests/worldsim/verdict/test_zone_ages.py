"""The figures of a run's zones, against ages recomputed point by point."""

from __future__ import annotations

import numpy as np
import pytest

from patrol.changing.ground import ChangingTerrain, ClosedPoints
from patrol.journal import Event, Status
from patrol.journal.records import CLOSED
from patrol.measures.zoned import ZonedGround, best_weighted_s
from patrol.pose import Pose
from patrol.prepare import sensor_footprint
from patrol.zones.spec import weighing_at
from tests.present import present
from tests.worldsim.checks.judged import summary_of
from tests.worldsim.conftest import Lab
from worldsim.output.summary import summarise
from worldsim.truth import Truth
from worldsim.verdict.judge import judge

DISC = {"model": "holonomic", "radius": 0.4, "speed": 1.0}
VAULT = {"name": "vault", "polygon": [[12, 8], [20, 8], [20, 15], [12, 15]], "weight": 4}
LOBBY = {"name": "lobby", "polygon": [[0, 0], [6, 0], [6, 6], [0, 6]], "weight": 0.5}
ALL = {"name": "all", "polygon": [[0, 0], [20, 0], [20, 15], [0, 15]], "weight": 2}
FAR = {"name": "far", "polygon": [[18, 13], [20, 13], [20, 15], [18, 15]]}


def test_figures_are_those_of_the_points(lab: Lab) -> None:
    world = lab.world([DISC] * 2, [(3.0, 3.0, 0.0), (14.0, 4.0, 0.0)], duration=30.0, zones=[VAULT, LOBBY])
    journal = lab.run(world)
    summary = summary_of((world, journal))
    patrolled, terrain = world.prepared.patrolled, world.prepared.terrain
    ys, xs = np.indices(terrain.shape) * terrain.point + 0.5 * terrain.point
    inside = {"vault": (xs > 12) & (ys > 8), "lobby": (xs < 6) & (ys < 6)}
    inside["elsewhere"] = ~(inside["vault"] | inside["lobby"])
    weights = {"vault": 4.0, "lobby": 0.5, "elsewhere": 1.0}
    truth, ages = Truth(sensor_footprint(world.scenario, terrain), patrolled), []
    for record in journal.ticks:
        living = [(r.number, Pose(r.x, r.y, r.heading)) for r in record.robots if r.status is Status.ALIVE]
        truth.observe(record.k, living)
        ages.append(truth.fog.age(record.k) * world.scenario.step)
    weighted = [max(weights[name] * age[inside[name] & patrolled].max() for name in weights) for age in ages]
    assert summary.mfow_weighted_mean_s == pytest.approx(np.mean(weighted))
    half = len(weighted) // 2
    assert summary.mfow_weighted_late_mean_s == pytest.approx(np.mean(weighted[half:]))
    assert summary.mfow_weighted_max_s == pytest.approx(max(weighted))
    for name, weight in weights.items():
        found, ground = summary.zones[name], inside[name] & patrolled
        assert found.weight == weight
        assert found.area_m2 == pytest.approx(np.count_nonzero(ground) * 0.25)
        assert found.mfow_mean_s == pytest.approx(np.mean([age[ground].max() for age in ages]))
        assert found.mfow_late_mean_s == pytest.approx(np.mean([age[ground].max() for age in ages[half:]]))
        assert found.mfow_max_s == max(age[ground].max() for age in ages)
        assert found.fog_mean_s == pytest.approx(np.mean([age[ground].mean() for age in ages]))
        assert found.kept_share is None


def test_a_zone_counts_while_it_is_in_force(lab: Lab) -> None:
    """Nothing of the far zone is ever seen, so its age is the time; it weighs from 5 s to 10 s."""
    far = FAR | {"weight": 4, "times": [[5, 10]]}
    world = lab.world([DISC], [(3.0, 3.0, 0.0)], duration=20.0, zones=[far, far | {"name": "never", "times": []}])
    summary = summary_of((world, lab.run(world)))
    times = [0.5 * k for k in range(40)]
    assert set(summary.zones) == {"far", "elsewhere"}
    assert summary.zones["far"].mfow_mean_s == pytest.approx(np.mean([t for t in times if 5 <= t < 10]))
    assert summary.zones["far"].fog_mean_s == pytest.approx(np.mean([t for t in times if 5 <= t < 10]))
    assert summary.zones["far"].mfow_late_mean_s == pytest.approx(np.mean([t for t in times if 7.5 <= t < 10]))
    assert summary.zones["far"].mfow_max_s == 9.5
    assert summary.mfow_weighted_mean_s == pytest.approx(np.mean([4 * t if 5 <= t < 10 else t for t in times]))
    assert summary.mfow_weighted_late_mean_s == pytest.approx(np.mean([t for t in times if t >= 10.0]))
    assert summary.mfow_weighted_max_s == 38.0


def test_the_best_tours_count_by_the_ticks_in_which_their_zones_are_in_force(lab: Lab) -> None:
    world = lab.world([DISC], [(3.0, 3.0, 0.0)], duration=20.0, zones=[ALL | {"times": [[5, 11]]}])
    summary = summary_of((world, lab.run(world)))
    zones = world.scenario.zones
    weights = [present(ZonedGround(world.prepared).under(weighing_at(zones, s))) for s in (5.0, 0.0)]
    in_force, not_yet = (present(best_weighted_s(world.prepared, some)) for some in weights)
    assert in_force == 2.0 * not_yet
    assert summary.best_weighted_s == pytest.approx((12 * in_force + 28 * not_yet) / 40)


def test_figures_of_open_ground_are_those_of_its_ages_in_each_tick(lab: Lab) -> None:
    """The room is shut from 4 s to 12 s; `tests/patrol/closures/test_open_ground.py` is about the ages themselves."""
    room = {"name": "room", "polygon": [[10.5, 0], [20, 0], [20, 15], [10.5, 15]], "closed": [[4, 12]]}
    world = lab.world([DISC], [(3.0, 3.0, 0.0)], duration=20.0, closures=[room])
    journal = lab.run(world)
    summary, verdict = summarise(journal, judge(journal, {}, world.prepared), world.prepared)
    assert verdict.open_ages is not None
    ages_s = verdict.open_ages.ages_s
    assert ages_s.shape == (40,)
    assert ages_s[0] == 0.0
    assert summary.mfow_reachable_mean_s == pytest.approx(ages_s.sum() / 40)
    assert summary.mfow_reachable_late_mean_s == pytest.approx(ages_s[20:].sum() / 20)
    assert summary.mfow_reachable_max_s == max(ages_s)
    ground, shut = world.prepared.open_ground(), ChangingTerrain(world.terrain)
    assert ground is not None
    points = ClosedPoints(world.prepared.closable, world.terrain)
    points.take(Event(8, CLOSED, None, "room"))
    shut.close(points.grid)
    ground.tick(8, shut, {"room"}, {1: (journal.records[8].robots[0].x, journal.records[8].robots[0].y)}, {})
    out = np.count_nonzero(ground.closed_out) / np.count_nonzero(world.prepared.patrolled)
    assert out > 0.3
    assert summary.closed_out_share == pytest.approx(out * 16 / 40)


def test_how_long_a_wish_was_kept(lab: Lab) -> None:
    """Nothing of the far corner is seen, so its age is the time: half of 30 s it is at most 14.5 s."""
    world = lab.world([DISC], [(3.0, 3.0, 0.0)], duration=30.0, zones=[FAR | {"age": 14.5}])
    figures = summary_of((world, lab.run(world))).zones["far"]
    assert figures.wanted_s == 14.5
    assert figures.kept_share == pytest.approx(0.5)
