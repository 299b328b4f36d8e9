"""The verdict does not depend on the order in which its checks are listed."""

from __future__ import annotations

import pytest

from patrol.random import draw
from tests.worldsim.conftest import Lab
from tests.worldsim.verdict.test_judge import change, moved
from worldsim.checks.check import CheckResult
from worldsim.verdict.judge import CHECKS, judge


@pytest.mark.parametrize("seed", range(4))
def test_the_order_in_which_checks_are_listed_does_not_matter(
    lab: Lab, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A good run, one with a false frame and one with a robot off the terrain, under faults of many kinds."""
    faults = [
        {"kind": "loss", "rate": 0.2, "at": 1.0, "for": 4.0},
        {"kind": "delay", "delay": {"uniform": [0.0, 1.5]}},
        {"kind": "partition", "groups": "halves", "at": 3.0, "for": 3.0},
        {"kind": "spoof", "as": "r2", "payload": "random"},
        {"kind": "pause", "who": "r3", "at": 2.0, "for": 2.0},
        {"kind": "drift", "who": "r1", "bias": [0.5, 0.0]},
    ]
    world = lab.patrol(ticks=20, faults=faults)
    journal = lab.run(world)

    def results() -> dict[str, CheckResult]:
        return {check.name: check for check in judge(journal, {}, world.prepared).checks}

    def shuffled() -> dict[str, CheckResult]:
        order = sorted(CHECKS, key=lambda check: draw(seed, *check.__name__.encode()))
        assert order != list(CHECKS)
        with monkeypatch.context() as context:
            context.setattr("worldsim.verdict.judge.CHECKS", tuple(order))
            found = results()
        assert list(found) != list(results())
        return found

    assert all(check.ok for check in results().values())
    assert {"refused frames", "forged frames", "links add up", "senses"} <= set(results())
    assert shuffled() == results()
    source, frame = journal.records[6].frames[-1]
    change(journal, 6, frames=(*journal.records[6].frames[:-1], (source, frame[:-1] + b"?")))
    assert not all(check.ok for check in results().values())
    assert shuffled() == results()
    change(journal, 9, robots=moved(journal.records[9], 0, x=-100.0))
    assert not results()["robots there"].ok
    assert shuffled() == results()
