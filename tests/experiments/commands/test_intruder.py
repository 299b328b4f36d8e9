"""Intruder games from the command line, on the ground and on a graph, and tables of the graph's visits."""

from __future__ import annotations

import json
import re
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fogwatch
from experiments.intruders.infiltrator import Infiltrator
from experiments.intruders.on_run import games_of
from experiments.intruders.report_section import play_on
from monitor.replay.replay import Replay
from monitor.replay.run import open_run
from patrol.errors import BadInput
from tests.command_line import Command, output, refuses

GRAPH = {"vertices": [[10, 10], [30, 10], [60, 60]], "edges": [[0, 1, 20], [1, 2, 60]]}
SCENARIO = {
    "name": "watched",
    "terrain": {"builtin": "open", "graph": GRAPH},
    "point": 1.0,
    "duration": 60,
    "robots": {"count": 2, "model": "holonomic", "starts": [[10, 10], [50, 44]]},
    "patrol": {"policy": "cr"},
}


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fogwatch.run(SCENARIO, out=tmp_path_factory.mktemp("run") / "watched", picture=False).folder


def test_it_prints_the_shares_of_each_intruder(ran: Path, run: Command) -> None:
    said = output(run("intruder", ran, "--attacks", "2,10"))
    assert "points of the ground" in said
    assert "3 vertices of the graph" in said
    games = json.loads(output(run("intruder", ran, "--attacks", "2,10", "--json")))
    assert [share["attack_s"] for share in games["ground"]] == [2.0, 10.0]
    assert games["vertices"] == 3
    # Longer attacks succeed less often.
    assert games["ground"][0]["random"] >= games["ground"][1]["random"]
    assert 0.0 <= games["nodes"][1]["random"] <= games["nodes"][0]["random"] <= 1.0


def test_points_are_seen_when_they_are_in_view(ran: Path) -> None:
    """The random intruder against the replayed fog: nobody looks at a point until the attack is over."""
    run = open_run(ran)
    patrolled = np.flatnonzero(run.prepared.patrolled)
    chosen = patrolled[:: -(-len(patrolled) // 2000)]
    replay = Replay(run)
    seen = np.array([replay.fog(k).last_seen.reshape(-1)[chosen] for k in range(run.ticks)])
    # Seen in none of the four ticks after t: last seen, at tick t + 4, at t or before.
    expected = np.mean(seen[4:] <= np.arange(run.ticks - 4)[:, None])
    (found,) = games_of(run, [2.0]).ground
    assert found.random == pytest.approx(expected)


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that is long enough for a moving intruder that plans over 20 s."""
    zone = {"name": "vault", "polygon": [[40, 40], [50, 40], [50, 50]], "weight": 2}
    scenario = {**SCENARIO, "point": 2.0, "duration": 400, "zones": [zone], "patrol": {}}
    folder = tmp_path_factory.mktemp("run") / "long"
    return fogwatch.run(scenario, out=folder, picture=False, report=False, recording=False).folder


MOVING = ("--within", "20", "--stay", "5", "--speed", "4", "--attempts", "20")


def test_the_moving_intruder_gets_a_table_of_its_own(watched: Path, run: Command) -> None:
    shown = output(run("intruder", watched, *MOVING, "--depth", "15"))
    assert "a moving intruder gets in, 20 attempts" in shown
    assert "gain of watching" in shown
    assert "targets at least 15 m inside, points of 2 m" in shown
    where = ("--again", "--entries", "0,0 99,0 99,9", "--zone", "vault", "--json")
    moving = json.loads(output(run("intruder", watched, *MOVING, *where)))["moving"]
    assert set(moving["once"]) == {"future", "watching", "picture", "blind"}
    assert set(moving["again"]) == {"watching"}
    shares = [*moving["once"].values(), *moving["again"].values()]
    assert all(0.0 <= share["low"] <= share["percent"] <= share["high"] <= 100.0 for share in shares)
    watching, blind = (moving["once"][name]["percent"] for name in ("watching", "blind"))
    assert moving["gain"]["watching"]["percent"] == pytest.approx(watching - blind)
    settings: dict[str, Any] = {"within_s": 20.0, "stay_s": 5.0, "speed": 4.0, "attempts": 20, "zone": "vault"}
    played = fogwatch.load(watched).infiltration(**settings, entries=[(0, 0), (99, 0), (99, 9)])
    assert asdict(played)["once"] == moving["once"]
    with pytest.raises(BadInput, match="depth: the moving intruder has no such setting; did you mean depth_m"):
        fogwatch.load(watched).infiltration(depth=3.0)


def test_an_intruder_with_the_code_simulates_the_run(watched: Path, run: Command) -> None:
    shown = output(run("intruder", watched, *MOVING[:-1], "2", "--code"))
    assert "has the scenario and the code" in shown
    settings: dict[str, Any] = {"within_s": 20.0, "stay_s": 5.0, "speed": 4.0, "attempts": 2}
    played = fogwatch.load(watched).infiltration(code=True, **settings)
    assert played.gain.code is not None
    assert played.gain.code.percent == played.once["code"].percent - played.once["blind"].percent
    assert f"gain of scenario and code, likewise {played.gain.code.percent:.0f} (" in " ".join(shown.split())


def test_a_report_shows_an_attempt_that_succeeds_and_one_that_does_not(watched: Path) -> None:
    run = open_run(watched)
    moving = play_on(run, Infiltrator(speed=4.0, within_s=20.0, stay_s=5.0, attempts=40))
    assert [attempt.succeeded for attempt in moving.examples] == [True, False]
    titles = [axes.get_title(loc="left") or axes.get_title() for axes in moving.chart(run).axes]
    assert [title.split(":")[0] for title in titles] == ["gets in", "fails"]
    assert re.search("<td[^>]*>gain of watching", moving.table())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "the run has 60 s, and a moving intruder, which watches and then plans over 120 s, needs 600 s"),
        (["--code"], "the run has 60 s, and a moving intruder, which"),
        (["--again", "--speed", "3"], "the run has 60 s, and a moving intruder, which"),
        (["--within", "5"], "--stay 10: does not fit into 5 s"),
        (["--entries", "0,0 9,9"], "--entries 0,0 9,9: expected edge, doors, or three corners or more"),
        (["--zone", "hall"], "zone hall: there is no such zone; this scenario has none"),
        *((["--attacks", attacks], "expected seconds above 0") for attacks in ("", "x", "5,-1", "nan", "1e9")),
    ],
)
def test_intruders_that_cannot_be_are_one_line(ran: Path, run: Command, options: list[str], message: str) -> None:
    said = run("intruder", ran, *options)
    assert said.code == (2 if options else 0)
    assert message in said.err


def test_without_a_graph_the_vertices_are_those_made_from_the_ground(tmp_path: Path, run: Command) -> None:
    scenario = {**SCENARIO, "terrain": {"builtin": "open"}, "duration": 10}
    folder = fogwatch.run(scenario, out=tmp_path / "no-graph", picture=False).folder
    assert (
        json.loads(output(run("intruder", folder, "--json")))["vertices"]
        == open_run(folder).prepared.make_graph().size
        > 3
    )


def test_the_tables_of_patrolling_sim_are_written(ran: Path, run: Command, tmp_path: Path) -> None:
    """Robot 1 begins on vertex 0; the tables agree with the summary."""
    shown = output(run("report", ran, "--out", tmp_path / "report.html", "--csv", tmp_path / "tables"))
    assert "idleness.csv, timeresults.csv, info.csv" in shown
    nodes = json.loads((ran / "summary.json").read_text(encoding="utf-8"))["nodes"]
    visits, times, info = (
        [line.split(";") for line in (tmp_path / "tables" / f"{name}.csv").read_text(encoding="utf-8").splitlines()]
        for name in ("idleness", "timeresults", "info")
    )
    assert visits[0] == ["Time", "Robot", "Node", "Idleness", "Interferences"]
    seen_once = nodes["vertices"] - len(nodes["unvisited"])
    assert len(visits) - 1 == nodes["visits"] - seen_once > 0
    assert {row[1] for row in visits[1:]} <= {"0", "1"}
    assert times[0] == ["Time", "Idleness min", "Idleness avg", "Idleness stddev", "Idleness max", "Interferences"]
    numbers = (nodes["return_s"][0], nodes["return_mean_s"], nodes["return_deviation_s"], nodes["return_s"][-1])
    spread = [f"{number:.1f}" for number in numbers]
    assert times[1:] == [["60.0", *spread, str(nodes["interference"])]]
    assert len(info) == 1
    assert len(info[0]) == 22
    assert (info[0][0], info[0][1], info[0][6], info[0][10], info[0][13]) == ("open", "2", "cr", "60.0", "TIMEOUT")
    assert info[0][14:19] == [*spread, f"{nodes['interference_per_min']:.2f}"]
    assert info[0][19] == str(len(visits) - 1)


def test_tables_need_a_graph(run: Command, tmp_path: Path) -> None:
    scenario = {"terrain": {"builtin": "open"}, "point": 1.0, "duration": 1}
    folder = fogwatch.run(scenario, out=tmp_path / "run", picture=False).folder
    refuses(run("report", folder, "--csv", tmp_path / "tables"), "has no terrain.graph")
    assert not (tmp_path / "tables").exists()
