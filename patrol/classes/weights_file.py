"""The file of a trained network, which a scenario names by `patrol.options.weights`."""

from __future__ import annotations

import hashlib
from pathlib import Path

from patrol.errors import BadInput
from patrol.files.untrusted import WEIGHTS, read_untrusted

FIELD = "patrol.options.weights"
"""The field of the scenario that names one."""


def weights_content(path: Path, sha256: str | None = None) -> bytes:
    """Return the content of a trained network's file, after checking its SHA-256 (hex) where one is given."""
    try:
        content = read_untrusted(path, WEIGHTS)
    except OSError as error:
        raise BadInput(f"{FIELD} = {path}: cannot be read ({error.strerror}); correct it") from None
    digest = hashlib.sha256(content).hexdigest()
    if sha256 is not None and digest != sha256:
        raise BadInput(
            f"{path}: is not the file that this scenario was resolved with (SHA-256 {digest[:12]}, it says "
            f"{sha256[:12]}); restore it, or drop {FIELD}_sha256 to run with this one"
        )
    return content


def weights_digest(path: Path) -> str:
    """Return the SHA-256 (hex) of a trained network's file."""
    return hashlib.sha256(weights_content(path)).hexdigest()
