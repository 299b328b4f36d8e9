"""A ROS 2 robot as a mind's body (`agent.ports.Robot`).

The mind decides once a tick. Between its decisions a thread hears the robot and sends it safe commands, many times a
tick. So the robot stands soon after its odometry, its mind or its radio link has died; when this process dies, the
robot's own watchdog is the last line.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from threading import Event, Lock, Thread

from agent.mind_loop import Both
from agent.own_robot import Site
from agent.ports import Decision, FleetClock, Telemetry
from patrol.errors import BadInput
from patrol.exchange import Sensed
from patrol.pose import Command
from patrol.scenario import Scenario
from ros2.robot.diagnostics import Diagnostics, Patrolling
from ros2.robot.fence import Fence, Others
from ros2.robot.governor import Governor, Response
from ros2.robot.hardware import Hardware, Rivals
from ros2.robot.localisation import Fix
from ros2.robot.shown import Shown, show_map
from ros2.robot.steering import GoalSteering, Place, Steering, VelocitySteering
from ros2.robot.stops import DriverFailed, Standing, Stopper
from runtime.messages.phases import PHASE_B_SHARE
from runtime.messages.stop_orders import Order, Outcome, StopOrders
from runtime.process.context import ProcessContext
from runtime.process.lifeline import rest_before_pause
from runtime.reporting.logs import Log
from runtime.reporting.vitals import ODOMETRY_AGE, STOPPED, UNUSABLE, Vitals

REACTION_S = 0.1
"""Time from the reception of a command until the robot brakes, s."""

HOLD_STEPS = 1.5
"""Number of steps for which a command is obeyed when no other comes."""

SAY_AFTER_S = 1.0
"""Time that a robot stands before the reason is reported, s."""
HELD_AFTER_S = 10.0
"""Time that a robot that could drive is held before that is reported, s: at walls and in queues it soon goes round."""
LONGEST_CYCLE_S = 0.25
"""The longest time between two commands over which a speed may change, s: a late cycle must not allow a jump."""
# A thread that hangs in a call must not keep the robot from being stopped.
_JOIN_S = 1.0
_LOCK_S = 0.2

Objection = Rivals | Response
"""A reason besides stops that keeps a robot from driving."""


class Ros2Robot:
    """Drives a ROS 2 robot, and tells `onlooker` of every decision, too.

    `step_s` is a tick, in the robot's time. `orders` are those of operators, or None. `objections` may keep the robot
    from driving besides stops.
    """

    def __init__(
        self,
        hardware: Hardware,
        steering: Steering,
        clock: FleetClock,
        step_s: float,
        onlooker: Telemetry | None,
        orders: StopOrders | None,
        log: Log,
        objections: Sequence[Objection] = (),
    ) -> None:
        self._hardware = hardware
        self._steering = steering
        self._clock = clock
        self._step_s = step_s
        self._onlooker = onlooker
        self._orders = orders
        self._log = log
        self._say = Sayer(log.info)
        self._objections = objections
        self._goal: Place | None = None
        self._lock = Lock()
        self._over = Event()
        self._failed = ""
        self._stopped = ""
        self._standing = Standing(hardware.factor)
        self._cycled_s = time.monotonic()
        self._thread = Thread(target=self._send_commands, name="drive", daemon=True)

    def start(self) -> Ros2Robot:
        """Begin to drive; itself."""
        if self._orders is not None:
            self._orders.obey(self._carry_out)
        self._thread.start()
        return self

    @property
    def stopped(self) -> str:
        """The reason why it may not drive, and what ends that; empty if it may. From any thread."""
        return self._failed or self._stopped

    def show(self, vitals: Vitals) -> None:
        """Add the robot's figures to those of the process from now on."""
        vitals.probe(STOPPED, lambda: float(bool(self.stopped)))
        vitals.probe(ODOMETRY_AGE, lambda: self._hardware.odometry_age_s)
        vitals.probe(UNUSABLE, lambda: self._hardware.refused)

    def sense(self) -> Sensed | None:
        """Wait for the next tick in which the robot's pose is known; None when it is time to leave.

        `DriverFailed` is raised when the robot can no longer be driven.
        """
        while (k := self._clock.tick()) is not None:
            if self._failed:
                raise DriverFailed(self._failed)
            with self._lock:
                fix = self._hardware.fix()
                if fix is None:
                    continue
                # The command that is decided on now begins to act only then.
                pose = self._steering.ahead(fix, PHASE_B_SHARE * self._step_s)
                bumped = self._steering.blocked(fix.pose) and not self._hardware.stops
            return Sensed(k, pose, bumped, clock_s=k * self._step_s)
        return None

    def report(self, sensed: Sensed, decision: Decision, decision_ms: float) -> None:
        """A decision has been taken (`agent.ports.Telemetry`)."""
        self._goal = decision.goal
        if self._onlooker is not None:
            self._onlooker.report(sensed, decision, decision_ms)

    def act(self, command: Command) -> None:
        """Obey for one step."""
        now_s = self._hardware.time.now()
        if now_s is not None:
            with self._lock:
                self._steering.want(command, self._goal, now_s)

    def stop(self, reason: str) -> None:
        """Stop for good."""
        if self._over.is_set():
            return
        self._over.set()
        if self._thread.is_alive():
            self._thread.join(_JOIN_S)
        self._halt_robot()
        self._say.now(f"stopped for good: {reason}")
        if doubt := self._steering.unconfirmed:
            self._say.now(f"may still drive: {doubt}")
        if unsaved := self._hardware.stops.unsaved():
            self._say.now(f"stops are not noted: {unsaved}")

    def rest(self) -> None:
        """Stop before this process is paused; `go_on` drives on."""
        self._halt_robot()

    def go_on(self) -> None:
        """Drive on after `rest`, unless the robot was stopped for good."""
        if not self._over.is_set():
            self._steering.go_on()

    def cycle(self) -> Fix | None:
        """Hear the robot, send it one safe command, and return where it is."""
        with self._lock:
            moment_s = time.monotonic()
            since_s = min((moment_s - self._cycled_s) * self._hardware.factor, LONGEST_CYCLE_S)
            self._cycled_s = moment_s
            fix = self._hardware.fix()
            now_s = self._hardware.time.now()
            stopped = self._hardware.stops.why or next(
                (objection.why for objection in self._objections if objection.why), ""
            )
            self._stopped = stopped
            if not stopped:
                self._standing.told()  # the robot is about to be driven, so a stop from now on is a new one
            why = self._steering.step(fix, 0.0 if now_s is None else now_s, since_s, stopped)
        if stopped:
            self._standing.look(fix, self._steering.unconfirmed, moment_s)
        elif fix is None:
            why = self._hardware.why
        self._say.state(why, moment_s, SAY_AFTER_S if stopped or fix is None else HELD_AFTER_S)
        return fix

    def _carry_out(self, order: Order) -> Outcome:
        """Carry out an operator's order, and return its outcome once that is known."""
        stops = self._hardware.stops
        if order is Order.RELEASE:
            objected = any(objector.why for objector in self._objections)
            for objection in self._objections:
                objection.release()
            if stops.release(Stopper.OPERATOR) or objected:
                self._say.now("released by an operator")
            return Outcome(True, stops.why or "not stopped")
        if stops.hold(Stopper.OPERATOR):
            self._standing.told()
            self._say.now("stopped by an operator")
        doubt = self._standing.doubt()
        if doubt:
            return Outcome(False, f"may still drive: {doubt}; {stops.why}")
        if unsaved := stops.unsaved():
            return Outcome(False, f"stands, but a restart of its agent would end that ({unsaved}); {stops.why}")
        return Outcome(True, stops.why)

    def _send_commands(self) -> None:
        period_s = 1.0 / (self._hardware.settings.rate_hz * self._hardware.factor)
        due_s = time.monotonic()
        try:
            while not self._over.wait(max(0.0, due_s - time.monotonic())):
                self.cycle()
                # After a late cycle the next one is due at once, but missed ones are not made up for.
                due_s = max(due_s + period_s, time.monotonic())
        except Exception as error:  # noqa: BLE001 - whatever it is, the robot must stand, and the mind must know
            self._log.failure(error)
            self._failed = f"the driver failed: {type(error).__name__}: {error}"
        finally:
            self._halt_robot()

    def _halt_robot(self) -> None:
        """Send zero velocity, after the present message; also if the thread that sends it hangs."""
        # Without the lock as well, after a moment: a robot that must stand must not wait for a thread that hangs.
        locked = self._lock.acquire(timeout=_LOCK_S)
        try:
            self._steering.halt()
        finally:
            if locked:
                self._lock.release()


class Sayer:
    """Says why a robot stands, once, when it has stood for a while; and when it drives again."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self.now = say
        self._since_s: float | None = None
        self._said = False

    def state(self, why: str, moment_s: float, after_s: float = SAY_AFTER_S) -> None:
        """Take in why the robot stands, empty if it does not, and say it once it has stood for `after_s`."""
        if not why:
            if self._said:
                self.now("drives again")
            self._since_s, self._said = None, False
            return
        if self._since_s is None:
            self._since_s = moment_s
        if not self._said and moment_s - self._since_s >= after_s:
            self.now(f"stands: {why}")
            self._said = True


def assemble(
    site: Site, hardware: Hardware, scenario: Scenario, rivals: Rivals, process: ProcessContext, *, shows_map: bool
) -> Ros2Robot:
    """Return a robot that drives, and is shown to viewers and the robot's own tools."""
    link, settings, log = hardware.link, hardware.settings, process.log
    if shows_map and not show_map(link, settings, site.terrain, hardware.stamp_ns()):
        log.info(f"somebody else publishes {link.resolve(settings.topic('map'))}, so this agent does not")
    shown = Shown(link, settings, site.terrain, site.fog, hardware.stamp_ns)
    names = {spec.number: spec.name for spec in scenario.roster}
    facts = Patrolling(site.spec.name, names, site.step, site.factor, scenario.radio.forget_after)
    diagnostics = Diagnostics(hardware, facts, site.peers, site.no_tick)
    robot = _make_driver(site, hardware, Both(shown, diagnostics), log, rivals)
    diagnostics.watch(lambda: robot.stopped)
    process.closing.callback(diagnostics.close)
    if process.supervision.counts:
        robot.show(process.vitals)
    rest_before_pause(robot.rest, robot.go_on)
    return robot


def _make_driver(site: Site, hardware: Hardware, onlooker: Telemetry, log: Log, rivals: Rivals) -> Ros2Robot:
    settings, spec = hardware.settings, site.spec
    if settings.margin >= spec.radius:
        raise BadInput(f"--margin {settings.margin:g}: {spec.name}'s radius of {spec.radius:g} m holds it; give less")
    if settings.drive == "ackermann" and spec.model != "car":
        raise BadInput(f"--drive ackermann: steers a car, and {spec.name} is {spec.model}; set its model to car")
    steering: Steering
    objections: list[Objection] = [rivals]
    if settings.drive == "nav2":
        steering = GoalSteering(hardware)
    else:
        period_s = 1.0 / settings.rate_hz
        # Between two commands the robot goes on; half of the margin is kept for the errors of its pose.
        fence = Fence(site.terrain, spec.radius - 0.5 * settings.margin, 2.0 * period_s + REACTION_S, settings.braking)
        peers = Others(site.peers, site.radii, site.step, site.foreseen)
        response = Response(spec.radius, spec.speed / settings.braking)
        objections.append(response)
        governor = Governor(spec.model, spec.limits, settings.acceleration, HOLD_STEPS * site.step, fence)
        steering = VelocitySteering(hardware, governor, peers, response)
    return Ros2Robot(hardware, steering, site.clock, site.step, onlooker, site.orders(), log, objections).start()
