"""Text that others wrote, for a terminal."""

from __future__ import annotations

_CONTROLS = (
    *range(0x20),  # C0: escape sequences begin with one of them
    *range(0x7F, 0xA0),  # DEL and C1
    0x061C,
    *range(0x200B, 0x2010),  # widthless characters and marks of direction
    *range(0x2028, 0x202F),  # separators of lines, and embeddings and overrides of direction
    *range(0x2060, 0x2070),  # isolates of direction, and more that nobody sees
    0xFEFF,
    *range(0xD800, 0xE000),  # halves of surrogate pairs, which no terminal's encoding has
)
_SHOWN = {code: f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" for code in _CONTROLS}


def printable(text: str) -> str:
    r"""A text in which each control character is replaced by its escape, such as ``\x1b``.

    Control characters are those of C0 and C1, DEL, marks that change the direction of writing, and characters that
    nobody sees. In a text that others wrote they could move the cursor, hide a part of a line or retitle the window.

    Args:
        text: any text.

    Returns:
        one line that can be printed on any terminal.
    """
    return text.translate(_SHOWN)
