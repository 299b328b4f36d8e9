"""The map check's lines about closures."""

from __future__ import annotations

from fogwatch.grounds.scenario_notes import closure_lines
from patrol.prepare import prepare
from patrol.scenario import load_scenario


def test_each_closure_says_what_it_closes_out_and_whom_it_shuts_in() -> None:
    robots = {"count": 2, "model": "holonomic", "radius": 0.4, "starts": [[8, 10], [8, 60]]}
    apart = robots | {"starts": [[8, 10], [80, 60]]}
    wall = {"name": "wall", "polygon": [[50, 0], [51, 0], [51, 88], [50, 88]], "closed": [[10, 20]]}
    pen = {"name": "pen", "polygon": [[0, 20], [20, 20], [20, 0], [21, 0], [21, 21], [0, 21]], "closed": [[10, 20]]}
    given = {"terrain": {"builtin": "open"}, "point": 1.0, "robots": robots, "closures": [wall, pen]}
    head, about_wall, about_pen = closure_lines(prepare(load_scenario(given)))
    assert head == "closures: 2"
    assert about_wall.startswith("  wall: 88.0 m², ")
    assert float(about_wall.split("closes out ")[1].split()[0]) > 4000.0
    assert about_pen.endswith("shuts in r1 at the start")
    # Robots on both sides: what lies behind the wall is said all the same.
    _, about_wall, _ = closure_lines(prepare(load_scenario(given | {"robots": apart})))
    assert float(about_wall.split(" m² behind")[0].split()[-1]) > 4000.0
    assert "closes out 88.0 m² from the starts, as robots start on both sides" in about_wall
