"""Zones in a fleet of processes: they begin, end and are switched, and the trace is that of one process."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import fogwatch
from tests.fleets import COARSE, one_and_many
from tests.fogwatch.processes.test_control import Operating, operate

__all__ = ["operate"]

pytestmark = pytest.mark.processes

SITE: dict[str, Any] = {
    **COARSE,
    "robots": {"count": 3, "model": "holonomic", "radius": 0.4, "speed": 4.0},
    "zones": [
        {"name": "vault", "polygon": [[0, 0], [40, 0], [40, 40], [0, 40]], "weight": 8, "times": [[10, 30]]},
        {"name": "ward", "polygon": [[40, 40], [100, 40], [100, 88], [40, 88]], "speed": 0.5, "times": [[20, 50]]},
    ],
}


def test_zones_that_begin_and_end_leave_the_same_trace(tmp_path: Path) -> None:
    scenario = {**SITE, "duration": 60}
    one, _ = one_and_many(scenario, tmp_path)
    plain = fogwatch.run({**scenario, "zones": []}, out=tmp_path / "plain", picture=False)
    assert plain.trace_hash != one.trace_hash


def test_zones_that_an_operator_switches_leave_the_same_trace(
    operate: Callable[..., Operating], tmp_path: Path
) -> None:
    at = operate({**SITE, "duration": 100_000})
    held = at.step(30)
    assert at.ask(do="zone", name="ward", on=True).text == f"ward is in force from tick {held} on"
    assert at.ask(do="zone", name="vault", weight=0.2).text == f"vault counts 0.2 times from tick {held} on"
    held = at.step(10)
    assert at.ask(do="zone", name="vault", on=False).text == f"vault is out of force from tick {held} on"
    refused = at.ask(do="zone", name="vault", on=False)
    assert not refused.done
    assert refused.text == "control: name = vault: is not in force, and will not be"
    assert at.ask(do="go").done
    at.run.pass_ticks(30)
    at.run.interrupt()
    summary = at.run.summary()
    assert summary["verdict"]["valid"], summary["verdict"]
    length = {"duration": summary["ticks"] * 0.5}
    again = fogwatch.run(at.run.folder / "timeline.yaml", out=tmp_path / "again", overrides=length, picture=False)
    assert again.verdict.valid, again.verdict.failed
    assert again.trace_hash == summary["trace_hash"]
    untouched = fogwatch.run({**SITE, **length}, out=tmp_path / "untouched", picture=False)
    assert untouched.trace_hash != summary["trace_hash"]
