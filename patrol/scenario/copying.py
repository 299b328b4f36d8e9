"""A scenario in a run's folder: all that is needed to run it again, wherever the folder is moved to.

A fleet's key is a secret and is not copied: the scenario goes on naming its file.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import yaml

from patrol.errors import BadInput
from patrol.ground.maps import read_map_file
from patrol.scenario import Scenario, dump_scenario

FILE = "scenario.yaml"
MAP = "map"


def keep_scenario(scenario: Scenario, folder: Path) -> Path:
    """Write the resolved scenario into a folder, with a copy of its map beside it.

    Args:
        scenario: resolved.
        folder: an existing one.

    Returns:
        the scenario's new file.

    Raises:
        BadInput: when the map cannot be read.
        OSError: when the folder cannot be written to.
    """
    path = folder / FILE
    path.write_text(dump_scenario(_with_own_map(scenario, folder / MAP)), encoding="utf-8")
    return path


def _with_own_map(scenario: Scenario, folder: Path) -> Scenario:
    """The scenario with its map copied into `folder`, named relative to the scenario's file."""
    if scenario.terrain.map is None:
        return scenario
    source = read_map_file(scenario.base / scenario.terrain.map)
    folder.mkdir()
    try:
        shutil.copyfile(source.image, folder / source.image.name)
    except OSError as error:
        raise BadInput(f"{source.path}: image = {source.image}: cannot be read ({error.strerror})") from None
    says = {
        "image": source.image.name,
        "resolution": source.resolution,
        "origin": [*source.origin, 0.0],
        "negate": int(source.negate),
        "occupied_thresh": source.occupied_thresh,
        "free_thresh": source.free_thresh,
        "mode": source.mode,
    }
    name = source.path.name
    (folder / name).write_text(yaml.safe_dump(says, sort_keys=False), encoding="utf-8")
    terrain = scenario.terrain.model_copy(update={"map": f"{folder.name}/{name}"})
    return scenario.model_copy(update={"terrain": terrain})
