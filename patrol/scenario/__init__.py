"""The scenario: one file that says everything a run depends on, its faults, and what an operator may change."""

from patrol.scenario.explain import naming
from patrol.scenario.lengths import BodyLengths
from patrol.scenario.load import (
    as_mapping,
    changed_scenario,
    dump_scenario,
    load_scenario,
    open_scenario,
    parse_overrides,
    same_but_for_files,
    scenario_hash,
    scenario_schema,
    with_assumed,
    with_spares,
)
from patrol.scenario.model import Scenario
from patrol.scenario.policies import (
    CommitmentOptions,
    CommittedOptions,
    PatrolOptions,
    PatrolSpec,
    PotentialFieldOptions,
    StochasticOptions,
)
from patrol.scenario.radio_spec import RadioSpec
from patrol.scenario.sections import IntruderSpec, RobotEntry, RobotGroup, RobotSpec, SensorSpec, TerrainSpec
from patrol.values import BUILTINS, MAX_ROBOTS

__all__ = [
    "BUILTINS",
    "MAX_ROBOTS",
    "BodyLengths",
    "CommitmentOptions",
    "CommittedOptions",
    "IntruderSpec",
    "PatrolOptions",
    "PatrolSpec",
    "PotentialFieldOptions",
    "RadioSpec",
    "RobotEntry",
    "RobotGroup",
    "RobotSpec",
    "Scenario",
    "SensorSpec",
    "StochasticOptions",
    "TerrainSpec",
    "as_mapping",
    "changed_scenario",
    "dump_scenario",
    "load_scenario",
    "naming",
    "open_scenario",
    "parse_overrides",
    "same_but_for_files",
    "scenario_hash",
    "scenario_schema",
    "with_assumed",
    "with_spares",
]
