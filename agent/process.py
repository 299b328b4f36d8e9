"""The process around a mind: it joins a fleet, lets the mind decide tick after tick, and leaves when told to."""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from patrol.errors import BadInput
from patrol.net.phases import FIRST_INCARNATION
from patrol.net.telemetry import Telemetry, Traffic, pack_view
from patrol.process.lifeline import INTERRUPTED, Ending, heed
from patrol.process.options import TOGETHER, fleet_parser, prepared_as_told

if TYPE_CHECKING:
    from agent.decision import Decision
    from agent.mind import Mind
    from agent.robots import Radio, Robot, Sensed
    from patrol.scenario import RobotSpec, Scenario

HELP = f"""
One robot of a fleet whose router and world run elsewhere. {TOGETHER}

They may be started in any order. Where the scenario's radio.via is direct, --radio says what the robots hear each other
by: a multicast group, which needs no router, or a router of their own; unless given, the fleet's.

Exit codes: 0 the run is over, 1 left out of it, 2 bad input, 130 interrupted.
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
    from patrol.net.keys import check_locator, check_radio, fleet_keys
    from patrol.scenario import load_scenario, scenario_hash

    router = check_locator(options.router, "--router")
    keys = fleet_keys(options.fleet)
    scenario = load_scenario(options.scenario)
    on_air = check_radio(options.radio, "--radio", scenario.radio.via)
    spec = _spec(scenario, options.robot)
    mind = _mind(scenario, spec, options, ending)
    if mind is None:
        return INTERRUPTED

    from agent.radios.direct import tune_in
    from agent.robots.sim import Identity, join
    from patrol.net.link import open_links

    def say(line: str) -> None:
        print(f"{spec.name}: {line}", file=sys.stderr, flush=True)

    links = open_links(router, on_air, options.wait, say, lambda: bool(ending))
    if links is None:
        return INTERRUPTED
    link, air = links
    instance = int.from_bytes(os.urandom(8), "big") >> 1 | 1
    identity = Identity(spec.name, options.incarnation, instance, scenario_hash(scenario))

    def waiting(waited_s: float) -> None:
        say(f"waiting for the world of fleet {keys.fleet} ({waited_s:.0f} s)")

    blind_s = math.inf if scenario.factor is None else scenario.watchdog / scenario.factor
    robot = join(link, keys, identity, len(scenario.roster), ending, options.wait, waiting, blind_s)
    eyes = Eyes(link.publisher(keys.telemetry(spec.name)))
    radio: Radio = robot
    if scenario.radio.via == "direct":
        numbers = {one.name: one.number for one in scenario.roster}
        radio = direct = tune_in(air, keys, spec.name, numbers, lambda: robot.hear() is not None)
        eyes.traffic = lambda final: direct.traffic(options.incarnation, final=final)
    try:
        run_mind(mind, robot, radio, eyes.show)
    finally:
        eyes.close()
        air.close()
        link.close()
    if robot.orderly:
        return 0
    say(f"left: {robot.farewell}")
    return INTERRUPTED if ending else 1


def _spec(scenario: Scenario, name: str) -> RobotSpec:
    for spec in scenario.roster:
        if spec.name == name:
            return spec
    names = ", ".join(spec.name for spec in scenario.roster[:8])
    raise BadInput(f"--robot {name!r}: no robot of scenario {scenario.name}; its first are {names}")


def _mind(scenario: Scenario, spec: RobotSpec, options: argparse.Namespace, ending: Ending) -> Mind | None:
    """The robot's mind, with the launcher's static fields or ones of its own making; None when told to leave."""
    from patrol.process.warmup import warm

    warm(("patrol", "agent"), lambda line: print(f"{spec.name}: {line}", file=sys.stderr, flush=True))
    import numpy as np

    from agent.bodies.refine import psi_field
    from agent.mind import Mind, MindSetup
    from patrol.radio.fleet_key import fleet_key

    prepared = prepared_as_told(scenario, options, ending)
    if prepared is None:
        return None
    static: Path | None = options.static
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
            key=fleet_key(scenario.radio.key),
            regions=prepared.regions_of(spec.number),
        )
    )


class Eyes:
    """Shows decisions, at most one each `TELEMETRY_S`. traffic: what the radio has carried, when somebody counts it."""

    def __init__(self, post: Callable[[bytes], None]) -> None:
        self.traffic: Callable[[bool], Traffic | None] = lambda _final: None
        self._post = post
        self._due = 0.0
        self._last: Telemetry | None = None

    def show(self, sensed: Sensed, decision: Decision, decision_ms: float) -> None:
        """Show a decision, when it is time to."""
        now = time.monotonic()
        self._last = view = Telemetry(
            k=sensed.k,
            state=decision.state.value,
            goal=decision.goal,
            refined=decision.refined,
            direction=decision.direction,
            mfow=decision.mfow,
            decision_ms=decision_ms,
            rejected=decision.rejected,
        )
        if now >= self._due:
            self._due = now + TELEMETRY_S
            self._post(pack_view(replace(view, traffic=self.traffic(False))))

    def close(self) -> None:
        """Show the last decision once more, with all that the radio has carried."""
        if self._last is not None and (traffic := self.traffic(True)) is not None:
            self._post(pack_view(replace(self._last, traffic=traffic)))


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = fleet_parser("agent", "One robot of a simulated fleet, as a process.", HELP, "router and world")
    add = parser.add_argument
    add("--robot", required=True, metavar="NAME", help="which robot of the scenario this is")
    add("--incarnation", type=int, default=FIRST_INCARNATION, metavar="N", help="how often this robot was started")
    return parser.parse_args(arguments)
