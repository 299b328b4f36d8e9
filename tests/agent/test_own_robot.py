"""Robots of one's own: what is said of a scenario that they cannot patrol."""

from __future__ import annotations

from pathlib import Path

import pytest

from agent.own_robot import drive
from examples.my_robot import MyRobot


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (
            "radio: {via: direct}\nzones: [{name: vault, polygon: [[900, 1], [901, 1], [901, 2]], weight: 2}]",
            "zones.0: vault lies outside of open",
        ),
        ("", "radio.via = ether: only a world carries frames so; set radio: {via: direct}"),
    ],
)
def test_the_scenarios_file_is_named(more: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    site = tmp_path / "site.yaml"
    site.write_text(f"terrain: {{builtin: open}}\npace: realtime\nrobots: [{{name: r1}}]\n{more}\n")
    assert drive(MyRobot, scenario=site, robot="r1", router="tcp/127.0.0.1:9", fleet="night", wait_s=0.1) == 2
    assert f"{site}: {said}" in capsys.readouterr().err
