"""The fleet's key: a file whose bytes tag every position message."""

from __future__ import annotations

from pathlib import Path

from patrol.errors import BadInput
from patrol.scenario import Scenario

SHORTEST = 16
LONGEST = 64


def fleet_key(scenario: Scenario) -> bytes | None:
    """The key that ``radio.key`` names, or None without one.

    The file's bytes are the key, less white space at either end; 16 to 64 of them. Raises BadInput otherwise.
    """
    if scenario.radio.key is None:
        return None
    path = Path(scenario.radio.key)
    try:
        key = path.read_bytes().strip()
    except OSError as error:
        raise BadInput(f"radio.key: cannot read {path}: {error.strerror}; name a readable key file") from None
    if not SHORTEST <= len(key) <= LONGEST:
        raise BadInput(f"radio.key: {path} holds {len(key)} bytes; a key has {SHORTEST} to {LONGEST}")
    return key
