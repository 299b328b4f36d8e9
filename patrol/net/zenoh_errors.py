"""Texts of Zenoh's errors, for people and for programs."""

from __future__ import annotations

import re


def system_error(error: Exception) -> int | None:
    """Return the number of the system's error in the text of a Zenoh error; None without one."""
    match = re.search(r"\(os error (\d+)\)", str(error))
    return None if match is None else int(match[1])


def first_line(error: Exception) -> str:
    """Give Zenoh's text without the place in its sources."""
    text = str(error).partition(" at /")[0].partition("\n")[0]
    system = re.search(r": ([^:\[\]]+) \(os error \d+\)", text)
    return system[1] if system else text
