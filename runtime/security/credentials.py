"""A process's credentials at a fleet's router, and the files by which the router checks them.

A member's credentials are a JSON file: the fleet, its router, the member's role, the operators' token where the role
has it, and a password. In a fleet of several machines there is no password. The file `MEMBER` then lies in a folder of
its own, beside the member's certificate and key and the certificate of the fleet's authority; in a fleet
without a router also beside `runtime.security.mesh.MESH`.

Only the owner may read any of these files, and files that others can read are refused.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from patrol.errors import BadInput
from runtime.security.keys import FleetKeys, check_locator, check_locators, fleet_keys, is_local
from runtime.security.mesh import GUARDED, MESH, Mesh, read_mesh
from runtime.security.private_files import REMEDY, check_private, option_in, read_object, text_in
from runtime.security.roles import COMMON_NAMES, USERNAMES, Kind, Role, access_control, robot_role, role_of

MEMBER = "member.json"
"""A member's credentials, in a folder of their own."""
ROUTER = "router.json"
"""The file in a router's folder that names the fleet and its members."""
USERS = "users.txt"
"""The file in a router's folder with the passwords; there is none where members have certificates."""
AUTHORITY, CERTIFICATE, KEY = "authority.pem", "certificate.pem", "key.pem"
"""The certificate of the fleet's authority, a member's own, and its key."""

SHORTEST_TOKEN = 16
"""Characters of the shortest token."""


@dataclass(frozen=True, slots=True)
class Credentials:
    """A process's role, its secrets and where its fleet meets.

    The `repr` shows no secrets.
    """

    fleet: str
    router: str  # locator, or several with commas, tried in turn; of a mesh, the members' with known addresses
    role: Role
    password: str | None = None  # proves the role to the router; None for a member with a certificate
    token: str | None = None  # the right to control the fleet; None but for operators and the world
    folder: Path | None = None  # of the certificate, its key and the authority's certificate; None with a password
    mesh: Mesh | None = None  # None where the fleet has a router
    beside: bool = False  # for a process's second session, which cannot listen where the first one does

    def __repr__(self) -> str:
        return f"Credentials({self.fleet!r}, {self.router!r}, {self.role.user!r})"

    @property
    def meets_at(self) -> str:
        """The place where the fleet meets, for people."""
        return self.router if self.mesh is None else f"the mesh of its {len(self.mesh.members)} members"

    @property
    def listens_at(self) -> str:
        """The locator that a member of a mesh listens on; empty for others."""
        return "" if self.mesh is None else self.mesh.listens_at(self.role, beside=self.beside)

    def session(self) -> dict[str, object]:
        """Give the settings for Zenoh's configuration of a member's session, by key."""
        if self.folder is None:
            return {"transport/auth/usrpwd/user": self.role.user, "transport/auth/usrpwd/password": self.password}
        if self.mesh is None:
            return _certificate_settings(self.folder, listens=False)
        return {**_certificate_settings(self.folder, listens=True), **self.mesh.session(self.listens_at)}

    def check_router(self, router: str, option: str) -> str:
        """Check that a router can ask for these credentials, and return its locator.

        Otherwise their owner would be told that the credentials are wrong, and not the address.
        """
        if self.mesh is not None:
            raise BadInput(
                f"{option} {router}: the members of {self.fleet} meet without a router; leave the option out"
            )
        return _check_locator_of(router, option, self.folder is None)


def _certificate_settings(folder: Path, *, listens: bool) -> dict[str, object]:
    """Give the settings of a session with a certificate, by key of Zenoh's configuration."""
    ways = ("connect", "listen") if listens else ("connect",)
    return {
        "transport/link/tls/root_ca_certificate": str(folder / AUTHORITY),
        **{f"transport/link/tls/{way}_certificate": str(folder / CERTIFICATE) for way in ways},
        **{f"transport/link/tls/{way}_private_key": str(folder / KEY) for way in ways},
        "transport/link/tls/enable_mtls": True,
        "transport/link/tls/verify_name_on_connect": True,
        "transport/link/tls/close_link_on_expiration": True,
    }


def as_json(credentials: Credentials) -> str:
    """Return the text of a credentials file."""
    says = {
        "fleet": credentials.fleet,
        "router": credentials.router if credentials.mesh is None else None,
        "role": str(credentials.role.kind),
        "robot": credentials.role.robot,
        "password": credentials.password,
        "token": credentials.token,
    }
    return f"{json.dumps({name: value for name, value in says.items() if value}, indent=2)}\n"


def read_credentials(path: Path, option: str) -> Credentials:
    """Read a member's credentials from a file, or from the folder that `MEMBER` lies in.

    Files that others can read are refused.
    """
    file = path / MEMBER if path.is_dir() else path
    says = read_object(file, option, secret=True)
    where = f"{option}: {file}"
    kind = text_in(says, "kind of role", "role", where)
    if kind not in list(Kind):
        raise BadInput(f"{where}: role = {kind!r}: expected one of {', '.join(Kind)}; {REMEDY}")
    role = robot_role(text_in(says, "robot's name", "robot", where)) if kind == Kind.ROBOT else Role(Kind(kind))
    password, token = option_in(says, "password", where), option_in(says, "token", where)
    if token is not None and len(token) < SHORTEST_TOKEN:
        raise BadInput(f"{where}: the token has {len(token)} characters; give {SHORTEST_TOKEN} or more, random ones")
    folder = None if password is not None else file.parent.absolute()
    if folder is not None:
        check_private(folder / KEY, option)
        for name in (AUTHORITY, CERTIFICATE):
            if not (folder / name).is_file():
                raise BadInput(f"{option}: {folder / name}: no such file, and {file} has no password; {REMEDY}")
    fleet = fleet_keys(text_in(says, "fleet's name", "fleet", where), f"{where}: fleet").fleet
    if folder is not None and "router" not in says and (folder / MESH).is_file():
        mesh = _own_mesh(folder / MESH, fleet, role, option)
        return Credentials(fleet, ",".join(mesh.others(role)), role, token=token, folder=folder, mesh=mesh)
    router = check_locators(text_in(says, "router's address", "router", where), f"{where}: router")
    credentials = Credentials(fleet, router, role, password, token, folder)
    credentials.check_router(router, f"{where}: router")
    return credentials


def _own_mesh(file: Path, fleet: str, role: Role, option: str) -> Mesh:
    """Read the file of a mesh that a member belongs to. Raises BadInput for another fleet's, and without the member."""
    mesh = read_mesh(file, option)
    if mesh.fleet != fleet:
        raise BadInput(f"{option}: {file}: is of fleet {mesh.fleet}, and the credentials are of {fleet}")
    if role not in mesh.members.values():
        remedy = f"copy the fleet's {MESH} again, or make it one with: fogwatch fleet add"
        raise BadInput(f"{option}: {file}: {role.name} is no member of fleet {fleet}; {remedy}")
    return mesh


@dataclass(frozen=True, slots=True)
class RouterSecurity:
    """The members of a fleet, for its router."""

    keys: FleetKeys
    listen: str  # locator
    members: Mapping[str, Role]  # by user, or by the common name of the certificate
    folder: Path  # of the passwords, or of the router's certificate, its key and the authority's certificate
    passwords: bool  # members have passwords, and no certificates

    def session(self) -> dict[str, object]:
        """Give the settings for Zenoh's configuration of the router, by key."""
        if self.passwords:
            return {
                "transport/auth/usrpwd/dictionary_file": str(self.folder / USERS),
                "access_control": access_control(self.keys, self.members, USERNAMES),
            }
        return {
            **_certificate_settings(self.folder, listens=True),
            "access_control": access_control(self.keys, self.members, COMMON_NAMES),
        }

    def check_listen(self, listen: str) -> str:
        """Check where the router listens, and return the locator.

        Members must be told apart there, and no stranger may read along: passwords do not leave this machine, and
        members with certificates need an encrypted locator.
        """
        return _check_locator_of(listen, "--listen", self.passwords)

    def check_connect(self, other: str) -> str:
        """Check that a link to another router of the fleet is guarded, and return its locator.

        Routers cannot prove themselves with passwords, so a fleet with passwords has no such link.
        """
        if self.passwords:
            raise BadInput(f"--connect {other}: a fleet with passwords is on one machine, with one router; {REMEDY}")
        if not other.startswith(GUARDED):
            raise BadInput(f"--connect {other}: the link would not be encrypted; write tls/{other.partition('/')[2]}")
        return other


def _check_locator_of(locator: str, option: str, passwords: bool) -> str:
    if passwords and not is_local(locator):
        raise BadInput(f"{option} {locator}: passwords are for one machine; for several, {REMEDY}")
    unguarded = [address for address in locator.split(",") if not address.startswith(GUARDED)]
    if not passwords and unguarded:
        remedy = f"tls/{unguarded[0].partition('/')[2]}"
        raise BadInput(f"{option} {locator}: the members have certificates, which need tls; write {remedy}")
    return locator


def read_router(path: Path, option: str) -> RouterSecurity:
    """Read what a router needs to know, from its own folder or the fleet's, in which that lies.

    Secrets that others can read are refused.
    """
    folder = path if (path / ROUTER).is_file() else path / "router"
    file = folder / ROUTER
    says = read_object(file, option)
    where = f"{option}: {file}"
    keys = fleet_keys(text_in(says, "fleet's name", "fleet", where))
    listen = check_locator(text_in(says, "router's address", "listen", where), f"{where}: listen")
    members = says.get("members")
    if not isinstance(members, dict) or not all(isinstance(user, str) for user in members.values()):
        raise BadInput(f'{where}: expected "members", each member by the name that it is known by; {REMEDY}')
    roles = {name: role_of(user, where) for name, user in members.items()}
    passwords = (folder / USERS).exists()
    check_private(folder / (USERS if passwords else KEY), option)
    return RouterSecurity(keys, listen, roles, folder.absolute(), passwords)


def router_json(keys: FleetKeys, listen: str, members: Mapping[str, Role]) -> str:
    """Return the text of a router's file."""
    users = {name: role.user for name, role in members.items()}
    return f"{json.dumps({'fleet': keys.fleet, 'listen': listen, 'members': users}, indent=2)}\n"
