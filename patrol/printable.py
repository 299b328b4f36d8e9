"""Text that others wrote, made safe to show: nothing of it can move a cursor, change a colour or reverse a line."""

from __future__ import annotations


def printable(text: str) -> str:
    r"""Replace all characters that a terminal might act on by their escape sequences.

    These are all that Unicode does not count as printable: C0 and C1 controls with escape, newline and tab, DEL, format
    characters such as bidirectional overrides and zero-width spaces, line separators, and halves of surrogate pairs.

    Args:
        text: Any text.

    Returns:
        One line of printable characters, with ``\x1b`` in the place of an escape character. The same text where all
        characters are printable.
    """
    if text.isprintable():
        return text
    return "".join(char if char.isprintable() else _escaped(char) for char in text)


def printable_lines(text: str) -> str:
    r"""Replace characters as `printable` does, but for line ends.

    Args:
        text: Lines, such as the end of a log, or one line that names a path.

    Returns:
        As many lines, all printable.
    """
    return "\n".join(map(printable, text.split("\n")))


def _escaped(char: str) -> str:
    return char.encode("unicode_escape").decode("ascii")
