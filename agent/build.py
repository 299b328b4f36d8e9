"""Assembly of a mind: belief, policy and body of one robot, from a prepared scenario.

Robots' processes, fleets in one process, tests and benchmarks all come here, so that all of them have the same mind.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from agent.answers import PASSED_ON, failure_of, raised_at
from agent.belief.believed import Area, Beliefs
from agent.belief.blocked import Blocked
from agent.belief.obstacles import BUMPED_S, Obstacles
from agent.belief.posts import Posts
from agent.bodies import BODIES
from agent.bodies.setup import BodySetup
from agent.chance import Chance
from agent.mind import Facts, Mind
from agent.policies.charging import Charging
from agent.policies.found import PolicyKind, policy_of
from agent.policies.surround import Surround
from agent.ports import FleetSetup, GroundSetup, Policy, PolicyFailed, PolicySetup, RobotSetup
from agent.psi import Psi, psi_of
from agent.routes.ground import Ground
from agent.routes.routes import Routes
from agent.sender import Sending
from agent.view import FogView
from patrol.ground.footprint import Footprint
from patrol.measures.zoned import with_rounds
from patrol.prepare import inboxes_of, sensor_footprint
from patrol.radio.peers import Predictor
from patrol.random import Purpose
from patrol.scenario.policies import LEARNED
from patrol.zones.ground import SpeedLimits
from runtime.process.deadline import DECISION_LIMIT_S
from runtime.security.private_files import fleet_key

if TYPE_CHECKING:
    from patrol.ground.fields import StaticFields
    from patrol.ground.terrain import Terrain
    from patrol.prepare import Prepared
    from patrol.scenario import Scenario
    from patrol.scenario.lengths import BodyLengths


class Shared:
    """Values that the minds of one process share, to save time and memory.

    `prepared` is the scenario as prepared, `known` as robots know it, with the rounds that their policy follows.
    """

    def __init__(
        self,
        prepared: Prepared,
        footprint: Footprint | None = None,
        *,
        psi: Psi | None = None,
        believers: Sequence[int] = (),
        kind: PolicyKind | None = None,
    ) -> None:
        """Compute `footprint` and `psi` unless they are given; `kind` is the scenario's policy unless given.

        The robots of the numbers `believers` share what they believe, where that is the same and no ground closes; then
        the caller lets `beliefs` hear for all of them, and then each decide.
        """
        scenario = prepared.scenario
        self.prepared = prepared
        self.key = fleet_key(scenario.radio.key)  # of the fleet's tags, or None
        self.footprint = footprint or sensor_footprint(scenario, prepared.terrain)
        # What the minds believe and have heard; None where each has its own, as in a process.
        self.beliefs: Beliefs | None = None
        if believers and not self.footprint.changes:
            inboxes = inboxes_of(scenario, believers, prepared.terrain.bounds, self.key)
            self.beliefs = Beliefs(inboxes, self.footprint, shares=True)
        self.kind = kind or policy_of(scenario)
        self.known = known_to_robots(with_rounds(prepared) if self.kind.follows_rounds else prepared)
        self.chance = Chance(scenario.seed, self.key)
        self.fleet = fleet_setup(scenario, self.chance)
        self.psi = psi_of(scenario, prepared.terrain) if psi is None else psi
        # By robot number, m: radii, and the longest ways in one step.
        self.radii: Mapping[int, float] = MappingProxyType(self.fleet.radii)
        self.strides = MappingProxyType({spec.number: spec.speed * scenario.step for spec in scenario.roster})
        self.speed_limits = SpeedLimits(scenario.zones, prepared.terrain)
        self.scratch: dict[str, Any] = {}  # working memory of policies, by name
        is_straight = scenario.patrol.paths == "straight"

        @cache
        def posts_of(fields: StaticFields) -> Posts:
            # On straight paths, which know no walls, each point is its own post.
            return Posts(np.full_like(fields.proxy, -1) if is_straight else fields.proxy)

        @cache
        def area_of(fields: StaticFields, dilatation: int) -> Area:
            ground = fields.patrolled if is_straight else fields.reach & fields.patrolled
            is_square = "square-window" in scenario.patrol.paper_rules
            return Area(fields.patrolled, ground, posts_of(fields), dilatation, is_square)

        # Of the bodies with some static fields; the area for a window of some points in each direction, the ground with
        # nothing closed.
        self.posts_of, self.area_of = posts_of, area_of
        self.ground_of = cache(lambda fields: Ground(prepared.terrain, fields.reach))


def known_to_robots(prepared: Prepared) -> Prepared:
    """Leave out what robots do not know: faults, intruders, and which ground closes."""
    return replace(prepared, scenario=prepared.scenario.known_to_robots(), closable={})


def fleet_setup(scenario: Scenario, chance: Chance) -> FleetSetup:
    """Return the part of policies' setups that is the same for the whole fleet."""
    draw = partial(chance.draw, Purpose.PLAN)
    return FleetSetup(scenario.step, scenario.roster, scenario.patrol, scenario.docks, draw)


def build_mind(shared: Shared, number: int, incarnation: int = 1) -> Mind:
    """Put the mind of one robot together; robots and their incarnations are numbered from 1.

    The incarnation is 1 for the robot's first process, and one more for each restart. A policy that cannot be made
    raises `PolicyFailed`.
    """
    prepared, kind = shared.prepared, shared.kind
    scenario, fields = prepared.scenario, prepared.fields[number]
    # On ground that changes each mind has a sensor of its own, on the ground as it believes it.
    sight = sensor_footprint(scenario, prepared.terrain) if scenario.changes_ground else shared.footprint
    terrain = sight.terrain if scenario.changes_ground else prepared.terrain
    patrol, spec = scenario.patrol, scenario.roster[number - 1]
    lengths = scenario.lengths[spec.number].with_options(kind.options)
    chance = shared.chance.of_robot(number, incarnation)
    beliefs = shared.beliefs or Beliefs(inboxes_of(scenario, [number], terrain.bounds, shared.key), sight)
    # What is in a robot's way moves its posts alone.
    posts = shared.posts_of(fields).own()
    belief = beliefs.join(number, shared.area_of(fields, _dilation_points(scenario, terrain, lengths, kind)))
    # Where it changes, the terrain is the mind's own.
    ground = Ground(terrain, fields.reach) if scenario.changes_ground else shared.ground_of(fields).over()
    policy = _policy_of(
        kind,
        PolicySetup(
            RobotSetup(spec, lengths),
            GroundSetup(terrain, fields, posts, sight, shared.known, shared.scratch),
            shared.fleet,
            kind.options,
        ),
        shared.speed_limits,
    )
    body = BODIES[spec.model](
        BodySetup(
            spec=spec,
            radii=shared.radii,
            strides=shared.strides,
            step=scenario.step,
            patrol=patrol,
            lengths=lengths,
            ground=ground,
            psi=shared.psi.get(lengths.refine_reach),
            chance=chance,
            sees_all_round=shared.footprint.all_round,
        )
    )
    patience = math.ceil(scenario.radio.forget_after / scenario.step)
    facts = Facts(
        spec=spec,
        radii=shared.radii,
        step=scenario.step,
        patience=patience,
        memory=math.floor(patrol.contact_memory / scenario.step),
        sending=_make_sending(scenario, prepared.terrain),
        key=shared.key,
        zones=scenario.zones,
        speed_limits=shared.speed_limits,
        limit_s=None if kind.ours else DECISION_LIMIT_S,
    )
    fog = FogView(belief, fields.patrolled, posts)
    memory = math.floor(patrol.blocked_memory / scenario.step)
    first = math.ceil(BUMPED_S / scenario.step)
    obstacles = Obstacles(number, shared.radii, shared.strides, terrain, patience, memory, first)
    # Straight paths and regions know nothing of what is in the way.
    blocked = Blocked(sight, fields, spec.radius, memory, posts) if patrol.paths == "wave" else None
    return Mind(facts, belief, fog, ground, Routes(ground), policy, body, chance, obstacles, blocked)


def _dilation_points(scenario: Scenario, terrain: Terrain, lengths: BodyLengths, kind: PolicyKind) -> int:
    """Return by how many points a mind dilates its belief."""
    if scenario.patrol.needs_rounds or kind.name == LEARNED:
        return 0  # they do not ask for it
    # A window of half the terrain's points in every direction already holds all of it.
    return min(round(lengths.dilatation / scenario.point), terrain.height + terrain.width)


def _policy_of(kind: PolicyKind, setup: PolicySetup, speed_limits: SpeedLimits) -> Policy:
    """Make a policy of a kind, inside `Surround` and, where there are docks, inside `Charging`.

    Only the errors of a policy that is not built in become `PolicyFailed`.
    """
    try:
        policy = Surround(setup, kind.make(setup))
    except PASSED_ON:
        raise
    except BaseException as error:
        if kind.ours:
            raise
        why = f"{failure_of(error)}{raised_at(error)}"
        raise PolicyFailed(f"policy {kind.name}: cannot be made for {setup.robot.spec.name}: {why}") from error
    return Charging(setup, policy, speed_limits) if setup.fleet.docks else policy


def _make_sending(scenario: Scenario, terrain: Terrain) -> Sending:
    """Return how the robots of a scenario send; predictions know the map, and no belief about closed ground."""
    radio, share = scenario.radio, scenario.radio_share
    if radio.adaptive is None:
        return Sending(radio.trail, radio.trail_every, share)
    silence = radio.silence_ticks(scenario.step)
    predictor = Predictor(terrain, radio.trail_every, silence)
    return Sending(radio.trail, radio.trail_every, share, radio.adaptive.error, silence, predictor)
