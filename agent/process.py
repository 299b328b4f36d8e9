"""The process around a mind: it joins a fleet, lets the mind decide tick after tick, and leaves on request."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from patrol.errors import BadInput
from patrol.exchange import FIRST_INCARNATION
from runtime.process.context import ProcessContext, run_with
from runtime.process.failures import INTERRUPTED
from runtime.process.lifeline import Ending
from runtime.process.options import TOGETHER, Meeting, ProcessParser, fleet_parser, robot_named

if TYPE_CHECKING:
    from agent.mind import Mind
    from agent.ports import Telemetry
    from agent.robots.sim import SimRobot
    from patrol.scenario import Scenario

HELP = f"""
One robot of a fleet whose other processes run elsewhere. {TOGETHER}

The processes may start in any order. With radio.via: direct in the scenario, --radio names the network on which the
robots hear each other: a multicast group, a serial line, a separate router or another mesh (default: the fleet's mesh
or router).

A ROS 2 robot is driven with --robot ros2 --connect LOCATOR; its options are other ones:
fogwatch agent --robot ros2 --help.

Exit codes: 0 the run is over, 1 the robot failed or was left out of the run, 2 bad input, 130 interrupted.
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one agent."""
    options = simulated_parser().parse_args(arguments)
    return run_with(options, options.robot or "agent", _run_agent)


def _run_agent(process: ProcessContext) -> int:
    """Check the input and find out which robot this is, then patrol; return the exit code."""
    from agent.own_robot import mind_of, spec_of
    from patrol.scenario import load_scenario, naming
    from runtime.security.keys import check_radio
    from runtime.security.roles import Kind

    options = process.options
    meeting = process.meet(Kind.ROBOT)
    scenario = load_scenario(options.scenario)
    on_air = check_radio(options.radio, "--radio", scenario.radio.via)
    spec = spec_of(scenario, robot_named(options.robot, meeting.credentials), "--robot")
    process.follow(spec.name, fleet=meeting.keys.fleet)
    with naming(options.scenario):
        _, mind = mind_of(process, scenario, spec, options.incarnation)
    return _join_patrol(mind, scenario, meeting, on_air, process)


def _join_patrol(mind: Mind, scenario: Scenario, meeting: Meeting, on_air: str | None, process: ProcessContext) -> int:
    """Join the fleet and patrol with it until it is time to leave; return the exit code."""
    from agent.mind_loop import Both, TelemetrySender, TickFigures, run_mind
    from agent.robots.direct import DirectRadio, tune_in
    from agent.robots.sim import join
    from patrol.scenario import scenario_hash
    from runtime.messages.session import Identity
    from runtime.security.keys import callers_of

    options, ending, log = process.options, process.ending, process.log
    spec, keys = mind.spec, meeting.keys
    numbers = {member.name: member.number for member in scenario.roster}
    link, air = process.open_links(meeting, on_air, callers_of(keys, numbers))
    instance = int.from_bytes(os.urandom(8), "big") >> 1 | 1
    identity = Identity(spec.name, options.incarnation, instance, scenario_hash(scenario))

    def waiting(waited_s: float) -> None:
        if robot.world_present:
            log.info(
                f"the world of fleet {keys.fleet} is there, but has not greeted {spec.name} ({waited_s:.0f} s): its "
                "scenario has no such robot, or the robot has not joined yet"
            )
        else:
            but = f"; it is not there, or {spec.name} was revoked" if meeting.revocable else ""
            log.info(f"waiting for the world of fleet {keys.fleet} ({waited_s:.0f} s){but}")

    blind_s = math.inf if scenario.factor is None else scenario.watchdog / scenario.factor
    alive = process.notifier.alive
    # A launcher ends its agents when the world is gone; until then the world may be slow, or the router stand still.
    patience_s = process.patience_s
    counts = len(scenario.roster), len(scenario.zones)
    robot = join(link, keys, identity, *counts, ending, patience_s, waiting, blind_s, spec.model, alive)
    telemetry = TelemetrySender(link.publisher(keys.telemetry(spec.name)))
    radio: SimRobot | DirectRadio = robot
    if scenario.radio.via == "direct":
        assert scenario.factor is not None  # a direct radio is refused in lockstep
        radio = direct = tune_in(air, keys, spec.name, numbers, robot, scenario.step / scenario.factor, mind.facts.key)
        telemetry.traffic = lambda final: direct.traffic(options.incarnation, final=final)
    receivers: Telemetry = Both(robot, telemetry)
    if process.supervision.counts:
        for part in {robot, radio}:  # of a robot without a direct radio these are one
            part.show(process.vitals)
        receivers = Both(receivers, TickFigures(mind, process.vitals, log))
    try:
        failure = run_mind(mind, robot, radio, receivers)
    finally:
        telemetry.close()
    if failure is not None:
        log.error(failure)
        return 1
    return _exit_code_of(robot, log.warning, ending)


def _exit_code_of(robot: SimRobot, warn: Callable[[str], None], ending: Ending) -> int:
    """Return the exit code of a robot that has left its fleet."""
    if robot.orderly:
        return 0
    if robot.unlike:
        raise BadInput(robot.farewell)
    warn(f"left: {robot.farewell}")
    return INTERRUPTED if ending else 1


def simulated_parser() -> ProcessParser:
    """Make the command line's parser for a robot that a world simulates."""
    instead = "; for a ROS 2 robot give --robot ros2 instead"
    description = "One robot of a simulated fleet, as a process."
    parser = fleet_parser("fogwatch agent", description, HELP, "router and world", instead)
    add = parser.add_argument
    add("--robot", metavar="NAME", help="the robot's name in the scenario (default: the credentials')")
    add("--incarnation", type=int, default=FIRST_INCARNATION, metavar="N", help="which start this is (%(default)s)")
    return parser
