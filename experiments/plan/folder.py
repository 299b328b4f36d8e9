"""The folder of a plan: its figures, pictures, and the scenarios of its fleets, ready to run.

plan.json            all figures
curve.png, curve.svg the age that fleets keep, over their number of robots
tour.png             the tour that all robots of the chosen fleet share
territories.png      the ground and the tour of each of them
robots-N.yaml        the scenario of a fleet of N robots; `fogwatch run FOLDER/robots-N.yaml` runs it
robots-N-one-dead.yaml, robots-N-PATROL.yaml       the chosen fleet's other runs
map/                 a copy of the map, if there is one
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

from experiments.plan.pictures import curve_figure, territories_picture, tour_picture
from experiments.plan.plan import FleetPlan, plan_facts
from fogwatch.run_folder.runfolder import RUNS, untaken
from monitor.figures.style import write_figure
from patrol.classes.class_file import class_file
from patrol.errors import BadInput
from patrol.files.whole_file import writing
from patrol.scenario import Scenario, as_mapping, dump_scenario, load_scenario
from patrol.scenario.patrols import patrol_name


def plan_folder(out: Path | None, name: str) -> Path:
    """Return the folder for a plan, after checking that it can be written; it is not made yet.

    `out` is new or empty. Without it, the folder is `runs/plan-NAME`, with a number appended if that is taken.
    """
    folder = untaken(RUNS / f"plan-{name}") if out is None else out
    with writing(f"--out {folder}", "choose another folder"):
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise BadInput(f"--out {folder}: is not an empty folder; choose one that is, or that does not exist yet")
        existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
        with tempfile.TemporaryFile(dir=existing):
            pass
    return folder


def write_plan(plan: FleetPlan, folder: Path) -> None:
    """Write all files of a plan."""
    with writing(folder, "choose another --out"):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "plan.json").write_text(f"{json.dumps(plan_facts(plan), indent=1)}\n", encoding="utf-8")
        copied = plan.scenario.with_copies(folder)
        for size in plan.sizes:
            name = f"robots-{size.robots}"
            alone = load_scenario(as_mapping(plan.scenario), {"robots.count": size.robots})
            runs = {
                name: alone if size.simulated is None else size.simulated.scenario,
                f"{name}-one-dead": None if size.one_dead is None else size.one_dead.scenario,
            }
            if (alternative := size.other_patrol) is not None:
                runs[f"{name}-{patrol_name(alternative.scenario.patrol.policy)}"] = alternative.scenario
            for file, scenario in runs.items():
                if scenario is not None:
                    _write_scenario(folder / f"{file}.yaml", scenario, copied)
    write_figure(curve_figure(plan), [folder / "curve.png", folder / "curve.svg"])
    drawn = plan.sizes[-1] if plan.chosen is None else plan.size(plan.chosen)
    if drawn.tour_s is not None:
        tour_picture(plan, drawn, folder / "tour.png")
    if drawn.territories is not None:
        territories_picture(plan, drawn, folder / "territories.png")


def _write_scenario(file: Path, scenario: Scenario, copied: Scenario) -> None:
    """Write a scenario that names the copies of its map and classes."""
    policy = {"policy": copied.patrol.policy} if class_file(scenario.patrol.policy) is not None else {}
    complete = scenario.model_copy(
        update={
            "terrain": copied.terrain,
            "patrol": scenario.patrol.model_copy(update=policy),
            "sensor": copied.sensor,
            "radio": copied.radio,
        }
    )
    file.write_text(dump_scenario(complete), encoding="utf-8")
