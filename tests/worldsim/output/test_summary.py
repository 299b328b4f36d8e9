"""The summary: what summary.json says, from the journal alone."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from patrol.journal import Status, trace_hash
from patrol.measures.best_tour import best_tour
from patrol.measures.stays import roaming_radius
from patrol.scenario import load_scenario, scenario_hash
from patrol.summary.metric import metrics_of
from patrol.summary.model import Messages, RobotFigures, Summary
from tests.worldsim.checks import judged
from tests.worldsim.checks.judged import move
from tests.worldsim.conftest import Lab
from worldsim.output.record import lower_bound
from worldsim.output.summary import summarise
from worldsim.output.ticks_table import HEAD
from worldsim.run_record import MemoryJournal
from worldsim.verdict.judge import judge
from worldsim.world import World


def summary_of(world: World, journal: MemoryJournal) -> dict[str, Any]:
    return judged.summary_of((world, journal)).document()


def test_the_summary_has_what_it_promises(lab: Lab) -> None:
    world = lab.patrol(ticks=20)
    journal = lab.run(world)
    assert journal.end is not None
    journal.end = replace(journal.end, notes={"wall_s": 2.0})
    summary = summary_of(world, journal)
    assert json.loads(json.dumps(summary, allow_nan=False)) == summary
    assert summary["scenario_hash"] == scenario_hash(world.scenario)
    assert summary["trace_hash"] == trace_hash(journal.ticks)
    assert (summary["ticks"], summary["simulated_s"], summary["realtime_factor"]) == (20, 10.0, 5.0)
    assert summary["mfow_mean_s"] == np.mean([record.mfow for record in journal.ticks]) * 0.5
    assert summary["mfow_max_s"] == max(record.mfow for record in journal.ticks) * 0.5
    assert summary["fog_mean_s"] == pytest.approx(np.mean([record.fog_mean for record in journal.ticks]) * 0.5)
    assert summary["patrolled_area_m2"] == np.count_nonzero(lab.room.free) * 0.25
    assert summary["seen_share"] == journal.records[-1].seen / np.count_nonzero(lab.room.free)
    assert (summary["point_m"], summary["sensor_range_m"]) == (0.5, 3.0)
    assert summary["verdict"]["valid"] is True
    assert {"name", "ok", "detail", "judged", "warnings"} == set(summary["verdict"]["checks"][0])


WITH_ZONES = {"mfow_weighted_mean_s", "mfow_weighted_late_mean_s", "mfow_weighted_max_s", "best_weighted_s", "zones"}
WITH_CLOSURES = {"mfow_open_mean_s", "mfow_open_late_mean_s", "mfow_open_max_s", "closed_out_share", "closures"}
ON_SOME_GROUND = {"patrolled_vertices", "nodes"}
OTHERS = {"intruders", "refused", "deadlines", "direct", "exit_codes"}
IN_SOME_RUNS = OTHERS | ON_SOME_GROUND | WITH_ZONES | WITH_CLOSURES


def test_every_metric_is_declared_and_computed_in_the_order_of_its_declaration(lab: Lab) -> None:
    world = lab.patrol(ticks=2)
    summary = summary_of(world, lab.run(world))
    assert list(summary) == [key for key, _ in metrics_of(Summary) if key not in IN_SOME_RUNS]
    assert list(summary["messages"]) == [key for key, _ in metrics_of(Messages)]
    assert list(summary["robots"]["r1"]) == [key for key, _ in metrics_of(RobotFigures) if key != "battery"]


def test_every_column_of_the_ticks_is_explained() -> None:
    text = (Path(__file__).parents[3] / "docs" / "run-folder.md").read_text(encoding="utf-8")
    assert set(HEAD.split(",")) <= set(re.findall(r"`(\w+)`", text.partition("## ticks.csv")[2]))


def test_robots_are_summed_up(lab: Lab) -> None:
    world = lab.patrol(ticks=20)
    summary = summary_of(world, lab.run(world))
    assert list(summary["robots"]) == ["r1", "r2", "r3", "r4"]
    for body in world.bodies.values():
        facts = summary["robots"][body.spec.name]
        assert facts["distance_m"] == pytest.approx(body.distance_m)
        assert facts["collisions"] == body.collisions
        assert (facts["decisions"], facts["missed"], facts["dead_end_share"]) == (20, 0, 0.25)
        assert facts["decision_ms_p50"] == facts["decision_ms_p99"] == float(body.spec.number)
        assert (facts["sent"], facts["delivered"], facts["dropped"], facts["rejected"]) == (60, 60, 0, 0)
        assert facts["refused_commands"] == 0
    assert sum(facts["distance_m"] for facts in summary["robots"].values()) > 0


def test_messages_are_counted_once_per_receiver(lab: Lab) -> None:
    world = lab.patrol(ticks=20)
    journal = lab.run(world, lab.fleet(world, killed={9: (3, Status.DEAD)}))
    summary = summary_of(world, journal)
    messages = summary["messages"]
    assert messages["frames"] == 4 * 10 + 3 * 10
    assert messages["sent"] == 3 * messages["frames"] == messages["delivered"] + messages["dropped"]
    assert messages["dropped_by_cause"] == {"receiver dead": 30}
    length = sum(len(frame) for record in journal.ticks for _, frame in record.frames)
    assert messages["bytes_per_robot_s"] == length / (70 * 0.5)
    assert summary["robots"]["r3"]["status"] == "dead"
    assert summary["robots"]["r3"]["decisions"] == 10
    assert messages["delivered"] == sum(len(record.deliveries) for record in journal.ticks)
    assert messages["dropped"] == sum(len(record.dropped) for record in journal.ticks)


def test_commands_that_made_no_sense_are_counted_by_robot(lab: Lab) -> None:
    world = lab.patrol(ticks=20)
    journal = lab.run(world)
    for k in (3, 4, 11):
        move(journal, k, 3, refused=True)
    counts = {name: facts["refused_commands"] for name, facts in summary_of(world, journal)["robots"].items()}
    assert counts == {"r1": 0, "r2": 0, "r3": 3, "r4": 0}


def test_a_robot_that_is_lost_at_the_very_end_is_called_lost(lab: Lab) -> None:
    world = lab.patrol(ticks=5)
    summary = summary_of(world, lab.run(world, lab.fleet(world, silent={(4, 4, "B")})))
    assert summary["robots"]["r4"]["status"] == "lost"
    assert summary["robots"]["r4"]["missed"] == 1


def test_a_run_cut_off_before_its_first_tick_has_a_summary(lab: Lab) -> None:
    world = lab.patrol(ticks=5)
    journal = lab.run(world, stop=lambda: True)
    journal.end = None
    summary = summary_of(world, journal)
    assert (summary["ticks"], summary["mfow_mean_s"], summary["realtime_factor"]) == (0, None, None)
    assert summary["verdict"]["outcome"] == "unknown"


def test_the_bound_is_that_of_the_formula() -> None:
    roster = load_scenario({"terrain": {"builtin": "open"}, "robots": {"count": 3, "model": "holonomic"}}).roster
    area = 100.0 * 88.0
    expected = (area / 3 - math.pi * 100.0) / (2 * 10.0 * 4.4)
    assert lower_bound(area, roster, 10.0) == pytest.approx(expected)
    assert lower_bound(area, roster, 10.0) == pytest.approx(29.8, abs=0.05)
    slower = [replace(spec, speed=spec.speed / 2) for spec in roster]
    assert lower_bound(area, slower, 10.0) == pytest.approx(2 * expected)
    assert lower_bound(500.0, roster, 10.0) == 0.0


def test_the_longest_stay_is_the_longest_time_within_one_circle(lab: Lab) -> None:
    world = lab.patrol(ticks=20)
    journal = lab.run(world)
    radius = {spec.number: roaming_radius(spec, world.step) for spec in world.scenario.roster}
    swing = 0.6 * radius[1]
    for k in range(20):
        move(journal, k, 1, x=1.0 + (swing if k // 2 % 2 else 0.0), y=1.0)
        move(journal, k, 3, x=2.0, y=2.0, status=Status.PAUSED if k == 8 else Status.ALIVE)
    robots_of = summary_of(world, journal)["robots"]
    assert (robots_of["r1"]["longest_stay_s"], robots_of["r3"]["longest_stay_s"]) == (9.5, 4.5)
    circle = {"x": pytest.approx(1.0 + swing / 2.0), "y": 1.0, "radius_m": pytest.approx(radius[1])}
    assert robots_of["r1"]["longest_stay"] == {"seconds": 9.5, "since_s": 0.0, **circle}
    assert robots_of["r3"]["longest_stay"]["since_s"] == 5.0


def test_the_summary_says_where_the_stalest_place_was_and_who_was_near(lab: Lab) -> None:
    world = lab.patrol(ticks=20)
    journal = lab.run(world)
    summary = summary_of(world, journal)
    worst, end = summary["stalest"]["worst"], summary["stalest"]["end"]
    assert worst["age_s"] == summary["mfow_max_s"]
    assert end["age_s"] == summary["mfow_end_s"]
    assert (worst["at_s"], end["at_s"]) == (journal.records[-1].k * 0.5, 9.5)
    rows = {row.number: row for row in journal.records[-1].robots}
    away = {f"r{n}": math.dist((row.x, row.y), (end["x"], end["y"])) for n, row in rows.items()}
    assert end["nearest"] == min(away, key=away.__getitem__)
    assert end["nearest_m"] == pytest.approx(away[end["nearest"]])
    point = world.terrain.point_at(end["x"], end["y"])
    assert world.truth.fog.age(19)[point] == 19
    assert end["seen"] is bool(world.truth.fog.last_seen[point] >= 0)


def test_the_summary_has_the_best_tour_where_it_is_given_the_terrain(lab: Lab) -> None:
    world = lab.patrol(ticks=5)
    journal = lab.run(world)
    verdict = judge(journal, {}, world.prepared)
    assert summarise(journal, verdict).best_tour_s is None
    summary = summarise(journal, verdict, world.prepared)
    tour = best_tour(world.prepared)
    assert summary.best_tour_m == tour.length_m
    assert summary.best_tour_s == tour.bound_s(dict.fromkeys(range(1, 5), 1.0))
    assert summary.best_tour_s is not None
    assert summary.best_tour_s > 0.0
