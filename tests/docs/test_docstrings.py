"""Docstrings as the site reads them."""

from __future__ import annotations

import pytest

from docs.site.docstrings import with_examples


def test_an_indented_paragraph_after_text_is_an_example() -> None:
    assert with_examples(["Text.", "", "    code", "    more", "", "Text."]) == [
        *("Text.", "", "::", "", "    code", "    more", "", "Text."),
    ]


@pytest.mark.parametrize(
    "lines",
    [
        ["Text.", "", "Args:", "    name: The name.", "", "        Its second paragraph.", "    other: More."],
        ["Text::", "", "    code"],
    ],
    ids=["sections", "what is marked already"],
)
def test_others_stay(lines: list[str]) -> None:
    assert with_examples(lines) == lines
