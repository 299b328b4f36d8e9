"""The file that a scenario's policy comes from, without running it."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Final

from patrol.errors import BadInput
from patrol.untrusted import POLICY, read_untrusted

COMMITTED: Final = "committed"
"""The default policy."""

PAPER: Final = "potential-field"
"""The policy of the paper."""

BUILT_IN = (COMMITTED, PAPER)
"""Policies that come with fogwatch."""


def policy_file(policy: str) -> Path | None:
    """The file in ``./file.py:Class``; None for a policy that comes from an installed package."""
    place, colon, _ = policy.rpartition(":")
    return Path(place) if colon and (place.endswith(".py") or "/" in place) else None


def policy_digest(path: Path) -> str:
    """SHA-256 (hex) of a policy's file.

    Raises:
        BadInput: It cannot be read.
    """
    return hashlib.sha256(policy_source(path)).hexdigest()


def policy_source(path: Path) -> bytes:
    """The content of a policy's file.

    Raises:
        BadInput: It cannot be read.
    """
    try:
        return read_untrusted(path, POLICY)
    except OSError as error:
        raise BadInput(f"patrol.policy = {path}: cannot be read ({error.strerror}); correct it") from None
