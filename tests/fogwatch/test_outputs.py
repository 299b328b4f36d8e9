"""The figures that users read are those that are written down; a change that moves one says so and writes them anew."""

import json
from pathlib import Path
from typing import Any

import pytest

from tests.accept.trace_cases import made_on
from tests.fogwatch.output_cases import CASES, QUICK, REST
from tests.fogwatch.outputs import WRITTEN, differences, outputs, table

SHOWN = 30


@pytest.fixture(scope="module")
def pinned() -> Any:
    written = json.loads(WRITTEN.read_text(encoding="utf-8"))
    if written["made_on"] != made_on():
        pytest.skip(f"outputs.json was written on another machine or lock file: {written['made_on']}")
    assert list(written["figures"]) == list(CASES)
    return written["figures"]


def check(name: str, pinned: Any, folder: Path) -> None:
    found = differences(pinned[name], outputs(name, folder))
    more = f"\n... and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
    assert not found, (
        f"{len(found)} figures of {name} moved; if they should, run python -m tests.fogwatch.outputs {name}\n"
        + "\n".join(found[:SHOWN])
        + more
    )


@pytest.mark.parametrize("name", QUICK)
def test_figures(name: str, pinned: Any, tmp_path: Path) -> None:
    check(name, pinned, tmp_path)


@pytest.mark.parametrize("name", REST)
def test_more_figures(name: str, pinned: Any, tmp_path: Path) -> None:
    check(name, pinned, tmp_path)


def test_a_figure_that_moves_is_named_with_both_values() -> None:
    was = {"a: b": 1, "a: c": 0.5, "a: d": "x", "gone": None, "a: e": 1.0}
    now = {"a: b": 2, "a: c": 0.5 * (1 + 1e-10), "a: d": "y", "new": True, "a: e": 1.0 + 1e-8}
    assert differences(was, now) == [
        "a: b: pinned 1, now 2",
        "a: d: pinned 'x', now 'y'",
        "gone: pinned None, now 'nothing'",
        "a: e: pinned 1.0, now 1.00000001",
        "new: pinned 'nothing', now True",
    ]


def test_a_table_is_pinned_by_rows_order_and_every_value() -> None:
    one, other = table("a,b\n1,x\n2,y\n3,z\n"), table("a,b\n2,y\n1,x\n3,z\n")
    assert one["rows"] == 3
    assert one["a"] == ["1 ... 3", 14.0]
    assert (other["a"], other["b"] == one["b"]) == (["2 ... 3", 13.0], False)
