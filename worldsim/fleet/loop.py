"""The loop of a run's ticks, the same over processes and in one process."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from patrol.journal import Event, Status, TickRecord
from worldsim.fleet.acts import Acts
from worldsim.run_record import COMPLETED, DESERTED, INTERRUPTED

if TYPE_CHECKING:
    from patrol.exchange import Reply, Sensed
    from worldsim.controls import Operator
    from worldsim.fleet.process_control import ProcessControl
    from worldsim.world import World


class Fleet(Protocol):
    """All robots' minds, in processes or in this one."""

    def phase_a(self, k: int, reports: Mapping[int, Sensed]) -> Mapping[int, Sequence[bytes]]:
        """Send the living robots their senses, and return the frames that they send, by robot number.

        A robot that stays silent has no frames; one that is missing has died.
        """
        ...

    def phase_b(self, k: int, heard: Mapping[int, list[bytes]]) -> Mapping[int, Reply | None]:
        """Send the robots that answered phase A their frames, and return their replies, by robot number.

        The reply is None from a robot that is late; one that is missing has died.
        """
        ...

    def lost(self) -> Iterable[tuple[int, Status, str]]:
        """Return, between ticks, (number, status, reason) of each robot that was lost since the last call."""
        ...

    def finish(self, k: int) -> None:
        """End the run before tick k, whatever the reason."""
        ...


def run_ticks(
    world: World,
    fleet: Fleet,
    sink: Callable[[TickRecord], None],
    events: Callable[[Event], None],
    stop: Callable[[], bool] = lambda: False,
    control: ProcessControl | None = None,
    operator: Operator | None = None,
    settle: Callable[[], None] = lambda: None,
) -> str:
    """Run the ticks that are left, and return why they ended (`worldsim.run_record`).

    `sink` takes each tick's record, `events` what happens between ticks. `settle` does what `sink` has put off: it is
    called where the next tick may be long in coming, and at the end. `control` may be None only where no fault needs
    process control.
    """
    acts = Acts(world, control)
    try:
        while world.tick < world.ticks:
            if stop():
                return INTERRUPTED
            if operator is not None:
                for event in operator.between(stop):
                    events(event)
                # Operators may have paused the run, so that long time has passed.
                if stop():
                    return INTERRUPTED
            if acts.may_wait:
                settle()
            if not act_between_ticks(world, acts, events):
                return DESERTED
            end_tick(world, fleet, begin_tick(world, fleet), sink, events)
        return COMPLETED
    finally:
        # Robots' processes are let go even if the record cannot be written.
        try:
            settle()
        finally:
            if control is not None:
                control.release([number for number, body in world.bodies.items() if body.status is Status.PAUSED])
            fleet.finish(world.tick)


@dataclass(frozen=True, slots=True)
class BegunTick:
    """A tick up to the point at which its robots decide."""

    reports: Mapping[int, Sensed]
    frames: Mapping[int, Sequence[bytes]]
    heard: Mapping[int, list[bytes]]


def act_between_ticks(world: World, acts: Acts, events: Callable[[Event], None]) -> bool:
    """Do what is due before the next tick; return False if no robot is left for it."""
    for event in acts.due():
        events(event)
    # After the acts: a robot that has just appeared keeps a part open.
    for event in world.close_and_open():
        events(event)
    return not acts.deserted


def begin_tick(world: World, fleet: Fleet) -> BegunTick:
    """Begin the world's next tick: robots sense, send and hear."""
    reports = world.begin_tick()
    frames = fleet.phase_a(world.tick, reports)
    return BegunTick(reports, frames, world.exchange(frames))


def end_tick(
    world: World, fleet: Fleet, begun: BegunTick, sink: Callable[[TickRecord], None], events: Callable[[Event], None]
) -> None:
    """End a tick: robots decide and move."""
    k = world.tick
    replies = fleet.phase_b(k, begun.heard)
    sink(world.end_tick(replies))
    lost = {number: (status, reason) for number, status, reason in fleet.lost() if number in begun.reports}
    for number in begun.reports:
        if number not in begun.frames or number not in replies:
            phase = "A" if number not in begun.frames else "B"
            # What the fleet says of a robot goes before the mere lack of an answer.
            lost.setdefault(number, (Status.LOST, f"no answer in phase {phase} of tick {k}"))
    # By number, so that the order of events does not depend on who was noticed first.
    for number, (status, reason) in sorted(lost.items()):
        events(world.stand_down(number, status, reason))
