"""Text that others wrote, made safe to show: nothing of it can move a cursor, change a colour or reverse a line."""

from __future__ import annotations


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
