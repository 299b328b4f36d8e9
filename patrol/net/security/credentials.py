"""A process's credentials at a fleet's router, and the files by which the router checks them.

A member's credentials are a JSON file: the fleet, its router, the member's role, the operators' token where the role
has it, and a password. In a fleet of several machines there is no password. The file `MEMBER` then lies in a folder of
its own, beside the member's certificate and key and the certificate of the fleet's authority.

Only the owner may read any of these files, and files that others can read are refused.
"""

from __future__ import annotations

import json
import os
import stat
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from patrol.errors import BadInput
from patrol.files.half_characters import refuse_half_characters
from patrol.files.untrusted import ACCESS, open_untrusted
from patrol.files.whole_file import replacing
from patrol.net.keys import FleetKeys, check_locator, fleet_keys, is_local
from patrol.net.security.roles import COMMON_NAMES, USERNAMES, Kind, Role, access_control, robot_role, role_of

MEMBER = "member.json"
"""A member's credentials, in a folder of their own."""
ROUTER = "router.json"
"""The file in a router's folder that names the fleet and its members."""
USERS = "users.txt"
"""The file in a router's folder with the passwords; there is none where members have certificates."""
AUTHORITY, CERTIFICATE, KEY = "authority.pem", "certificate.pem", "key.pem"
"""The certificate of the fleet's authority, a member's own, and its key."""

GIVEN = "CREDENTIALS_DIRECTORY"
"""Variable of the environment with the folder of secrets that a service manager gives."""

SHORTEST_TOKEN = 16
"""Characters of the shortest token."""
_ENCRYPTED = ("tls/", "quic/")
_REMEDY = "make it with: fogwatch fleet init"


@dataclass(frozen=True, slots=True)
class Credentials:
    """A process's role, its secrets and its fleet's router. The `repr` shows no secrets.

    Attributes:
        fleet: The fleet's name.
        router: The router's locator.
        role: What the process is.
        password: Proves it to the router; None for a member with a certificate.
        token: The right to control the fleet, for operators and the world; None for others.
        folder: Where certificate, key and the authority's certificate lie; None for a member with a password.
    """

    fleet: str
    router: str
    role: Role
    password: str | None = None
    token: str | None = None
    folder: Path | None = None

    def __repr__(self) -> str:
        return f"Credentials({self.fleet!r}, {self.router!r}, {self.role.user!r})"

    def session(self) -> dict[str, object]:
        """Give the settings for Zenoh's configuration of a client's session, by key."""
        if self.folder is None:
            return {
                "transport/auth/usrpwd/user": self.role.user,
                "transport/auth/usrpwd/password": self.password,
            }
        return {
            "transport/link/tls/root_ca_certificate": str(self.folder / AUTHORITY),
            "transport/link/tls/connect_certificate": str(self.folder / CERTIFICATE),
            "transport/link/tls/connect_private_key": str(self.folder / KEY),
            "transport/link/tls/enable_mtls": True,
            "transport/link/tls/verify_name_on_connect": True,
            "transport/link/tls/close_link_on_expiration": True,
        }

    def check_router(self, router: str, option: str) -> str:
        """Check that a router can ask for these credentials, so that their owner is not told that they are wrong.

        Args:
            router: The router's locator.
            option: What errors call it.

        Returns:
            The locator.

        Raises:
            BadInput: A password would leave this machine, or the locator has no certificates.
        """
        return _check_locator_of(router, option, self.folder is None)


def as_json(credentials: Credentials) -> str:
    """Return the text of a credentials file.

    Args:
        credentials: What it holds.
    """
    says = {
        "fleet": credentials.fleet,
        "router": credentials.router,
        "role": str(credentials.role.kind),
        "robot": credentials.role.robot,
        "password": credentials.password,
        "token": credentials.token,
    }
    return f"{json.dumps({name: value for name, value in says.items() if value}, indent=2)}\n"


def read_credentials(path: Path, option: str) -> Credentials:
    """Read a member's credentials.

    Args:
        path: The file, or the folder that `MEMBER` lies in.
        option: What errors call the path.

    Returns:
        The credentials.

    Raises:
        BadInput: There are none, others can read them, or they hold something else.
    """
    file = path / MEMBER if path.is_dir() else path
    says = read_object(file, option, secret=True)
    where = f"{option}: {file}"
    kind = _text(says, "kind of role", "role", where)
    if kind not in list(Kind):
        raise BadInput(f"{where}: role = {kind!r}: expected one of {', '.join(Kind)}; {_REMEDY}")
    role = robot_role(_text(says, "robot's name", "robot", where)) if kind == Kind.ROBOT else Role(Kind(kind))
    password, token = _option(says, "password", where), _option(says, "token", where)
    if token is not None and len(token) < SHORTEST_TOKEN:
        raise BadInput(f"{where}: the token has {len(token)} characters; give {SHORTEST_TOKEN} or more, random ones")
    folder = None if password is not None else file.parent.absolute()
    if folder is not None:
        check_private(folder / KEY, option)
        for name in (AUTHORITY, CERTIFICATE):
            if not (folder / name).is_file():
                raise BadInput(f"{option}: {folder / name}: no such file, and {file} has no password; {_REMEDY}")
    credentials = Credentials(
        fleet_keys(_text(says, "fleet's name", "fleet", where), f"{where}: fleet").fleet,
        check_locator(_text(says, "router's address", "router", where), f"{where}: router"),
        role,
        password,
        token,
        folder,
    )
    credentials.check_router(credentials.router, f"{where}: router")
    return credentials


@dataclass(frozen=True, slots=True)
class RouterSecurity:
    """The members of a fleet, for its router.

    Attributes:
        keys: The fleet's keys.
        listen: The locator that the router listens on.
        members: Roles by the name that the router knows each member by: its user, or its certificate's common name.
        folder: Where the passwords lie, or the router's certificate, its key and the authority's certificate.
        passwords: Whether members have passwords, and no certificates.
    """

    keys: FleetKeys
    listen: str
    members: Mapping[str, Role]
    folder: Path
    passwords: bool

    def session(self) -> dict[str, object]:
        """Give the settings for Zenoh's configuration of the router, by key."""
        if self.passwords:
            return {
                "transport/auth/usrpwd/dictionary_file": str(self.folder / USERS),
                "access_control": access_control(self.keys, self.members, USERNAMES),
            }
        return {
            "transport/link/tls/root_ca_certificate": str(self.folder / AUTHORITY),
            "transport/link/tls/listen_certificate": str(self.folder / CERTIFICATE),
            "transport/link/tls/listen_private_key": str(self.folder / KEY),
            "transport/link/tls/connect_certificate": str(self.folder / CERTIFICATE),
            "transport/link/tls/connect_private_key": str(self.folder / KEY),
            "transport/link/tls/enable_mtls": True,
            "transport/link/tls/verify_name_on_connect": True,
            "transport/link/tls/close_link_on_expiration": True,
            "access_control": access_control(self.keys, self.members, COMMON_NAMES),
        }

    def check_listen(self, listen: str) -> str:
        """Check that members can be told apart, and that no stranger can read along, where the router listens.

        Args:
            listen: The locator.

        Returns:
            The locator.

        Raises:
            BadInput: Passwords would leave this machine, or the locator has no certificates.
        """
        return _check_locator_of(listen, "--listen", self.passwords)

    def check_connect(self, other: str) -> str:
        """Check that a link to another router of the fleet is guarded.

        Args:
            other: The other router's locator.

        Returns:
            The locator.

        Raises:
            BadInput: The fleet has passwords, which routers cannot prove themselves with, or the locator is not
                encrypted.
        """
        if self.passwords:
            raise BadInput(f"--connect {other}: a fleet with passwords is on one machine, with one router; {_REMEDY}")
        if not other.startswith(_ENCRYPTED):
            raise BadInput(f"--connect {other}: the link would not be encrypted; write tls/{other.partition('/')[2]}")
        return other


def _check_locator_of(locator: str, option: str, passwords: bool) -> str:
    if passwords and not is_local(locator):
        raise BadInput(f"{option} {locator}: passwords are for one machine; for several, {_REMEDY}")
    if not passwords and not locator.startswith(_ENCRYPTED):
        remedy = f"tls/{locator.partition('/')[2]}"
        raise BadInput(f"{option} {locator}: the members have certificates, which need tls; write {remedy}")
    return locator


def read_router(path: Path, option: str) -> RouterSecurity:
    """Read what a router needs to know.

    Args:
        path: The router's folder, or the fleet's folder that it lies in.
        option: What errors call the path.

    Raises:
        BadInput: It is no such folder, others can read its secrets, or it holds something else.
    """
    folder = path if (path / ROUTER).is_file() else path / "router"
    file = folder / ROUTER
    says = read_object(file, option)
    where = f"{option}: {file}"
    keys = fleet_keys(_text(says, "fleet's name", "fleet", where))
    listen = check_locator(_text(says, "router's address", "listen", where), f"{where}: listen")
    members = says.get("members")
    if not isinstance(members, dict) or not all(isinstance(user, str) for user in members.values()):
        raise BadInput(f'{where}: expected "members", each member by the name that it is known by; {_REMEDY}')
    roles = {name: role_of(user, where) for name, user in members.items()}
    passwords = (folder / USERS).exists()
    check_private(folder / (USERS if passwords else KEY), option)
    return RouterSecurity(keys, listen, roles, folder.absolute(), passwords)


def router_json(keys: FleetKeys, listen: str, members: Mapping[str, Role]) -> str:
    """Return the text of a router's file.

    Args:
        keys: The fleet's keys.
        listen: The locator that the router listens on.
        members: Roles by the name that the router knows each member by.
    """
    users = {name: role.user for name, role in members.items()}
    return f"{json.dumps({'fleet': keys.fleet, 'listen': listen, 'members': users}, indent=2)}\n"


def check_private(file: Path, option: str) -> None:
    """Check that a file with a secret is a regular one that only its owner can read.

    Args:
        file: The file.
        option: What errors call it.

    Raises:
        BadInput: It is something else, or others can read it.
    """
    try:
        status = file.stat()
    except OSError as error:
        raise BadInput(f"{option}: {file} cannot be read: {error.strerror}; {_REMEDY}") from None
    if not stat.S_ISREG(status.st_mode):
        raise BadInput(f"{option}: {file}: is no regular file; {_REMEDY}")
    if _exposed(file, status.st_mode):
        raise BadInput(f"{option}: {file}: others can read it (mode {status.st_mode & 0o777:o}); run chmod 600 {file}")


def _exposed(file: Path, mode: int) -> bool:
    """Return True if others than its owner can read or change a file.

    A service manager gives a service its secrets in a folder of their own, by an access list that names the service's
    user. Such a list shows in the mode as a right of the group to read.
    """
    given_folder = os.environ.get(GIVEN)
    allowed = 0o040 if given_folder and file.parent == Path(given_folder) else 0
    return bool(mode & 0o077 & ~allowed)


def read_object(file: Path, option: str, *, secret: bool = False) -> dict[str, Any]:
    """Read the JSON object in a file.

    Args:
        file: The file.
        option: What errors call it.
        secret: Whether only its owner may be able to read it.

    Raises:
        BadInput: It cannot be read, or is no JSON object.
    """
    try:
        with open_untrusted(file, ACCESS) as opened:
            mode = os.fstat(opened.fileno()).st_mode & 0o777
            text = opened.read(ACCESS.most)
    except OSError as error:
        raise BadInput(f"{option}: {file} cannot be read: {error.strerror}") from None
    if secret and _exposed(file, mode):
        raise BadInput(f"{option}: {file}: others can read it (mode {mode:o}); run chmod 600 {file}")
    try:
        says = json.loads(text)
    except (ValueError, RecursionError):
        says = None
    if not isinstance(says, dict):
        raise BadInput(f"{option}: {file}: expected a JSON object")
    refuse_half_characters(says, f"{option}: {file}")
    return says


def write_private(file: Path, text: str) -> None:
    """Write a new file that only its owner may read.

    Args:
        file: The new file.
        text: What it holds.

    Raises:
        OSError: It exists already, or cannot be written.
    """
    descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "w", encoding="utf-8") as opened:
        opened.write(text)


def _text(says: Mapping[str, Any], what: str, name: str, where: str) -> str:
    value = says.get(name)
    if not isinstance(value, str) or not value:
        raise BadInput(f'{where}: expected "{name}", the {what}; {_REMEDY}')
    return value


def _option(says: Mapping[str, Any], name: str, where: str) -> str | None:
    value = says.get(name)
    if value is not None and not isinstance(value, str):
        raise BadInput(f"{where}: {name}: expected a text; {_REMEDY}")
    return value


def replace_private(file: Path, text: str) -> None:
    """Write a file that only its owner may read; readers see the whole file or the one before.

    Args:
        file: The file, which may be there already.
        text: What it is to hold.

    Raises:
        OSError: It cannot be written.
    """
    with replacing(file) as part:
        write_private(part, text)
