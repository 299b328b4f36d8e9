"""The summary: figures of the run, of links, of faults and of intruders, from the journal alone."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from patrol.journal import Status, trace_hash
from patrol.journal.records import SURROUNDING
from patrol.measures.best_tour import best_tour
from patrol.measures.stays import roaming_radius
from patrol.radio.message import CONTACT, Position, decode, encode
from patrol.scenario import load_scenario, scenario_hash
from patrol.summary.metric import metrics_of
from patrol.summary.model import Messages, RobotFigures, Summary
from tests.worldsim.checks import judged
from tests.worldsim.checks.judged import failures, move
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
    world, journal = lab.driven(ticks=20)
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
WITH_CLOSURES = {
    "mfow_reachable_mean_s",
    "mfow_reachable_late_mean_s",
    "mfow_reachable_max_s",
    "closed_out_share",
    "closed_out",
    "closures",
}
ON_SOME_GROUND = {"patrolled_vertices", "nodes"}
OTHERS = {"intruders", "refused", "deadlines", "direct", "exit_codes"}
IN_SOME_RUNS = OTHERS | ON_SOME_GROUND | WITH_ZONES | WITH_CLOSURES


def test_every_metric_is_declared_and_computed_in_the_order_of_its_declaration(lab: Lab) -> None:
    world = lab.patrol(ticks=2)
    summary = summary_of(world, lab.run(world))
    assert list(summary) == [key for key, _ in metrics_of(Summary) if key not in IN_SOME_RUNS]
    assert list(summary["messages"]) == [key for key, _ in metrics_of(Messages)]
    assert list(summary["robots"]["r1"]) == [key for key, _ in metrics_of(RobotFigures) if key != "battery"]


def test_percentiles_of_decisions_lie_between_those_next_to_them(lab: Lab) -> None:
    world, journal = lab.driven(ticks=20)
    for k in range(20):
        move(journal, k, 1, decision_ms=float((7 * k) % 20))
    facts = summary_of(world, journal)["robots"][world.bodies[1].spec.name]
    assert (facts["decision_ms_p50"], facts["decision_ms_p99"]) == pytest.approx((9.5, 18.81))


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
    world, journal = lab.driven(ticks=20)
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
    world, journal = lab.driven(ticks=20)
    radius = {spec.number: roaming_radius(spec, world.step) for spec in world.scenario.roster}
    swing = 0.6 * radius[1]
    for k in range(20):
        move(journal, k, 1, x=1.0 + (swing if k // 2 % 2 else 0.0), y=1.0)
        move(journal, k, 3, x=2.0, y=2.0, status=Status.PAUSED if k == 8 else Status.ALIVE)
        move(journal, k, 4, x=1.0 if k < 12 else 19.0, y=14.0 if k < 12 else 1.0)
    robots_of = summary_of(world, journal)["robots"]
    assert (robots_of["r1"]["longest_stay_s"], robots_of["r3"]["longest_stay_s"]) == (9.5, 4.5)
    circle = {"x": pytest.approx(1.0 + swing / 2.0), "y": 1.0, "radius_m": pytest.approx(radius[1])}
    assert robots_of["r1"]["longest_stay"] == {"seconds": 9.5, "since_s": 0.0, **circle}
    assert robots_of["r3"]["longest_stay"]["since_s"] == 5.0
    assert (robots_of["r4"]["longest_stay_s"], robots_of["r4"]["longest_stay"]["since_s"]) == (5.5, 0.0), "not the last"


def test_the_summary_says_where_the_stalest_place_was_and_who_was_near(lab: Lab) -> None:
    world, journal = lab.driven(ticks=20)
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


def test_the_summary_has_the_best_tour(lab: Lab) -> None:
    world, journal = lab.driven(ticks=5)
    verdict = judge(journal, {}, world.prepared)
    summary, _ = summarise(journal, verdict, world.prepared)
    tour = best_tour(world.prepared)
    assert summary.best_tour_m == tour.length_m
    assert summary.best_tour_s == tour.bound_s(dict.fromkeys(range(1, 5), 1.0))
    assert summary.best_tour_s is not None
    assert summary.best_tour_s > 0.0


# --- links and faults ------------------------------------------------------------------------------------------------

TICKS = 20


def traffic_of(lab: Lab, *faults: dict[str, Any]) -> dict[str, Any]:
    result = lab.driven(ticks=TICKS, faults=list(faults))
    assert failures(result) == {}
    return judged.summary_of(result).document()


def test_without_faults_every_link_delivers_everything(lab: Lab) -> None:
    summary = traffic_of(lab)
    whole = {"sent": TICKS, "delivered": TICKS, "dropped": {}, "in_flight": 0}
    names = ["r1", "r2", "r3", "r4"]
    assert summary["links"] == {a: {b: whole for b in names if b != a} for a in names}
    assert summary["faults"] == {}


@pytest.mark.parametrize(
    ("fault", "counts"),
    [
        # Ten ticks long; frames, dropped, delayed, duplicated.
        ({"kind": "loss", "rate": 1.0, "from": "r1", "to": ["r2", "r3"]}, (20, 20, 0, 0)),
        ({"kind": "delay", "delay": {"constant": 0.5}, "from": "r1"}, (30, 0, 30, 0)),
        ({"kind": "delay", "delay": {"constant": 0.1}}, (120, 0, 0, 0)),
        ({"kind": "duplicate", "rate": 1.0, "to": "r4"}, (30, 0, 0, 30)),
        ({"kind": "reorder", "rate": 1.0, "from": "r1", "to": "r2"}, (10, 0, 10, 0)),
        ({"kind": "partition", "groups": [["r1"]]}, (60, 60, 0, 0)),
        ({"kind": "partition", "groups": [["r1"]], "direction": "one-way"}, (30, 30, 0, 0)),
        ({"kind": "silence", "who": "r1", "direction": "in"}, (30, 30, 0, 0)),
        ({"kind": "silence", "who": ["r1", "r2"], "direction": "out"}, (60, 60, 0, 0)),
        ({"kind": "silence", "who": ["r1", "r2"]}, (100, 100, 0, 0)),
        ({"kind": "range", "who": "r1", "reach": 0.001}, (30, 30, 0, 0)),
        ({"kind": "bandwidth", "who": "r1", "bytes_per_s": 0.001}, (30, 18, 0, 0)),
        ({"kind": "spoof", "as": ["r1"], "payload": "random"}, (40, 0, 0, 0)),
        ({"kind": "spoof", "by": "r2", "as": ["r1", "r3"], "payload": "random"}, (80, 0, 0, 0)),
    ],
    ids=lambda value: value["kind"] if isinstance(value, dict) else "",
)
def test_a_faults_frames_and_what_it_did_to_them(
    lab: Lab, fault: dict[str, Any], counts: tuple[int, int, int, int]
) -> None:
    summary = traffic_of(lab, {**fault, "id": "x", "at": 2.0, "for": 5.0})
    told = dict(zip(("frames", "dropped", "delayed", "duplicated"), counts, strict=True))
    assert summary["faults"] == {"x": {"kind": fault["kind"], **told}}
    for row in summary["links"].values():
        for link in row.values():
            assert link["sent"] == link["delivered"] + sum(link["dropped"].values()) + link["in_flight"]
    genuine = [link for name, row in summary["links"].items() if name != "forger" for link in row.values()]
    assert sum(link["sent"] for link in genuine) == 12 * TICKS + told["duplicated"] == summary["messages"]["sent"]


def test_what_is_in_flight_at_the_end_is_told(lab: Lab) -> None:
    summary = traffic_of(lab, {"kind": "delay", "delay": {"constant": 2.0}, "from": "r1", "to": "r2"})
    assert summary["links"]["r1"]["r2"] == {"sent": 20, "delivered": 16, "dropped": {}, "in_flight": 4}
    assert summary["messages"]["in_flight"] == summary["robots"]["r1"]["in_flight"] == 4


def test_forged_frames_are_a_sender_of_their_own(lab: Lab) -> None:
    summary = traffic_of(lab, {"kind": "spoof", "by": "r2", "as": ["r1"], "payload": "random", "for": 5.0})
    heard = {"sent": 10, "delivered": 10, "dropped": {}, "in_flight": 0}
    own = {**heard, "delivered": 0, "dropped": {"own": 10}}
    assert summary["links"]["forger"] == {"r1": heard, "r2": own, "r3": heard, "r4": heard}
    assert summary["messages"]["forged"] == 10


# --- intruders -------------------------------------------------------------------------------------------------------

PLACE = (8.0, 6.0)


def reporting(journal: MemoryJournal, ticks: range, place: tuple[float, float], key: bytes | None = None) -> None:
    """Let the first robot report an intruder in some ticks, and nobody report any in the others."""
    for record in journal.ticks:
        frames = []
        for source, frame in record.frames:
            if decode(frame).robot == CONTACT:
                continue
            frames.append((source, frame))
            if source == 1 and record.k in ticks:
                frames.append((1, encode(Position.of_contact(record.k, 0.5 * record.k, *place), key)))
        journal.records[record.k] = replace(record, frames=tuple(frames))


def standing(journal: MemoryJournal, ticks: range, robots: int, place: tuple[float, float]) -> None:
    """Let the first robots stand beside a place and surround it in some ticks."""
    for k in ticks:
        for number in range(1, robots + 1):
            move(journal, k, number, state=SURROUNDING, x=place[0] + 1.0, y=place[1] - number)


def intruders_of(journal: MemoryJournal, world: World) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = judged.summary_of((world, journal)).document()["intruders"]
    return found


@pytest.mark.parametrize("key", [None, b"fleet"])
def test_an_intruder_is_found_and_surrounded(lab: Lab, key: bytes | None) -> None:
    world, journal = lab.driven(
        ticks=40, intruders=[{"place": [8.0, 6.0], "at": 2, "for": 15}, {"place": [16.0, 12.0]}]
    )
    reporting(journal, range(10, 30), PLACE, key)
    standing(journal, range(12, 14), 1, PLACE)
    standing(journal, range(14, 30), 2, PLACE)
    standing(journal, range(20, 24), 3, PLACE)
    one, other = intruders_of(journal, world)
    times = {"at_s": 2.0, "until_s": 17.0, "first_reported_s": 5.0, "reported_s": 10.0, "surrounded_s": 8.0}
    assert one == {"place_m": [8.0, 6.0], **times, "most_robots": 3}
    assert (other["first_reported_s"], other["surrounded_s"], other["until_s"]) == (None, 0.0, None)


def test_an_intruder_is_there_from_its_time_until_it_goes(lab: Lab) -> None:
    world, journal = lab.driven(ticks=40, intruders=[{"place": [8.0, 6.0], "at": 2, "for": 15}])
    reporting(journal, range(40), PLACE)
    standing(journal, range(40), 2, PLACE)
    (one,) = intruders_of(journal, world)
    assert (one["first_reported_s"], one["reported_s"], one["surrounded_s"]) == (2.0, 15.0, 15.0)


def test_who_comes_to_the_same_place_later_is_another_one(lab: Lab) -> None:
    world, journal = lab.driven(
        ticks=40, intruders=[{"place": [8.0, 6.0], "for": 5}, {"place": [8.0, 6.0], "at": 10, "for": 5}]
    )
    reporting(journal, range(22, 26), PLACE)
    standing(journal, range(15, 30), 4, PLACE)
    one, other = intruders_of(journal, world)
    assert (one["first_reported_s"], one["surrounded_s"]) == (None, 0.0)
    assert (other["first_reported_s"], other["reported_s"], other["surrounded_s"]) == (11.0, 2.0, 5.0)


def test_robots_that_are_dead_far_away_or_patrolling_surround_nobody(lab: Lab) -> None:
    world, journal = lab.driven(ticks=20, intruders=[{"place": [8.0, 6.0]}], patrol={"surround_distance": 2.0})
    standing(journal, range(5, 20), 4, (14.0, 6.0))
    for k in range(5, 10):
        for number in (1, 2, 3, 4):
            move(journal, k, number, x=8.0, y=7.0, status=Status.DEAD)
    (one,) = intruders_of(journal, world)
    assert (one["surrounded_s"], one["most_robots"]) == (0.0, 0)


def test_a_fault_counts_the_robots_that_are_there_in_each_tick(lab: Lab) -> None:
    faults = [{"kind": "loss", "from": "r1", "rate": 0.5}, {"kind": "leave", "who": "r4", "at": 5.0}]
    facts = summary_of(*lab.driven(ticks=20, faults=faults))["faults"]["f1"]
    assert facts["frames"] == 10 * 3 + 10 * 2
