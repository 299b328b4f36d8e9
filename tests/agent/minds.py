"""Minds for tests: scenarios prepared on small terrains, and what robots sense on them."""

from __future__ import annotations

from collections.abc import Sequence

from agent.belief.dilated import Posts
from agent.build import fleet_setup
from agent.chance import Chance
from agent.policies.found import policy_of
from agent.ports import GroundSetup, PolicySetup, RobotSetup
from patrol.exchange import Sensed
from patrol.ground.fields import compute_fields
from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.prepare import Prepared, sensor_footprint
from patrol.scenario import Scenario

STEP = 0.5


def prepared_on(scenario: Scenario, terrain: Terrain, starts: Sequence[Pose]) -> Prepared:
    """A scenario on another terrain than its own; robots of 1 m radius reach what they reach from the starts."""
    fields = compute_fields(terrain, 1.0, scenario.sensor.range, True, list(starts))
    all_starts = (*starts, *[starts[-1]] * (len(scenario.roster) - len(starts)))
    return Prepared(scenario, terrain, all_starts, {spec.number: fields for spec in scenario.roster})


def at(k: int, pose: Pose, bumped: bool = False, contacts: tuple[tuple[float, float], ...] = ()) -> Sensed:
    """The senses of a robot with a true clock at tick k."""
    return Sensed(k, pose, bumped, contacts, k * STEP)


def setup_of(prepared: Prepared, number: int = 1) -> PolicySetup:
    """The setup of one robot's policy."""
    scenario, fields = prepared.scenario, prepared.fields[number]
    spec = scenario.roster[number - 1]
    sight = sensor_footprint(scenario, prepared.terrain)
    return PolicySetup(
        RobotSetup(spec, scenario.lengths[number]),
        GroundSetup(prepared.terrain, fields, Posts(fields.proxy), sight, prepared),
        fleet_setup(scenario, Chance(scenario.seed)),
        policy_of(scenario).options,
    )
