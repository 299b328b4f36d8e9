"""Tables side by side: none is wider than the terminal, and nothing in them is cut."""

import io

import pytest
from rich.console import Console

from fogwatch.cli.columns import print_side_by_side


@pytest.mark.parametrize("width", [40, 80, 200])
def test_columns_that_do_not_fit_stand_below(width: int) -> None:
    names = [f"a-long-name-of-run-{number}" for number in range(1, 7)]
    rows = [("mean MFoW", *(f"{number}.5 s" for number in range(1, 7))), ("trace hash", *["5ab69437374a3d1d"] * 6)]
    text = io.StringIO()
    console = Console(file=text, width=width)
    print_side_by_side(console, names, [("", rows), ("settings that differ", [("sensor.range", *["12.0"] * 6)])])
    shown = text.getvalue()
    assert max(map(len, shown.splitlines())) <= width
    assert "…" not in shown
    assert all(shown.count(name) == 1 for name in names)
    assert shown.count("5ab69437374a3d1d") == shown.count("12.0") == 6
    blocks = shown.count("mean MFoW")
    assert (blocks == 1) == (width == 200)
    assert shown.count("settings that differ") == blocks


def test_one_long_value_does_not_part_the_columns() -> None:
    text = io.StringIO()
    value = '[{"kind": "silence", "id": "f1", "at": 120.0}]'
    rows = [("mean MFoW", "13.4 s", "20.5 s")]
    parts = [("", rows), ("settings that differ", [("faults", "[]", value)])]
    print_side_by_side(Console(file=text, width=80), ["quiet", "silent"], parts)
    shown = text.getvalue()
    assert [line.split() for line in shown.splitlines() if "MFoW" in line] == [
        ["mean", "MFoW", "13.4", "s", "20.5", "s"]
    ]
    assert value.replace(" ", "") in "".join(shown.split())
