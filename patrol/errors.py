"""The exceptions for input that cannot be used, and how messages spell values, near misses and texts of others.

Unusable                what a user, a file or a wire gave
    BadInput            a user's file or argument; the command line prints it and ends with exit code 2
        NotPrepared     a scenario that cannot run on its ground, or with these robots
        WrongArguments  arguments that a function does not take (`fogwatch.notebook.arguments`)
    Malformed           bytes that are not the message or the record that belongs there
    Rejected            a frame that must not be used (`patrol.radio.message`)
    RequestRefused      a request that does not control the run (`runtime.security.control_auth`)
    FileRefused         a file of a wrong kind or size (`patrol.files.untrusted`)
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from typing import Any

__all__ = ["BadInput"]

_LONGEST = 60


class Unusable(Exception):
    """Input that cannot be used; ``str(error)`` says why. Files and wires raise subclasses of it."""


class Malformed(Unusable, ValueError):
    """Bytes that are not the message or the record that they should be. What sent or wrote them is at fault."""


class BadInput(Unusable):
    """Input from the user that cannot be used.

    ``str(error)`` is one line that names the file or field, the value, what is wrong with it and what to do instead.
    Control characters, which a message quotes from files and arguments, are replaced by their escapes. The command line
    prints that line and ends with exit code 2.
    """

    def __init__(self, message: str) -> None:
        super().__init__(printable(" ".join(message.splitlines())))


class NotPrepared(BadInput):
    """A scenario whose values are right, and that cannot run on its ground, or with robots that no world simulates.

    The line names the field, or another file, such as the map. `patrol.scenario.explain.naming` adds the file that
    the scenario came from.
    """


def did_you_mean(word: str, known: Sequence[str]) -> str:
    """'did you mean X?' for the known word nearest to a misspelt one, or the list of known words if none is near.

    Args:
        word: What the user wrote.
        known: The words that would have been right.

    Returns:
        The end of an error message.
    """
    near = get_close_matches(word.lower(), known, n=1, cutoff=0.6)
    return f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}"


def quoted(value: Any) -> str:
    """Spell a value as a scenario file would, cut to a readable length.

    Args:
        value: Anything that a file or a message may hold.

    Returns:
        The value as JSON where it has a JSON form, otherwise as Python writes it; at most 60 characters.
    """
    try:
        text = json.dumps(value, ensure_ascii=False, default=repr)
    except (ValueError, TypeError, RecursionError):
        try:
            text = repr(value)
        except (ValueError, RecursionError):  # a number with too many digits, or lists nested too deeply
            text = type(value).__name__
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."


def in_flow(value: object) -> str:
    """Spell a value on one line as YAML does, for people.

    Args:
        value: Made of mappings, lists, texts and numbers.

    Returns:
        For example ``{constant: 2}`` or ``[r1, r2]``.
    """
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{name}: {in_flow(inner)}" for name, inner in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(in_flow(inner) for inner in value) + "]"
    return f"{value:g}" if isinstance(value, float) else str(value).lower() if isinstance(value, bool) else str(value)


def printable(text: str) -> str:
    r"""Replace all characters that a terminal might act on by their escape sequences.

    These are all that Unicode does not count as printable: C0 and C1 controls with escape, newline and tab, DEL, format
    characters such as bidirectional overrides and zero-width spaces, line separators, and halves of surrogate pairs. So
    the result is one line.
    """
    if text.isprintable():
        return text
    return "".join(char if char.isprintable() else _escape_char(char) for char in text)


def printable_lines(text: str) -> str:
    r"""Replace characters as `printable` does, but for line ends."""
    return "\n".join(map(printable, text.split("\n")))


def _escape_char(char: str) -> str:
    return char.encode("unicode_escape").decode("ascii")
