"""The results of benchmarks as pages: what people wrote stays, what was measured replaces what was measured before."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from experiments.bench.tools.machine import Machine
from experiments.bench.tools.measure import Finding, Measured, Task
from experiments.bench.tools.results import as_json, cells, check_page, number, page, table_of
from patrol.errors import BadInput

MACHINE = Machine("a processor", 2, 8.0, "Linux x86_64", "3.11.7", "0.68.1", "0.2.0", "abc1234", "2026-01-01", 0.0)
TASK = Task("kernels", "wave", lambda _: [])
OURS = Measured("ours", "ms", (3.0, 1.0, 2.0))
RIVAL = Measured("rival", "ms", (30.0, 20.0, 10.0), (10.0, 20.0, 5.0), "lengths equal")
FINDINGS = [Finding(TASK, (OURS, RIVAL)), Finding(Task("kernels", "look", lambda _: []), (), "no | eyes")]

WRITTEN = """# Speed

Words that stay.

<!-- bench kernels -->
old numbers
<!-- end bench -->

More words.

<!-- bench memory -->
old memory
<!-- end bench -->
"""


def test_a_row_has_least_median_most_and_the_ratio_to_ours() -> None:
    assert cells(RIVAL) == ("rival", "ms", "10.0", "20.0", "30.0", "3", "10.0 (5.00 to 20.0)", "lengths equal")
    assert cells(Measured("none", "ms", (), says="not installed")) == (
        "none", "ms", "-", "-", "-", "0", "", "not installed",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (4.1e-06, "0.00000410"),
        (0.00012, "0.000120"),
        (0.0123, "0.0123"),
        (0.9996, "1.00"),
        (1.0, "1.00"),
        (9.996, "10.0"),
        (99.94, "99.9"),
        (99.96, "100"),
        (-99.96, "-100"),
        (123.4, "123"),
        (999.6, "1,000"),
        (1998000.0, "1,998,000"),
    ],
)
def test_numbers_have_three_digits(value: float, text: str) -> None:
    assert number(value) == text


def test_a_table_is_no_wider_than_it_must_be() -> None:
    assert table_of([Measured("size", "MB", (1.0,), says="said")]) == (
        ("what", "unit", "value", ""),
        [("size", "MB", "1.00", "said")],
    )
    assert table_of([OURS])[0] == ("what", "unit", "min", "median", "max", "readings", "")
    assert "ratio to ours" in table_of([OURS, RIVAL])[0]


def test_a_page_keeps_everything_but_the_marked_parts_that_were_measured(tmp_path: Path) -> None:
    path = tmp_path / "speed.md"
    path.write_text(WRITTEN, encoding="utf-8")
    for _ in range(2):  # what was written once can be written again
        path.write_text(page(path, MACHINE, "fogwatch bench kernels", FINDINGS), encoding="utf-8")
        text = path.read_text(encoding="utf-8")
        assert text.startswith("# Speed\n\nWords that stay.\n\n<!-- bench kernels -->\n")
        assert text.endswith("\n\nMore words.\n\n<!-- bench memory -->\nold memory\n<!-- end bench -->\n")
        assert "old numbers" not in text
        assert text.count("| wave | ours | ms | 1.00 | 2.00 | 3.00 | 3 |  |  |") == 1
        assert "`fogwatch bench kernels`" in text
        assert "| look | no \\| eyes |" in text


def test_a_group_tells_the_most_that_others_did_while_it_was_measured(tmp_path: Path) -> None:
    findings = [*(replace(FINDINGS[0], others=cores) for cores in (0.0, 1.2, None)), *FINDINGS]
    text = page(tmp_path / "new.md", MACHINE, "fogwatch bench", findings)
    assert "\nothers' work meanwhile: up to 1.20 of 2 cores  \n**Measured beside other work (up to 1.2 of 2" in text
    quiet = page(tmp_path / "new.md", MACHINE, "fogwatch bench", [replace(FINDINGS[0], others=0.01)])
    assert "up to 0.01 of 2 cores  \n\n| |" in quiet
    assert "others' work" not in page(tmp_path / "new.md", MACHINE, "fogwatch bench", FINDINGS)
    assert as_json(MACHINE, "fogwatch bench", findings)["results"][1]["others_cores"] == 1.2


def test_a_page_without_marks_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "speed.md"
    path.write_text("# Only words\n", encoding="utf-8")
    with pytest.raises(BadInput, match="has no lines <!-- bench kernels --> and <!-- end bench --> to write between"):
        check_page(path, ["kernels"])
    path.write_text(WRITTEN, encoding="utf-8")
    check_page(path, ["fleets", "kernels"])


def test_a_new_page_can_be_written_again(tmp_path: Path) -> None:
    path = tmp_path / "new.md"
    first = page(path, MACHINE, "fogwatch bench", FINDINGS)
    path.write_text(first, encoding="utf-8")
    assert page(path, MACHINE, "fogwatch bench", FINDINGS) == first


def test_json_has_every_reading() -> None:
    says = json.loads(json.dumps(as_json(MACHINE, "fogwatch bench", FINDINGS), allow_nan=False))
    wave, look = says["results"]
    assert wave["measures"][1]["values"] == [30.0, 20.0, 10.0]
    assert wave["measures"][1]["summary"] == {"min": 10.0, "median": 20.0, "max": 30.0, "readings": 3.0}
    assert look["failure"] == "no | eyes"
    assert says["machine"]["commit"] == "abc1234"
