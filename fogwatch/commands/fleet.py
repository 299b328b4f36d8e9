"""``fogwatch fleet``: the members of a fleet of several machines, and the options that name a running fleet.

Commands raise BadInput; the caller prints it.
"""

from __future__ import annotations

import time
from argparse import Namespace
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from fogwatch.cli.command_help import command, group
from fogwatch.cli.ending import say
from fogwatch.cli.options import argument, bounded, option
from patrol.errors import BadInput
from runtime.security.private_files import new_key

if TYPE_CHECKING:
    from fogwatch.fleets.folder import FleetFolder


WAIT_S = 60.0
A_DAY_S = 86400.0
LISTEN_S = 3.0

_CREDENTIALS = "A viewer's credentials, made by fogwatch fleet init, or the folder of a run of this machine."
_SCENARIO = "Scenario of a fleet without a world, to follow its robots by their positions."
_RADIO = "Direct radio of a fleet without a world: group, line, router, or this member's folder in a mesh."


@dataclass(frozen=True)
class FleetOptions:
    """The router or credentials by which a running fleet is reached."""

    credentials: Annotated[Path | None, option("PATH", _CREDENTIALS)] = None
    router: Annotated[str | None, option("LOCATOR", "Router of a running fleet, tcp/HOST:PORT.")] = None
    fleet: Annotated[str | None, option("NAME", "Name of the running fleet.")] = None
    scenario: Annotated[Path | None, option("FILE", _SCENARIO)] = None
    radio: Annotated[str | None, option("LOCATOR|FOLDER", _RADIO)] = None

    def check_one_fleet(self, command: str, run: Path | None) -> None:
        """Check that a command is given one of the folder of a run, credentials, or a router and a fleet's name."""
        named = [value is not None for value in (self.router, self.fleet)]
        if run is not None:
            is_one = not any(named) and self.credentials is None
        else:
            is_one = all(named) or self.credentials is not None
        if not is_one:
            ways = "a run's folder, or --router and --fleet of a running fleet, or --credentials"
            raise BadInput(f"{command}: name {ways}")

    def as_source(self, command: str, run: Path | None, wait: float, key: Path | None = None) -> Namespace:
        """Return what names the fleet, and gives the right to control it, as `monitor.process.source_opener` takes it.

        RUN is as for `control_file`. A scenario is of robots without a world, which an operator may watch as well; with
        the folder of a run, which has a scenario of its own, it is refused.
        """
        from runtime.security.credentials import MEMBER

        self.check_one_fleet(command, run)
        if run is not None and self.scenario is not None and run.is_dir() and not (run / MEMBER).is_file():
            why = f"--scenario is for robots without a world, and {run} has one"
            raise BadInput(f"{command}: {why}; leave the option out")
        access = None if run is None else control_file(command, run)
        return Namespace(replay=None, access=access, wait=wait, key=key, **vars(self))


RunningFleet = Annotated[Path | None, argument("[RUN]", "Folder of a running fleet, or an operator's credentials.")]
Seconds = Annotated[float, bounded("S", "How long to listen, in s.", 0.1, 600.0)]
Wait = Annotated[float, bounded("S", "How long to wait for the fleet, in s.", 0.0, A_DAY_S)]


def control_file(command: str, run: Path) -> Path:
    """Return the file that says how to reach and control a running fleet.

    `run` is the fleet's folder, its control file, or an operator's credentials.
    """
    from monitor.replay.run_files import JOURNAL
    from runtime.security.access import FILE
    from runtime.security.credentials import MEMBER

    if (run.is_file() and run.name != JOURNAL) or (run / MEMBER).is_file():
        return run
    if not run.is_dir():
        raise BadInput(f"{command} {run}: no such folder; name a running fleet's, such as runs/yards-20260101-120000")
    if not (run / FILE).is_file():
        raise BadInput(
            f"{command} {run}: holds no {FILE}, so no fleet is running there, or not yet; for a finished run use: "
            f"fogwatch replay {run}"
        )
    return run / FILE


app = group("fleet", "Say who may join a fleet of several machines.")

WRONG = 1
DAYS = 365
LONGEST_DAYS = 3650
PORT = 7447
ROBOT_PORT = 7448
"""Beside the port of the robot's own programs."""

Folder = Annotated[Path, argument("DIR", "Folder of the fleet.")]
Days = Annotated[int, bounded("N", "How long certificates are valid, in days.", 1, LONGEST_DAYS)]
_HOSTS = (
    "Name or address of the router's machine. Repeatable; members use the first. `add` keeps earlier ones. In a fleet "
    "without a router `add` takes a robot's."
)
Hosts = Annotated[list[str] | None, option("HOST", _HOSTS)]


@command(
    app,
    examples=[
        "fogwatch fleet init yards-1 --robots r1=192.168.1.11,r2=192.168.1.12,r3",
        "fogwatch fleet init yards-1 --robots r1,r2,r3 --host 192.168.1.10",
    ],
)
def init(
    folder: Annotated[Path, argument("DIR", "Folder to make; it must not exist yet.")],
    robots: Annotated[
        str,
        option(
            "NAME[=HOST],...",
            "The robots' names, as in the scenario. With the name or address of the machine of one or more, they meet "
            "without a router.",
        ),
    ],
    host: Hosts = None,
    name: Annotated[str | None, option("NAME", "The fleet's name (default: the folder's).")] = None,
    port: Annotated[int, option("N", "TCP port of the router; without one, UDP port of the robots.")] = PORT,
    days: Days = DAYS,
) -> None:
    """Make a fleet's certificates, and the rules by which its members let each other in: one folder for each member.

    Robots with a HOST meet directly: each member connects to those addresses, and learns of all others there. Members
    without one listen on any free UDP port: where firewalls stand between the robots, give each a HOST. With --host,
    all meet at a router, which has a folder too. Without any address, the router can be reached from this machine only.

    Copy each folder to its machine, readable by its user alone. The folder of the authority stays where it is: with it,
    anyone can make members.
    """
    from fogwatch.fleets.folder import make_fleet

    names, places = _read_robots(robots)
    if places and host:
        why = "is a router's address, and robots with addresses meet without one"
        raise BadInput(f"--host {host[0]}: {why}; choose one")
    new_fleet = make_fleet(folder, name or folder.name, names, host or [], port, days, places)
    members = ", ".join(sorted(part.name for part in folder.iterdir() if part.is_dir() and part.name != "authority"))
    mesh = f"without a router; {', '.join(new_fleet.places.values())}"
    where = mesh if new_fleet.is_mesh else f"router at {new_fleet.router}"
    say(f"{folder}: fleet {new_fleet.fleet}, {where}; copy each folder to its machine: {members}")


@command(app, examples=["fogwatch fleet add yards-1 r4"])
def add(
    folder: Folder,
    member: Annotated[str, argument("NAME", "A robot, world, viewer, operator, or router.")],
    host: Hosts = None,
    days: Days = DAYS,
) -> None:
    """Add a member, or one that was revoked anew. For the router: a new certificate.

    The router knows new members after it has got its folder again and has been restarted; without a router, the other
    members know them after each has got the file mesh.json again and has been restarted.
    """
    from fogwatch.fleets.folder import THE_ROUTER, fleet_to_change, member_role

    with fleet_to_change(folder) as fleet:
        if member != THE_ROUTER and host and not fleet.is_mesh:
            raise BadInput(f"--host {host[0]}: is for the router; leave the option out")
        if member != THE_ROUTER and len(host or []) > 1:
            raise BadInput(f"--host: {member} has one address, not {len(host or [])}; give one")
        if member == THE_ROUTER:
            before = fleet.router
            fleet.renew_router(days, host or [])
            say(f"{folder / THE_ROUTER}: new certificate; {_RESTART.format(folder / THE_ROUTER)}")
            if fleet.router != before:
                say(f"the fleet meets at {fleet.router} from now on: copy all folders to their machines again")
                for name in fleet.absent:
                    say(f"{name}: its folder is not here; revoke and add it, for a folder with the new address")
            return
        role = member_role(member)
        fleet.add(role, days, host[0] if host else None)
    say(f"{folder / role.name}: copy it to its machine; {_restart_text(fleet)}")


@command(app, examples=["fogwatch fleet revoke yards-1 r2"])
def revoke(folder: Folder, member: Annotated[str, argument("NAME", "A robot, world, viewer or operator.")]) -> None:
    """Take a member's rights away, for example because its machine was lost.

    Its certificate stays valid, but the router lets it do nothing any more after it has got its folder again and has
    been restarted; without a router, each member after it has got the file mesh.json again and has been restarted.
    """
    from fogwatch.fleets.folder import THE_ROUTER, fleet_to_change, member_role
    from runtime.security.roles import Kind

    if member == THE_ROUTER:
        raise BadInput(
            f"{member}: cannot be revoked, because members believe every certificate of the fleet's authority; make a "
            "new fleet: fogwatch fleet init"
        )
    role = member_role(member)
    with fleet_to_change(folder) as fleet:
        renewed = fleet.revoke(role, DAYS)
    say(f"{member}: revoked; {_restart_text(fleet)}")
    if renewed is not None:
        restart = ", and restart the world" if renewed.kind is Kind.WORLD else ""
        say(f"there is a new token for operators: copy {folder / renewed.name} to its machine again{restart}")


@command(
    app,
    "robot-router",
    examples=[
        "fogwatch fleet robot-router yards-1 r1 --namespace robot1 --host 192.168.1.20 --place /etc/fogwatch/r1-router"
    ],
)
def robot_router(
    folder: Folder,
    robot: Annotated[str, argument("NAME", "The robot of the fleet whose agent drives it.")],
    namespace: Annotated[str, option("NAME", "The ROS 2 robot's namespace (default: none).")] = "",
    domain: Annotated[int, option("N", "Its ROS_DOMAIN_ID.")] = 0,
    form: Annotated[
        str, option("NAME", "What it speaks: rmw_zenoh, rmw_zenoh-humble or bridge.", "--format")
    ] = "rmw_zenoh",
    command_topic: Annotated[
        list[str] | None, option("TOPIC", "Topic that drives it (default: cmd_vel, ackermann_cmd).", "--command")
    ] = None,
    host: Annotated[list[str] | None, option("HOST", "Name or address of the ROS 2 robot. Repeatable.")] = None,
    port: Annotated[int, option("N", "TCP port for the fleet's members.")] = ROBOT_PORT,
    place: Annotated[
        Path | None, option("DIR", "Where the folder will lie on the robot (default: where it is).")
    ] = None,
    days: Days = DAYS,
) -> None:
    """Make the configuration of a ROS 2 robot's Zenoh router, so that only its agent can drive it over the network.

    The robot's own programs connect as before, over loopback. Members of the fleet come over TLS with certificates: the
    robot's agent may command it, a viewer may look. No other process is let in.
    """
    from fogwatch.fleets.folder import ROBOT_ROUTER, make_robot_router, open_fleet_folder
    from ros2.wire.access import COMMANDS
    from ros2.wire.formats import format_named
    from ros2.wire.names import check_domain, check_name

    check_name(namespace, "--namespace")
    spoken = format_named(form, check_domain(domain, "--domain"), "--format")
    topics = [check_name(topic, "--command") for topic in command_topic or COMMANDS]
    fleet = open_fleet_folder(folder)
    path = make_robot_router(fleet, robot, spoken, namespace, host or [], port, place, days, commands=topics)
    lies = path if place is None else place
    started = f"start its router with ZENOH_ROUTER_CONFIG_URI={lies / ROBOT_ROUTER}"
    say(
        f"{path}: copy it to the robot as {lies}, and {started}; its agent "
        f"then connects with --connect tls/{(host or ['127.0.0.1'])[0]}:{port} --credentials {folder / robot}"
    )


@command(app, examples=["fogwatch fleet check yards-1"], exit_codes="0 all is well, 1 something is wrong, 2 bad input")
def check(folder: Folder) -> int:
    """Check the certificates of a fleet: whose they are, who signed them, when they expire, and who can read them.

    It reads the fleet's folder alone, not the copies on the members' machines.
    """
    from fogwatch.fleets.folder import open_fleet_folder

    fine = True
    for name, well, says in open_fleet_folder(folder).check(time.time()):
        fine &= well
        say(f"{name}: {says}")
    return 0 if fine else WRONG


@command(app, examples=["fogwatch fleet key fleet.key"])
def key(path: Annotated[Path, argument("FILE", "File to write; it must not exist yet.")]) -> None:
    """Make a key that authenticates a fleet's messages: write it to a file that only its owner can read.

    It is random. Give each robot a copy, and name the file in the scenario: radio: {key: FILE}.
    """
    new_key(path)
    say(f"{path}: new key written; name the file in the scenario as radio.key")


_RESTART = "copy {} to the router's machine, and restart the router"


def _restart_text(fleet: FleetFolder) -> str:
    """Return how others learn of a change."""
    from fogwatch.fleets.folder import THE_ROUTER
    from runtime.security.mesh import MESH

    if fleet.is_mesh:
        return f"copy {fleet.path / MESH} into the folder of each other member, on its machine, and restart it"
    return _RESTART.format(fleet.path / THE_ROUTER)


def _read_robots(text: str) -> tuple[list[str], dict[str, str]]:
    """Return the robots' names, and the hosts of those that have one."""
    pairs = [entry.strip().partition("=") for entry in text.split(",")]
    return [name for name, _, _ in pairs], {name: host for name, equals, host in pairs if equals}
