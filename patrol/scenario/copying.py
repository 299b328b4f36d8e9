"""A scenario in a run's folder: all that is needed to run it again, wherever the folder is moved to.

A fleet's key is a secret and is not copied: the scenario goes on naming its file.
"""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

import yaml

from patrol.classes.class_file import class_file, class_source, file_digest
from patrol.errors import BadInput
from patrol.files.untrusted import IMAGE, read_untrusted
from patrol.maps.map_file import read_map_file
from patrol.scenario import Scenario, dump_scenario
from patrol.scenario.policies import LearnedPatrol, PatrolSpec
from patrol.values import Section

FILE = "scenario.yaml"
MAP = "map"
POLICY = "policy"
SENSOR = "sensor"
MODEL = "model"

AnySection = TypeVar("AnySection", bound=Section)


def keep_scenario(scenario: Scenario, folder: Path) -> Path:
    """Write a resolved scenario with copies of its map, own classes and network, and return its new file.

    The folder must exist. A file that cannot be read raises BadInput, a folder that cannot be written to OSError.
    """
    path = folder / FILE
    path.write_text(dump_scenario(with_copies(scenario, folder)), encoding="utf-8")
    return path


def with_copies(scenario: Scenario, folder: Path) -> Scenario:
    """Copy a scenario's map, own classes and trained network into a folder.

    The scenario returned names the copies relative to the folder, which must exist and have no such copies yet. A file
    that cannot be read raises BadInput, a folder that cannot be written to OSError.
    """
    own = _with_own_map(scenario, folder / MAP)
    return own.model_copy(
        update={
            "patrol": _with_own_weights(_with_own_class(own.patrol, "patrol.policy", folder / POLICY), folder / POLICY),
            "sensor": _with_own_class(own.sensor, "sensor.kind", folder / SENSOR),
            "radio": _with_own_class(own.radio, "radio.model", folder / MODEL),
        }
    )


def _with_own_class(section: AnySection, named: str, folder: Path) -> AnySection:
    """Copy the file of the class that a section names into `folder`; name it relative to the scenario's file."""
    field = named.rpartition(".")[2]
    text = getattr(section, field)
    source = class_file(text)
    if source is None:
        return section
    if getattr(section, f"{field}_sha256") not in (None, file_digest(source, named)):
        raise BadInput(f"{source}: has changed since the scenario was loaded; start again")
    folder.mkdir()
    (folder / source.name).write_bytes(class_source(source, named))
    return section.model_copy(update={field: f"./{folder.name}/{source.name}:{text.rpartition(':')[2]}"})


def _with_own_weights(section: PatrolSpec, folder: Path) -> PatrolSpec:
    """Copy the file of the trained network that a section names into `folder`, likewise."""
    if not isinstance(section, LearnedPatrol) or section.options.weights is None:
        return section
    source = Path(section.options.weights)
    content = section.options.read_weights()
    folder.mkdir()
    (folder / source.name).write_bytes(content)
    options = section.options.model_copy(update={"weights": f"./{folder.name}/{source.name}"})
    return section.model_copy(update={"options": options})


def _with_own_map(scenario: Scenario, folder: Path) -> Scenario:
    """Copy a scenario's map into `folder`; name it relative to the scenario's file."""
    if scenario.terrain.map is None:
        return scenario
    source = read_map_file(scenario.base / scenario.terrain.map)
    folder.mkdir()
    try:
        image = read_untrusted(source.image, IMAGE)
    except OSError as error:
        raise BadInput(f"{source.path}: image = {source.image}: cannot be read ({error.strerror})") from None
    (folder / source.image.name).write_bytes(image)
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
