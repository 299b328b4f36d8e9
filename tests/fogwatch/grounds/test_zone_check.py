"""The output of ``fogwatch map check --zones``."""

from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

from fogwatch.commands.map import app
from patrol.errors import BadInput
from patrol.measures.zoned import zone_weights
from patrol.prepare import prepare
from patrol.scenario import load_scenario

WALL = {"name": "tape", "polygon": [[0, 43], [100, 43], [100, 45], [0, 45]], "keep_out": True}
VAULT: dict[str, Any] = {"name": "vault", "polygon": [[0, 0], [40, 0], [40, 30], [0, 30]]}


def check(ground: str | Path, radius: float, folder: Path, *zones: dict[str, Any]) -> str:
    """The check of a ground with zones, for four robots."""
    file = folder / "zones.yaml"
    file.write_text(yaml.safe_dump(list(zones)), encoding="utf-8")
    words = ["check", ground, "--radius", radius, "--point", "0.5", "--zones", file, "--robots", "4"]
    result = CliRunner().invoke(app, [*map(str, words)], catch_exceptions=False)
    assert result.exit_code == 0
    return result.output


def test_what_a_keep_out_shuts_off(tmp_path: Path) -> None:
    told = check("yards", 0.4, tmp_path, WALL).splitlines()
    (tape,) = (line for line in told if line.startswith("  tape: keep-out, "))
    assert float(tape.split()[2]) > 50.0
    (behind,) = (line for line in told if line.startswith("  beside and behind keep-outs: "))
    assert float(behind.split()[4]) > 1000.0
    assert any("walled off, without an opening" in line for line in told)


@pytest.mark.parametrize(
    ("age", "told"),
    [
        (5000, "wanted age 5000 s: its tour takes at least 0.0 of 4 robots"),
        (60, "wanted age 60 s: its tour takes at least 3.4 of 4 robots"),
        (12, "wanted age 12 s: cannot be kept, as its tour takes at least 17.1 of 4 robots"),
    ],
)
def test_how_much_of_the_fleet_a_wish_takes(tmp_path: Path, age: float, told: str) -> None:
    said = check("yards", 0.4, tmp_path, VAULT | {"age": age}).splitlines()
    (vault,) = (line for line in said if line.startswith("  vault: weight "))
    assert told in vault
    assert " m² to patrol" in vault
    fleet = "zones: 1; wanted ages are weighed for 4 holonomic robots of radius 0.4 m at 1 m/s that see 10 m"
    assert any(line.startswith(fleet) for line in said)


def test_a_run_of_the_same_fleet_has_the_same_weight(tmp_path: Path) -> None:
    said = check("yards", 0.4, tmp_path, VAULT | {"age": 60})
    robots = {"count": 4, "model": "holonomic", "radius": 0.4, "speed": 1.0}
    terrain = {"builtin": "yards"}
    says = {
        "terrain": terrain,
        "point": 0.5,
        "robots": robots,
        "sensor": {"range": 10.0},
        "zones": [VAULT | {"age": 60}],
    }
    weights = zone_weights(prepare(load_scenario(says)))
    assert f"vault: weight {weights['vault']:g}," in said
    faster = load_scenario(says | {"robots": robots | {"speed": 2.0}})
    assert zone_weights(prepare(faster))["vault"] < weights["vault"]


def test_a_file_without_zones_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "zones.yaml"
    file.write_text("name: vault", encoding="utf-8")
    with pytest.raises(BadInput, match=r"--zones .*zones\.yaml: holds no list of zones"):
        CliRunner().invoke(app, ["check", "yards", "--point", "1", "--zones", str(file)], catch_exceptions=False)
