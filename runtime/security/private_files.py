"""The files of a fleet's members: JSON objects, secrets that only their owner may read, and the key of positions."""

from __future__ import annotations

import json
import os
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from patrol.errors import BadInput
from patrol.files.untrusted import ACCESS, KEY, open_untrusted, read_untrusted, refuse_half_characters
from patrol.files.whole_file import replacing

GIVEN = "CREDENTIALS_DIRECTORY"
"""Variable of the environment with the folder of secrets that a service manager gives."""
REMEDY = "make it with: fogwatch fleet init"


def check_private(file: Path, option: str) -> None:
    """Check that a file with a secret is a regular one that only its owner can read."""
    try:
        status = file.stat()
    except OSError as error:
        raise BadInput(f"{option}: {file} cannot be read: {error.strerror}; {REMEDY}") from None
    if not stat.S_ISREG(status.st_mode):
        raise BadInput(f"{option}: {file}: is no regular file; {REMEDY}")
    if _is_exposed(file, status.st_mode):
        raise BadInput(f"{option}: {file}: others can read it (mode {status.st_mode & 0o777:o}); run chmod 600 {file}")


def _is_exposed(file: Path, mode: int) -> bool:
    """Return True if others than its owner can read or change a file.

    A service manager gives a service its secrets in a folder of their own, by an access list that names the service's
    user. Such a list shows in the mode as a right of the group to read.

    For example, mode 640 is refused for a file of one's own, and allowed in such a folder.
    """
    given_folder = os.environ.get(GIVEN)
    allowed = 0o040 if given_folder and file.parent == Path(given_folder) else 0
    return bool(mode & 0o077 & ~allowed)


def read_object(file: Path, option: str, *, secret: bool = False) -> dict[str, Any]:
    """Read the JSON object in a file; with `secret`, refuse a file that others can read."""
    try:
        with open_untrusted(file, ACCESS) as opened:
            mode = os.fstat(opened.fileno()).st_mode & 0o777
            text = opened.read(ACCESS.most)
    except OSError as error:
        raise BadInput(f"{option}: {file} cannot be read: {error.strerror}") from None
    if secret and _is_exposed(file, mode):
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
    """Write a new file that only its owner may read."""
    # The mode is given at once: changed later, the file would be open to others for a moment.
    descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "w", encoding="utf-8") as opened:
        opened.write(text)


def text_in(says: Mapping[str, Any], what: str, name: str, where: str) -> str:
    """Return the text of a field that must be there. Raises BadInput."""
    text = says.get(name)
    if not isinstance(text, str) or not text:
        raise BadInput(f'{where}: expected "{name}", the {what}; {REMEDY}')
    return text


def option_in(says: Mapping[str, Any], name: str, where: str) -> str | None:
    """Return the text of a field that may be missing. Raises BadInput."""
    text = says.get(name)
    if text is not None and not isinstance(text, str):
        raise BadInput(f"{where}: {name}: expected a text; {REMEDY}")
    return text


def replace_private(file: Path, text: str) -> None:
    """Write a file that only its owner may read, as `patrol.files.whole_file.write_whole` does for all readers."""
    with replacing(file) as part:
        write_private(part, text)


SHORTEST_KEY, LONGEST_KEY = 16, 64
"""Bytes of a fleet's key, which tags every position message."""


def fleet_key(file: str | Path | None) -> bytes | None:
    """Read the key in a file, which is the file's bytes less white space at either end; None without a file.

    A key has 16 to 64 bytes.
    """
    if file is None:
        return None
    path = Path(file)
    try:
        key = read_untrusted(path, KEY).strip()
    except OSError as error:
        raise BadInput(f"radio.key: cannot read {path}: {error.strerror}; name a readable key file") from None
    if not SHORTEST_KEY <= len(key) <= LONGEST_KEY:
        raise BadInput(f"radio.key: {path} holds {len(key)} bytes; a key has {SHORTEST_KEY} to {LONGEST_KEY}")
    return key


def new_key(path: Path) -> None:
    """Write a new random key, as text, to a new file that no other user can read."""
    if path.is_dir():
        raise BadInput(f"{path}: is a folder; name a new file in it, such as {path / 'fleet.key'}")
    try:
        file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError:
        raise BadInput(f"{path}: exists already, and robots may be using it; name a new file") from None
    except OSError as error:
        raise BadInput(f"{path}: cannot be written ({error.strerror}); name a file in an existing folder") from None
    with os.fdopen(file, "w", encoding="ascii") as text:
        text.write(f"{os.urandom(LONGEST_KEY // 2).hex()}\n")
