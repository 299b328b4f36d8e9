"""The folder for the Zenoh router of a ROS 2 robot: its certificate, and rules that let the fleet's members in.

FOLDER/ROBOT-router/zenoh.json5       what the router reads
FOLDER/ROBOT-router/certificate.pem   and key.pem, authority.pem: it proves to members that it is the robot's
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from fogwatch.fleets.certificates import issue
from fogwatch.fleets.folder import AUTHORITY_FOLDER, FleetFolder, changing
from fogwatch.fleets.hosts import LOCAL, checked_hosts
from patrol.errors import BadInput
from patrol.security.credentials import AUTHORITY, CERTIFICATE, KEY
from patrol.security.keys import check_locator
from patrol.security.private_files import replace_private
from patrol.security.roles import VIEWER, Kind, robot_role
from ros2.wire.access import COMMANDS, agent_rights, robot_router, viewer_rights
from ros2.wire.formats import Format

FILE = "zenoh.json5"
LOCAL_PORT = 7447


def make_robot_router(
    fleet: FleetFolder,
    robot: str,
    form: Format,
    namespace: str,
    hosts: Sequence[str],
    port: int,
    place: Path | None,
    days: int,
    local_port: int = LOCAL_PORT,
    commands: Sequence[str] = COMMANDS,
) -> Path:
    """Make the folder for the router of a ROS robot, or make it anew, and return it.

    `robot` is the fleet's robot whose agent drives the ROS robot. `hosts` are names and addresses of the ROS robot's
    machine; without any, members reach the router from this machine alone. `port` is the TCP port for members,
    `local_port` that for the robot's own programs. `place` is where the folder will lie on the ROS robot; None for
    where it is made. The certificate is valid for `days`. `commands` are the topics by which the robot is driven.
    """
    role = robot_role(robot)
    folder = fleet.path / f"{robot}-router"
    if role.user not in fleet.members:
        raise BadInput(f"{robot}: is no robot of {fleet.fleet}; add it with: fogwatch fleet add {fleet.path} {robot}")
    if f"{Kind.ROBOT}-{folder.name}" in fleet.members:
        raise BadInput(f"{folder.name}: is a robot of {fleet.fleet} too, with this folder; rename one of the two")
    own_hosts = checked_hosts(hosts)
    for number in (port, local_port):
        check_locator(f"tcp/127.0.0.1:{number}", "--port:")
    names = [*dict.fromkeys([*own_hosts, *LOCAL])]
    with changing(fleet.path):
        folder.mkdir(mode=0o700, exist_ok=True)
        issue(fleet.path / AUTHORITY_FOLDER, folder, f"{robot}-router.{fleet.fleet[:40]}", days, names)
    members = {fleet.members[role.user]: agent_rights(form, namespace, commands)}
    if VIEWER.user in fleet.members:
        members[fleet.members[VIEWER.user]] = viewer_rights(form, namespace)
    lies = folder.absolute() if place is None else place
    everywhere = "[::]" if any(":" in host for host in own_hosts) else "0.0.0.0"
    listen = [f"tcp/127.0.0.1:{local_port}", f"tls/{everywhere if own_hosts else '127.0.0.1'}:{port}"]
    tls = {
        "root_ca_certificate": str(lies / AUTHORITY),
        "listen_certificate": str(lies / CERTIFICATE),
        "listen_private_key": str(lies / KEY),
        "enable_mtls": True,
        "close_link_on_expiration": True,
    }
    config = robot_router(form, namespace, members, listen, tls, commands)
    with changing(fleet.path):
        replace_private(folder / FILE, f"{json.dumps(config, indent=2)}\n")
    return folder
