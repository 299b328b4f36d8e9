"""One robot's mind: belief, policy and body, once a tick (paper, "Final algorithm").

Pure: no clock, no I/O, no randomness but draws from (seed, robot, incarnation, tick). `agent.build` puts one together.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from agent.answers import PASSED_ON, checked, failure_of
from agent.belief.believed import Belief
from agent.belief.blocked import Blocked
from agent.belief.obstacles import Obstacles
from agent.chance import Draw
from agent.ports import Body, Decision, Place, Policy, PolicyFailed
from agent.routes.ground import Ground
from agent.routes.routes import Routes
from agent.sender import Sender, Sending
from agent.view import FogView, View
from patrol.exchange import Sensed
from patrol.ground.own_place import OwnPlace
from patrol.ground.swept_path import advance
from patrol.pose import Command, Pose, halted, slowed
from patrol.radio.message import MAX_CONTACTS, Position, as_received
from patrol.scenario import RobotSpec
from patrol.zones.ground import SpeedLimits
from patrol.zones.spec import Weighing, ZoneSpec, weighing_at, zones_in_force


@dataclass(frozen=True, slots=True)
class Facts:
    """Facts that a mind knows of its fleet and itself, and that never change."""

    spec: RobotSpec
    radii: Mapping[int, float]  # of all robots, by number, m
    step: float  # s per tick
    patience: int  # ticks of silence after which a robot is no longer counted on
    memory: int  # ticks for which an intruder is remembered after its last report
    sending: Sending
    key: bytes | None  # of the fleet's tags, or None
    zones: Sequence[ZoneSpec]
    speed_limits: SpeedLimits  # of the slow zones among them
    limit_s: float | None  # wall time after which a decision counts as failed; None for a policy that is built in


class Mind:
    """Call `frames` with the senses of tick k, then `step` with the frames heard; once each, k counting up."""

    def __init__(
        self,
        facts: Facts,
        belief: Belief,
        fog: FogView,
        ground: Ground,
        routes: Routes,
        policy: Policy,
        body: Body,
        chance: Draw,
        obstacles: Obstacles,
        blocked: Blocked | None = None,
    ) -> None:
        """Put the parts together that `agent.build` has made; `blocked` is None on straight or regional paths."""
        self.facts = facts
        self.spec = facts.spec
        self.belief = belief
        self.policy = policy
        self.body = body
        self._fog = fog
        self._ground = ground
        self._routes = routes
        self._chance = chance
        self._obstacles = obstacles
        self._last: Command = halted(facts.spec.model)
        self._own_place = OwnPlace(facts.step)
        self._elsewhere: Collection[int] = ()
        self.blocked = blocked
        self._sender = Sender(facts.spec.number, facts.sending, facts.key)

    def locate(self, sensed: Sensed) -> Sensed:
        """Return a tick's senses with the pose that the robot believes; once a tick, before all else."""
        return replace(sensed, pose=self._own_place.take(sensed.k, sensed.pose, self._last, sensed.bumped))

    def frames(self, sensed: Sensed) -> tuple[bytes, ...]:
        """Return a tick's frames: the position and the intruders in view; none where the fleet saves on its radio."""
        return self._sender.frames(sensed)

    def step(self, sensed: Sensed, heard: Sequence[bytes]) -> Decision:
        """Hear and decide at a tick; `heard` holds the frames that reach the robot, by sender and sequence.

        `PolicyFailed` is raised where the policy has raised, or has returned something other than an intent. The mind
        cannot go on then.
        """
        self.hear(sensed, heard)
        return self.decide(sensed)

    def hear(self, sensed: Sensed, heard: Sequence[bytes]) -> None:
        """Take in the frames heard, as the first half of `step`."""
        if self.blocked is not None:
            self.blocked.sense(sensed)
        self.belief.hear(sensed.k, as_received(sensed.pose), heard)

    def decide(self, sensed: Sensed, view: View | None = None) -> Decision:
        """Decide as the second half of `step`, once the belief has taken in the frames heard."""
        if view is None:
            view = self.look(sensed)
        try:
            intent = checked(self.policy.decide(view), self.facts.radii)
        except (PolicyFailed, *PASSED_ON):
            raise
        except BaseException as error:
            raise PolicyFailed(f"raised {failure_of(error)}") from error
        # A policy that knows better than the radio where others are says so for the next tick too.
        self._elsewhere = intent.others.keys() if isinstance(intent, Place) and intent.others is not None else ()
        choice = self.body.obey(intent, view)
        goal = choice.goal
        self._last = slowed(choice.command, self.facts.speed_limits.at(sensed.pose.x, sensed.pose.y, view.zones))
        return Decision(
            command=self._last,
            state=choice.state,
            direction=choice.bearing,
            goal=None if goal is None else goal.goal,
            refined=None if goal is None else goal.refined,
            mfow=view.mfow,
            rejected=self.belief.rejected,
            figures=intent.figures,
        )

    def look(self, sensed: Sensed) -> View:
        """Make the policy's view, after the contacts have joined the belief and obstacles are closed for this tick."""
        facts, k, pose = self.facts, sensed.k, sensed.pose
        reported = as_received(pose)
        for contact in sensed.contacts[:MAX_CONTACTS]:
            self.belief.contacts.report(Position.of_contact(k, k * facts.step, *contact), k)
        contacts = self.belief.contacts.known(k, facts.memory)
        peers = self.belief.peers_at(k, facts.sending.predictor)
        end = advance(pose, self._last, facts.step) if sensed.bumped else None
        obstacles = self._obstacles.note(k, pose, end, self.belief, peers, self._elsewhere)
        peers = self._obstacles.corrected(peers)
        self._ground.begin(
            [*self._obstacles.closed(obstacles, pose), *self.body.obstacles(k, pose, sensed.bumped, peers)]
        )
        if self.blocked is not None:
            self._leave_out_blocked(self.blocked, k, pose)
        return View(
            tick=k,
            time_s=k * facts.step,
            pose=pose,
            reported=reported,
            bumped=sensed.bumped,
            spec=facts.spec,
            stride=facts.spec.speed * facts.step,
            peers=self.belief.lately(peers, k - facts.patience),
            radii=facts.radii,
            contacts=contacts,
            fog=self._fog,
            ground=self._ground,
            routes=self._routes,
            chance=self._chance,
            charge=sensed.charge,
            zones=self._zones_in_force(sensed),
            weighing=self._zone_weighing(sensed),
            obstacles=obstacles,
        )

    def _zones_in_force(self, sensed: Sensed) -> frozenset[str]:
        """Return the names of the zones in force: by the world once an operator has switched one, or by their times."""
        zones = self.facts.zones
        if sensed.zones is None:
            return zones_in_force(zones, sensed.k * self.facts.step)
        return frozenset(zones[number].name for number in sensed.zones)

    def _zone_weighing(self, sensed: Sensed) -> Weighing:
        """Return the zones in force that weigh, with the weights that operators have given them."""
        zones = self.facts.zones
        if sensed.zones is None:
            return weighing_at(zones, sensed.k * self.facts.step)
        weights = dict(sensed.weights)
        in_force = ((zones[number], weights.get(number, zones[number].weight)) for number in sensed.zones)
        return frozenset((zone.name, weight) for zone, weight in in_force if zone.weighs)

    def _leave_out_blocked(self, blocked: Blocked, k: int, pose: Pose) -> None:
        """Close points believed blocked for this tick, and leave what is behind them out of the policy's fog.

        So it is with the ground behind a wreck, which is closed already.
        """
        blocked.bar(self._obstacles.met(k, self.belief.peers))
        if blocked.area is not None:
            self._ground.close(areas=[blocked.area])
        if blocked.is_in_the_way:
            start = self._ground.join(pose.x, pose.y)
            blocked.stand_at(None if start is None else (start[0] - 1, start[1] - 1))
        self._fog.leave_out(blocked.left_out, blocked.stands)


MakeMind = Callable[[int, int], Mind]
"""Makes a mind by robot number and incarnation."""
