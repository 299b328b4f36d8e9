"""The process of simulated ROS 2 robots: it connects them, keeps the time, and writes the measurements."""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

from patrol.classes.named_class import NamedClass
from patrol.classes.static_check import announce
from patrol.errors import BadInput
from patrol.files.whole_file import writing
from patrol.own_sensor import allow_sensor, sensor_named
from patrol.pose import Pose
from patrol.prepare import Prepared, prepare, sensor_footprint
from patrol.scenario import Scenario, load_scenario, naming
from ros2.sim.bodies import BODIES, bodies_named
from ros2.sim.node import Habits, RobotNode
from ros2.sim.odometry import Errors
from ros2.sim.options import check, parser, robots_of, unplugged
from ros2.sim.robot import Build, SimulatedRobot
from ros2.sim.simulation import STEP_S, Simulation
from ros2.wire.formats import format_named
from ros2.wire.frames import pose_given
from ros2.wire.link import open_ros2
from ros2.wire.names import NodeName, check_name
from runtime.net.link import LinkDown
from runtime.process.context import AskedToLeave, ProcessContext, run_with
from runtime.process.failures import INTERRUPTED
from runtime.process.lifeline import Ending
from runtime.reporting.vitals import COMMANDS, MFOW, TICK, Vitals
from runtime.security.keys import check_locator
from worldsim.truth import Truth

Note = Callable[[float, Mapping[str, Pose]], None]

NODE = "robot_sim"


def main(arguments: Sequence[str] | None = None) -> int:
    """Simulate robots until the time is over or asked to leave."""
    return run_with(parser().parse_args(arguments), "robot-sim", _run_simulation)


def _run_simulation(process: ProcessContext) -> int:
    options, say = process.options, process.log.info
    check(options)
    process.follow()
    scenario = _make_scenario(options) if options.scenario is None else load_scenario(options.scenario)
    names = list(robots_of(options))
    plugs = unplugged(options, names)
    process.warm(("patrol", "worldsim"), scenario)
    bodies = [] if options.bodies is None else [NamedClass(BODIES, options.bodies, None, {})]
    announce([sensor_named(scenario.sensor), *bodies])
    allow_sensor(scenario.sensor, record=True)
    with nullcontext() if options.scenario is None else naming(options.scenario):
        prepared = prepare(scenario)
    pace = options.pace or scenario.factor or 1.0
    simulation = _make_simulation(process, prepared, pace, _pose_note(process))
    say(f"simulates {', '.join(names)} at {options.connect}")
    _show_figures(simulation, process.vitals)
    _keep_time(simulation, pace, options.duration, plugs, process.ending, say)
    _write_summary(options, simulation.summary())
    return INTERRUPTED if process.ending else 0


def _make_scenario(options: argparse.Namespace) -> Scenario:
    """Return a scenario for robots of one kind on a map."""
    starts = [pose_given("--start", text) for text in options.start]
    body = {name: getattr(options, name) for name in ("model", "speed", "radius", "turning_radius")}
    robots: list[dict[str, Any]] = [{"name": name, **body} for name in robots_of(options)]
    for robot, start in zip(robots, starts, strict=False):
        robot["start"] = [start.x, start.y, start.heading]
    raw = {"terrain": {"map": str(options.map.absolute())}, "pace": "realtime", "robots": robots}
    return load_scenario(raw, called="options", aliases={"terrain.map": "--map", "robots": "--robots"})


def _pose_note(process: ProcessContext) -> Note | None:
    """Return a function that writes true poses as they come; None where no option asks for it."""
    path: Path | None = process.options.poses
    if path is None:
        return None
    with writing(f"--poses {path}", "give another file"):
        file = process.closing.enter_context(path.open("w", encoding="ascii", buffering=1))
    print("time_s,robot,x,y,heading", file=file)

    def note(time_s: float, poses: Mapping[str, Pose]) -> None:
        for name, pose in poses.items():
            print(f"{time_s:.2f},{name},{pose.x:.4f},{pose.y:.4f},{pose.heading:.4f}", file=file)

    return note


def _make_simulation(process: ProcessContext, prepared: Prepared, pace: float, note: Note | None) -> Simulation:
    """Return the robots, each with a connection of its own."""
    options, scenario, terrain = process.options, prepared.scenario, prepared.terrain
    builds = _robot_builds(options, prepared)
    bodies = bodies_named(options.bodies, terrain, list(builds.values()))
    habits = Habits(
        options.drive,
        options.wheelbase,
        options.odometry_rate,
        options.delay,
        tells_time=pace != 1.0,
        has_map=options.show_map,
        has_nav2=options.nav2,
        is_lost=options.lost,
        transform=pose_given("--transform", options.transform),
    )
    locator = check_locator(options.connect, "--connect")
    nodes = {}
    for name, spoken in robots_of(options).items():
        form = format_named(spoken, options.domain, f"--robots {name}")
        node = NodeName(NODE, check_name(name, "--robots"))
        try:
            link = open_ros2(locator, form, node, options.wait, stopped=process.leaving)
        except LinkDown as down:
            if process.ending:
                raise AskedToLeave from None
            raise BadInput(f"--connect {options.connect}: {down}; start one: fogwatch router") from None
        process.closing.callback(link.close)
        nodes[name] = RobotNode(link, SimulatedRobot(builds[name]), habits, terrain)
    truth = Truth(sensor_footprint(scenario, terrain), prepared.patrolled)
    return Simulation(nodes, bodies, truth, scenario.step, time.time(), note)


def _robot_builds(options: argparse.Namespace, prepared: Prepared) -> dict[str, Build]:
    """Return how each robot is built, by its name."""
    specs = {spec.name: spec for spec in prepared.scenario.roster}
    errors = Errors(
        options.noise,
        options.noise_heading,
        options.drift,
        options.drift_heading,
        options.pose_noise,
        options.pose_noise_heading,
    )
    builds = {}
    for name in robots_of(options):
        if name not in specs:
            raise BadInput(f"--robots {name}: no robot of the scenario, which has {', '.join(list(specs)[:8])}")
        spec = specs[name]
        if options.scenario is not None and options.margin >= spec.radius:
            raise BadInput(f"--margin {options.margin:g}: {spec.name}'s radius is {spec.radius:g} m; give less")
        margin = 0.0 if options.scenario is None else options.margin
        builds[name] = Build(
            replace(spec, radius=spec.radius - margin),
            prepared.starts[spec.number - 1],
            errors,
            options.acceleration,
            options.watchdog,
            options.seed,
        )
    return builds


def _show_figures(simulation: Simulation, vitals: Vitals) -> None:
    """Let the process's vitals show the figures of the simulated robots."""
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


def _write_summary(options: argparse.Namespace, summary: dict[str, Any]) -> None:
    text = json.dumps(summary, indent=1)
    if options.out is None:
        print(text)
        return
    with writing(f"--out {options.out}", "give another file"):
        options.out.write_text(f"{text}\n", encoding="utf-8")
