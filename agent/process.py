"""The process around a mind: it joins a fleet, lets the mind decide tick after tick, and leaves when told to."""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from patrol.errors import BadInput
from patrol.lifeline import INTERRUPTED, Ending, heed
from patrol.phases import FIRST_INCARNATION

if TYPE_CHECKING:
    from agent.decision import Decision
    from agent.mind import Mind
    from agent.robots import Radio, Robot, Sensed
    from patrol.scenario import RobotSpec, Scenario

HELP = """
One robot of a fleet whose router and world run elsewhere. All processes are given the same scenario file and the same
name for the fleet:

  python -m fogwatch.router --listen tcp/0.0.0.0:7447
  python -m worldsim --router tcp/192.168.1.10:7447 --fleet yards-1 --scenario yards.yaml --out runs/yards-1
  python -m agent    --router tcp/192.168.1.10:7447 --fleet yards-1 --scenario yards.yaml --robot r1
  python -m agent    --router tcp/192.168.1.10:7447 --fleet yards-1 --scenario yards.yaml --robot r2

They may be started in any order. Exit codes: 0 the run is over, 1 left out of it, 2 bad input, 130 interrupted.
"""

TELEMETRY_S = 0.2
"""Wall time between two reports for eyes."""

PSI = "psi.npy"

Show = Callable[["Sensed", "Decision", float], None]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one agent; the exit code."""
    options = _options(arguments)
    ending = heed(options.lifeline)
    try:
        return _run(options, ending)
    except BadInput as bad:
        print(f"{options.robot}: {bad}", file=sys.stderr)
        return 2


def run_mind(mind: Mind, robot: Robot, radio: Radio, show: Show) -> None:
    """Sense, tell, hear, decide, act, for as long as there is something to sense."""
    while (sensed := robot.sense()) is not None:
        radio.send(mind.frames(sensed.k, sensed.pose, sensed.contacts, sensed.clock_s))
        heard = radio.hear()
        if heard is None:
            continue
        began = time.perf_counter()
        decision = mind.step(sensed.k, sensed.pose, heard, sensed.bumped, sensed.contacts)
        decision_ms = (time.perf_counter() - began) * 1000.0
        robot.act(decision, decision_ms)
        show(sensed, decision, decision_ms)


def _run(options: argparse.Namespace, ending: Ending) -> int:
    from patrol.keys import check_locator, fleet_keys
    from patrol.scenario import load_scenario, scenario_hash

    router = check_locator(options.router, "--router")
    keys = fleet_keys(options.fleet)
    scenario = load_scenario(options.scenario)
    spec = _spec(scenario, options.robot)
    mind = _mind(scenario, spec, options, ending)
    if mind is None:
        return INTERRUPTED

    from agent.robots.sim import Identity, join
    from patrol.link import LinkDown, open_link

    def waiting_for(what: str) -> Callable[[float], None]:
        return lambda waited: print(f"{spec.name}: waiting for {what} ({waited:.0f} s)", file=sys.stderr, flush=True)

    try:
        link = open_link(router, options.wait, waiting_for(f"a router at {router}"), lambda: bool(ending))
    except LinkDown as down:
        if ending:
            return INTERRUPTED
        raise BadInput(f"{down}; start one with: python -m fogwatch.router --listen {router}") from None
    instance = int.from_bytes(os.urandom(8), "big") >> 1 | 1
    identity = Identity(spec.name, options.incarnation, instance, scenario_hash(scenario))
    world = f"the world of fleet {keys.fleet}"
    robot = join(link, keys, identity, len(scenario.roster), ending, options.wait, waiting_for(world))
    show = _telemetry(link.show(keys.telemetry(spec.name)))
    try:
        run_mind(mind, robot, robot, show)
    finally:
        link.close()
    if robot.orderly:
        return 0
    print(f"{spec.name}: left: {robot.farewell}", file=sys.stderr, flush=True)
    return INTERRUPTED if ending else 1


def _spec(scenario: Scenario, name: str) -> RobotSpec:
    for spec in scenario.roster:
        if spec.name == name:
            return spec
    names = ", ".join(spec.name for spec in scenario.roster[:8])
    raise BadInput(f"--robot {name!r}: no robot of scenario {scenario.name}; its first are {names}")


def _mind(scenario: Scenario, spec: RobotSpec, options: argparse.Namespace, ending: Ending) -> Mind | None:
    """The robot's mind, with the launcher's static fields or ones of its own making; None when told to leave."""
    from patrol.warmup import warm

    warm(("patrol", "agent"), lambda line: print(f"{spec.name}: {line}", file=sys.stderr, flush=True))
    import numpy as np

    from agent.mind import Mind, MindSetup
    from agent.refine import psi_field
    from patrol.keyfile import fleet_key
    from patrol.prepare import Prepared, prepare

    static: Path | None = options.static
    limit_s = options.wait if options.lifeline is None else math.inf  # a launcher may have a large map to work on
    if static is not None and not ending.wait_for(static, limit_s):
        if ending:
            return None
        raise BadInput(f"--static {static}: there is no such folder; leave the option out to compute the fields here")
    prepared = prepare(scenario) if static is None else Prepared.load(scenario, static)
    psi = None
    if scenario.patrol.avoidance == "goal-refinement":
        reach = scenario.patrol.refine_reach
        psi = psi_field(prepared.terrain, reach) if static is None else np.load(static / PSI, mmap_mode="r")
    return Mind(
        MindSetup(
            scenario,
            spec.number,
            prepared.terrain,
            prepared.fields[spec.number],
            psi,
            incarnation=options.incarnation,
            key=fleet_key(scenario),
            regions=prepared.regions_of(spec.number),
        )
    )


def _telemetry(post: Callable[[bytes], None]) -> Show:
    """Shows decisions, at most one each `TELEMETRY_S`."""
    from patrol.eyes import Telemetry, show

    due = 0.0

    def tell(sensed: Sensed, decision: Decision, decision_ms: float) -> None:
        nonlocal due
        now = time.monotonic()
        if now < due:
            return
        due = now + TELEMETRY_S
        view = Telemetry(
            k=sensed.k,
            state=decision.state.value,
            goal=decision.goal,
            refined=decision.refined,
            direction=decision.direction,
            mfow=decision.mfow,
            decision_ms=decision_ms,
            rejected=decision.rejected,
        )
        post(show(view))

    return tell


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m agent",
        description="One robot of a simulated fleet, as a process.",
        epilog=HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--router", required=True, metavar="tcp/HOST:PORT", help="the router that the fleet meets at")
    add("--fleet", required=True, metavar="NAME", help="the fleet's name, the same for all its processes")
    add("--scenario", required=True, type=Path, metavar="FILE", help="the scenario, the same for all processes")
    add("--robot", required=True, metavar="NAME", help="which robot of the scenario this is")
    add("--static", type=Path, metavar="DIR", help="static fields made by the launcher (default: make them here)")
    add("--incarnation", type=int, default=FIRST_INCARNATION, metavar="N", help="how often this robot was started")
    add("--wait", type=float, default=60.0, metavar="S", help="how long to wait for router and world (%(default)g s)")
    add("--lifeline", type=int, metavar="FD", help="leave when this pipe ends (set by the launcher)")
    return parser.parse_args(arguments)
