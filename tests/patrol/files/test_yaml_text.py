from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.errors import BadInput
from patrol.files.yaml_text import line_of, parse_yaml
from patrol.scenario import load_scenario

ALIAS_BOMB = "a0: &a0 [1, 2]\n" + "".join(f"a{n}: &a{n} [{f'*a{n - 1},' * 9}]\n" for n in range(1, 30))


def problem(text: str) -> str:
    with pytest.raises(BadInput) as caught:
        parse_yaml(text, "a.yaml")
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        *(
            ("1e3", 1000.0),
            ("1E-3", 0.001),
            ("-.5", -0.5),
            ("5.", 5.0),
            ("+7", 7),
            ("007", 7),
            ("0x1F", 31),
            ("0o17", 15),
        ),
        *((text, text) for text in ("1_000", "1:30", "2024-01-01", "yes", "on", "e3", ".", "=")),
        *(("True", True), ("false", False), ("~", None), ("", None), ("-", [None])),
        ("{a: &x {b: 1}, c: *x, d: '<<'}", {"a": {"b": 1}, "c": {"b": 1}, "d": "<<"}),
        ("\ufeffa: 1", {"a": 1}),
    ],
)
def test_plain_values_are_read_by_the_core_rules(text: str, value: object) -> None:
    read = parse_yaml(text, "a.yaml")
    assert read == value
    assert type(read) is type(value)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a: 1\nb: 2\na: 3", "a.yaml: line 3, column 1: a occurs twice; correct the YAML"),
        ("a: {b: 1, b: 1}", "a.yaml: line 1, column 11: b occurs twice"),
        ("a: [1, 2", "a.yaml: line 1, column 9: expected ',' or ']'"),
        ("a: 1\n  b: 2", "a.yaml: line 2, column 4: mapping values are not allowed here"),
        ("a: 1\n---\nb: 2", "a.yaml: line 2, column 1: but found another document"),
        ("a: !!python/object:os.system {}", "a.yaml: line 1, column 4: could not determine a constructor"),
        ("a: !x 1", "could not determine a constructor for the tag '!x'"),
        ("a: *x", "found undefined alias 'x'"),
        ("? [1]\n: 2", "a.yaml: line 1, column 3: found unhashable key"),
        ("a: \x00", "a.yaml: character 3: special characters are not allowed"),
        ("a: \t- 1", "a.yaml: line 1"),
        ("[" * 10_000, "a.yaml: nested too deeply"),
        ("[" * 51 + "]" * 51, "a.yaml: nested too deeply"),
        ("{a: &x {b: 1}, c: {<<: *x, d: 2}}", "a.yaml: line 1, column 20: merge keys (<<) are not read"),
        ("a: &x [1, *x]", "a.yaml: line 1, column 11: *x is inside of what it stands for"),
        ("a: !!bool maybe", "holds a value that its tag (!!) does not fit"),
        ("a: !!timestamp 2024-01-01", "could not determine a constructor"),
        ("a: !!binary abc", "could not determine a constructor"),
        ("a: !!set {b}", "could not determine a constructor"),
        (f"a: 0x{'f' * 4000}", "a.yaml: line 1, column 4: a number of 4002 characters, and at most 64 are read"),
        (f"a: {'x' * 70_000}", "a.yaml: line 1, column 4: a value of 70000 characters"),
        (f"a: [{'1,' * 100_001}]", "more than 100000 entries"),
        (ALIAS_BOMB, "more than 100000 entries, what aliases stand for included; correct the YAML"),
    ],
)
def test_what_is_not_well_formed_is_told_with_its_line(text: str, expected: str) -> None:
    assert expected in problem(text)


@given(st.text(max_size=40) | st.text(alphabet="ab:-[]{},&*<? \n'\"#|>!%0.~", max_size=40))
def test_no_text_raises_anything_but_bad_input(text: str) -> None:
    with suppress(BadInput):
        parse_yaml(text, "a.yaml")


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", "is empty; give at least 'terrain: {builtin: yards}'"),
        (b"# nothing\n", "is empty"),
        (b"[1, 2]", "holds [1, 2]; expected keys and values"),
        (b"yards", 'holds "yards"; expected keys and values'),
        (b"\xff\xfe\x00", "not UTF-8 text"),
        (b"terrain: &a [*a]", "*a is inside of what it stands for"),
    ],
)
def test_a_file_that_is_no_scenario_is_named(tmp_path: Path, content: bytes, expected: str) -> None:
    path = tmp_path / "a.yaml"
    path.write_bytes(content)
    with pytest.raises(BadInput) as caught:
        load_scenario(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert expected in str(caught.value)


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    for path, expected in (
        (tmp_path / "none.yaml", "no such file"),
        (tmp_path, "is a folder; give a file"),
        (Path("a\0b"), "cannot be read"),
        (tmp_path / ("x" * 300), "cannot be read"),
    ):
        with pytest.raises(BadInput, match=expected):
            load_scenario(path)


@pytest.mark.parametrize(
    ("location", "line"),
    [
        *((("a",), 1), (("b",), 2), (("b", 0), 3), (("b", 1, "c"), 4), (("b", 1, "d", "e"), 6), (("7",), 7)),
        *((("b", 1, "x"), 4), (("b", 2), 2), (("b", "x"), 2), (("x",), None)),
        ((), None),
    ],
)
def test_the_line_of_an_entry_is_found(location: tuple[str | int, ...], line: int | None) -> None:
    assert line_of("a: 1\nb:\n- 1\n- c: 1\n\n  d: {e: 1}\n7: 1\n", location) == line
