"""Minds for tests: scenarios prepared on small terrains, and what robots sense on them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agent.belief.posts import Posts
from agent.build import fleet_setup
from agent.chance import Chance
from agent.policies.found import policy_of
from agent.policies.potential_field import Field, Pull
from agent.ports import GroundSetup, PolicySetup, RobotSetup
from agent.routes.ground import Ground
from agent.routes.path_window import CENTRE, Aside
from patrol.exchange import Sensed
from patrol.ground.fields import StaticFields, compute_fields
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.pose import Pose
from patrol.prepare import Prepared, closable_ground, sensor_footprint
from patrol.scenario import PotentialFieldOptions, Scenario

STEP = 0.5


def prepared_on(scenario: Scenario, terrain: Terrain, starts: Sequence[Pose]) -> Prepared:
    """A scenario on another terrain than its own; robots of 1 m radius reach what they reach from the starts."""
    fields = compute_fields(terrain, 1.0, scenario.sensor.range, True, list(starts))
    all_starts = (*starts, *[starts[-1]] * (len(scenario.roster) - len(starts)))
    return Prepared(
        scenario,
        terrain,
        all_starts,
        {spec.number: fields for spec in scenario.roster},
        closable_ground(scenario, terrain),
    )


def at(k: int, pose: Pose, bumped: bool = False, contacts: tuple[tuple[float, float], ...] = ()) -> Sensed:
    """The senses of a robot with a true clock at tick k."""
    return Sensed(k, pose, bumped, contacts, k * STEP)


def fields_of(free: BoolGrid) -> StaticFields:
    """Fields of ground on which a body fits and patrols wherever it is free."""
    return StaticFields(free, free, free, np.full(free.shape, -1, dtype=np.int32))


def pull_on(
    fields: StaticFields,
    start: tuple[int, int],
    seen: NDArray[np.int32],
    *,
    dilated: NDArray[np.int32] | None = None,
    rivals: Sequence[tuple[int, int]] = (),
    looked: NDArray[np.int32] | None = None,
    ground: Ground | None = None,
    tick: int = 100,
    mfow: int = 100,
    aside: Aside = CENTRE,
    key: int = 0,
    **options: Any,
) -> Pull:
    """The pull on a robot at a framed point of ground with points of 0.5 m, by when each was last seen."""
    field = Field(PotentialFieldOptions.model_validate(options), fields, Posts(fields.proxy), 0.5, {})
    ground = ground or Ground(Terrain("field", fields.cspace, 0.5), fields.reach)
    spread = seen if dilated is None else dilated
    return field.pull(ground, *start, seen, lambda _: spread, tick, mfow, rivals, looked, aside, key)


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
