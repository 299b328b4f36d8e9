"""What nobody waits for is done while the world waits for its robots, and changes nothing that a run leaves."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
import pytest

from patrol.exchange import Reply
from patrol.journal import Event, Status, TickRecord
from runtime.messages.phases import PhaseA, PhaseB
from tests.worldsim.conftest import Lab, RandomFleet
from tests.worldsim.fleet.net import NAMES, Net, heard, lockstep, paced, sensed, tick
from worldsim.fleet.lockstep import LockstepFleet
from worldsim.fleet.loop import run_ticks
from worldsim.fleet.paced import PacedFleet
from worldsim.output.record import Recorder, header_of
from worldsim.run_record import COMPLETED, MemoryJournal, PutOff
from worldsim.wiring import put_off


class Waiting(RandomFleet):
    """A fleet that does what the world has put off while its robots decide."""

    aside: Callable[[], None]

    def phase_b(self, k: int, heard: Mapping[int, list[bytes]]) -> Mapping[int, Reply]:
        self.aside()
        return super().phase_b(k, heard)


@pytest.mark.parametrize(("start", "due"), [(lockstep, [(1, 1), (2, 2)]), (paced, [(1, 0), (2, 1)])])
def test_it_is_done_while_robots_decide_and_at_a_pace_before_phase_b_is_due(
    start: Callable[[], tuple[Net, LockstepFleet | PacedFleet]], due: list[tuple[int, int]]
) -> None:
    net, fleet = start()
    told: list[tuple[int, int]] = []
    fleet.aside = lambda: told.append((len(net.told(PhaseA, 3)), len(net.told(PhaseB, 3))))
    for k in range(2):
        assert len(tick(fleet, k)) == len(NAMES)
    assert told == due


def test_work_of_the_world_costs_no_robot_its_time_to_answer() -> None:
    net, fleet = lockstep(5.0)
    fleet.phase_a(0, sensed(0))

    def aside() -> None:
        net.time += 3600.0

    fleet.aside = aside
    assert len(fleet.phase_b(0, heard())) == len(NAMES)
    assert fleet.lost() == []


def _recorded(lab: Lab, *, later: bool, **more: Any) -> tuple[MemoryJournal, list[str], list[int]]:
    """A run's journal, the order of its records, and how many points of the true fog were fresh in each tick."""
    world = lab.patrol(**more)
    fleet = Waiting(world, killed={2: (6, Status.DEAD)})
    fleet.aside = lambda: None
    journal = MemoryJournal(header_of(world))
    recorder = Recorder(journal)
    order: list[str] = []
    fresh: list[int] = []

    def on_tick(record: TickRecord) -> None:
        recorder.tick(record)
        order.append(f"tick {record.k}")
        fresh.append(int(np.count_nonzero(world.truth.fog.last_seen == record.k)))

    def on_event(event: Event) -> None:
        recorder.event(event)
        order.append(f"{event.kind} before {event.k}")

    if not later:
        reason = run_ticks(world, fleet, on_tick, on_event, control=fleet)
    else:
        put_off = PutOff(on_tick, on_event)

        def aside() -> None:
            put_off.settle()
            world.observe()

        fleet.aside = aside
        reason = run_ticks(world, fleet, put_off.tick, put_off.event, control=fleet, settle=put_off.settle)
    assert reason == COMPLETED
    recorder.end(reason)
    return journal, order, fresh


def test_what_is_written_later_is_written_alike(lab: Lab) -> None:
    faults = [{"kind": "pause", "who": "r1", "at": 2.0, "for": 3.0}, {"kind": "kill", "who": "r3", "at": 6.0}]
    now, later = (_recorded(lab, later=later, faults=faults) for later in (False, True))
    assert later[0].records == now[0].records
    assert later[0].end == now[0].end
    assert later[1] == now[1]
    assert later[2] == now[2]
    assert max(now[2]) > 0


def test_a_tick_is_written_before_processes_are_waited_for_and_robots_are_dismissed(lab: Lab) -> None:
    world = lab.patrol(ticks=8, faults=[{"kind": "kill", "who": "r1", "at": 2.0}])
    written: list[int] = []
    seen: list[tuple[int, int]] = []
    fleet = Waiting(world)
    put_off = PutOff(lambda record: written.append(record.k), lambda _event: None)
    fleet.aside = put_off.settle

    def watched(act: Callable[[int], None], number: int) -> None:
        seen.append((world.tick, written[-1]))
        act(number)

    for name in ("kill", "finish"):
        setattr(fleet, name, partial(watched, getattr(fleet, name)))
    run_ticks(world, fleet, put_off.tick, put_off.event, control=fleet, settle=put_off.settle)
    assert seen == [(4, 3), (8, 7)]
    assert written == list(range(8))


def test_the_true_fog_takes_in_a_tick_once(lab: Lab) -> None:
    world = lab.patrol(ticks=3)
    reports = world.begin_tick()
    world.observe()
    once = world.truth.fog.last_seen.copy()
    assert (once == 0).any()
    world.observe()
    record = world.end_tick(dict.fromkeys(reports))
    assert np.array_equal(world.truth.fog.last_seen, once)
    assert record.seen == world.truth.fog.seen
    world.observe()  # between two ticks there is nothing to observe
    assert np.array_equal(world.truth.fog.last_seen, once)


def test_a_tick_is_written_while_a_robot_keeps_the_world_waiting(lab: Lab) -> None:
    net, fleet = lockstep(5.0)
    written: list[tuple[int, float]] = []
    later = PutOff(lambda record: written.append((record.k, net.time)), lambda _: None)
    put_off(later, lab.patrol(), fleet, None, lambda: None)
    later.tick(TickRecord(0, (), (), (), (), 0, 0.0, 0))
    net.mute = {2}
    began = net.time
    fleet.phase_a(1, sensed(1))
    assert [number for number, _, _ in fleet.lost()] == [2]
    [(k, at)] = written
    assert k == 0
    assert at - began < 1.0 < net.time - began
