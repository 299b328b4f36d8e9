"""The folder of a fleet of several machines: its authority, its members' credentials, and what its router needs.

    FOLDER/fleet.json     who is a member and who was, where the router is, and the operators' token
    FOLDER/authority/     signs certificates; stays where it is
    FOLDER/router/        for the router's machine (`patrol.net.credentials.RouterSecurity`)
    FOLDER/NAME/          for the machine of a member: a robot, world, viewer, operator (`Credentials`)

A certificate's common name holds a number that counts how often the member got one. Zenoh has no list of revoked
certificates, so the router's rules name the members whose certificates are valid, and whoever is not named may do
nothing.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from fogwatch.certificates import facts, issue, make_authority, problem
from patrol.errors import BadInput
from patrol.net.credentials import (
    AUTHORITY,
    CERTIFICATE,
    KEY,
    MEMBER,
    ROUTER,
    Credentials,
    as_json,
    check_private,
    read_object,
    router_json,
    write_private,
)
from patrol.net.keys import check_locator, fleet_keys, is_loopback
from patrol.net.roles import OPERATOR, RESERVED, WORLD_ROLE, Kind, Role, robot_role, role_of, roles_of

FILE = "fleet.json"
THE_ROUTER = "router"
AUTHORITY_FOLDER = "authority"
_HOST = re.compile(r"[A-Za-z0-9.:_-]{1,253}")
_LOCAL = ("127.0.0.1", "localhost")
_SOON_S = 30 * 86400


@dataclass(slots=True)
class FleetFolder:
    """A fleet's folder.

    Attributes:
        path: The folder.
        fleet: The fleet's name.
        hosts: Names and addresses of the router's machine, the one that members use first.
        port: TCP port of the router.
        token: The operators' token.
        members: The common name of each member's certificate, by `Role.user`.
        issued: How many certificates each member has got, by `Role.user`.
    """

    path: Path
    fleet: str
    hosts: list[str]
    port: int
    token: str
    members: dict[str, str] = field(default_factory=dict)
    issued: dict[str, int] = field(default_factory=dict)

    @property
    def router(self) -> str:
        """The router's locator, as members use it."""
        host = self.hosts[0]
        return f"tls/[{host}]:{self.port}" if ":" in host else f"tls/{host}:{self.port}"

    @property
    def listen(self) -> str:
        """The locator that the router listens on."""
        if all(is_loopback(host) for host in self.hosts):
            return self.router
        return f"tls/{'[::]' if any(':' in host for host in self.hosts) else '0.0.0.0'}:{self.port}"

    def add(self, role: Role, days: int) -> None:
        """Make somebody a member.

        Args:
            role: What the new member is.
            days: How long its certificate is valid.

        Raises:
            BadInput: It is one already, or openssl fails.
        """
        if role.user in self.members:
            raise BadInput(f"{role.name}: is a member already; to replace its certificate, revoke it first")
        folder = self.path / role.name
        if folder.exists():
            raise BadInput(f"{folder}: is there already, though {role.name} is no member; move it away")
        number = self.issued.get(role.user, 0) + 1
        common_name = f"{role.user}.{number}"
        folder.mkdir(mode=0o700)
        issue(self.path / AUTHORITY_FOLDER, folder, common_name, days)
        self._write_member(role)
        self.issued[role.user], self.members[role.user] = number, common_name
        self._save()

    def revoke(self, role: Role) -> None:
        """Take a member's rights away; those of an operator or the world take a new token for both.

        Args:
            role: The member.

        Raises:
            BadInput: It is no member.
        """
        if role.user not in self.members:
            names = ", ".join(sorted(role_of(user, FILE).name for user in self.members))
            raise BadInput(f"{role.name}: is no member of {self.fleet}; members are {names}")
        del self.members[role.user]
        shutil.rmtree(self.path / role.name, ignore_errors=True)
        if role in (WORLD_ROLE, OPERATOR):
            self.token = os.urandom(16).hex()
            for other in (WORLD_ROLE, OPERATOR):
                if other.user in self.members:
                    self._write_member(other)
        self._save()

    def renew_router(self, days: int, hosts: Sequence[str] = ()) -> None:
        """Issue a new certificate for the router.

        Args:
            days: How long it is valid.
            hosts: Names and addresses of its machine; none to keep those that it has. Members use the first.

        Raises:
            BadInput: A host cannot be one, or openssl fails.
        """
        before = self.router
        self.hosts = checked_hosts(hosts) or self.hosts
        folder = self.path / THE_ROUTER
        folder.mkdir(mode=0o700, exist_ok=True)
        names = [*dict.fromkeys([*self.hosts, *_LOCAL])]
        issue(self.path / AUTHORITY_FOLDER, folder, f"router.{self.fleet[:50]}", days, names)
        if self.router != before:
            for user in self.members:
                self._write_member(role_of(user, FILE))
        self._save()

    def check(self, now_s: float) -> Iterator[tuple[str, bool, str]]:
        """Check the credentials that lie in the folder.

        Args:
            now_s: The time, Unix time in s.

        Yields:
            Whom a line is about, whether all is well, and what there is to say.
        """
        for user, common_name in {THE_ROUTER: "", **self.members}.items():
            name = user if user == THE_ROUTER else role_of(user, FILE).name
            folder = self.path / name
            if not folder.exists():
                yield name, True, "its folder is not here (it may have been moved to its machine)"
                continue
            try:
                yield name, *_judge(folder, self.path / AUTHORITY_FOLDER / CERTIFICATE, common_name, now_s)
            except BadInput as bad:
                yield name, False, str(bad)

    def _write_member(self, role: Role) -> None:
        token = self.token if role in (WORLD_ROLE, OPERATOR) else None
        file = self.path / role.name / MEMBER
        if file.parent.is_dir():  # it may have been moved to its machine
            replace_private(file, as_json(Credentials(self.fleet, self.router, role, token=token)))

    def _save(self) -> None:
        """Write fleet.json, and the router's rules that follow from it."""
        says = {
            "fleet": self.fleet,
            "hosts": self.hosts,
            "port": self.port,
            "token": self.token,
            "members": self.members,
            "issued": self.issued,
        }
        replace_private(self.path / FILE, f"{json.dumps(says, indent=2)}\n")
        roles = {common_name: role_of(user, FILE) for user, common_name in self.members.items()}
        folder = self.path / THE_ROUTER
        folder.mkdir(mode=0o700, exist_ok=True)
        replace_private(folder / ROUTER, router_json(fleet_keys(self.fleet), self.listen, roles))


def make_fleet(
    path: Path, fleet: str, robots: Sequence[str], hosts: Sequence[str], port: int, days: int
) -> FleetFolder:
    """Make a fleet's folder, whole or not at all.

    Args:
        path: The new folder.
        fleet: The fleet's name.
        robots: The robots' names.
        hosts: Names and addresses of the router's machine, the one that members use first; none for this machine alone.
        port: TCP port of the router.
        days: How long certificates are valid.

    Raises:
        BadInput: The folder exists, a name or host cannot be one, or openssl fails.
    """
    keys = fleet_keys(fleet)
    roles = [*map(_robot, robots), *(role for role in roles_of(robots) if role.kind is not Kind.ROBOT)]
    made = FleetFolder(path, keys.fleet, checked_hosts(hosts) or [*_LOCAL], port, os.urandom(16).hex())
    check_locator(made.router, "--host, --port:")
    if path.exists():
        raise BadInput(f"{path}: exists already; to add a member, use: fogwatch fleet add {path} NAME")
    part = path.with_name(f".{path.name}.part")
    shutil.rmtree(part, ignore_errors=True)
    try:
        part.mkdir(mode=0o700, parents=True)
    except OSError as error:
        raise BadInput(f"{path}: cannot be made ({error.strerror}); choose another folder") from None
    made.path = part
    try:
        write_private(part / ".gitignore", "*\n")  # keys belong into no repository
        make_authority(part / AUTHORITY_FOLDER, fleet)
        made.renew_router(days)
        for role in roles:
            made.add(role, days)
        part.rename(path)
    except BaseException:
        shutil.rmtree(part, ignore_errors=True)
        raise
    made.path = path
    return made


def open_fleet_folder(path: Path) -> FleetFolder:
    """Open a fleet's folder.

    Args:
        path: The folder.

    Raises:
        BadInput: It is none, or not whole.
    """
    says = read_object(path / FILE, "fleet", secret=True)
    members, issued, hosts = (says.get(name, none) for name, none in (("members", {}), ("issued", {}), ("hosts", [])))
    fine = (
        isinstance(says.get("fleet"), str)
        and isinstance(says.get("token"), str)
        and isinstance(says.get("port"), int)
        and isinstance(hosts, list)
        and isinstance(members, dict)
        and isinstance(issued, dict)
        and all(isinstance(value, str) for value in (*hosts, *members.values()))
        and all(isinstance(value, int) for value in issued.values())
    )
    if not fine or not hosts:
        raise BadInput(f"fleet: {path / FILE}: is damaged; restore it, or make a new fleet: fogwatch fleet init")
    for user in members:
        role_of(user, f"fleet: {path / FILE}")
    keys = fleet_keys(says["fleet"])
    return FleetFolder(path, keys.fleet, checked_hosts(hosts), says["port"], says["token"], members, issued)


def member_role(name: str) -> Role:
    """The role of a member by its name in a fleet's folder: a robot's name, world, viewer or operator.

    Args:
        name: The name.

    Raises:
        BadInput: It is not a member's name.
    """
    return Role(Kind(name)) if name in RESERVED and name in list(Kind) else _robot(name)


def _robot(name: str) -> Role:
    if name in RESERVED:
        raise BadInput(f"{name}: is a folder of every fleet, and cannot be a robot's name here; rename the robot")
    return robot_role(name)


def _judge(folder: Path, authority: Path, common_name: str, now_s: float) -> tuple[bool, str]:
    for name in (KEY, ROUTER if not common_name else MEMBER):
        check_private(folder / name, "fleet")
    if not (folder / AUTHORITY).is_file():
        return False, f"{AUTHORITY} is missing"
    if wrong := problem(folder, authority):
        return False, f"its certificate {wrong}"
    found = facts(folder / CERTIFICATE)
    if common_name and found.common_name != common_name:
        return False, f"its certificate is for {found.common_name}, and the router lets in {common_name}"
    left_s = found.ends_s - now_s
    day = time.strftime("%Y-%m-%d", time.gmtime(found.ends_s))
    if left_s <= 0:
        return False, f"its certificate expired on {day}"
    return True, f"valid until {day}{', which is soon' if left_s < _SOON_S else ''}"


def checked_hosts(hosts: Sequence[str]) -> list[str]:
    """Names and addresses of a machine, each once.

    Args:
        hosts: As given.

    Raises:
        BadInput: One cannot be a name or an address.
    """
    for host in hosts:
        if not _HOST.fullmatch(host):
            raise BadInput(f"--host {host!r}: not the name or address of a machine; write it as in 192.168.1.10")
    return [*dict.fromkeys(hosts)]


def replace_private(file: Path, text: str) -> None:
    """Write a file that only its owner can read, whole or not at all.

    Args:
        file: The file, which may be there already.
        text: What it is to hold.
    """
    part = file.with_name(f".{file.name}.part")
    with suppress(FileNotFoundError):
        part.unlink()
    write_private(part, text)
    part.replace(file)
