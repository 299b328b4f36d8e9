"""Files that others may read at any moment: they see all of what was written, or what was there before."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from patrol.errors import BadInput


@contextmanager
def writing(name: object, remedy: str = "choose another file") -> Iterator[None]:
    """Turn an error of the disk into BadInput that names what is written, such as a file, and a remedy."""
    try:
        yield
    except OSError as error:
        raise BadInput(f"{name}: cannot be written ({error.strerror}); {remedy}") from None


@contextmanager
def replacing(file: Path) -> Iterator[Path]:
    """Give a path beside a file to write to, and then put it in the file's place.

    The path does not exist yet, and has the same suffix, by which libraries know a format. After an error nothing of it
    stays.
    """
    part = file.with_name(f".part.{file.name}")
    part.unlink(missing_ok=True)
    try:
        yield part
        part.replace(file)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def write_whole(file: Path, text: str) -> None:
    """Write a text file, whole or not at all."""
    with replacing(file) as part:
        part.write_text(text, encoding="utf-8")
