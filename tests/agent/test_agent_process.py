from __future__ import annotations

import argparse
import math
from pathlib import Path

import pytest

from agent import process
from patrol.process.lifeline import Ending
from patrol.process.reporting.logs import Log
from patrol.scenario import load_scenario


class Leaving(Ending):
    """Remembers how long somebody would have waited, and does not."""

    limit_s = 0.0

    def wait_for(self, path: Path, limit_s: float = math.inf) -> bool:
        self.limit_s = limit_s
        self.ask("enough")
        return path.exists()


@pytest.mark.parametrize(("lifeline", "limit_s"), [(5, math.inf), (None, 60.0)])
def test_static_fields_are_waited_for_as_long_as_there_is_a_launcher(
    lifeline: int | None, limit_s: float, tmp_path: Path
) -> None:
    """It computes them while agents start; a large map takes it minutes."""
    scenario = load_scenario({"terrain": {"builtin": "open"}, "point": 0.5, "robots": {"count": 1}})
    options = argparse.Namespace(static=tmp_path / "static", wait=60.0, lifeline=lifeline, incarnation=1)
    ending = Leaving()
    told = process._Process(options, ending, Log("r1"), None)
    assert process._mind(scenario, scenario.roster[0], told) is None
    assert ending.limit_s == limit_s
