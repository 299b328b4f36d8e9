"""A robot of your own in a fleet: no world simulates it, and its positions go over a direct radio.

A driver only has to call `drive`; see ``examples/my_robot.py``.
"""

from __future__ import annotations

import math
import time
from argparse import Namespace
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from agent.ports import Telemetry
from agent.robots.direct import APART
from patrol.errors import BadInput, NotPrepared
from patrol.radio.message import MAX_TIME_MS, ms_to_s
from runtime.process.context import ProcessContext, run_with

if TYPE_CHECKING:
    from agent.mind import Mind
    from agent.ports import FleetClock, Robot
    from agent.robots.clock import KeptClock
    from agent.robots.direct import DirectRadio
    from patrol.ground.fog import Fog
    from patrol.ground.terrain import Terrain
    from patrol.pose import Pose
    from patrol.prepare import Prepared
    from patrol.radio.peers import Peer
    from patrol.scenario import RobotSpec, Scenario
    from runtime.messages.stop_orders import StopOrders
    from runtime.net.link import Link
    from runtime.net.mailbox import Air
    from runtime.process.lifeline import Ending
    from runtime.security.keys import FleetKeys

__all__ = ["Site", "drive"]

COMPLAIN_S = 10.0
"""Wall time between two messages about robots that count ticks differently, s."""

FOLLOW_AGAIN_S = 300.0
"""Wall time after which a robot counts ticks as the same other one again, s."""

LONGEST_WAIT_S = 86_400.0
"""Longest time until tick 0, s."""

MEET_S = 12.0
"""How long robots that meet directly wait for the first other one before they count ticks alone, s: Zenoh tries a
connection again after ten seconds."""

_LISTEN_S = 0.2


@dataclass(frozen=True, slots=True)
class Site:
    """The facts from which a driver makes its robot.

    Attributes:
        spec: The robot's model, speed (m/s), radius (m) and turning radius (m).
        start: The robot's start in the scenario, m and rad.
        terrain: The map.
        clock: Waits for the next tick.
        step: s per tick.
        factor: Seconds of the robot's time in one of ours; 1 but for simulations.
        fog: What the robot will believe of the fog, to be shown.
        peers: The other robots heard so far, by number; goes on to change.
        foreseen: Where the other robots should be, by number, so many ticks from now; None where the fleet's robots do
            not predict each other by their trails (`radio.adaptive`, `radio.trail`).
        radii: Of all robots, by number, m.
        orders: Makes the place where operators' orders to stop wait, for a robot that obeys them.
        no_tick: Says why no tick comes; empty if they come.
    """

    spec: RobotSpec
    start: Pose
    terrain: Terrain
    clock: FleetClock
    step: float
    factor: float
    fog: Fog
    peers: Mapping[int, Peer]
    foreseen: Callable[[int], Mapping[int, Peer]] | None
    radii: Mapping[int, float]
    orders: Callable[[], StopOrders]
    no_tick: Callable[[], str] = lambda: ""


def drive(
    make: Callable[[Site], Robot],
    *,
    scenario: Path | str,
    robot: str,
    credentials: Path | str | None = None,
    router: str | None = None,
    fleet: str | None = None,
    radio: str | None = None,
    epoch_s: float | None = None,
    wait_s: float = 60.0,
) -> int:
    """Let a robot patrol with a fleet until it is interrupted.

    Args:
        make: Makes the robot.
        scenario: Scenario file with ``radio.via: direct`` and the robot in its roster.
        robot: Name in the roster.
        credentials: Folder of this robot, made by ``fogwatch fleet init``; says where the fleet meets.
        router: Of a fleet that is no mesh, ``tcp/HOST:7447`` (default: the credentials').
        fleet: Name of the fleet (default: the credentials').
        radio: Where the robots hear each other, as for ``fogwatch agent --radio`` (default: the fleet's).
        epoch_s: When tick 0 begins, Unix time in s (default: derived from the first position heard).
        wait_s: How long to wait for the router and for the first position, s.

    Returns:
        Exit code: 1 when the robot's policy has failed, 2 for bad input, 130 when interrupted.
    """
    from patrol.scenario import load_scenario, naming

    proof = None if credentials is None else Path(credentials)
    options = Namespace(credentials=proof, router=router, fleet=fleet, radio=radio, wait=wait_s)

    def work(process: ProcessContext) -> int:
        loaded = load_scenario(Path(scenario))
        with naming(scenario):
            return patrol_with(process, make, loaded, robot, Ticks(epoch_s, wait_s))

    return run_with(options, robot, work)


@dataclass(frozen=True, slots=True)
class Ticks:
    """The start of counting ticks.

    Attributes:
        epoch_s: When tick 0 begins, Unix time in s; None to count on from the first position heard.
        wait_s: How long to wait for the router and for that position, s.
        alone_s: How long to listen for one before counting from now, s; None if another robot must be heard.
    """

    epoch_s: float | None
    wait_s: float
    alone_s: float | None = None


def patrol_with(
    process: ProcessContext, make: Callable[[Site], Robot], scenario: Scenario, name: str, ticks: Ticks
) -> int:
    """Let a robot patrol with a fleet until it is asked to leave; a robot that is `Telemetry` too sees all decisions.

    Args:
        process: Around it; the options say where the fleet meets and, as ``radio``, where the robots hear each other.
        make: Makes the robot.
        scenario: With ``radio.via: direct`` and the robot in its roster.
        name: In the roster.
        ticks: From when on ticks are counted.

    Returns:
        Exit code: 1 when the robot's policy has failed, 130 when interrupted.

    Raises:
        BadInput: One line says what is wrong and what to do instead.
        NotPrepared: The same, where the scenario's file must be named.
        AskedToLeave: Before the patrol could begin.
    """
    from runtime.process.failures import INTERRUPTED
    from runtime.process.options import robot_named
    from runtime.security.keys import callers_of, check_radio
    from runtime.security.roles import Kind

    if scenario.radio.via != "direct":
        raise NotPrepared("radio.via = ether: only a world carries frames so; set radio: {via: direct}")
    spec = spec_of(scenario, name)
    meeting = process.meet(Kind.ROBOT)
    robot_named(name, meeting.credentials)
    keys = meeting.keys
    on_air = check_radio(process.options.radio, "radio", scenario.radio.via)
    # Its counts of frames begin anew, so a reader that adds them up must not take it for the process before.
    incarnation = int(time.time()) % 2**31
    prepared, mind = mind_of(process, scenario, spec, incarnation)
    link, air = process.open_links(
        meeting, on_air, callers_of(keys, {member.name: member.number for member in scenario.roster})
    )
    if link.sees(keys.alive(name)):
        raise BadInput(f"robot {name}: another process is {name} already; end that one, or choose another robot")
    link.live(keys.alive(name))
    failure = _Driver(prepared, spec, mind, incarnation, process).run(make, link, air, keys, ticks)
    if failure is not None:
        process.log.error(failure)
    return INTERRUPTED if failure is None else 1


def mind_of(process: ProcessContext, scenario: Scenario, spec: RobotSpec, incarnation: int) -> tuple[Prepared, Mind]:
    """Make a robot's mind, from the static fields of a launcher or from its own.

    Args:
        process: Around it.
        scenario: With the robot in its roster.
        spec: The robot.
        incarnation: How often it was started.

    Returns:
        The prepared scenario and the mind.

    Raises:
        NotPrepared: The scenario cannot be patrolled.
        BadInput: Its policy cannot be made.
        AskedToLeave: Before there was a mind.
    """
    process.warm(("patrol", "agent"), scenario)
    from agent.build import Shared, build_mind
    from agent.policies.found import policy_named
    from agent.ports import PolicyFailed
    from agent.psi import load_psi
    from patrol.classes.static_check import announce
    from patrol.own_sensor import allow_sensor, sensor_named

    if not process.launched:
        announce([policy_named(scenario), sensor_named(scenario.sensor)])
    allow_sensor(scenario.sensor, record=True)
    prepared = process.prepare(scenario)
    psi = None if process.static is None else load_psi(scenario, process.static)
    try:
        return prepared, build_mind(Shared(prepared, psi=psi), spec.number, incarnation)
    except PolicyFailed as failed:
        if failed.__cause__ is not None:
            process.log.failure(failed.__cause__)
        raise BadInput(str(failed)) from None


def spec_of(scenario: Scenario, name: str, called: str = "robot") -> RobotSpec:
    """Find a robot in a scenario's roster.

    Args:
        scenario: The scenario.
        name: The robot's name.
        called: The option or field that gave the name.

    Raises:
        BadInput: There is no such robot.
    """
    for spec in scenario.roster:
        if spec.name == name:
            return spec
    names = ", ".join(spec.name for spec in scenario.roster[:8])
    raise BadInput(f"{called} {name!r}: no robot of scenario {scenario.name}; its first are {names}")


@dataclass(frozen=True, slots=True)
class _Driver:
    """One robot's mind, about to be put into the robot."""

    prepared: Prepared
    spec: RobotSpec
    mind: Mind
    incarnation: int
    process: ProcessContext

    def run(self, make: Callable[[Site], Robot], link: Link, air: Air, keys: FleetKeys, ticks: Ticks) -> str | None:
        """Patrol until it is time to leave, then stop the robot; return how the policy has failed, or None."""
        from agent.mind_loop import Both, TelemetrySender, TickFigures, run_mind
        from agent.robots.clock import KeptClock, latest_tick
        from agent.robots.direct import tune_in
        from runtime.messages.stop_orders import StopOrders

        scenario, name, process = self.prepared.scenario, self.spec.name, self.process
        log, ending = process.log, process.ending
        assert scenario.factor is not None  # a direct radio is refused in lockstep
        step_s = scenario.step / scenario.factor
        names = {member.name: member.number for member in scenario.roster}
        clock = LateClock(process.notifier.alive)
        radio = tune_in(air, keys, name, names, clock, step_s, self.mind.facts.key)
        epoch_s = ticks.epoch_s
        if epoch_s is None:
            _meet_others(air, name, ending)
            epoch_s = _find_begin(radio, step_s, self.mind.facts.key, ticks, log.info, ending)
        if epoch_s is None:
            return None
        check_epoch(epoch_s, time.time(), log.info)
        clock.keeper = KeptClock(step_s, epoch_s, time.time, ending.wait, log.warning)
        start = self.prepared.starts[self.spec.number - 1]
        site = Site(
            spec=self.spec,
            start=start,
            terrain=self.prepared.terrain,
            clock=clock,
            step=scenario.step,
            factor=scenario.factor,
            fog=self.mind.belief.fog,
            peers=self.mind.belief.peers,
            foreseen=foreseen(self.mind, clock),
            radii=self.mind.facts.radii,
            orders=lambda: StopOrders(link, keys, name),
            no_tick=lambda: clock.why,
        )
        robot = make(site)
        telemetry = TelemetrySender(link.publisher(keys.telemetry(name)))
        telemetry.traffic = lambda final: radio.traffic(self.incarnation, final=final)
        telemetry.stopped = lambda: getattr(robot, "stopped", "")  # of a robot that obeys orders
        latest = None if ticks.epoch_s is not None else lambda: latest_tick(step_s, time.time())
        watched = WatchedRadio(radio, clock, latest, log.warning)
        receivers: Telemetry = Both(robot, telemetry) if isinstance(robot, Telemetry) else telemetry
        if process.supervision.counts:
            radio.show(process.vitals)
            receivers = Both(receivers, TickFigures(self.mind, process.vitals, log))
        log.info(f"patrols with fleet {keys.fleet}")
        failure = None
        try:
            failure = run_mind(self.mind, robot, watched, receivers)
        finally:
            robot.stop(failure or ending.reason or "the driver ends")
        telemetry.close()
        return failure


def foreseen(mind: Mind, clock: LateClock) -> Callable[[int], Mapping[int, Peer]] | None:
    """Return a function that predicts where others are in some ticks; None where the fleet does not predict.

    Args:
        mind: The mind.
        clock: Counts its ticks.
    """
    sending = mind.facts.sending
    if sending.predictor is None or not sending.trail:  # without trails, robots are predicted to stand
        return None
    return lambda ahead: mind.belief.peers_at(clock.k + ahead, sending.predictor)


class LateClock:
    """A fleet clock (`agent.ports.FleetClock`) whose keeper is known only after another robot has been heard.

    Attributes:
        keeper: Counts the ticks; None until then.
        k: The tick; -1 before the first.

    Args:
        alive: Told in each tick, by the loop that waits for it: the process is ready, and does not hang.
    """

    def __init__(self, alive: Callable[[], None] = lambda: None) -> None:
        self._alive = alive
        self.keeper: KeptClock | None = None
        self.k = -1

    def tick(self) -> int | None:
        """Wait for the next tick; None when it is time to leave."""
        assert self.keeper is not None
        k = self.keeper.tick()
        self._alive()
        self.k = self.k if k is None else k
        return k

    @property
    def why(self) -> str:
        """The reason why no tick comes; empty if they come."""
        return "" if self.keeper is None else self.keeper.why

    def decide(self) -> bool:
        """Wait until it is time to decide; False when there is nothing to decide."""
        assert self.keeper is not None
        return self.keeper.decide()

    def advance(self, ticks: int) -> None:
        """Count so many ticks more from the next one on."""
        assert self.keeper is not None
        self.keeper.advance(ticks)


class WatchedRadio:
    """A radio that reports when other robots count ticks differently, and lets the clock count as the oldest of them.

    A robot that meets no other for a while begins to count by itself, so robots of a fleet may begin at different
    moments. All then count as the one that began first, since ticks never go back. A member can lie, and tell each
    robot another count, so a robot follows each other one at most once in `FOLLOW_AGAIN_S`. Once the liar is silent,
    robots that hear each other agree on the latest count within that time.
    """

    def __init__(
        self,
        radio: DirectRadio,
        clock: LateClock,
        latest: Callable[[], int] | None,
        say: Callable[[str], None],
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        """Watch a radio.

        Args:
            radio: The radio.
            clock: Counts the ticks.
            latest: Returns the latest tick to which another robot's count may lead now; None where the user has said
                when tick 0 was, so that no other robot is followed.
            say: Takes a line for people.
            now: Returns the time in s, by a clock that is never set.
        """
        self._radio = radio
        self._clock = clock
        self._latest = latest
        self._say = say
        self._now = now
        self._due = 0.0
        self._followed_s: dict[str, float] = {}  # when each robot was followed last

    def send(self, frames: tuple[bytes, ...]) -> None:
        """Send the frames."""
        self._radio.send(frames)

    def hear(self) -> list[bytes] | None:
        """Return the frames that have arrived, after a check of the ticks that they count."""
        frames = self._radio.hear()
        skew, now = self._radio.skew, self._now()
        if now < self._due or (complaint := skew.complaint()) is None:
            return frames
        longest_lead = APART if self._latest is None else self._latest() - self._clock.k
        leads = {name: lead for name, lead in skew.ticks.items() if APART < lead <= longest_lead}
        too_early = {name for name in leads if now < self._followed_s.get(name, -math.inf) + FOLLOW_AGAIN_S}
        if name := max(leads.keys() - too_early, key=lambda other: (leads[other], other), default=""):
            self._followed_s[name] = now
            self._clock.advance(leads[name])
            skew.advance(leads[name])
            self._say(f"{name} has counted ticks for longer, by {leads[name]} ticks; this robot counts on from there")
        else:
            self._due = now + COMPLAIN_S
            again = "".join(
                f"; {other} has been followed within the last {FOLLOW_AGAIN_S:g} s, and is ahead again: it, or a robot "
                "that it follows, tells wrong ticks"
                for other in sorted(too_early)
            )
            if longest_lead < 0:
                again += "; this robot counts further than others follow: start it again"
            self._say(f"{complaint}{again}")
        return frames


def check_epoch(epoch_s: float, now_s: float, say: Callable[[str], None]) -> None:
    """Refuse an epoch that cannot be one, and say so when tick 0 is still to come.

    Args:
        epoch_s: When tick 0 begins, Unix time in s.
        now_s: The time, likewise.
        say: Takes a line for people.

    Raises:
        BadInput: It is not finite, or too far away.
    """
    oldest_s = ms_to_s(MAX_TIME_MS)
    if not math.isfinite(epoch_s) or not -LONGEST_WAIT_S <= now_s - epoch_s <= oldest_s:
        raise BadInput(
            f"epoch_s = {epoch_s!r}: tick 0 lies at most {LONGEST_WAIT_S:g} s ahead and {oldest_s:.0f} s back; "
            "give Unix time in s"
        )
    if epoch_s > now_s:
        say(f"tick 0 begins in {epoch_s - now_s:.0f} s")


def _meet_others(air: Air, own: str, ending: Ending) -> None:
    """Wait for a connection to another robot where robots meet directly: their links open without any."""
    from runtime.net.link import Link

    if not isinstance(air, Link) or air.mesh is None:
        return
    members = {name for name, role in air.mesh.members.items() if role.robot not in ("", own)}
    until = time.monotonic() + MEET_S
    while members and not members & air.neighbours.names and time.monotonic() < until and not ending:
        ending.wait(_LISTEN_S)


def _find_begin(
    radio: DirectRadio, step_s: float, key: bytes | None, ticks: Ticks, say: Callable[[str], None], ending: Ending
) -> float | None:
    """Return when tick 0 began, Unix time in s, by the first position heard; None when it is time to leave."""
    from agent.robots.clock import epoch_of

    say("listens for a position, to count ticks as the others do")
    began = time.monotonic()
    while not ending:
        frame = radio.overhear(_LISTEN_S)
        epoch_s = None if frame is None else epoch_of(frame, time.time(), step_s, key)
        if epoch_s is not None:
            return epoch_s
        waited_s = time.monotonic() - began
        if ticks.alone_s is not None and waited_s >= ticks.alone_s:
            say("no position was heard, so ticks count from now")
            return time.time()
        if waited_s >= ticks.wait_s:
            raise BadInput(
                f"no position was heard within {ticks.wait_s:g} s; check router and fleet, start another robot first, "
                "or pass epoch_s"
            )
    return None
