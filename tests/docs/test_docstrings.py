"""How the site reads docstrings."""

from __future__ import annotations

from docs.site.docstrings import with_examples


def test_an_indented_paragraph_after_text_is_an_example() -> None:
    assert with_examples(["Text.", "", "    code", "    more", "", "Text."]) == [
        *("Text.", "", "::", "", "    code", "    more", "", "Text."),
    ]


def test_sections_stay() -> None:
    lines = ["Text.", "", "Args:", "    name: The name.", "", "        Its second paragraph.", "    other: More."]
    assert with_examples(lines) == lines


def test_what_is_marked_already_stays() -> None:
    lines = ["Text::", "", "    code"]
    assert with_examples(lines) == lines
