"""The file with the address of a running fleet and the token without which its world refuses every control.

A launcher writes one into the run's folder, readable by its user alone, and removes it when the run is over. For
processes that are started by hand it is made by hand: a JSON object with "fleet", "router" and "token".
"""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path

from patrol.errors import BadInput
from patrol.net.keys import check_locator, fleet_keys
from patrol.untrusted import ACCESS, read_untrusted

FILE = "control.json"
LEAST = 16
"""Characters of the shortest token."""


@dataclass(frozen=True, slots=True)
class Access:
    """How to reach a fleet and control it.

    Attributes:
        fleet: its name.
        router: its locator.
        token: the right to control it.
    """

    fleet: str
    router: str
    token: str

    def __repr__(self) -> str:
        return f"Access({self.fleet!r}, {self.router!r})"


def write_access(path: Path, access: Access) -> None:
    """Write a new file that nobody else may read.

    Args:
        path: the new file.
        access: what it holds.

    Raises:
        OSError: when the file cannot be written.
    """
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "w", encoding="utf-8") as file:
        json.dump(asdict(access), file)


def read_access(path: Path, option: str) -> Access:
    """Read the access file of a fleet.

    Args:
        path: the file, or the run's folder.
        option: what errors call the path.

    Raises:
        BadInput: when there is no such file or it holds something else.
    """
    file = path / FILE if path.is_dir() else path
    try:
        says = json.loads(read_untrusted(file, ACCESS))
    except OSError as error:
        gone = " (it is removed when the run is over)" if path.is_dir() else ""
        raise BadInput(f"{option}: {file} cannot be read: {error.strerror}{gone}") from None
    except (ValueError, RecursionError):
        says = None
    fields = [says.get(name) for name in ("fleet", "router", "token")] if isinstance(says, dict) else []
    texts = [field for field in fields if isinstance(field, str)]
    if len(texts) != 3:
        raise BadInput(f'{option}: {file}: expected a JSON object with "fleet", "router" and "token", all strings')
    fleet, router, token = texts
    if len(token) < LEAST:
        raise BadInput(f"{option}: {file}: the token has {len(token)} characters; give {LEAST} or more, random ones")
    return Access(fleet_keys(fleet).fleet, check_locator(router, f"{option}: router"), token)
