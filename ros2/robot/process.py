"""The process around a mind that drives a ROS 2 robot: it finds the robot and its map, and joins its fleet."""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

from agent.own_robot import Site, Ticks, check_epoch, patrol_with
from agent.ports import Robot
from patrol.errors import BadInput, NotPrepared
from patrol.files.whole_file import writing
from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.prepare import terrain_of
from patrol.scenario import RobotSpec, Scenario, dump_scenario, load_scenario, naming, parse_overrides
from patrol.starts import place_starts
from ros2.robot.hardware import Hardware, Rivals
from ros2.robot.initial import InitialPose
from ros2.robot.localisation import Source
from ros2.robot.options import FORMATS, SCENARIO_START, DriveSettings, drive_settings
from ros2.robot.shown import write_map
from ros2.robot.stops import DriverFailed, StopFiles, state_folder
from ros2.wire.formats import format_named
from ros2.wire.link import open_ros2
from ros2.wire.mailbox import RosMailbox
from ros2.wire.messages import OccupancyGrid, PoseWithCovarianceStamped
from ros2.wire.names import LATCHED, NodeName, check_name, domain_given
from ros2.wire.ports import Ros2Link
from ros2.wire.rclpy_link import RclpyLink, import_rclpy
from runtime.net.link import LinkDown
from runtime.process.context import AskedToLeave, ProcessContext
from runtime.security.credentials import read_credentials
from runtime.security.keys import check_locator, check_radio
from runtime.security.roles import Kind, robot_role

FLEET = "patrol"
"""The fleet's name unless options say otherwise."""

FAILED = 1
"""The exit code of a robot that can no longer be driven."""

NODE = "fogwatch"
"""The name of our node in the ROS graph, in the robot's namespace."""

SAY_S = 5.0
"""Time between two lines about a wait, s."""

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

_LOOK_S = 0.05


def _robot_name(options: argparse.Namespace) -> str:
    """Return the robot's name in its fleet."""
    if options.name is not None:
        return str(options.name)
    if options.credentials is not None:
        return read_credentials(options.credentials, "--credentials").role.name
    # The last part of a namespace such as /fleet/robot1 names the robot.
    return options.namespace.strip("/").rpartition("/")[2] or "robot"


def _check_scenario(scenario: Scenario, drive: str) -> None:
    """Refuse closures and batteries, which a ROS 2 robot does not sense, and zones that Nav2 does not know."""
    if scenario.changes_ground:
        raise NotPrepared("closures: a ROS 2 robot reports nothing blocked here; drop them")
    if any(spec.battery is not None for spec in scenario.roster):
        raise NotPrepared("robots.battery: a ROS 2 robot reports no charge here; drop it and docks")
    if drive != "nav2":
        return
    for number, zone in enumerate(scenario.zones):
        if zone.speed is not None:
            why = "Nav2 drives to goals at its own speed; give it the mask for its speed filter, and drop it here"
            raise NotPrepared(f"zones.{number}.speed = {zone.speed:g}: {why}")


def drive(process: ProcessContext) -> int:
    """Find the robot, and patrol with it; return the exit code."""
    options = process.options
    overrides = parse_overrides(options.set)
    with nullcontext() if options.scenario is None else naming(options.scenario, overrides):
        return _find_and_patrol(process, overrides)


def _find_and_patrol(process: ProcessContext, overrides: dict[str, object]) -> int:
    """Check all input, then find the robot, and patrol with it; return the exit code."""
    options = process.options
    name = _robot_name(options)
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
                settings = _started_settings(settings, spec)
            break
    else:
        if options.start == SCENARIO_START:
            raise BadInput(f"--start scenario: {name} is not in {options.scenario}; give --name, or a pose")
    _check_start(settings, terrain)
    link = _join_link(process)
    process.closing.callback(link.close)
    factor = 1.0 if scenario is None or scenario.factor is None else scenario.factor
    hardware = Hardware(link, settings, factor, say, stop_files)
    pose = _find_pose(hardware, link, process)
    say(f"is at ({pose.x:.2f}, {pose.y:.2f}), heading {pose.heading:.2f}")
    # A robot with a map of its own shows that itself.
    has_map = options.transform is None and (scenario is not None or options.map is not None)
    if scenario is None:
        folder = Path(process.closing.enter_context(tempfile.TemporaryDirectory(prefix="fogwatch-")))
        map_file = options.map or _robots_map(link, settings, folder, process)
        scenario = _make_scenario(options, name, map_file, pose, overrides)
    if (file := options.write_scenario) is not None:
        with writing(f"--write-scenario {file}", "give another file"):
            file.write_text(dump_scenario(scenario), encoding="utf-8")
    return _patrol_robot(process, scenario, hardware, has_map)


def _patrol_robot(process: ProcessContext, scenario: Scenario, hardware: Hardware, shows_map: bool) -> int:
    """Patrol with a robot that was found; return the exit code."""
    name, options = process.log.owner, process.options
    numbers = {spec.name: spec.number for spec in scenario.roster}
    # By its number, so that of robots started together only the first counts ticks from now.
    alone_s = LISTEN_S + LISTEN_MORE_S * (numbers.get(name, 1) - 1)
    rivals = _claim_robot(hardware, process)
    if options.router is not None and options.router == options.connect:
        where = f"the robot's own router, {options.connect}"
        process.log.info(f"meets its fleet at {where}; give --router if others have another")
    ticks = Ticks(options.epoch, options.wait, alone_s)

    def make(site: Site) -> Robot:
        from ros2.robot.driver import assemble  # imports kernels, which were compiled by now

        return assemble(site, hardware, scenario, rivals, process, shows_map=shows_map)

    try:
        return patrol_with(process, make, scenario, name, ticks)
    except DriverFailed as failed:
        process.log.error(str(failed))
        return FAILED
    finally:
        rivals.close()


def _claim_robot(hardware: Hardware, process: ProcessContext) -> Rivals:
    """Make sure that no other process drives the robot, from now on. Raises BadInput if one does."""
    settings, link = hardware.settings, hardware.link
    usual = None if settings.is_shared else settings.commands
    # A robot that gets goals has no topic of velocities that another node could use.
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
    if scenario is None and options.map is None:
        elsewhere = {field: value for field, value in overrides.items() if not field.startswith("terrain.")}
        _make_scenario(options, name, None, None, elsewhere)
        return None
    if scenario is None:
        scenario = _make_scenario(options, name, options.map, None, overrides)
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


def _join_link(process: ProcessContext) -> Ros2Link:
    """Join the robot's router, or its ROS. Raises AskedToLeave, or BadInput when there is none."""
    options = process.options
    namespace = options.namespace.strip("/")
    if namespace:
        check_name(namespace, "--namespace")
    node = NodeName(NODE, namespace)
    if options.robot == "rclpy":
        return RclpyLink(import_rclpy(), node, domain_given(options.domain), process.ending.ask)
    locator = check_locator(options.connect, "--connect")
    option, proof = "--ros-credentials", options.ros_credentials
    if proof is None and locator.startswith("tls/"):
        option, proof = "--credentials", options.credentials
    credentials = None if proof is None else read_credentials(proof, option)
    try:
        return open_ros2(
            locator,
            format_named(options.format or FORMATS[0], domain_given(options.domain), "--format"),
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


def _find_pose(hardware: Hardware, link: Ros2Link, process: ProcessContext) -> Pose:
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
        format_name = link.other_format(GRAPH_S)
        if now - began >= wait_s:
            remedy = f"the nodes on this router speak {format_name}" if format_name else "fogwatch doctor says more"
            raise BadInput(f"the robot was not found within {wait_s:g} s: {doubt}; {remedy}")
        speaks = f"; the nodes on this router speak {format_name}" if format_name else ""
        process.log.info(f"waiting for the robot: {doubt}{speaks}")
    raise AskedToLeave


def _started_settings(settings: DriveSettings, spec: RobotSpec) -> DriveSettings:
    """Return the settings of a robot that stands where its scenario has it."""
    if spec.start is None:
        raise BadInput(f"--start scenario: {spec.name} has no start there; give it one, or a pose here")
    return replace(settings, localisation=replace(settings.localisation, start=spec.start))


def _initial_pose(hardware: Hardware) -> InitialPose | None:
    """Return the sender of the robot's first pose to its localisation; None where no option asks for it."""
    settings = hardware.settings
    localisation = settings.localisation
    if localisation.start is None or localisation.source is Source.ODOMETRY:
        return None
    pose = settings.on_robots_map(localisation.start)
    message = PoseWithCovarianceStamped(0, settings.localisation.map_frame, pose, localisation.variances)
    sender = hardware.link.publisher(settings.topic("initialpose"), PoseWithCovarianceStamped)
    return InitialPose(localisation.start, message, sender)


def _robots_map(link: Ros2Link, settings: DriveSettings, folder: Path, process: ProcessContext) -> Path:
    """Return the robot's own map as a file. Raises AskedToLeave, or BadInput when none comes."""
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


def _make_scenario(
    options: argparse.Namespace, name: str, map_file: Path | None, pose: Pose | None, overrides: dict[str, object]
) -> Scenario:
    """Make a scenario for robots of one kind on a map; without one on a stand-in, which checks the rest."""
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


def _choose_router(process: ProcessContext) -> None:
    """Let the fleet meet at the robot's own router, unless an option names another place, and check that place."""
    options = process.options
    if options.credentials is None:
        options.router, options.fleet = options.router or options.connect, options.fleet or FLEET
        if options.router is None:
            raise BadInput(
                "--router: missing; --robot rclpy needs one for operators and the fleet, which fogwatch router starts"
            )
    process.meet(Kind.ROBOT)
