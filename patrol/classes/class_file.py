"""The file that a class comes from which a scenario names, without running it, and the sections that name one."""

from __future__ import annotations

import ast
import hashlib
from pathlib import Path
from typing import Any, ClassVar, Self

from pydantic import ValidationError, ValidationInfo, ValidatorFunctionWrapHandler, WrapValidator, model_validator

from patrol.errors import BadInput
from patrol.files.untrusted import KIB, OWN_CLASS, WEIGHTS, Kind, read_untrusted
from patrol.values import Section, absolute, unexpected, wrong

LONGEST = 256 * KIB
"""Bytes of the longest source that is parsed; a parsed one takes some hundred times as much memory."""

_MOST_OFFERED = 5


def class_file(text: str) -> Path | None:
    """Return the file in ``./file.py:Class``; None for a class that comes from an installed package."""
    file, colon, _ = text.rpartition(":")
    return Path(file) if colon and (file.endswith(".py") or "/" in file) else None


def class_check(built_in: str) -> WrapValidator:
    """Make the check of a field that names a class, beside its pattern; `built_in` lists those of fogwatch, for errors.

    A file's path is resolved against the scenario's folder.
    """
    expected = f"{built_in}, package.module:Class, ./file.py:Class or the name of an entry point"

    def check(value: Any, handler: ValidatorFunctionWrapHandler, info: ValidationInfo) -> str:
        try:
            text: str = handler(value)
        except ValidationError:
            raise unexpected(_offer_classes(value, info) or expected) from None
        path = class_file(text)
        return text if path is None else f"{absolute(str(path), info)}:{text.rpartition(':')[2]}"

    return WrapValidator(check)


def _offer_classes(value: Any, info: ValidationInfo) -> str:
    """Return the names of the classes in a source file that is named without one; empty for anything else."""
    if not (isinstance(value, str) and value.endswith(".py") and info.context and info.context["opens_classes"]):
        return ""
    try:
        source = read_untrusted(Path(absolute(value, info)), OWN_CLASS)
        module = ast.parse(source if len(source) <= LONGEST else "")
        classes = [node.name for node in module.body if isinstance(node, ast.ClassDef)]
    except (OSError, BadInput, SyntaxError, ValueError, RecursionError, MemoryError):
        classes = []
    return " or ".join(f"{value}:{name}" for name in classes[:_MOST_OFFERED]) or f"{value}:Class"


def file_digest(path: Path, field: str) -> str:
    """Return the SHA-256 (hex) of a class's file."""
    return checked_source(path, None, field)[1]


def checked_source(path: Path, sha256: str | None, field: str, kind: Kind = OWN_CLASS) -> tuple[bytes, str]:
    """Return the content of a class's file, or of another file that a field names, and its SHA-256 (hex).

    A file whose SHA-256 is not the one that the scenario gives, if it gives one, is refused.
    """
    try:
        content = read_untrusted(path, kind)
    except OSError as error:
        raise BadInput(f"{field} = {path}: cannot be read ({error.strerror}); correct it") from None
    digest = hashlib.sha256(content).hexdigest()
    if sha256 is not None and digest != sha256:
        raise BadInput(
            f"{path}: is not the file that this scenario was resolved with (SHA-256 {digest[:12]}, it says "
            f"{sha256[:12]}); restore it, or drop {field}_sha256 to run with this one"
        )
    return content, digest


class ClassSection(Section):
    """A section that may name a class of one's own.

    `NAMED` is the field that does, such as ``sensor.kind``; the one after it has the SHA-256 of the class's file, if it
    comes from one. `SORT` is its kind, such as ``sensor``. A run's folder keeps the file in a folder of that name.
    """

    NAMED: ClassVar[str]
    SORT: ClassVar[str]

    def _class_entry(self) -> tuple[str, str, str | None]:
        """Return the field, the name of the class, and the SHA-256 of its file."""
        field = self.NAMED.rpartition(".")[2]
        return field, getattr(self, field), getattr(self, f"{field}_sha256")

    @model_validator(mode="after")
    def _has_a_hash_of_a_file(self) -> Self:
        field, name, digest = self._class_entry()
        if digest is not None and class_file(name) is None:
            raise wrong(f"{field}_sha256", f"only a {self.SORT} that is a file has a hash; drop it")
        return self

    def reduce(self, says: dict[str, Any], files: bool) -> None:
        """Let a class enter by its name, and by its file's content."""
        super().reduce(says, files)
        field, name, digest = self._class_entry()
        del says[f"{field}_sha256"]
        class_name = name.rpartition(":")[2]
        if not files:
            says[field] = class_name
        elif digest is not None:
            says[field] = [digest, class_name]

    def with_digests(self) -> Self:
        """Add the SHA-256 of the class's file."""
        field, name, digest = self._class_entry()
        section, path = super().with_digests(), class_file(name)
        if path is None or digest is not None or not path.is_file():
            return section
        return section.model_copy(update={f"{field}_sha256": file_digest(path, self.NAMED)})

    def with_copies(self, folder: Path) -> Self:
        """Copy the class's file."""
        field, name, digest = self._class_entry()
        section, source = super().with_copies(folder), class_file(name)
        if source is None:
            return section
        content, now = checked_source(source, None, self.NAMED)
        if digest not in (None, now):
            raise BadInput(f"{source}: has changed since the scenario was loaded; start again")
        subfolder = folder / self.SORT
        subfolder.mkdir()
        (subfolder / source.name).write_bytes(content)
        return section.model_copy(update={field: f"./{self.SORT}/{source.name}:{name.rpartition(':')[2]}"})


FIELD = "patrol.options.weights"
"""The field of the scenario that names one."""


def weights_content(path: Path, sha256: str | None = None) -> bytes:
    """Return the content of a trained network's file, after checking its SHA-256 (hex) where one is given."""
    return checked_source(path, sha256, FIELD, WEIGHTS)[0]


def weights_digest(path: Path) -> str:
    """Return the SHA-256 (hex) of a trained network's file."""
    return checked_source(path, None, FIELD, WEIGHTS)[1]
