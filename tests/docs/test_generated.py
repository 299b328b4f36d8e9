"""The generated parts of the reference: nothing that the code knows is missing."""

import functools
import re
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from docs.site.commands import commands
from docs.site.docstrings import with_examples
from docs.site.fields import fields
from docs.site.generated import PARTS, with_generated
from fogwatch.cli.app import app
from patrol.scenario import scenario_schema

FIELDS = functools.cache(fields)
DOCS = Path(__file__).parents[2] / "docs"


def leaves(name: str, command: Any) -> list[tuple[str, Any]]:
    """All commands that are no groups, by their whole names."""
    if not hasattr(command, "commands"):
        return [(name, command)]
    return [leaf for word, child in command.commands.items() for leaf in leaves(f"{name} {word}", child)]


def test_every_command_has_a_section_with_all_its_options_and_its_examples() -> None:
    parts = re.split(r"^#+ (.*)$", commands(), flags=re.MULTILINE)
    sections = dict(zip(parts[1::2], parts[2::2], strict=True))
    every = leaves("fogwatch", get_command(app))
    assert len(every) > 25
    for name, command in every:
        listed = set(re.findall(r"(?<!\w)--[\w-]+", sections[name]))
        assert {option for param in command.params for option in param.opts if option.startswith("--")} <= listed, name
        assert "Exit codes: " in sections[name]
        assert "Example" in sections[name]


def test_every_model_of_the_schema_has_its_fields() -> None:
    text = FIELDS()
    schema = scenario_schema()
    for model in (schema, *schema["$defs"].values()):
        assert f"\n\n{model['description']}\n\n" in text
        for name in model["properties"]:
            assert f"`{name}`" in text


def test_a_field_says_what_it_may_be_and_its_default() -> None:
    assert "- **`duration`** (number > 0, default `5000.0`): simulated s\n" in FIELDS()
    assert '- **`step`** (`auto` or number > 0, default `"auto"`): s per tick; auto: ' in FIELDS()
    assert "- **`terrain`** (mapping, required): " in FIELDS()


def test_each_part_has_its_place_in_one_document() -> None:
    documents = [path.read_text(encoding="utf-8") for path in DOCS.rglob("*.md")]
    for name in PARTS:
        assert sum(f"\n<!-- generated: {name} -->\n" in text for text in documents) == 1


def test_a_part_stands_in_place_of_its_line() -> None:
    assert with_generated("Text.\n\n<!-- generated: fields -->\n\nMore.\n") == f"Text.\n\n{FIELDS()}\n\nMore.\n"
    with pytest.raises(KeyError):
        with_generated("<!-- generated: nothing -->")


def test_an_indented_paragraph_after_text_is_an_example() -> None:
    assert with_examples(["Text.", "", "    code", "    more", "", "Text."]) == [
        *("Text.", "", "::", "", "    code", "    more", "", "Text.")
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
