"""The fleet's key: a file whose bytes tag every position message."""

from __future__ import annotations

import os
from pathlib import Path

from patrol.errors import BadInput
from patrol.files.untrusted import KEY, read_untrusted

SHORTEST = 16
LONGEST = 64


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
    if not SHORTEST <= len(key) <= LONGEST:
        raise BadInput(f"radio.key: {path} holds {len(key)} bytes; a key has {SHORTEST} to {LONGEST}")
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
        text.write(f"{os.urandom(LONGEST // 2).hex()}\n")
