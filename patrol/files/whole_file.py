"""Files that others may read at any moment: they see all of what was written, or what was there before."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(file: Path) -> Iterator[Path]:
    """Write a file beside another one, then replace that; after an error nothing of the new file stays.

    Args:
        file: The other file, which may be there already.

    Yields:
        The file to write, which is not there yet.

    Raises:
        OSError: It cannot be written.
    """
    part = file.with_name(f".{file.name}.part")
    part.unlink(missing_ok=True)
    try:
        yield part
        part.replace(file)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def write_whole(file: Path, text: str) -> None:
    """Write a text file, whole or not at all.

    Args:
        file: The file, which may be there already.
        text: What it is to hold.

    Raises:
        OSError: It cannot be written.
    """
    with replacing(file) as part:
        part.write_text(text, encoding="utf-8")
