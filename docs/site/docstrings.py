"""Docstrings as Sphinx reads them: a paragraph that is indented after plain text is an example, shown as it stands."""

from __future__ import annotations

from collections.abc import Sequence


def with_examples(lines: Sequence[str]) -> list[str]:
    """Return a docstring's lines with a mark of reStructuredText before each example.

    Args:
        lines: The docstring, without its own indentation. What follows a section's title, such as ``Args:``, at once is
            no example: an example has an empty line before it.
    """
    marked: list[str] = []
    last = ""
    for k, line in enumerate(lines):
        begins = line.startswith("    ") and k > 0 and not lines[k - 1].strip()
        if begins and last and not last.startswith(" ") and not last.endswith("::"):
            marked += ["::", ""]
        marked.append(line)
        if line.strip():
            last = line
    return marked
