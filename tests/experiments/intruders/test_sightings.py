"""Sightings written down for the moving intruder: on which runs, where it enters, and what it wants."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.intruders.game import Game
from experiments.intruders.infiltrator import Infiltrator
from experiments.intruders.sightings import Sightings
from patrol.errors import BadInput
from patrol.pose import Pose
from patrol.prepare import prepare, sensor_footprint
from patrol.scenario import load_scenario

OFFICE = Path(__file__).resolve().parents[3] / "examples" / "maps" / "office.yaml"


def game(infiltrator: Infiltrator, **scenario: Any) -> Game:
    """The game on a run of 400 ticks of 1 s in which a robot goes to and fro in the corridor of the office."""
    robots = {"count": 1, "model": "holonomic", "radius": 0.2}
    fields = {"terrain": {"map": str(OFFICE)}, "point": 0.2, "step": 1.0, "robots": robots, **scenario}
    prepared = prepare(load_scenario(fields))
    sightings = Sightings(prepared, sensor_footprint(prepared.scenario, prepared.terrain), None, 400, infiltrator)
    for k in range(400):
        sightings.look(k, [(1, Pose(2.0 + abs(20.0 - k % 40), 6.8, 0.0))])
    return sightings.game()


def test_it_enters_at_the_doors_between_rooms() -> None:
    played = game(Infiltrator(within_s=15.0, entries="doors"))
    ground = played.watch.ground
    assert 3 <= np.count_nonzero(ground.entries) < 20
    assert (ground.depths_m[played.targets] >= played.depth_m).all()


def test_its_targets_are_in_a_zone() -> None:
    zone = {"name": "vault", "polygon": [[2, 6], [5, 6], [5, 7.6], [2, 7.6]], "weight": 2}
    played = game(Infiltrator(within_s=15.0, zone="vault"), zones=[zone])
    ground = played.watch.ground
    assert played.targets.size
    assert (ground.cols[played.targets] * 0.2 < 6.0).all()
    with pytest.raises(BadInput, match="zone valt: there is no such zone; did you mean vault"):
        game(Infiltrator(within_s=15.0, zone="valt"), zones=[zone])


TERRAIN = {"map": str(OFFICE), "graph": {"vertices": [[2, 6.8], [4, 6.8]], "edges": [[0, 1, 2]]}}


@pytest.mark.parametrize(
    ("scenario", "message"),
    [
        ({"sensor": {"quality": 0.5}}, "leaves some of a point's age"),
        (
            {"robots": {"count": 1, "spare": 200, "model": "holonomic", "radius": 0.1}},
            "has 201 robots, and at most 200 can be watched",
        ),
        ({"terrain": {**TERRAIN, "patrolled": "vertices"}}, "only the vertices of a graph are patrolled"),
    ],
)
def test_where_it_cannot_be_played_one_line_says_why(scenario: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        game(Infiltrator(within_s=15.0), **scenario)


def test_entries_that_are_not_on_the_ground_are_none() -> None:
    says = "finds no entry: there is no patrolled ground in the polygon; choose other entries"
    with pytest.raises(BadInput, match=says):
        game(Infiltrator(within_s=15.0, entries=[(900.0, 900.0), (901.0, 900.0), (901.0, 901.0)]))
