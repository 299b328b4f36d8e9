"""The command-line options that the processes of a fleet, its world and its robots, have in common."""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from patrol.errors import BadInput
from runtime.process.failures import BAD_INPUT
from runtime.reporting.supervision import add_supervision

if TYPE_CHECKING:
    from runtime.security.credentials import Credentials
    from runtime.security.keys import FleetKeys
    from runtime.security.roles import Kind

TOGETHER = """All processes are given the same scenario file. Who they
are, and where they meet, they know from a folder of their own:

  fogwatch fleet init yards-1 --robots r1=192.168.1.11,r2             # then copy each folder to its machine
  python -m worldsim --credentials yards-1/world --scenario yards.yaml --out runs/yards-1
  fogwatch agent     --credentials yards-1/r1 --scenario yards.yaml
  fogwatch agent     --credentials yards-1/r2 --scenario yards.yaml

They meet directly, as a mesh. With --host 192.168.1.10 instead of the robots' addresses they meet at a router, which
runs there: fogwatch router --fleet yards-1/router. On one machine a router also serves without credentials:

  fogwatch router
  python -m worldsim --router tcp/127.0.0.1:7447 --fleet yards-1 --scenario yards.yaml --out runs/yards-1
  fogwatch agent     --router tcp/127.0.0.1:7447 --fleet yards-1 --scenario yards.yaml --robot r1"""
"""Text in each process's help: starting a fleet by hand."""

_REQUIRED = "the following arguments are required: "
_ARGUMENT, _NO_VALUE = "argument ", ": expected one argument"
"""Beginning of argparse's error about missing options."""


class ProcessParser(argparse.ArgumentParser):
    """A parser of a process's command line, whose errors are one line that says what to give."""

    def __init__(self, prog: str, description: str, epilog: str, *, reports_start: bool = False) -> None:
        """Make a parser of the options that every process has; the caller adds its own."""
        form = argparse.RawDescriptionHelpFormatter
        super().__init__(prog, description=description, epilog=epilog, formatter_class=form, allow_abbrev=False)
        self.add_argument("--lifeline", type=int, metavar="FD", help="leave when this pipe ends (set by the launcher)")
        if reports_start:
            self.add_argument("--ready", type=int, metavar="FD", help="report the start here (set by the launcher)")
        add_supervision(self)

    def list_options(self) -> str:
        """List the options with their explanations, as the help has them, without the rest of the help."""
        formatter = self._get_formatter()
        for group in self._action_groups:
            formatter.start_section(group.title)
            formatter.add_arguments(group._group_actions)
            formatter.end_section()
        return formatter.format_help()

    def error(self, message: str) -> NoReturn:
        """End the process with one line."""
        if message.startswith(_REQUIRED):
            names = message.removeprefix(_REQUIRED).split(", ")
            missing = [action for action in self._actions if not set(action.option_strings).isdisjoint(names)]
            message = "; ".join(
                f"{missing_option.option_strings[0]} {missing_option.metavar} is missing: {missing_option.help}"
                for missing_option in missing
            )
        if message.startswith(_ARGUMENT) and message.endswith(_NO_VALUE):
            option = message.removeprefix(_ARGUMENT).removesuffix(_NO_VALUE).split("/")[0]
            message += f", and a value that begins with a minus needs a =, as in {option}=-1"
        self.exit(BAD_INPUT, f"{self.prog}: {message}; all options: {self.prog} --help\n")


def fleet_parser(prog: str, description: str, epilog: str, others: str, instead: str = "") -> ProcessParser:
    """Make a parser of the options that world and agents have; the caller adds its own."""
    parser = ProcessParser(prog, description, epilog)
    add = parser.add_argument
    add("--credentials", type=Path, metavar="FOLDER", help="this member's, of a fleet made by: fogwatch fleet init")
    add(
        "--router",
        metavar="LOCATOR",
        help="the router that the fleet meets at; not in a mesh (default: the credentials')",
    )
    add("--fleet", metavar="NAME", help="the fleet's name, the same for all its processes (default: the credentials')")
    scenario = f"the scenario, the same for all processes{instead}"
    add("--scenario", required=True, type=Path, metavar="FILE", help=scenario)
    add(
        "--radio",
        metavar="LOCATOR|FOLDER",
        help="direct radio: a multicast group, a serial line, a router, or this member's folder in a mesh that carries "
        "positions (default: the fleet's)",
    )
    add("--static", type=Path, metavar="DIR", help="static fields made by the launcher (default: make them here)")
    add("--wait", type=float, default=60.0, metavar="S", help=f"how long to wait for {others} (%(default)g s)")
    return parser


@dataclass(frozen=True, slots=True)
class Meeting:
    """The router or mesh, the keys and the credentials by which a process meets its fleet."""

    router: str  # locator, or several with commas; in a mesh, of other members
    keys: FleetKeys
    credentials: Credentials | None = None  # None for a router that asks for none

    @property
    def meets_at(self) -> str:
        """The place where the fleet meets, for people."""
        return self.router if self.credentials is None or self.credentials.mesh is None else self.credentials.meets_at

    @property
    def beside(self) -> Meeting:
        """The meeting for a second session of the process."""
        credentials = None if self.credentials is None else replace(self.credentials, beside=True)
        return replace(self, credentials=credentials)

    @property
    def revocable(self) -> bool:
        """True if the process may have been revoked: others then let it in, and silently ignore all it sends."""
        return self.credentials is not None and self.credentials.folder is not None


def meeting(credentials: Path | None, router: str | None, fleet: str | None, *kinds: Kind) -> Meeting:
    """Find out where a fleet meets, from credentials, or from a router and a fleet's name.

    Credentials of any of the `kinds` fit; in a run of this machine, those of the first kind are taken. What is None
    comes from the credentials.
    """
    from runtime.security.access import credentials_at
    from runtime.security.keys import check_locators, fleet_keys
    from runtime.security.roles import Role

    if credentials is None:
        if router is None or fleet is None:
            raise BadInput("no fleet named; give --credentials FOLDER, or both --router LOCATOR and --fleet NAME")
        return Meeting(check_locators(router, "--router"), fleet_keys(fleet))
    identity = credentials_at(credentials, "--credentials", Role(kinds[0]))
    if identity.role.kind not in kinds:
        raise BadInput(f"--credentials {credentials}: of {identity.role.user}; give those of a {' or '.join(kinds)}")
    if fleet not in (None, identity.fleet):
        raise BadInput(f"--fleet {fleet}: the credentials are for fleet {identity.fleet}; leave the option out")
    if router is not None:
        router = identity.check_router(check_locators(router, "--router"), "--router")
    return Meeting(router or identity.router, fleet_keys(identity.fleet), identity)


def robot_named(name: str | None, credentials: Credentials | None) -> str:
    """Return the name of the robot that a process is for, from its option or its credentials."""
    owner = None if credentials is None else credentials.role.robot
    if name is None and owner is None:
        raise BadInput("--robot: name the robot of the scenario that this process is")
    if owner is not None and name not in (None, owner):
        raise BadInput(f"--robot {name}: the credentials are {owner}'s; leave the option out, or give {name}'s")
    return name or owner or ""
