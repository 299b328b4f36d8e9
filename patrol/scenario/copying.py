"""A scenario in a run's folder: all that is needed to run it again, wherever the folder is moved to.

A fleet's key is a secret and is not copied: the scenario goes on naming its file.
"""

from __future__ import annotations

from pathlib import Path

import yaml

from patrol.errors import BadInput
from patrol.ground.map_file import read_map_file
from patrol.scenario import Scenario, dump_scenario
from patrol.scenario.policy_file import policy_digest, policy_file, policy_source
from patrol.untrusted import IMAGE, read_untrusted

FILE = "scenario.yaml"
MAP = "map"
POLICY = "policy"


def keep_scenario(scenario: Scenario, folder: Path) -> Path:
    """Write the resolved scenario into a folder, with copies of its map and its policy's file beside it.

    Args:
        scenario: Resolved.
        folder: An existing one.

    Returns:
        The scenario's new file.

    Raises:
        BadInput: When one of them cannot be read.
        OSError: When the folder cannot be written to.
    """
    path = folder / FILE
    own = _with_own_policy(_with_own_map(scenario, folder / MAP), folder / POLICY)
    path.write_text(dump_scenario(own), encoding="utf-8")
    return path


def _with_own_policy(scenario: Scenario, folder: Path) -> Scenario:
    """The scenario with its policy's file copied into `folder`, named relative to the scenario's file."""
    source = policy_file(scenario.patrol.policy)
    if source is None:
        return scenario
    digest = policy_digest(source)
    if scenario.patrol.policy_sha256 not in (None, digest):
        raise BadInput(f"{source}: has changed since the scenario was loaded; start again")
    folder.mkdir()
    (folder / source.name).write_bytes(policy_source(source))
    name = scenario.patrol.policy.rpartition(":")[2]
    patrol = scenario.patrol.model_copy(update={"policy": f"./{folder.name}/{source.name}:{name}"})
    return scenario.model_copy(update={"patrol": patrol})


def _with_own_map(scenario: Scenario, folder: Path) -> Scenario:
    """The scenario with its map copied into `folder`, named relative to the scenario's file."""
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
