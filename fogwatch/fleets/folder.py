"""The folder of a fleet of several machines: its authority, its members' credentials, and what its router needs.

    FOLDER/fleet.json     the members and former members, where they meet, and the operators' token
    FOLDER/authority/     signs certificates; stays where it is
    FOLDER/router/        for the router's machine (`runtime.security.credentials.RouterSecurity`)
    FOLDER/mesh.json      in a fleet without a router, instead: a copy is in each member's folder
    FOLDER/NAME/          for the machine of a member: a robot, world, viewer, operator (`Credentials`)
    FOLDER/NAME-router/   for the Zenoh router of a ROS 2 robot: its certificate, key and authority (``*.pem``), and
                          zenoh.json5, with rules that let members in

A certificate's common name holds a number that counts how often the member got one. Zenoh has no list of revoked
certificates, so the rules of the router, or of each member of a mesh, name the members whose certificates are valid.
What a process without such a name sends is refused.
"""

from __future__ import annotations

import fcntl
import ipaddress
import json
import os
import re
import shutil
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from fogwatch.fleets.certificates import facts, issue, make_authority, problem
from patrol.errors import BadInput
from ros2.wire.access import COMMANDS, agent_rights, robot_router, viewer_rights
from ros2.wire.formats import Format
from runtime.process import failures as exhausted
from runtime.security.credentials import AUTHORITY, CERTIFICATE, KEY, MEMBER, ROUTER, Credentials, as_json, router_json
from runtime.security.keys import check_locator, fleet_keys, is_loopback, is_no_host
from runtime.security.mesh import MESH, Mesh, mesh_json, read_mesh
from runtime.security.private_files import check_private, read_object, replace_private, write_private
from runtime.security.roles import (
    OPERATOR,
    RESERVED,
    VIEWER,
    WORLD_ROLE,
    Kind,
    Role,
    robot_role,
    role_of,
    roles_of,
    router_name,
)

FILE = "fleet.json"
THE_ROUTER = "router"
AUTHORITY_FOLDER = "authority"
_SOON_S = 30 * 86400
_LAST_PORT = 65535
LOCK_S = 10.0
"""Longest wait for another command that changes the folder, s."""

ROBOT_ROUTER, LOCAL_PORT = "zenoh.json5", 7447
"""The file that the router of a ROS 2 robot reads, and the port of the robot's own programs."""

LOCAL = ("127.0.0.1", "localhost")
"""Those of every machine itself."""

_LABEL = r"[A-Za-z0-9_](?:[A-Za-z0-9_-]{0,61}[A-Za-z0-9_])?"
_NAME = re.compile(rf"(?=.{{1,253}}\Z){_LABEL}(?:\.{_LABEL})*")
_WITH_PORT = re.compile(r"(?:[^:]+|\[.*\]):[0-9]+")


class FleetFolder(BaseModel):
    """A fleet's folder: where it is, and what is in `FILE`."""

    model_config = ConfigDict(strict=True)

    path: Path = Field(exclude=True)
    fleet: str
    hosts: list[str] = []  # of the router's machine, the one that members use first; empty in a mesh
    port: int = Field(ge=1, le=_LAST_PORT)  # TCP, of the router; in a mesh UDP, of each host's first member
    token: str  # of the operators
    members: dict[str, str] = {}  # common name of each one's certificate, by `Role.user`
    issued: dict[str, int] = {}  # number of certificates each member has got, by `Role.user`
    places: dict[str, str] = {}  # in a mesh, known locators by `Role.user`; revoked members keep theirs

    @property
    def is_mesh(self) -> bool:
        """True if the members meet without a router."""
        return not self.hosts

    @property
    def roles(self) -> dict[str, Role]:
        """The members' roles by `Role.user`."""
        return {user: role_of(user, FILE) for user in self.members}

    @property
    def router(self) -> str:
        """The router's locator, as members use it."""
        return f"tls/{_join_authority(self.hosts[0], self.port)}"

    @property
    def mesh(self) -> Mesh | None:
        """The content of mesh.json, by which members meet without a router; None for a fleet with a router."""
        if not self.is_mesh:
            return None
        places = {user: address for user, address in self.places.items() if user in self.members}
        return Mesh(self.fleet, self._roles_by_certificate(), places)

    @property
    def listen(self) -> str:
        """The locator that the router listens on: all addresses of its machine, or this machine alone."""
        if all(is_loopback(host) for host in self.hosts):
            return self.router
        return f"tls/{_any_address(self.hosts)}:{self.port}"

    @property
    def absent(self) -> list[str]:
        """The names of members whose folders are not here; they may have been moved to their machines."""
        return [role.name for role in self.roles.values() if not (self.path / role.name).is_dir()]

    def add(self, role: Role, days: int, host: str | None = None, called: str = "--host") -> None:
        """Add a member with a certificate that is valid for `days`.

        In a mesh, `host` is the name or address of its machine; None for the one that it had, if any. Errors name the
        host by `called`.
        """
        if role.user in self.members:
            raise BadInput(f"{role.name}: is a member already; to replace its certificate, revoke it first")
        folder = self.path / role.name
        if os.path.lexists(folder):  # also a link that leads nowhere
            raise BadInput(f"{folder}: is there already, though {role.name} is no member; move it away")
        number = self.issued.get(role.user, 0) + 1
        common_name = f"{role.user}.{number}"
        if host is not None:
            addresses = [address for user, address in self.places.items() if user != role.user]
            self.places[role.user] = mesh_locator(checked_hosts([host], called)[0], self.port, addresses)
        with _made_whole(folder) as part:
            issue(self.path / AUTHORITY_FOLDER, part, common_name, days, listens=self.is_mesh)
            self._write_member(role, part)
        self.issued[role.user], self.members[role.user] = number, common_name
        self._save_files()

    def revoke(self, role: Role, days: int) -> Role | None:
        """Take a member's rights away, and return the member whose folder must be copied again, or None.

        Operator and world share a token: when one is revoked, the other gets a new one into its folder. If that folder
        is not here, it is made anew, with a certificate that is valid for `days`.
        """
        if role.user not in self.members:
            names = ", ".join(sorted(member.name for member in self.roles.values()))
            raise BadInput(f"{role.name}: is no member of {self.fleet}; members are {names}")
        del self.members[role.user]
        counterpart = {WORLD_ROLE: OPERATOR, OPERATOR: WORLD_ROLE}.get(role)
        if counterpart is not None:
            self.token = os.urandom(16).hex()
        if counterpart is None or counterpart.user not in self.members:
            counterpart = None
        elif (self.path / counterpart.name).is_dir():
            self._write_member(counterpart, self.path / counterpart.name)
        else:  # its folder was moved away, so the token cannot be written into it
            del self.members[counterpart.user]
            self.add(counterpart, days)
        self._save_files()
        folder = self.path / role.name
        if folder.is_symlink():  # the folder that it leads to is not ours to remove
            folder.unlink()
        shutil.rmtree(folder, ignore_errors=True)
        return counterpart

    def renew_router(self, days: int, hosts: Sequence[str] = ()) -> None:
        """Issue a new certificate for the router, valid for `days`.

        `hosts` are added before the names and addresses that its machine has. Members use the first.
        """
        if self.is_mesh:
            raise BadInput(f"{self.path}: fleet {self.fleet} meets without a router")
        before = self.router
        self.hosts = checked_hosts([*hosts, *self.hosts])
        folder = self.path / THE_ROUTER
        folder.mkdir(mode=0o700, exist_ok=True)
        names = [*dict.fromkeys([*self.hosts, *LOCAL])]
        issue(self.path / AUTHORITY_FOLDER, folder, router_name(self.fleet), days, names)
        if self.router != before:
            for role in self._roles_here():
                self._write_member(role, self.path / role.name)
        self._save_files()

    def check(self, now_s: float) -> Iterator[tuple[str, bool, str]]:
        """Check the credentials that lie in the folder; copies on other machines are not seen.

        Yield the name that a line is about, whether all is well, and the line. `now_s` is Unix time.
        """
        try:
            yield AUTHORITY_FOLDER, *_judge_expiry(facts(self.path / AUTHORITY_FOLDER / CERTIFICATE).ends_s, now_s)
        except BadInput as bad:
            yield AUTHORITY_FOLDER, False, str(bad)
        names = {role.name: self.members[user] for user, role in self.roles.items()}
        for name, common_name in {**({} if self.is_mesh else {THE_ROUTER: ""}), **names}.items():
            folder = self.path / name
            if not folder.exists():
                yield name, True, "its folder is not here (it may have been moved to its machine)"
                continue
            try:
                if (mesh := self.mesh) is not None and read_mesh(folder / MESH, "fleet") != mesh:
                    yield name, False, f"its {MESH} is an old one; copy {self.path / MESH} into it"
                    continue
                yield name, *_judge_certificate(folder, self.path / AUTHORITY_FOLDER / CERTIFICATE, common_name, now_s)
            except BadInput as bad:
                yield name, False, str(bad)

    def _write_member(self, role: Role, folder: Path) -> None:
        token = self.token if role in (WORLD_ROLE, OPERATOR) else None
        router = "" if self.is_mesh else self.router
        replace_private(folder / MEMBER, as_json(Credentials(self.fleet, router, role, token=token)))

    def _save_files(self) -> None:
        """Write fleet.json, and what follows from it: the router's rules, or the file of the mesh and its copies."""
        fields = self.model_dump(exclude=None if self.is_mesh else {"places"})
        replace_private(self.path / FILE, f"{json.dumps(fields, indent=2)}\n")
        if (mesh := self.mesh) is not None:
            for folder in (self.path, *(self.path / role.name for role in self._roles_here())):
                replace_private(folder / MESH, mesh_json(mesh))
            return
        folder = self.path / THE_ROUTER
        folder.mkdir(mode=0o700, exist_ok=True)
        rules = router_json(fleet_keys(self.fleet), self.listen, self._roles_by_certificate())
        replace_private(folder / ROUTER, rules)

    def _roles_by_certificate(self) -> dict[str, Role]:
        return {self.members[user]: role for user, role in self.roles.items()}

    def _roles_here(self) -> list[Role]:
        """Return the members whose folders are here."""
        return [role for role in self.roles.values() if (self.path / role.name).is_dir()]


def make_fleet(
    path: Path,
    fleet: str,
    robots: Sequence[str],
    hosts: Sequence[str],
    port: int,
    days: int,
    places: Mapping[str, str] = MappingProxyType({}),
) -> FleetFolder:
    """Make a fleet's folder, whole or not at all.

    `hosts` are names and addresses of the router's machine, the one that members use first; none for this machine
    alone. With `places`, the names or addresses of robots' machines by robot, the fleet is a mesh without a router.
    `port` is the TCP port of the router; in a mesh, the UDP port of each host's first robot. Certificates are valid for
    `days`.
    """
    if path.exists():
        raise BadInput(f"{path}: exists already; to add a member, use: fogwatch fleet add {path} NAME")
    keys = fleet_keys(fleet, "--name")
    roles = [*map(_robot_role, robots), *(role for role in roles_of(robots) if role.kind is not Kind.ROBOT)]
    if not 1 <= port <= _LAST_PORT:
        raise BadInput(f"--port {port}: ports go from 1 to {_LAST_PORT}; choose one of them")
    router_hosts = [] if places else checked_hosts(hosts) or [*LOCAL]
    token = os.urandom(16).hex()
    new_fleet = FleetFolder(path=path, fleet=keys.fleet, hosts=router_hosts, port=port, token=token)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with _made_whole(path) as part:
            new_fleet.path = part
            write_private(part / ".gitignore", "*\n")  # keys belong into no repository
            make_authority(part / AUTHORITY_FOLDER, fleet)
            if not new_fleet.is_mesh:
                new_fleet.renew_router(days)
            for role in roles:
                new_fleet.add(role, days, places.get(role.name), f"--robots {role.name}=")
    except OSError as error:
        raise BadInput(f"{path}: cannot be made ({error.strerror}); choose another folder") from None
    new_fleet.path = path
    return new_fleet


@contextmanager
def fleet_to_change(path: Path) -> Iterator[FleetFolder]:
    """Open a fleet's folder to change it; other commands that want to change it wait until this is done."""
    open_fleet_folder(path)
    descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    until = time.monotonic() + LOCK_S
    try:
        while True:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if time.monotonic() >= until:
                    raise BadInput(f"{path}: another command is changing it; wait until that has ended") from None
                time.sleep(0.05)
        with changing(path):
            yield open_fleet_folder(path)
    finally:
        os.close(descriptor)


@contextmanager
def changing(path: Path) -> Iterator[None]:
    """Turn an OSError about a file into a BadInput that says that the folder cannot be changed."""
    try:
        yield
    except OSError as error:
        if error.filename is None or exhausted.told(error):  # such as an output without a reader, or a full disk
            raise
        file = error.filename2 or error.filename
        raise BadInput(f"{file}: cannot be written ({error.strerror}); make {path} writable") from None


def open_fleet_folder(path: Path) -> FleetFolder:
    """Open a fleet's folder."""
    if not (path / FILE).exists():
        raise BadInput(f"{path}: no fleet's folder, because it holds no {FILE}; make one with: fogwatch fleet init")
    fields = read_object(path / FILE, "fleet", secret=True)
    remedy = "restore it, or make a new fleet: fogwatch fleet init"
    damaged = BadInput(f"fleet: {path / FILE}: is damaged; {remedy}")
    try:
        fleet = FleetFolder.model_validate({**fields, "path": path})
    except ValidationError:
        raise damaged from None
    if fleet.is_mesh and "places" not in fields:
        raise damaged
    for user in fleet.members:
        role_of(user, f"fleet: {path / FILE}")
    fleet.fleet, fleet.hosts = fleet_keys(fleet.fleet).fleet, checked_hosts(fleet.hosts)
    return fleet


def member_role(name: str) -> Role:
    """Return the role of a member by its name in a fleet's folder: a robot's name, world, viewer or operator."""
    return Role(Kind(name)) if name in RESERVED and name in list(Kind) else _robot_role(name)


def _robot_role(name: str) -> Role:
    if name in RESERVED:
        raise BadInput(f"{name}: is a folder of every fleet, and cannot be a robot's name here; rename the robot")
    return robot_role(name)


def _judge_certificate(folder: Path, authority: Path, common_name: str, now_s: float) -> tuple[bool, str]:
    for name in (KEY, ROUTER if not common_name else MEMBER):
        check_private(folder / name, "fleet")
    if not (folder / AUTHORITY).is_file():
        return False, f"{AUTHORITY} is missing"
    if wrong := problem(folder, authority):
        return False, f"its certificate {wrong}"
    certificate = facts(folder / CERTIFICATE)
    if common_name and certificate.common_name != common_name:
        return False, f"its certificate is for {certificate.common_name}, and the fleet's member is {common_name}"
    return _judge_expiry(certificate.ends_s, now_s)


def _judge_expiry(ends_s: int, now_s: float) -> tuple[bool, str]:
    """Return whether a certificate is still valid, and until when."""
    day = time.strftime("%Y-%m-%d", time.gmtime(ends_s))
    if ends_s <= now_s:
        return False, f"its certificate expired on {day}"
    return True, f"valid until {day}{', which is soon' if ends_s - now_s < _SOON_S else ''}"


@contextmanager
def _made_whole(folder: Path) -> Iterator[Path]:
    """Make a folder that gets its name when its files are complete; remove it if that fails."""
    part = folder.with_name(f".{folder.name}.part")
    shutil.rmtree(part, ignore_errors=True)
    try:
        part.mkdir(mode=0o700)
        yield part
        part.rename(folder)
    except BaseException:
        shutil.rmtree(part, ignore_errors=True)
        raise


def checked_hosts(hosts: Sequence[str], called: str = "--host") -> list[str]:
    """Check hosts, and return each of them once, addresses without brackets.

    A host by which other machines could not reach its machine raises an error, which names the option `called`.
    """
    return [*dict.fromkeys(_check_host(host, called) for host in hosts)]


def mesh_locator(host: str, port: int, taken: Collection[str]) -> str:
    """Return the locator of a member that others connect to without a router.

    Positions may be lost on it, the rest not. `port` is the first UDP port to try: one on the same host as a locator in
    `taken` needs another port.
    """
    while (locator := f"quic/{_join_authority(host, port)}?mixed_rel=1") in taken:
        port += 1
    return locator


def _join_authority(host: str, port: int) -> str:
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def _any_address(hosts: Sequence[str]) -> str:
    """Return the address to listen on by which all of a machine's hosts are reached."""
    return "[::]" if any(":" in host for host in hosts) else "0.0.0.0"


def _check_host(host: str, called: str) -> str:
    bare = host[1:-1] if host[:1] == "[" and host[-1:] == "]" else host
    try:
        address = ipaddress.ip_address(bare)
    except ValueError:
        return _checked_name(host, called)
    if address.is_unspecified or is_no_host(bare):
        raise BadInput(f"{called} {host}: is no machine's own address; give the one that members reach it at")
    if "%" in bare:
        interface = bare[bare.index("%") :]
        raise BadInput(f"{called} {host}: no certificate or file can name an interface; leave {interface} out")
    return str(address)


def _checked_name(host: str, called: str) -> str:
    if _WITH_PORT.fullmatch(host):
        name, _, port = host.rpartition(":")
        raise BadInput(f"{called} {host!r}: holds a port; write {name} here, and --port {port}")
    if not _NAME.fullmatch(host) or is_no_host(host):
        raise BadInput(f"{called} {host!r}: not the name or address of a machine; write it as in 192.168.1.10")
    return host


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
    listen = [f"tcp/127.0.0.1:{local_port}", f"tls/{_any_address(own_hosts) if own_hosts else '127.0.0.1'}:{port}"]
    tls = {
        "root_ca_certificate": str(lies / AUTHORITY),
        "listen_certificate": str(lies / CERTIFICATE),
        "listen_private_key": str(lies / KEY),
        "enable_mtls": True,
        "close_link_on_expiration": True,
    }
    config = robot_router(form, namespace, members, listen, tls, commands)
    with changing(fleet.path):
        replace_private(folder / ROBOT_ROUTER, f"{json.dumps(config, indent=2)}\n")
    return folder
