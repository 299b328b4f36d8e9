"""The secrets of one run: a password for each role, and the operators' token, in a folder that only this user can see.

    ROOT/NAME/lock          held by the launcher as long as it lives
    ROOT/NAME/router/       what the router needs (`runtime.security.credentials.RouterSecurity`)
    ROOT/NAME/ROLE.json     the credentials of a role

The folder lies outside the run's folder, which people copy, keep and share. It goes when the run ends. The next
launcher that starts removes the folder of one that was killed. A system may clear such folders while a run goes on, for
example when its user logs out; the launcher then makes the folder anew, under the same name, when it needs it.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from patrol.errors import BadInput
from runtime.security.access import is_private, private_roots
from runtime.security.credentials import ROUTER, USERS, Credentials, as_json, router_json
from runtime.security.keys import fleet_keys
from runtime.security.private_files import replace_private, write_private
from runtime.security.roles import OPERATOR, WORLD_ROLE, Role, roles_of

_LOCK = "lock"
_PART = "part-"
_ABANDONED_S = 3600.0
"""Age beyond which a folder without its name is in use no more, s."""


class Secrets:
    """The secrets of one run, and the private folder that holds them.

    `name` is the folder's name; `token` is the operators' token.
    """

    def __init__(self, fleet: str, robots: Sequence[str]) -> None:
        """Draw the secrets, and make the folder; `robots` are all that may ever join."""
        self._fleet = fleet
        self._roles = {role.user: role for role in roles_of(robots)}
        self._passwords = {user: os.urandom(16).hex() for user in self._roles}
        self.token = os.urandom(16).hex()
        self.name = os.urandom(16).hex()
        self._router = ""
        self._lock = -1
        self._keeping = threading.Lock()  # robots are started again on a thread of its own
        self.path = self._make_folder()

    def for_router(self, listen: str) -> Path:
        """Write what the router needs to listen on a locator, and return the folder."""
        self._keep_folder()
        folder = self.path / "router"
        folder.mkdir(mode=0o700, exist_ok=True)
        for file in (folder / USERS, folder / ROUTER):
            file.unlink(missing_ok=True)
        users = "".join(f"{user}:{password}\n" for user, password in self._passwords.items())
        write_private(folder / USERS, users)
        write_private(folder / ROUTER, router_json(fleet_keys(self._fleet), listen, self._roles))
        return folder

    def for_members(self, router: str) -> None:
        """Write the credentials of all roles; called once."""
        self._router = router
        self._keep_folder()

    def of_role(self, role: Role) -> Path:
        """Return the file of a role's credentials."""
        self._keep_folder()
        return self.path / f"{role.user}.json"

    def remove(self) -> None:
        """Remove the folder; what has been removed stays so."""
        shutil.rmtree(self.path, ignore_errors=True)
        self._unlock_folder()

    def _keep_folder(self) -> None:
        """Make the folder anew if it has been cleared, and write the credentials that are missing in it."""
        with self._keeping:
            if not (self.path / _LOCK).exists():
                shutil.rmtree(self.path, ignore_errors=True)
                self._unlock_folder()
                self.path = self._make_folder()
            for user, role in self._roles.items() if self._router else ():
                file = self.path / f"{user}.json"
                if not file.exists():
                    token = self.token if role in (WORLD_ROLE, OPERATOR) else None
                    credentials = Credentials(self._fleet, self._router, role, self._passwords[user], token)
                    replace_private(file, as_json(credentials))

    def _make_folder(self) -> Path:
        """Make the folder, locked as long as this process lives. It gets its name last, so no sweep finds it open."""
        root = _find_root()
        _sweep_folders(root)
        part = root / f"{_PART}{self.name}"
        try:
            part.mkdir(mode=0o700)
            self._lock = os.open(part / _LOCK, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o600)
            fcntl.flock(self._lock, fcntl.LOCK_EX)
            return part.rename(root / self.name)
        except BaseException:
            shutil.rmtree(part, ignore_errors=True)
            raise

    def _unlock_folder(self) -> None:
        if self._lock >= 0:
            os.close(self._lock)
        self._lock = -1


def _find_root() -> Path:
    """Find a folder that private folders can be made in; the first that this user may make or has made."""
    tried = []
    for root in private_roots():
        with suppress(OSError):
            root.mkdir(mode=0o700)
        if is_private(root) and os.access(root, os.W_OK):
            return root
        tried.append(str(root))
    neither = f"neither {' nor '.join(tried)} is; remove one of them"
    raise BadInput(f"the run's secrets need a folder that is yours alone, and {neither}")


def _sweep_folders(root: Path) -> None:
    """Remove the folders of launchers that are gone."""
    for folder in root.iterdir():
        if folder.name.startswith(_PART):  # of a launcher that is about to lock it, or was killed before it did
            with suppress(FileNotFoundError):
                if time.time() - folder.stat().st_mtime > _ABANDONED_S:
                    shutil.rmtree(folder, ignore_errors=True)
            continue
        try:
            lock = os.open(folder / _LOCK, os.O_WRONLY | os.O_CLOEXEC)
        except OSError:
            continue
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            pass
        else:
            shutil.rmtree(folder, ignore_errors=True)
        finally:
            os.close(lock)
