"""The process around a mind that drives a ROS 2 robot: it finds the robot and its map, and joins its fleet."""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from patrol.errors import BadInput, NotPrepared
from patrol.process.context import AskedToLeave, ProcessContext, run_with
from patrol.process.lifeline import rest_before_pause
from patrol.reporting.logs import Log
from ros2.robot.options import FORMATS, SCENARIO_START, domain_of, drive_settings, options_of

if TYPE_CHECKING:
    from agent.own_robot import Site
    from agent.ports import Telemetry
    from patrol.ground.terrain import Terrain
    from patrol.pose import Pose
    from patrol.scenario import RobotSpec, Scenario
    from ros2.robot.diagnostics import Diagnostics
    from ros2.robot.driver import Ros2Robot
    from ros2.robot.hardware import Hardware, Rivals
    from ros2.robot.initial import InitialPose
    from ros2.robot.options import DriveSettings
    from ros2.robot.shown import Shown
    from ros2.wire.ports import Ros2Link

FLEET = "patrol"
"""The fleet's name unless options say otherwise."""

FAILED = 1
"""The exit code of a robot that can no longer be driven."""

NODE = "fogwatch"
"""The name of our node in the ROS graph, in the robot's namespace."""

SAY_S = 5.0
"""Time between two lines about what is waited for, s."""

QUIET_S = 2.0
"""Time for which a robot's localisation has to say nothing, from the first odometry on, before it is told where it is,
s: one that knows is told nothing, and its first word may come after the odometry."""

GRAPH_S = 1.0
"""Time for a router to list the nodes that it knows, s."""

LISTEN_S = 2.0
LISTEN_MORE_S = 1.5
"""Time for which the first robot of a roster listens for others before it counts ticks from now, and by how much longer
each next one does, s: of robots that start together, all but the first hear another robot's count."""

LONGEST_S = 4_000_000.0
"""Longest patrol without a scenario, s: 46 days."""

REACTION_S = 0.1
"""Time from the reception of a command until the robot brakes, s."""

HOLD_STEPS = 1.5
"""Number of steps for which a command is obeyed when no other comes."""

_LOOK_S = 0.05
_Say = Callable[[str], None]


def main(arguments: Sequence[str]) -> int:
    """Drive a ROS 2 robot until asked to leave."""
    return run_with(options_of(arguments), "robot", _run)


def _name(options: argparse.Namespace) -> str:
    """Return the robot's name in its fleet."""
    from patrol.security.credentials import read_credentials

    if options.name is not None:
        return str(options.name)
    if options.credentials is not None:
        return read_credentials(options.credentials, "--credentials").role.name
    return options.namespace.strip("/").rpartition("/")[2] or "robot"


def _check_scenario(scenario: Scenario, drive: str) -> None:
    """Refuse what a ROS 2 robot does not sense, and zones that Nav2 would drive through as if they were not there."""
    if scenario.closures:
        raise NotPrepared("closures: a ROS 2 robot reports nothing blocked here; drop them")
    if any(spec.battery is not None for spec in scenario.roster):
        raise NotPrepared("robots.battery: a ROS 2 robot reports no charge here; drop it and docks")
    if drive != "nav2":
        return
    for number, zone in enumerate(scenario.zones):
        if zone.speed is not None:
            why = "Nav2 drives to goals at its own speed; give it the mask for its speed filter, and drop it here"
            raise NotPrepared(f"zones.{number}.speed = {zone.speed:g}: {why}")
        if zone.one_way is not None:
            why = (
                "Nav2 drives to goals on ways of its own, which may lead against it; drop it, or choose another --drive"
            )
            raise NotPrepared(f"zones.{number}.one_way = {zone.one_way}: {why}")


def _run(process: ProcessContext) -> int:
    """Find the robot, and patrol with it; return the exit code."""
    from patrol.scenario import naming, parse_overrides

    options = process.options
    overrides = parse_overrides(options.set)
    with nullcontext() if options.scenario is None else naming(options.scenario, overrides):
        return _find_and_patrol(process, overrides)


def _find_and_patrol(process: ProcessContext, overrides: dict[str, object]) -> int:
    """Check all input, then find the robot, and patrol with it; return the exit code."""
    from agent.own_robot import check_epoch
    from patrol.scenario import load_scenario
    from patrol.security.keys import check_locator, check_radio
    from patrol.security.roles import robot_role
    from ros2.robot.hardware import Hardware
    from ros2.robot.stop_files import StopFiles, state_folder

    options = process.options
    name = _name(options)
    process.follow(name)
    say = process.log.info
    settings = drive_settings(options)
    stop_files = StopFiles(state_folder(options.state, os.environ), robot_role(name).robot)
    scenario = None if options.scenario is None else load_scenario(options.scenario, overrides)
    if scenario is not None:
        _check_scenario(scenario, settings.drive)
    terrain = _check_ground(options, name, scenario, overrides)
    if options.connect is not None:
        check_locator(options.connect, "--connect")
    check_radio(options.radio, "--radio", "direct")
    if options.epoch is not None:
        check_epoch(options.epoch, time.time(), say)
    _choose_router(process)
    for spec in () if scenario is None else scenario.roster:
        if spec.name == name:
            settings = settings.of_body(spec.model, spec.limits)
            if options.start == SCENARIO_START:
                settings = _started(settings, spec)
            break
    else:
        if options.start == SCENARIO_START:
            raise BadInput(f"--start scenario: {name} is not in {options.scenario}; give --name, or a pose")
    _check_start(settings, terrain)
    link = _link(process)
    process.closing.callback(link.close)
    factor = 1.0 if scenario is None or scenario.factor is None else scenario.factor
    hardware = Hardware(link, settings, factor, say, stop_files)
    pose = _found(hardware, link, process)
    say(f"is at ({pose.x:.2f}, {pose.y:.2f}), heading {pose.heading:.2f}")
    # A robot with a map of its own shows that itself.
    has_map = options.transform is None and (scenario is not None or options.map is not None)
    if scenario is None:
        folder = Path(process.closing.enter_context(tempfile.TemporaryDirectory(prefix="fogwatch-")))
        map_file = options.map or _robots_map(link, settings, folder, process)
        scenario = _scenario(options, name, map_file, pose, overrides)
    if options.write_scenario is not None:
        _write(scenario, options.write_scenario)
    return _patrol(process, scenario, hardware, has_map)


def _patrol(process: ProcessContext, scenario: Scenario, hardware: Hardware, shows_map: bool) -> int:
    """Patrol with a robot that was found; return the exit code."""
    from agent.mind_loop import Both
    from agent.own_robot import Ticks, patrol_with
    from ros2.robot.driver import DriverFailed

    name, options = process.log.process, process.options
    numbers = {spec.name: spec.number for spec in scenario.roster}
    alone_s = LISTEN_S + LISTEN_MORE_S * (numbers.get(name, 1) - 1)
    rivals = _alone(hardware, process)
    if options.router is not None and options.router == options.connect:
        where = f"the robot's own router, {options.connect}"
        process.log.info(f"meets its fleet at {where}; give --router if others have another")
    ticks = Ticks(options.epoch, options.wait, alone_s)

    def make(site: Site) -> Ros2Robot:
        shown = _shown(site, hardware, shows_map, process.log)
        diagnostics = _diagnostics(site, hardware, scenario)
        robot = _robot(site, hardware, Both(shown, diagnostics), process.log, rivals)
        diagnostics.watch(robot)
        process.closing.callback(diagnostics.close)
        if process.supervision.counts:
            robot.show(process.vitals)
        rest_before_pause(robot.rest, robot.go_on)
        return robot

    try:
        return patrol_with(process, make, scenario, name, ticks)
    except DriverFailed as failed:
        process.log.error(str(failed))
        return FAILED
    finally:
        rivals.close()


def _alone(hardware: Hardware, process: ProcessContext) -> Rivals:
    """Make sure that no other process drives the robot, from now on. Raises BadInput if one does."""
    from ros2.robot.hardware import Rivals

    settings, link = hardware.settings, hardware.link
    usual = None if settings.is_shared else settings.commands
    rivals = Rivals(link, None if usual is None else link.resolve(settings.topic(usual)))
    if drivers := rivals.are_there(stopped=process.leaving):
        raise BadInput(
            f"{', '.join(drivers)}: drives the robot already; end that first, or let a twist_mux choose and give its "
            "input by --topic, or give --shared-commands for a joystick"
        )
    return rivals.watch()


def _check_ground(
    options: argparse.Namespace, name: str, scenario: Scenario | None, overrides: dict[str, object]
) -> Terrain | None:
    """Check options, map and bodies before anything waits for the robot; return the map, if it is given."""
    from patrol.prepare import terrain_of
    from patrol.starts import place_starts

    if scenario is None and options.map is None:
        elsewhere = {field: value for field, value in overrides.items() if not field.startswith("terrain.")}
        _scenario(options, name, None, None, elsewhere)
        return None
    if scenario is None:
        scenario = _scenario(options, name, options.map, None, overrides)
    terrain = terrain_of(scenario)
    try:
        place_starts(terrain, scenario.roster, scenario.seed)
    except BadInput as error:
        words = str(error)
        if options.scenario is None:
            words = words.replace("robots.radius =", "--radius with --margin =")
        raise NotPrepared(words) from None
    return terrain


def _check_start(settings: DriveSettings, terrain: Terrain | None) -> None:
    """Refuse a start off the map, before the robot's localisation is told."""
    start = settings.localisation.start
    if start is None or terrain is None:
        return
    xmin, ymin, xmax, ymax = terrain.bounds
    if not (xmin <= start.x <= xmax and ymin <= start.y <= ymax):
        raise BadInput(
            f"--start: ({start.x:g}, {start.y:g}) is not on {terrain.name}, which spans x {xmin:g} to {xmax:g} m and "
            f"y {ymin:g} to {ymax:g} m"
        )


def _link(process: ProcessContext) -> Ros2Link:
    """Join the robot's router, or its ROS. Raises AskedToLeave, or BadInput when there is none."""
    from patrol.net.link import LinkDown
    from patrol.security.credentials import read_credentials
    from patrol.security.keys import check_locator
    from ros2.wire.formats import format_named
    from ros2.wire.link import open_ros2
    from ros2.wire.names import NodeName, check_name
    from ros2.wire.rclpy_link import RclpyLink, import_rclpy

    options = process.options
    namespace = options.namespace.strip("/")
    if namespace:
        check_name(namespace, "--namespace")
    node = NodeName(NODE, namespace)
    if options.robot == "rclpy":
        return RclpyLink(import_rclpy(), node, domain_of(options), process.ending.ask)
    locator = check_locator(options.connect, "--connect")
    option, proof = "--ros-credentials", options.ros_credentials
    if proof is None and locator.startswith("tls/"):
        option, proof = "--credentials", options.credentials
    credentials = None if proof is None else read_credentials(proof, option)
    try:
        return open_ros2(
            locator,
            format_named(options.format or FORMATS[0], domain_of(options), "--format"),
            node,
            options.wait,
            lambda waited: process.log.info(f"waiting for the robot's router at {locator} ({waited:.0f} s)"),
            process.leaving,
            credentials,
        )
    except LinkDown as down:
        if process.ending:
            raise AskedToLeave from None
        raise BadInput(f"--connect {options.connect}: {down}; is the robot's Zenoh router running?") from None


def _found(hardware: Hardware, link: Ros2Link, process: ProcessContext) -> Pose:
    """Return where the robot is at first. Raises AskedToLeave, or BadInput when it cannot be found."""
    wait_s = process.options.wait
    initial = _initial_pose(hardware)
    began = reported_at = time.monotonic()
    heard_at: float | None = None
    while not process.ending.wait(_LOOK_S):
        now, fix = time.monotonic(), hardware.fix()
        doubt = hardware.why if fix is None else "" if initial is None else initial.doubt(fix.pose, now)
        if fix is not None and not doubt:
            return fix.pose
        if fix is not None and initial is not None and not initial.was_told:
            raise BadInput(f"--start: the robot is localised already, and {doubt}")
        if heard_at is None and hardware.odometry_age_s is not None:
            heard_at = now
        if initial is not None and heard_at is not None and now - heard_at >= QUIET_S:
            if not initial.was_told and hardware.stamp_ns():
                process.log.info("tells the robot's localisation where --start says it is")
            initial.tell(hardware.stamp_ns(), now)
        if now - reported_at < SAY_S and now - began < wait_s:
            continue
        reported_at = now
        other = link.other_format(GRAPH_S)
        if now - began >= wait_s:
            remedy = f"the nodes on this router speak {other}" if other else "fogwatch doctor says more"
            raise BadInput(f"the robot was not found within {wait_s:g} s: {doubt}; {remedy}")
        speaks = f"; the nodes on this router speak {other}" if other else ""
        process.log.info(f"waiting for the robot: {doubt}{speaks}")
    raise AskedToLeave


def _started(settings: DriveSettings, spec: RobotSpec) -> DriveSettings:
    """Return the settings of a robot that stands where its scenario has it."""
    if spec.start is None:
        raise BadInput(f"--start scenario: {spec.name} has no start there; give it one, or a pose here")
    return replace(settings, localisation=replace(settings.localisation, start=spec.start))


def _initial_pose(hardware: Hardware) -> InitialPose | None:
    """Return what tells the robot's localisation where the robot is; None where that is not asked for."""
    from ros2.robot.initial import InitialPose
    from ros2.robot.localisation import Source
    from ros2.wire.messages import PoseWithCovarianceStamped

    settings = hardware.settings
    found = settings.localisation
    if found.start is None or found.source is Source.ODOMETRY:
        return None
    place = settings.on_robots_map(found.start)
    told = PoseWithCovarianceStamped(0, settings.map_frame, place, found.variances)
    sender = hardware.link.publisher(settings.topic("initialpose"), PoseWithCovarianceStamped)
    return InitialPose(found.start, told, sender)


def _robots_map(link: Ros2Link, settings: DriveSettings, folder: Path, process: ProcessContext) -> Path:
    """Return the robot's own map as a file. Raises AskedToLeave, or BadInput when none comes."""
    from ros2.robot.robot_map import write_map
    from ros2.wire.mailbox import RosMailbox
    from ros2.wire.messages import OccupancyGrid
    from ros2.wire.names import LATCHED

    topic = link.resolve(settings.topic("map"))
    mailbox: RosMailbox[OccupancyGrid] = RosMailbox()
    link.subscribe(topic, OccupancyGrid, mailbox, LATCHED)
    process.log.info(f"waits for the map on {topic}")
    wait_s, began = process.options.wait, time.monotonic()
    while not process.ending:
        if (received := mailbox.take(_LOOK_S)) is not None:
            return write_map(received.message, folder)
        if time.monotonic() - began >= wait_s:
            raise BadInput(f"no map on {topic} within {wait_s:g} s; give --map FILE, or start the robot's map_server")
    raise AskedToLeave


def _scenario(
    options: argparse.Namespace, name: str, map_file: Path | None, pose: Pose | None, overrides: dict[str, object]
) -> Scenario:
    """Make a scenario for robots of one kind on a map; without one on a stand-in, which checks the rest."""
    from patrol.scenario import load_scenario

    names = sorted({listed.strip() for listed in (options.robots or name).split(",")})
    if name not in names:
        raise BadInput(f"--robots {options.robots}: does not hold {name}, which this robot is; add it, or give --name")
    body: dict[str, Any] = {
        "model": options.model,
        "speed": options.speed,
        "radius": options.radius + options.margin,
        **({} if options.turning_radius is None else {"turning_radius": options.turning_radius}),
    }
    start = {} if pose is None else {"start": [pose.x, pose.y, pose.heading]}
    raw = {
        "name": FLEET,
        "terrain": {"builtin": "open"} if map_file is None else {"map": str(map_file.absolute())},
        "duration": LONGEST_S,
        "pace": "realtime",
        "robots": [{"name": robot, **body, **(start if robot == name else {})} for robot in names],
        "radio": {"via": "direct"},
    }
    return load_scenario(raw, overrides, called="options", aliases={"terrain.map": "--map", "robots": "--robots"})


def _write(scenario: Scenario, path: Path) -> None:
    from patrol.scenario import dump_scenario

    try:
        path.write_text(dump_scenario(scenario), encoding="utf-8")
    except OSError as error:
        raise BadInput(f"--write-scenario {path}: cannot be written ({error.strerror}); give another file") from None


def _choose_router(process: ProcessContext) -> None:
    """Let the fleet meet at the robot's own router, unless an option names another place, and check that place."""
    from patrol.security.roles import Kind

    options = process.options
    if options.credentials is None:
        options.router, options.fleet = options.router or options.connect, options.fleet or FLEET
        if options.router is None:
            raise BadInput(
                "--router: missing; --robot rclpy needs one for operators and the fleet, which fogwatch router starts"
            )
    process.meet(Kind.ROBOT)


def _shown(site: Site, hardware: Hardware, shows_map: bool, log: Log) -> Shown:
    from ros2.robot.shown import Shown, show_map

    link, settings = hardware.link, hardware.settings
    if shows_map and not show_map(link, settings, site.terrain, hardware.stamp_ns()):
        log.info(f"somebody else publishes {link.resolve(settings.topic('map'))}, so this agent does not")
    return Shown(link, settings, site.terrain, site.fog, hardware.stamp_ns)


def _diagnostics(site: Site, hardware: Hardware, scenario: Scenario) -> Diagnostics:
    from ros2.robot.diagnostics import Diagnostics, Patrolling

    names = {spec.number: spec.name for spec in scenario.roster}
    facts = Patrolling(site.spec.name, names, site.step, site.factor, scenario.radio.forget_after)
    return Diagnostics(hardware, facts, site.peers)


def _robot(site: Site, hardware: Hardware, onlooker: Telemetry, log: Log, rivals: Rivals) -> Ros2Robot:
    from ros2.robot.driver import Objection, Pace, Ros2Robot
    from ros2.robot.fence import Fence, Others
    from ros2.robot.governor import Governor, Response, Rule
    from ros2.robot.steering import GoalSteering, Steering, VelocitySteering

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
        rule = Rule(spec.model, spec.limits, settings.acceleration, HOLD_STEPS * site.step)
        # Between two commands the robot goes on; half of the margin is kept for the errors of its pose.
        fence = Fence(site.terrain, spec.radius - 0.5 * settings.margin, 2.0 * period_s + REACTION_S, settings.braking)
        others = Others(site.peers, site.radii, site.step, site.foreseen)
        response = Response(spec.radius, spec.speed / settings.braking)
        objections.append(response)
        steering = VelocitySteering(hardware, Governor(rule, fence), others, response)
    pace = Pace(site.step, site.factor, settings.rate_hz)
    return Ros2Robot(hardware, steering, site.clock, pace, onlooker, site.orders(), log, objections).start()
