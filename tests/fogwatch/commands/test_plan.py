import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from patrol.measures.best_tour import best_tour
from patrol.prepare import prepare
from patrol.scenario import load_scenario
from runtime.process.lifeline import Ending
from tests.cells import write_cells
from tests.command_line import Command, output, refuses

BODY = ["--model", "holonomic", "--radius", "0.3", "--speed", "1", "--point", "0.5", "--sensor-range", "4"]


@pytest.fixture(autouse=True)
def signals_are_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """The command heeds signals for the rest of its process, which here is that of all tests."""
    monkeypatch.setattr("fogwatch.commands.plan.heed", lambda *_, **__: Ending())
    monkeypatch.setenv("COLUMNS", "120")


@pytest.fixture
def rooms(tmp_path: Path) -> str:
    """A map of two rooms of 10 x 10 m with a door 2 m wide."""
    return str(write_cells(tmp_path, "rooms", walls()))


def walls(door: bool = True) -> NDArray[np.bool_]:
    occupied = np.zeros((22, 43), dtype=np.bool_)
    occupied[[0, -1]] = occupied[:, [0, 21, -1]] = True
    occupied[9:13, 21] = not door
    return occupied


def test_a_quick_plan_has_tours_and_pictures_and_simulates_nothing(rooms: str, run: Command, tmp_path: Path) -> None:
    shown = run("plan", rooms, "--robots", "1-3", "--quick", *BODY)
    assert shown.code == 0
    folder = tmp_path / "runs" / "plan-rooms"
    assert "files: runs/plan-rooms" in shown.out
    assert "3 robots: tours ..." in shown.err
    drawn = {"curve.png", "curve.svg", "tour.png", "territories.png"}
    files = {path.name for path in folder.iterdir()}
    assert files == drawn | {"plan.json", "map", "robots-1.yaml", "robots-2.yaml", "robots-3.yaml"}
    for name in drawn - {"curve.svg"}:
        with Image.open(folder / name) as picture:
            assert np.unique(np.asarray(picture.convert("L"))).size > 10
    facts = json.loads((folder / "plan.json").read_text())
    assert [size["robots"] for size in facts["sizes"]] == [1, 2, 3]
    for size in facts["sizes"]:
        scenario = load_scenario(folder / f"robots-{size['robots']}.yaml")
        assert len(scenario.roster) == size["robots"]
        tours = best_tour(prepare(scenario))
        assert size["tour_m"] == tours.length_m
        assert size["tour_s"] == tours.bound_of_fleet_s(scenario)
        assert size["own_tours_s"] == max(size["own_tours_m"])
        assert size["simulated"] is None


def test_a_plan_says_for_how_much_of_the_time_robots_with_a_battery_patrol(rooms: str, run: Command) -> None:
    docks = ["--set", "docks=[{place: [2, 2]}]"]
    battery = ["--set", "robots.battery={capacity: 30, idle: 10, drive: 30, charge: 130}"]
    for given, said in ((battery, False), ([*docks, *battery], True)):
        shown = output(run("plan", rooms, "--robots", "3", "--quick", *BODY, *given, "--out", f"plan-{said}"))
        # 120 W to charge, 40 W on patrol.
        line = "batteries: on patrol for 75 % of the time; of 3 robots, 2 at a time"
        assert (line in shown) is said


def test_a_plan_names_a_number_and_its_scenarios_repeat_the_runs(rooms: str, run: Command, tmp_path: Path) -> None:
    out = tmp_path / "plan"
    shown = output(run("plan", rooms, "--age", "40", "--duration", "120", "--seeds", "2", *BODY, "--out", str(out)))
    facts = json.loads((out / "plan.json").read_text())
    chosen = next(size for size in facts["sizes"] if size["robots"] == facts["robots"])
    assert chosen["simulated"]["keeps"] is True
    assert chosen["simulated"]["max_s"] <= 40.0
    assert (
        "given: holonomic, radius 0.3 m, speed 1 m/s, sensor of 4 m (all round, stopped by walls), points of " in shown
    )
    assert "assumed: steps of 0.5 s (auto)" in shown
    keep = f"keep{'s' if facts['robots'] == 1 else ''} 40 s: kept by 2 of 2 seeds"
    assert f"{keep}; in the worst run largest {chosen['simulated']['max_s']:.1f} s" in shown
    for size in facts["sizes"]:
        if size["robots"] == facts["robots"] - 1 and size["simulated"]:
            assert size["simulated"]["max_s"] > 40.0
    for file, key in (("", "simulated"), ("-tour", "other_patrol")):
        again = tmp_path / f"again{file}"
        scenario = str(out / f"robots-{facts['robots']}{file}.yaml")
        options = ["--in-process", "--quiet", "--no-picture", "--no-recording", "--no-report"]
        output(run("run", scenario, *options, "--out", again))
        assert json.loads((again / "summary.json").read_text())["trace_hash"] == chosen[key]["trace_hash"]


def test_an_age_that_no_number_keeps_is_told_with_a_remedy(rooms: str, run: Command) -> None:
    said = run("plan", rooms, "--age", "1", "--robots", "1-2", "--quick", *BODY)
    assert said.code == 1
    assert "answer: none of these numbers of robots keeps 1 s" in said.out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--age", "0"], "--age = 0: expected a finite number above 0, in s"),
        (["--robots", "3-1"], "--robots 3-1: expected a number or two with a hyphen, 1 to 24, such as 1-8"),
        ([], "--age or --robots: one is needed"),
        (["--age", "9", "--quick", "--duration", "60"], "--duration 60: has no effect with --quick"),
        (["--age", "9", "--model", "holonomic", "--turning-radius", "3"], "--turning-radius 3: has an effect only on"),
        (["--age", "9", "--seeds", "0"], "--seeds 0: expected a number of runs from 1 to 100"),
        (["--age", "9", "--out", "taken"], "--out taken: is not an empty folder"),
    ],
)
def test_what_cannot_be_planned_is_refused(words: list[str], message: str, run: Command, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file")
    refuses(run("plan", "yards", *words), message)


def test_an_interrupted_plan_is_gone(rooms: str, run: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("fogwatch.planning.plan.run_in_process", interrupt)
    assert run("plan", rooms, "--robots", "1", *BODY).code == 130
    assert not (tmp_path / "runs").exists()


def test_ground_without_a_way_to_it_is_named_in_plan_and_check(rooms: str, run: Command, tmp_path: Path) -> None:
    write_cells(tmp_path, "rooms", walls(door=False))
    words = "left out: 100 m² of free ground, which no robot sees; it is around (15.75, 5.25), walled off"
    shown = run("plan", rooms, "--robots", "1", "--quick", *BODY)
    assert shown.code == 0
    assert words in " ".join(shown.out.split())
    before, _, _ = shown.err.partition("1 robot: tours ...")  # before anything is computed
    assert f"warning: {words}" in before
    assert "to patrol it too, start a robot there, as with --start 15.75,5.25" in before
    assert shown.err.count("warning: left out") == 1
    (size,) = json.loads((tmp_path / "runs" / "plan-rooms" / "plan.json").read_text())["sizes"]
    assert size["left_out"]["area_m2"] == 100.0
    assert "warning: left out: 100 m² of free ground" in output(
        run("scenario", "check", rooms, "--set", "robots.radius=0.3", "--set", "robots.model=holonomic")
    )
