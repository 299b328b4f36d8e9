"""The verdict on what a world leaves out: frames that were never sent, moves that were never made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest

from patrol.journal import trace_hash
from tests.worldsim.conftest import Lab
from worldsim.run_record import MemoryJournal
from worldsim.verdict.judge import judge
from worldsim.world import World

TICKS = 12


def silence(journal: MemoryJournal, number: int, ticks: Sequence[int]) -> None:
    """Take a robot's frames in some ticks, and all that became of them, off the record."""
    for k in ticks:
        record = journal.records[k]
        journal.records[k] = replace(
            record,
            frames=tuple(frame for frame in record.frames if frame[0] != number),
            deliveries=tuple(link for link in record.deliveries if link[0] != number),
            dropped=tuple(drop for drop in record.dropped if drop[0] != number),
        )
    assert journal.end
    journal.end = replace(journal.end, trace_hash=trace_hash(journal.ticks))


def failures(journal: MemoryJournal, world: World) -> dict[str, str]:
    return {check.name: check.detail for check in judge(journal, {}, world.prepared).failed}


@pytest.mark.parametrize("ticks", [range(TICKS), [TICKS - 1]], ids=["always", "last"])
def test_a_living_robot_that_does_not_send_fails_in_lockstep(lab: Lab, ticks: Sequence[int]) -> None:
    world = lab.patrol(ticks=TICKS)
    journal = lab.run(world)
    silence(journal, 1, ticks)
    assert failures(journal, world) == {"frames": f"r1 did not send its position in tick {ticks[0]}"}


def test_at_a_pace_nobody_waits_for_a_frame(lab: Lab) -> None:
    world = lab.patrol(ticks=TICKS, pace=10)
    journal = lab.run(world)
    silence(journal, 1, range(TICKS))
    assert failures(journal, world) == {}


@pytest.mark.parametrize("free", [False, True])
def test_a_world_that_cancels_moves_at_will_fails(lab: Lab, monkeypatch: pytest.MonkeyPatch, free: bool) -> None:
    monkeypatch.setattr("worldsim.robots.motion.path_is_free", lambda *_: free)
    world = lab.patrol(ticks=TICKS)
    found = failures(lab.run(world), world)
    assert ("drives through a wall" if free else "neither a wall nor another body was in its way") in found["moves"]
