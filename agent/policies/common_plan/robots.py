"""The robots of a common plan, which drive as their bodies do, and what they see.

A planned robot has a body of its own (`agent.bodies`), is told of the other planned robots, and gives way to them. So
true robots that are where the plan has them can do what the planned ones do, and get to the same places.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, cast

from agent.bodies import BODIES
from agent.bodies.setup import BodySetup
from agent.ports import Place
from agent.routes.ground import Ground
from agent.routes.routes import Routes
from agent.view import FogView, View
from patrol.ground.swept_path import advance
from patrol.pose import halted, slowed
from patrol.radio.message import as_received
from patrol.radio.peers import Peer

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from agent.ports import PolicySetup
    from patrol.pose import Command, Pose
    from patrol.random import Purpose
    from patrol.scenario import RobotSpec
    from patrol.zones.ground import SpeedLimits

PACE = 0.99
"""Speed of the planned robots, as a share of the true ones': the rest is for making up for time lost."""


class PlannedRobot:
    """A robot of the plan."""

    def __init__(self, setup: PolicySetup, spec: RobotSpec, pose: Pose, origin: int) -> None:
        """Put a body on the ground as the map has it; ``origin`` is the plan's first tick."""
        self.spec, self.pose, self.heard = spec, pose, as_received(pose)  # and where others hear it
        self.command: Command = halted(spec.model)  # the last one
        self.stand = -1  # the point that it drives to, flat index; -1 for none
        self.look: float | None = None  # in which it faces there, and a holonomic robot already on its way, rad
        self._origin, self._draw = origin, setup.fleet.chance
        self._step, self._width = setup.fleet.step, setup.ground.prepared.terrain.width
        self._slower = replace(spec, speed=PACE * spec.speed)
        prepared, fields = setup.ground.prepared, setup.ground.prepared.fields[spec.number]
        grounds: dict[int, Ground] = setup.ground.scratch.setdefault("grounds of plans", {})
        if id(fields) not in grounds:
            grounds[id(fields)] = Ground(prepared.terrain, fields.reach)
        self._ground = grounds[id(fields)].over()
        self._routes = Routes(self._ground)
        self._radii = setup.fleet.radii
        self._body = BODIES[spec.model](
            BodySetup(
                spec=self._slower,
                radii=self._radii,
                strides={other.number: other.speed * self._step for other in setup.fleet.roster},
                step=self._step,
                patrol=setup.fleet.patrol,
                lengths=prepared.scenario.lengths[spec.number],
                ground=self._ground,
                psi=None,
                chance=self._chance,
                sees_all_round=setup.ground.sight.all_round,
            )
        )

    def choose(self, tick: int, others: Mapping[int, Peer], limits: SpeedLimits, zones: Collection[str]) -> None:
        """Choose the next command on the way to its stand; without one it stands still.

        ``others`` are by number where they are at a tick, and ``zones`` in force limit the speed.
        """
        if self.stand < 0:
            self.command = halted(self.spec.model)
            return
        self._ground.begin(self._body.obstacles(tick, self.pose, False, others))
        view = View(
            tick=tick,
            time_s=tick * self._step,
            pose=self.pose,
            reported=self.heard,
            bumped=False,
            spec=self._slower,
            stride=self._slower.speed * self._step,
            peers=others,
            radii=self._radii,
            contacts=(),
            fog=cast("FogView", None),  # no body looks at it
            ground=self._ground,
            routes=self._routes,
            chance=self._chance,
        )
        spot = self._ground.terrain.centre(*divmod(self.stand, self._width))
        place = Place(*spot, exact=True, gives_room=True, heading=self.look)
        command = self._body.obey(place, view).command
        self.command = slowed(command, limits.at(self.pose.x, self.pose.y, zones))

    def move(self) -> None:
        """Obey the command."""
        self.pose = advance(self.pose, self.command, self._step)
        self.heard = as_received(self.pose)

    @property
    def is_there(self) -> bool:
        """True on the point of its stand."""
        row, col = self._ground.terrain.nearest_point(self.heard.x, self.heard.y)
        return row * self._width + col == self.stand

    def _chance(self, purpose: Purpose, *question: int) -> float:
        return self._draw(self._origin, self.spec.number, int(purpose), *question)
