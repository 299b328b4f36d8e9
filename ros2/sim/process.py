"""The process of simulated ROS 2 robots: it connects them, keeps the time, and writes down what was measured."""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from patrol.errors import BadInput
from patrol.process.context import AskedToLeave, ProcessContext, run_with
from patrol.process.exit_codes import INTERRUPTED
from patrol.process.lifeline import Ending
from ros2.sim.options import check, errors_of, parser, robots_of, starts_of, transform_of, unplugged

if TYPE_CHECKING:
    from patrol.pose import Pose
    from patrol.prepare import Prepared
    from patrol.reporting.vitals import Vitals
    from patrol.scenario import Scenario
    from ros2.sim.node import Habits
    from ros2.sim.robot import Build
    from ros2.sim.simulation import Simulation

    Note = Callable[[float, Mapping[str, Pose]], None]

NODE = "robot_sim"


def main(arguments: Sequence[str] | None = None) -> int:
    """Simulate robots until the time is over or asked to leave."""
    return run_with(parser().parse_args(arguments), "robot-sim", _run)


def _run(process: ProcessContext) -> int:
    from patrol.own_sensor import allow_sensor
    from patrol.prepare import prepare
    from patrol.scenario import load_scenario, naming

    options, say = process.options, process.log.info
    check(options)
    process.follow()
    scenario = _scenario(options) if options.scenario is None else load_scenario(options.scenario)
    names = [one.name for one in robots_of(options)]
    plugs = unplugged(options, names)
    process.warm(("patrol", "worldsim"), scenario)
    allow_sensor(scenario.sensor)
    with nullcontext() if options.scenario is None else naming(options.scenario):
        prepared = prepare(scenario)
    pace = options.pace or scenario.factor or 1.0
    simulation = _simulation(process, prepared, pace, _noting(process))
    say(f"simulates {', '.join(names)} at {options.connect}")
    show(simulation, process.vitals)
    _keep_time(simulation, pace, options.duration, plugs, process.ending, say)
    _write(options, simulation.summary())
    return INTERRUPTED if process.ending else 0


def _scenario(options: argparse.Namespace) -> Scenario:
    """Return a scenario for robots of one kind on a map."""
    from patrol.scenario import load_scenario

    starts = starts_of(options)
    entries: list[dict[str, Any]] = []
    for place, robot in enumerate(robots_of(options)):
        entries.append(
            {
                "name": robot.name,
                "model": options.model,
                "speed": options.speed,
                "radius": options.radius,
                "turning_radius": options.turning_radius,
            }
        )
        if place < len(starts):
            entries[-1]["start"] = [starts[place].x, starts[place].y, starts[place].heading]
    raw = {"terrain": {"map": str(options.map.absolute())}, "pace": "realtime", "robots": entries}
    return load_scenario(raw, called="options", aliases={"terrain.map": "--map", "robots": "--robots"})


def _noting(process: ProcessContext) -> Note | None:
    """Return what writes true poses down as they come; None where no option asks for it."""
    path: Path | None = process.options.poses
    if path is None:
        return None
    try:
        file = process.closing.enter_context(path.open("w", encoding="ascii", buffering=1))
    except OSError as error:
        raise BadInput(f"--poses {path}: cannot be written ({error.strerror}); give another file") from None
    print("time_s,robot,x,y,heading", file=file)

    def note(time_s: float, poses: Mapping[str, Pose]) -> None:
        for name, pose in poses.items():
            print(f"{time_s:.2f},{name},{pose.x:.4f},{pose.y:.4f},{pose.heading:.4f}", file=file)

    return note


def _simulation(process: ProcessContext, prepared: Prepared, pace: float, note: Note | None) -> Simulation:
    """Return the robots, each with a connection of its own."""
    from patrol.net.link import LinkDown
    from patrol.prepare import sensor_footprint
    from patrol.security.keys import check_locator
    from ros2.sim.bodies import bodies_named
    from ros2.sim.node import RobotNode
    from ros2.sim.robot import SimulatedRobot
    from ros2.sim.simulation import CollisionGround, Simulation
    from ros2.wire.formats import format_named
    from ros2.wire.link import open_ros2
    from ros2.wire.names import NodeName, check_name

    options, scenario, terrain = process.options, prepared.scenario, prepared.terrain
    builds = _builds(options, prepared)
    bodies = bodies_named(options.bodies, terrain, list(builds.values()))
    habits = _habits(options, pace)
    locator = check_locator(options.connect, "--connect")
    nodes = {}
    for named in robots_of(options):
        form = format_named(named.format, options.domain, f"--robots {named.name}")
        node = NodeName(NODE, check_name(named.name, "--robots"))
        try:
            link = open_ros2(locator, form, node, options.wait, stopped=process.leaving)
        except LinkDown as down:
            if process.ending:
                raise AskedToLeave from None
            raise BadInput(f"--connect {options.connect}: {down}; start one: fogwatch router") from None
        process.closing.callback(link.close)
        nodes[named.name] = RobotNode(link, SimulatedRobot(builds[named.name]), habits, terrain)
    ground = CollisionGround(terrain, sensor_footprint(scenario, terrain), prepared.patrolled, scenario.step)
    return Simulation(nodes, ground, time.time(), bodies, note)


def _builds(options: argparse.Namespace, prepared: Prepared) -> dict[str, Build]:
    """Return how each robot is built, by its name."""
    from ros2.sim.robot import Build

    specs = {spec.name: spec for spec in prepared.scenario.roster}
    builds = {}
    for named in robots_of(options):
        if named.name not in specs:
            raise BadInput(f"--robots {named.name}: no robot of the scenario, which has {', '.join(list(specs)[:8])}")
        spec = specs[named.name]
        if options.scenario is not None and options.margin >= spec.radius:
            raise BadInput(f"--margin {options.margin:g}: {spec.name}'s radius is {spec.radius:g} m; give less")
        margin = 0.0 if options.scenario is None else options.margin
        builds[named.name] = Build(
            replace(spec, radius=spec.radius - margin),
            prepared.starts[spec.number - 1],
            errors_of(options),
            options.acceleration,
            options.watchdog,
            options.seed,
        )
    return builds


def _habits(options: argparse.Namespace, pace: float) -> Habits:
    from ros2.sim.node import Habits

    return Habits(
        options.drive,
        options.wheelbase,
        options.odometry_rate,
        options.delay,
        pace != 1.0,
        options.show_map,
        options.nav2,
        options.lost,
        transform_of(options),
    )


def show(simulation: Simulation, vitals: Vitals) -> None:
    """Let the process's vitals show the figures of the simulated robots."""
    from patrol.reporting.vitals import COMMANDS, MFOW, TICK

    vitals.probe(TICK, lambda: simulation.ticks or None)
    vitals.probe(MFOW, lambda: simulation.mfow_s)
    vitals.probe(COMMANDS, lambda: {name: node.robot.commands for name, node in simulation.nodes.items()})


def _keep_time(
    simulation: Simulation,
    pace: float,
    duration_s: float,
    plugs: dict[str, float],
    ending: Ending,
    say: Callable[[str], None],
) -> None:
    """Step by step until the time is over or it is time to leave."""
    from ros2.sim.simulation import STEP_S

    begin_s = time.monotonic()
    while simulation.patrolled_s < duration_s:
        due_s = begin_s + (simulation.time_s + STEP_S) / pace
        if ending.wait(max(0.0, due_s - time.monotonic())):
            return
        simulation.late_s = max(simulation.late_s, time.monotonic() - due_s)
        for name in [name for name, at_s in plugs.items() if simulation.patrolled_s >= at_s]:
            del plugs[name]
            simulation.unplug(name, time.monotonic())
            say(f"{name}: its odometry ends")
        simulation.step(time.monotonic())


def _write(options: argparse.Namespace, summary: dict[str, Any]) -> None:
    text = json.dumps(summary, indent=1)
    if options.out is None:
        print(text)
        return
    try:
        options.out.write_text(f"{text}\n", encoding="utf-8")
    except OSError as error:
        raise BadInput(f"--out {options.out}: cannot be written ({error.strerror}); give another file") from None
