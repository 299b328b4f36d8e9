"""The run: ticks in lockstep, the same over processes and in one process."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

from patrol.journal import Event, Status, TickRecord
from worldsim.fleet.acts import Acts
from worldsim.run_record import COMPLETED, DESERTED, INTERRUPTED

if TYPE_CHECKING:
    from worldsim.fleet.process_control import Hands
    from worldsim.operator import Operator
    from worldsim.world import Reply, Report, World


class Fleet(Protocol):
    """All robots' minds, wherever they are."""

    def phase_a(self, k: int, reports: Mapping[int, Report]) -> Mapping[int, Sequence[bytes]]:
        """Tell the living robots what they sense; returns the frames that they send, none from one that stays silent.

        A robot missing from the answer has died.
        """
        ...

    def phase_b(self, k: int, heard: Mapping[int, list[bytes]]) -> Mapping[int, Reply | None]:
        """Tell those who answered phase A what they hear; returns their replies, None from one that is late.

        A robot missing from the answer has died.
        """
        ...

    def lost(self) -> Iterable[tuple[int, Status, str]]:
        """Between ticks: (number, status, reason) of each robot that has left the living since the last call."""
        ...

    def finish(self, k: int) -> None:
        """There will be no tick k, nor any later one, whatever the reason."""
        ...


def run_ticks(
    world: World,
    fleet: Fleet,
    sink: Callable[[TickRecord], None],
    events: Callable[[Event], None],
    stop: Callable[[], bool] = lambda: False,
    hands: Hands | None = None,
    operator: Operator | None = None,
) -> str:
    """Run the ticks that are left, waiting for every living robot in each phase.

    Returns why they ended (`worldsim.run_record`).

    sink: takes each tick's record. events: takes what happens between ticks. stop: asked between ticks. hands: those
    that do to robots' minds what the scenario's faults ask for, where any do. operator: asked between ticks for what
    somebody wants of the run while it goes on.
    """
    acts = Acts(world, hands)
    try:
        while world.tick < world.ticks:
            if stop():
                return INTERRUPTED
            if operator is not None:
                for event in operator.between(stop):
                    events(event)
                if stop():
                    return INTERRUPTED
            for event in acts.due():
                events(event)
            if acts.deserted:
                return DESERTED
            _run_tick(world, fleet, sink, events)
        return COMPLETED
    finally:
        if hands is not None:
            hands.release([number for number, body in world.bodies.items() if body.status is Status.PAUSED])
        fleet.finish(world.tick)


def _run_tick(world: World, fleet: Fleet, sink: Callable[[TickRecord], None], events: Callable[[Event], None]) -> None:
    k = world.tick
    reports = world.begin_tick()
    frames = fleet.phase_a(k, reports)
    replies = fleet.phase_b(k, world.exchange(frames))
    sink(world.end_tick(replies))
    gone = {number: (status, reason) for number, status, reason in fleet.lost() if number in reports}
    for number in reports:
        if number not in frames or number not in replies:
            phase = "A" if number not in frames else "B"
            gone.setdefault(number, (Status.LOST, f"no answer in phase {phase} of tick {k}"))
    for number, (status, reason) in sorted(gone.items()):
        events(world.stand_down(number, status, reason))
