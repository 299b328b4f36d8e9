"""Lone surrogates, which no text can hold, are refused where text comes in."""

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.files.untrusted import refuse_half_characters
from patrol.files.yaml_text import parse_yaml
from patrol.scenario import load_scenario
from runtime.security.private_files import read_object
from tests.hostile.files.looks import MAP, one_line

ANY_TEXT = st.text(st.characters(exclude_categories=()), max_size=4)
PLAIN = st.recursive(
    st.none() | st.integers() | ANY_TEXT,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(ANY_TEXT, inner, max_size=3),
    max_leaves=6,
)


@given(PLAIN)
def test_what_is_let_through_can_be_written(value: Any) -> None:
    try:
        str_of(value).encode()
    except UnicodeEncodeError:
        assert "half of a character" in one_line(lambda: refuse_half_characters(value, "a file"))
    else:
        refuse_half_characters(value, "a file")


def str_of(value: Any) -> str:
    """All texts in a value."""
    if isinstance(value, dict):
        return "".join(str_of(part) for pair in value.items() for part in pair)
    return "".join(map(str_of, value)) if isinstance(value, list) else str(value)


def test_field_and_value_are_named() -> None:
    said = one_line(lambda: refuse_half_characters({"faults": [{"kind": "\udc00"}]}, "a.yaml"))
    assert said.startswith(r'a.yaml: faults.0.kind = "\udc00": holds half of a character')
    said = one_line(lambda: refuse_half_characters({"faults": [{"\udc00": 1}]}, "a.yaml"))
    assert said.startswith(r'a.yaml: key "\udc00" of faults.0: holds half of a character')


def test_what_holds_itself_is_looked_at_once() -> None:
    value: list[Any] = ["a"]
    value.append(value)
    refuse_half_characters(value, "a file")


@pytest.mark.parametrize(
    "given",
    [
        {"name": "\ud800"},
        {"faults": [{"kind": "\ud800"}]},
        {"patrol": {"options": {"\ud800": 1}}},
        {"\ud800": 1},
        {"terrain": {"map": "hall\udcff.yaml"}},
    ],
)
def test_scenarios_are_refused_in_one_line(given: dict[str, Any]) -> None:
    assert "half of a character" in one_line(lambda: load_scenario({"terrain": {"builtin": "yards"}} | given))


def test_every_file_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text(r'{"terrain": {"builtin": "yards"}, "faults": [{"kind": "\ud800"}]}', encoding="utf-8")
    for read in (
        lambda: load_scenario(path),
        lambda: read_object(path, "control"),
        lambda: parse_yaml(MAP.replace("map.pgm", r'"\ud800.pgm"'), "map.yaml"),
        lambda: load_scenario({"terrain": {"builtin": "yards"}}, {"name": r'"\ud800"'}),
    ):
        assert "half of a character" in one_line(read)
