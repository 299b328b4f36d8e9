"""Results on disk: nothing is lost but a torn last line, and no damage is passed over."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.sweeps.results import FILE, RunResult, open_results
from patrol.errors import BadInput


def result(name: str, value: float = 1.5, outcome: Literal["ok", "failed"] = "ok") -> RunResult:
    error = None if outcome == "ok" else "it broke"
    metrics = {"mfow_mean_s": value, "n": 3, "x": None}
    return RunResult(name, f"case {name}", 1, outcome, error, metrics, "ab", 0.5, "1.0")


def write(folder: Path, *results: RunResult) -> Path:
    with open_results(folder) as there:
        for one in results:
            there.add(one)
    return folder / FILE


def read(folder: Path) -> dict[str, RunResult]:
    with open_results(folder) as there:
        return dict(there.by_key)


def test_what_was_added_is_there(tmp_path: Path) -> None:
    write(tmp_path / "new" / "folder", result("a"), result("b", 0.1 + 0.2))
    assert read(tmp_path / "new" / "folder") == {"a": result("a"), "b": result("b", 0.1 + 0.2)}


def test_a_line_carries_the_settings_of_its_case_and_older_ones_have_none(tmp_path: Path) -> None:
    settings = {"patrol.options.separation": ["claims", "repulsion"], "robots.count": 3}
    file = write(tmp_path, replace(result("a"), settings=settings), result("b"))
    assert [json.loads(line)["settings"] for line in file.read_text().splitlines()] == [settings, {}]
    older = json.loads(file.read_text().splitlines()[1])
    del older["settings"]
    file.write_text(f"{file.read_text().splitlines()[0]}\n{json.dumps(older)}\n")
    assert {key: dict(found.settings) for key, found in read(tmp_path).items()} == {"a": settings, "b": {}}


def test_a_later_result_of_a_run_counts(tmp_path: Path) -> None:
    write(tmp_path, result("a", outcome="failed"), result("a"))
    assert read(tmp_path)["a"].ok


@given(cut=st.integers(min_value=1, max_value=400))
def test_a_line_torn_anywhere_costs_its_run_alone(tmp_path_factory: pytest.TempPathFactory, cut: int) -> None:
    folder = tmp_path_factory.mktemp("torn")
    file = write(folder, result("a"), result("b"))
    whole = file.read_bytes()
    first = whole.index(b"\n") + 1
    cut = min(cut, len(whole) - first)
    file.write_bytes(whole[:-cut])
    with open_results(folder) as there:
        # Without its line end alone the last result is whole still.
        assert there.by_key.keys() == ({"a", "b"} if cut == 1 else {"a"})
        assert there.repaired == (cut < len(whole) - first)
        there.add(result("c"))
    assert read(folder).keys() == ({"a", "b", "c"} if cut == 1 else {"a", "c"})
    for line in file.read_text().splitlines():
        json.loads(line)


def test_results_without_processor_time_are_read_and_count_by_their_wall_time(tmp_path: Path) -> None:
    file = write(tmp_path, replace(result("a"), wall_s=3.0, processor_s=2.0))
    assert read(tmp_path)["a"].computing_s == 2.0
    old = json.loads(file.read_text())
    del old["processor_s"]
    file.write_text(json.dumps(old) + "\n")
    assert read(tmp_path)["a"].computing_s == 3.0


DAMAGED = {
    "no JSON": b"oops",
    "another shape": b'{"key": "a"}',
    "a list": b"[1, 2]",
    "an empty line": b"",
    "no UTF-8": b"\xff\xfe",
    "a number that is none": b'{"key":"k","case":"c","seed":1,"outcome":"ok","error":null,"metrics":{"m":NaN},'
    b'"trace_hash":null,"wall_s":1,"software":"1"}',
    "half a line and the next": b'{"key":"k","case":{"key":"k"',
}


@pytest.mark.parametrize("line", DAMAGED.values(), ids=DAMAGED)
def test_damage_elsewhere_names_the_file_and_the_line(tmp_path: Path, line: bytes) -> None:
    file = write(tmp_path, result("a"), result("b"))
    before, after, _ = file.read_bytes().split(b"\n")
    file.write_bytes(b"\n".join([before, line, after, b""]))
    damaged = file.read_bytes()
    reads = {b"": "it is empty", b"oops": "it reads oops", b"[1, 2]": r"it reads \[1, 2\]"}.get(line, "it reads .*")
    with pytest.raises(BadInput, match=rf"results\.jsonl line 2: is damaged \({reads}\); delete that line"):
        read(tmp_path)
    assert file.read_bytes() == damaged


def test_one_sweep_at_a_time_writes_to_a_folder(tmp_path: Path) -> None:
    with open_results(tmp_path), pytest.raises(BadInput, match="another sweep is writing here"):
        read(tmp_path)
    assert read(tmp_path) == {}


def test_a_folder_that_cannot_be_one(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(BadInput, match="choose another --out"):
        read(tmp_path / "file")
