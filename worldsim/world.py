"""The world: one tick in two phases, from the current poses of all bodies to the next, and the true fog."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from patrol.changing.ground import ChangingFootprint
from patrol.energy.batteries import Batteries
from patrol.errors import BadInput
from patrol.exchange import FIRST_INCARNATION, Reply, Sensed
from patrol.journal import Event, RobotTick, Status, TickRecord
from patrol.journal.records import FORGED, IN_FORCE, OUT_OF_FORCE
from patrol.pose import Pose, slowed
from patrol.prepare import sensor_footprint
from patrol.radio.message import MAX_FRAMES
from patrol.zones.ground import SpeedLimits
from patrol.zones.spec import zones_in_force
from worldsim.faults import Timeline
from worldsim.radio.ether import Delivery, ether_of
from worldsim.radio.models import model_of
from worldsim.robots.bodies import Body, move, overlap, standstill, within_limits
from worldsim.robots.closures import Closures
from worldsim.robots.noise import MotionNoise
from worldsim.robots.senses import Senses
from worldsim.truth import Intruders, Truth

if TYPE_CHECKING:
    from patrol.ground.footprint import Footprint
    from patrol.prepare import Prepared
    from patrol.scenario import Scenario


class World:
    """The ground truth of one run.

    Tick k consists of begin_tick (each robot's senses, for phase A), exchange (the ether carries phase A's frames;
    frames for each robot, for phase B) and end_tick (phase B's commands move the bodies; the tick's record). The true
    fog is brought up to date in between, at the latest by end_tick: robots do not wait for it. The set of living robots
    changes only between ticks, by `stand_down` and `wake`; `worldsim.fleet` decides when. The world does not depend on
    whether robots are processes, nor on a clock.

    In lockstep a robot without a command stops at once. At any other pace the world does not wait: the last command
    holds until none has come for `watchdog` seconds.

    `scenario` and `timeline` are as amended so far, while `prepared` stays as it was. `step` is in s. `truth` is the
    true fog; its sensor's terrain is the ground as closed now, `terrain` the map without it.
    """

    def __init__(self, prepared: Prepared, *, footprint: Footprint | None = None, operated: bool = False) -> None:
        """Put the roster's bodies on their starts.

        `footprint` is the scenario's sensor on its terrain, given to share its cache. With `operated`, `amend` may add
        faults during the run.
        """
        scenario = prepared.scenario
        self.prepared = prepared
        self.scenario = scenario
        self.terrain = prepared.terrain
        self.step = scenario.step
        self.ticks = scenario.ticks
        self.tick = 0
        self.timeline = Timeline(scenario)
        self._starts = {spec.number: pose for spec, pose in zip(scenario.roster, prepared.starts, strict=True)}
        self.bodies = {spec.number: Body(spec, self._starts[spec.number], standstill(spec)) for spec in scenario.roster}
        for number in self.timeline.starts_absent:
            body = self.bodies[number]
            body.status, body.away, body.incarnation = Status.ABSENT, True, FIRST_INCARNATION - 1
        self.batteries = Batteries(scenario.roster, scenario.docks, scenario.step)
        self.truth = Truth(footprint or sensor_footprint(scenario, self.terrain), prepared.patrolled)
        self.closing = Closures(prepared, self.timeline)
        self._intruders = Intruders(scenario, self.truth.footprint)
        self.senses = Senses(scenario, self.timeline, self.terrain)
        self.noise = MotionNoise(scenario, self.timeline)
        model = model_of(scenario, self.terrain)
        self.ether = ether_of(scenario, self.timeline, self.terrain, self.senses, model=model, operated=operated)
        self._waits = scenario.factor is None
        self._carries = scenario.radio.via == "ether"
        self._frames: tuple[tuple[int, bytes], ...] = ()
        self._delivery = Delivery({}, (), ())
        self._localised: tuple[tuple[int, float, float, float], ...] = ()
        self._to_observe: list[tuple[int, Pose]] = []
        self._speed_limits = SpeedLimits(scenario.zones, self.terrain)
        self._zones: frozenset[str] = frozenset()
        self._is_switched = False

    @property
    def closed(self) -> frozenset[str]:
        """Names of the parts of the ground that are closed."""
        return self.closing.closed

    @property
    def living(self) -> list[int]:
        """Numbers of the robots that take part in this tick, ascending."""
        return [number for number, body in self.bodies.items() if body.alive]

    def close_and_open(self) -> Iterator[Event]:
        """Close and open what is due before the next tick, and let zones begin and end.

        This is for the time between ticks. It yields the events for the journal.
        """
        in_force = zones_in_force(self.scenario.zones, self.tick * self.step)
        for zone in self.scenario.zones if self.tick else ():
            if (zone.name in in_force) != (zone.name in self._zones):
                yield Event(self.tick, IN_FORCE if zone.name in in_force else OUT_OF_FORCE, None, zone.name)
        if isinstance(self.truth.footprint, ChangingFootprint):
            yield from self.closing.tick(self.tick, self.bodies, self.truth.footprint)

    def begin_tick(self) -> dict[int, Sensed]:
        """Begin a tick; return each living robot's senses, by number, for phase A."""
        self._frames, self._delivery = (), Delivery({}, (), ())
        living = {number: self.bodies[number] for number in self.living}
        # Poses of now: bodies move before the fog is brought up to date.
        self._to_observe = [(number, body.pose) for number, body in living.items()]
        contacts = {number: self._intruders.seen_by(self.tick, body.pose) for number, body in living.items()}
        k, senses, batteries = self.tick, self.senses, self.batteries
        poses = {number: senses.pose(number, k, body.pose) for number, body in living.items()}
        wrong = {number: pose for number, pose in poses.items() if pose != living[number].pose}
        self._localised = tuple((number, pose.x, pose.y, pose.heading) for number, pose in wrong.items())
        self._zones = zones_in_force(self.scenario.zones, k * self.step)
        zones, weights = self._zones_switched()
        return {
            number: Sensed(
                k,
                poses[number],
                body.bumped,
                contacts[number],
                senses.clock(number, k),
                batteries.share(number),
                self._blocked_points(body),
                zones,
                weights,
            )
            for number, body in living.items()
        }

    def _blocked_points(self, body: Body) -> tuple[int, ...]:
        """Return the points that a robot sees closed."""
        footprint = self.truth.footprint
        return self.closing.blocked(body, footprint) if isinstance(footprint, ChangingFootprint) else ()

    def _zones_switched(self) -> tuple[tuple[int, ...] | None, tuple[tuple[int, float], ...]]:
        """Return what robots learn of the zones where that is not as they know it: `Sensed.zones`, `Sensed.weights`."""
        if not self._is_switched:
            return None, ()
        zones, time_s = self.scenario.zones, self.tick * self.step
        weights = ((number, zone.weight_at(time_s)) for number, zone in enumerate(zones) if zone.weights is not None)
        return (
            tuple(number for number, zone in enumerate(zones) if zone.name in self._zones),
            tuple((number, weight) for number, weight in weights if weight is not None),
        )

    def observe(self) -> None:
        """Let all living bodies observe the ground, once in a tick that has begun; otherwise nothing happens."""
        looking, self._to_observe = self._to_observe, []
        self.truth.observe(self.tick, looking)

    def exchange(self, frames: Mapping[int, Sequence[bytes]]) -> Mapping[int, list[bytes]]:
        """Let the ether carry the living robots' frames; return the frames that each robot hears, for phase B.

        The frames of each robot have its position first; a robot that stays silent has none. A robot that is missing
        has died in phase A and hears nothing any more. The frames heard are ordered by sender and sequence.
        """
        sent = {number: frames[number][:MAX_FRAMES] for number in self.living if number in frames}
        genuine = tuple((number, frame) for number, all_of_it in sent.items() for frame in all_of_it)
        if not self._carries:  # robots hear each other directly; these are the frames that the world overheard
            self._frames, self._delivery = genuine, Delivery({number: [] for number in sent}, (), ())
            return self._delivery.heard
        statuses = {number: body.status for number, body in self.bodies.items()}
        # Missing in phase A: it hears nothing of this tick, though its status changes only after it.
        statuses |= {number: Status.LOST for number in self.living if number not in frames}
        poses = {number: body.pose for number, body in self.bodies.items() if body.status.is_present}
        self._delivery = self.ether.carry(self.tick, sent, statuses, poses)
        self._frames = (*((FORGED, forged.frame) for forged in self._delivery.forged), *genuine)
        return self._delivery.heard

    def end_tick(self, replies: Mapping[int, Reply | None]) -> TickRecord:
        """Let the living robots obey their commands for one step; return the record of the tick.

        Where no reply came from a robot, it is None or missing.
        """
        self.observe()
        for number in self.living:
            body = self.bodies[number]
            self._obey_reply(body, replies.get(number))
            body.command = slowed(body.command, self._speed_limits.at(body.pose.x, body.pose.y, self._zones))
            # After the slow zones: an empty battery stops the robot wherever it is.
            if self.batteries.is_empty(number):
                body.command = standstill(body.spec)
        # The record has the poses at the beginning of the tick, with the command that leads on.
        before = {number: body.pose for number, body in self.bodies.items()}
        driven = self.noise.driven(self.tick, {number: self.bodies[number].command for number in self.living})
        move(list(self.bodies.values()), self.truth.footprint.terrain, self.step, driven)
        robots = tuple(_robot_tick(body, before[number], replies.get(number)) for number, body in self.bodies.items())
        self.batteries.tick(robots)
        fog = self.truth.fog
        record = TickRecord(
            k=self.tick,
            robots=robots,
            frames=self._frames,
            deliveries=self._delivery.arrived,
            dropped=self._delivery.dropped,
            mfow=fog.mfow(self.tick),
            fog_mean=fog.mean(self.tick),
            seen=fog.seen,
            copies=self._delivery.copies,
            delayed=self._delivery.delayed,
            forged=tuple(forged.fault for forged in self._delivery.forged),
            localised=self._localised,
        )
        self.tick += 1
        return record

    def amend(self, scenario: Scenario) -> None:
        """Go on with other faults, intruders or zones from the next tick on.

        This is for the time between ticks. The scenario must have the same past (`patrol.scenario.controls.amended`).
        When `BadInput` is raised, nothing has changed.
        """
        for intruder in scenario.intruders[len(self.scenario.intruders) :]:
            intruder.check_place(self.terrain, "control: place")
        timeline = Timeline(scenario)
        if absent := sorted(timeline.starts_absent ^ self.timeline.starts_absent):
            names = ", ".join(self.bodies[number].spec.name for number in absent)
            raise BadInput(f"control: {names} cannot join: only who is not there yet, or has left, can")
        intruders = Intruders(scenario, self.truth.footprint)
        self.ether.follow(timeline)
        self.senses.timeline = self.noise.timeline = self.closing.timeline = timeline
        self.scenario, self.timeline = scenario, timeline
        self._intruders = intruders
        self._is_switched = scenario.zones != self.prepared.scenario.zones

    def stand_down(self, number: int, status: Status, reason: str, *, away: bool = False) -> Event:
        """Stop driving a robot, for good or for now; return the event for the journal.

        This is for the time between ticks. The status is DEAD (killed on purpose), LOST (died by itself), PAUSED or
        LEFT. With `away` the body disappears; otherwise it stays where it is, in the way of others.
        """
        body = self.bodies[number]
        body.halt(status)
        body.away = body.away or away
        return Event(self.tick, status.name.lower(), number, reason)

    def wake(self, number: int, reason: str) -> Event:
        """Drive a robot from now on; return the event for the journal.

        This is for the time between ticks. A robot that was away appears at its start.
        """
        body = self.bodies[number]
        self.batteries.renew(number)
        body.halt(Status.ALIVE)
        if body.away:
            body.pose = self._starts[number]
            body.away = False
        return Event(self.tick, Status.ALIVE.name.lower(), number, reason)

    def in_the_way(self, number: int) -> list[str]:
        """Return the names of the robots whose bodies overlap a robot's start, so that it cannot appear there."""
        start, radius = self._starts[number], self.bodies[number].spec.radius
        return [
            body.spec.name
            for neighbour, body in self.bodies.items()
            if neighbour != number and body.present and overlap(start, radius, body.pose, body.spec.radius)
        ]

    def _obey_reply(self, body: Body, reply: Reply | None) -> None:
        """Apply a reply's command, or handle its absence."""
        body.refused = False
        if reply is None:
            body.silent_s += self.step
            if self._waits or body.silent_s >= self.scenario.watchdog:
                body.command = standstill(body.spec)
            return
        body.silent_s = 0.0
        command = within_limits(body.spec, reply.command)
        if command is None:
            body.refused = True
            command = standstill(body.spec)
        body.command = command


def _robot_tick(body: Body, pose: Pose, reply: Reply | None) -> RobotTick:
    """One robot's row of this tick; `pose` is where it was when the tick began."""
    command = body.command
    c0, c1 = command.numbers
    return RobotTick(
        number=body.spec.number,
        status=body.status,
        x=pose.x,
        y=pose.y,
        heading=pose.heading,
        c0=c0,
        c1=c1,
        bumped=body.bumped,
        state=reply.state if reply else "",
        goal=reply.goal if reply else None,
        decision_ms=reply.decision_ms if reply else None,
        rejected=reply.rejected if reply else None,
        refused=body.refused,
    )
