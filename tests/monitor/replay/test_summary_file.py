"""Reading summary.json: every declared value is checked, and an error names file, field, value and remedy."""

import json
from pathlib import Path
from typing import Any

import pytest

from monitor.replay.run_files import DEEPEST, read_summary
from patrol.errors import BadInput
from tests.present import present

CHECK = {"name": "frames", "ok": True}
OLDER: dict[str, Any] = {
    "name": "five",
    "ticks": 600,
    "mfow_mean_s": 60,
    "robots": {"r1": {"status": "alive", "distance_m": 3.5, "laps": 2}},
    "stalest": {},
    "verdict": {"outcome": "valid", "checks": [CHECK]},
}


def nested(depth: int) -> Any:
    return [nested(depth - 1)] if depth else 1


def written(folder: Path, document: object) -> Path:
    path = folder / "summary.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


def test_a_summary_of_an_older_version_says_what_it_has(tmp_path: Path) -> None:
    summary = present(read_summary(written(tmp_path, OLDER)))
    assert (summary.mfow_mean_s, summary.mfow_max_s) == (60.0, None)
    assert summary.robots["r1"].distance_m == 3.5
    assert present(summary.verdict).checks[0].judged
    assert summary.document() == OLDER


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"mfow_mean_s": "fast"}, 'mfow_mean_s = "fast": input should be a valid number'),
        ({"ticks": 1.5}, "ticks = 1.5: input should be a valid integer"),
        ({"ticks": True}, "ticks = true: input should be a valid integer"),
        ({"mfow_mean_s": 10**400}, "mfow_mean_s is too large for a number"),
        ({"robots": [1]}, "robots = [1]: input should be a valid dictionary"),
        ({"robots": {"r1": {"collisions": None}}}, "robots.r1.collisions = null"),
        ({"links": {"r1": {"r2": {"sent": 1}}}}, "links.r1.r2.delivered = "),
        ({"stalest": {"worst": {"x": 1.0}}}, "stalest.worst.y = "),
        ({"laps": nested(DEEPEST + 2)}, "is nested too deeply"),
    ],
)
def test_what_is_of_another_type_is_bad_input(tmp_path: Path, change: dict[str, Any], words: str) -> None:
    path = written(tmp_path, OLDER | change)
    with pytest.raises(BadInput) as error:
        read_summary(path)
    line = str(error.value)
    assert words in line
    assert line.startswith(f"{path}: ")
    assert "remove or restore" in line


def test_as_deep_as_allowed_can_be_written_again(tmp_path: Path) -> None:
    document = OLDER | {"laps": nested(DEEPEST - 1)}
    assert present(read_summary(written(tmp_path, document))).document() == document
