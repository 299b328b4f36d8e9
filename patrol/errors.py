"""The one exception for input that cannot be used."""

from __future__ import annotations


class BadInput(Exception):
    """Something the user gave cannot be used.

    ``str(error)`` is one line that names the file or field, the value, what is wrong with it and what to do instead.
    The command line prints that line and ends with exit code 2.
    """

    def __init__(self, message: str) -> None:
        super().__init__(" ".join(message.splitlines()))
