"""The file that a class comes from which a scenario names, without running it."""

from __future__ import annotations

import hashlib
from pathlib import Path

from pydantic import ValidationInfo

from patrol.errors import BadInput
from patrol.files.untrusted import OWN_CLASS, WEIGHTS, read_untrusted
from patrol.values import absolute


def class_file(text: str) -> Path | None:
    """Return the file in ``./file.py:Class``; None for a class that comes from an installed package."""
    file, colon, _ = text.rpartition(":")
    return Path(file) if colon and (file.endswith(".py") or "/" in file) else None


def beside(text: str, info: ValidationInfo) -> str:
    """Resolve the file's path in a class's name against the scenario's folder; other names stay as they are."""
    path = class_file(text)
    return text if path is None else f"{absolute(str(path), info)}:{text.rpartition(':')[2]}"


def file_digest(path: Path, field: str) -> str:
    """Return the SHA-256 (hex) of a class's file."""
    return hashlib.sha256(class_source(path, field)).hexdigest()


def class_source(path: Path, field: str) -> bytes:
    """Return the content of a class's file."""
    try:
        return read_untrusted(path, OWN_CLASS)
    except OSError as error:
        raise BadInput(f"{field} = {path}: cannot be read ({error.strerror}); correct it") from None


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
