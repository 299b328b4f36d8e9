"""Files that others may read at any moment: they see all of what was written, or what was there before."""

from __future__ import annotations

from pathlib import Path


def write_whole(file: Path, text: str) -> None:
    """Write a text file, whole or not at all.

    Args:
        file: The file, which may be there already.
        text: What it is to hold.

    Raises:
        OSError: It cannot be written.
    """
    part = file.with_name(f".{file.name}.part")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(file)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
