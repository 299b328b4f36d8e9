"""Address of a running fleet, and the right to control it: `control.json`, or an operator's credentials.

A launcher keeps the secrets of its run in a private folder of this machine, and writes the file into the run's folder.
The file names the private folder, and holds no secret and no path: a run's folder may come from others, so
only folders that are this user's own, where launchers make them, are looked into.

For processes that are started by hand the file is made by hand: a JSON object with "fleet", "router" and "token". It
leads to a router on this machine only, because such a file may come from others too. A fleet of several machines needs
none: each operator has credentials in a folder of its own (`runtime.security.credentials`), which is never a run's.
"""

from __future__ import annotations

import json
import os
import re
import stat
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from patrol.errors import BadInput
from runtime.security.credentials import MEMBER, SHORTEST_TOKEN, Credentials, read_credentials
from runtime.security.keys import check_locator, fleet_keys, is_local
from runtime.security.private_files import read_object, replace_private
from runtime.security.roles import OPERATOR, Role

FILE = "control.json"
_PRIVATE = re.compile(r"[0-9a-f]{16,64}")
_FIELDS = ("fleet", "router", "token")
_OF_A_RUN = ("journal", "scenario.yaml")
"""Files that a run's folder holds, and a member's does not."""


@dataclass(frozen=True, slots=True)
class Access:
    """Address of a fleet, and the right to control it."""

    fleet: str
    router: str  # locator
    token: str  # the right to control it
    credentials: Credentials | None = field(default=None, compare=False)  # None for a router that asks for none

    def __repr__(self) -> str:
        return f"Access({self.fleet!r}, {self.router!r})"


def write_pointer(path: Path, fleet: str, router: str, private: str) -> None:
    """Write the file that names the private folder of a run, in one piece.

    A process that waits for the file finds it complete as soon as it is there.
    """
    replace_private(path, json.dumps({"fleet": fleet, "router": router, "private": private}))


def read_access(path: Path, option: str) -> Access:
    """Read how to reach and control a fleet."""
    access = _read_access(path, option, OPERATOR)
    if isinstance(access, Access):
        return access
    if access.token is None:
        kind = access.role.kind
        raise BadInput(
            f"{option}: {path}: a {kind}'s credentials give no right to control the fleet; name an operator's"
        )
    return Access(access.fleet, access.router, access.token, access)


def credentials_at(path: Path, option: str, role: Role) -> Credentials:
    """Read the credentials that a member has, or that a role has in a run of this machine.

    The path is the member's credentials, or the run's folder or file; only for a run does `role` count.
    """
    access = _read_access(path, option, role)
    if isinstance(access, Access):
        raise BadInput(f"{option}: {path}: holds no credentials; its router asks nobody for any")
    return access


def _read_access(path: Path, option: str, role: Role) -> Access | Credentials:
    file = path
    if path.is_dir():
        if (path / MEMBER).exists():
            if run_file := next((name for name in _OF_A_RUN if (path / name).exists()), None):
                raise BadInput(
                    f"{option}: {path}: holds a member's credentials beside a run's {run_file}; if the credentials are "
                    f"yours, name their file, {path / MEMBER}"
                )
            return read_credentials(path, option)
        file = path / FILE
    try:
        says = read_object(file, option)
    except BadInput as bad:
        removal_note = " (it is removed when the run is over)" if path.is_dir() and not file.exists() else ""
        raise BadInput(f"{bad}{removal_note}") from None
    if "role" in says:
        if file.name == FILE:
            raise BadInput(f"{option}: {file}: holds a member's credentials; if they are yours, give it another name")
        return read_credentials(file, option)
    if "private" in says:
        return _of_a_run(says, file, option, role)
    fields = [says.get(name) for name in _FIELDS]
    texts = [text for text in fields if isinstance(text, str)]
    if len(texts) != len(_FIELDS):
        raise BadInput(f'{option}: {file}: expected a JSON object with "fleet", "router" and "token", all strings')
    fleet, router, token = texts
    if len(token) < SHORTEST_TOKEN:
        raise BadInput(
            f"{option}: {file}: the token has {len(token)} characters; give {SHORTEST_TOKEN} or more, random ones"
        )
    if not is_local(check_locator(router, f"{option}: {file}: router")):
        raise BadInput(
            f"{option}: {file}: router = {router}: such a file leads to a router on this machine only; for another "
            "machine's, use an operator's credentials, made with: fogwatch fleet init"
        )
    return Access(fleet_keys(fleet).fleet, router, token)


def _of_a_run(says: Mapping[str, Any], file: Path, option: str, role: Role) -> Credentials:
    """Find a role's credentials in a run of this machine, whose file says where they are."""
    name = says["private"]
    if not isinstance(name, str) or not _PRIVATE.fullmatch(name):
        raise BadInput(f"{option}: {file}: private = {name!r}: expected 16 to 64 hex digits, the name of a folder")
    folder = next((root / name for root in private_roots() if is_private(root) and is_private(root / name)), None)
    if folder is None:
        raise BadInput(
            f"{option}: {file}: the secrets of its run are not here; the run is over, or another user's or machine's"
        )
    credentials = read_credentials(folder / f"{role.user}.json", option)
    if (credentials.fleet, credentials.router) != (says.get("fleet"), says.get("router")):
        raise BadInput(f"{option}: {file}: names the secrets of another run, of fleet {credentials.fleet}")
    return credentials


def private_roots() -> list[Path]:
    """List the folders in which launchers of this user make private folders, the first choice first."""
    user = os.getuid()
    runtime = os.environ.get("XDG_RUNTIME_DIR") or f"/run/user/{user}"
    roots = [Path(runtime) / "fogwatch", Path(tempfile.gettempdir()) / f"fogwatch-{user}"]
    home = os.environ.get("HOME")  # another user may have taken the name among the temporary files
    return [*roots, Path(home) / ".fogwatch"] if home else roots


def is_private(folder: Path) -> bool:
    """Return True if a path is a folder of this user's own, and no link, that no other user can look into."""
    try:
        # Not stat: a link of another user's may lead to a folder that is this user's own.
        status = folder.lstat()
    except OSError:
        return False
    return stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o077
