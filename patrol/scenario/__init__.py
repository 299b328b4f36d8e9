"""The scenario: one file that says everything a run depends on, its faults, and what an operator may change."""

from patrol.scenario.lengths import BodyLengths, lengths_by_robot, lengths_of
from patrol.scenario.load import (
    as_mapping,
    dump_scenario,
    load_scenario,
    map_digest,
    open_scenario,
    parse_overrides,
    same_but_for_files,
    scenario_hash,
    scenario_schema,
    with_spares,
)
from patrol.scenario.model import (
    IntruderSpec,
    PatrolSpec,
    RobotEntry,
    RobotGroup,
    Scenario,
    SensorSpec,
    TerrainSpec,
)
from patrol.scenario.radio_spec import RadioSpec, share_of
from patrol.scenario.robots import RobotSpec
from patrol.values.types import BUILTINS, MAX_ROBOTS

__all__ = [
    "BUILTINS",
    "MAX_ROBOTS",
    "BodyLengths",
    "IntruderSpec",
    "PatrolSpec",
    "RadioSpec",
    "RobotEntry",
    "RobotGroup",
    "RobotSpec",
    "Scenario",
    "SensorSpec",
    "TerrainSpec",
    "as_mapping",
    "dump_scenario",
    "lengths_by_robot",
    "lengths_of",
    "load_scenario",
    "map_digest",
    "open_scenario",
    "parse_overrides",
    "same_but_for_files",
    "scenario_hash",
    "scenario_schema",
    "share_of",
    "with_spares",
]
