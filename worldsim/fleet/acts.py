"""Acts of the timeline on robots between ticks: killed, restarted, paused, resumed, joining, leaving.

Only ALIVE robots take part in ticks. PAUSED and DEAD bodies stand in the way; those of robots that have left or are not
there yet do not, nor do wrecks that were removed. A robot that joins, or is restarted after its wreck was removed,
appears at its start, and waits tick by tick while another body overlaps that place; one whose wreck is still there
restarts in it. An act that makes no sense for a robot in its present status is skipped, and an event says so.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from patrol.errors import BadInput
from patrol.journal import Event, Status
from worldsim.faults import APPLIES, AS_IT_IS, BECOMES, BEING_STARTED, LOOKED_AT, SKIPPED, WAITING
from worldsim.fleet.process_control import NotStarted, ProcessControl

if TYPE_CHECKING:
    from worldsim.faults import Act
    from worldsim.world import World

NEEDS_LAUNCHER = (
    "faults: they kill, pause or start robots' processes, which only a run that started these can do; run the scenario "
    "with: fogwatch run"
)


class Acts:
    """Carries out the acts of a world's timeline: on bodies by itself, on robots' processes by process control."""

    def __init__(self, world: World, control: ProcessControl | None) -> None:
        """Take the acts of a world's timeline."""
        if control is None and world.timeline.needs_process_control:
            raise BadInput(NEEDS_LAUNCHER)
        self._world = world
        self._control = control
        self._coming: dict[int, str] = {}
        self._waiting: set[int] = set()

    @property
    def deserted(self) -> bool:
        """True if a robot was lost, none is alive or paused any more, and none will come back."""
        bodies = self._world.bodies.values()
        if self._coming or any(body.status in (Status.ALIVE, Status.PAUSED) for body in bodies):
            return False
        if all(body.status is not Status.LOST for body in bodies):
            return False
        kinds = ("restart", "join")
        return not any(e.begin >= self._world.tick and e.fault.kind in kinds for e in self._world.timeline.entries)

    def will_be_alive(self, number: int) -> bool:
        """Return True if a robot is alive, is being started, or will be after an act that is still to come."""
        status = self._world.bodies[number].status
        if status is Status.ALIVE or number in self._coming:
            return True
        for act in self._world.timeline.acts_on(number, self._world.tick + 1):
            # An act that makes no sense by then is skipped, as in the run.
            if status in APPLIES[act.kind]:
                status = BECOMES[act.kind]
            if status is Status.ALIVE:
                return True
        return False

    @property
    def may_wait(self) -> bool:
        """True if what is due before the next tick may have to wait for processes."""
        return bool(self._coming) or bool(self._world.timeline.acts(self._world.tick))

    def due(self) -> Iterator[Event]:
        """Do what is due before the next tick, and yield what happened, as it happens."""
        timeline, k = self._world.timeline, self._world.tick
        # Faults that end come first: one may begin in the tick in which another ends.
        yield from (*timeline.endings(k), *timeline.beginnings(k))
        for act in timeline.acts(k):
            if self._control is not None:
                yield from self._carry_out(act, self._control)
        # A copy, since robots that arrive are taken out.
        for number in list(self._coming):
            if self._control is not None:
                yield from self._bring_in(number, self._control)

    def _carry_out(self, act: Act, control: ProcessControl) -> Iterator[Event]:
        world, number = self._world, act.number
        body = world.bodies[number]
        reason = f"{act.fault} {act.kind}"
        if number in self._coming or body.status not in APPLIES[act.kind]:
            state = BEING_STARTED if number in self._coming else AS_IT_IS[body.status]
            yield Event(world.tick, SKIPPED, number, f"{reason}: {body.spec.name} is {state}")
            return
        match act.kind:
            case "kill":
                control.kill(number)
                yield world.stand_down(number, Status.DEAD, reason, away=act.wreck == "removed")
            case "pause":
                finding = control.pause(number)
                yield world.stand_down(number, Status.PAUSED, reason)
                yield from self._looked_at(number, finding)
            case "resume":
                finding = control.resume(number)
                yield world.wake(number, reason)
                yield from self._looked_at(number, finding)
            case "leave":
                control.leave(number)
                yield world.stand_down(number, Status.LEFT, reason, away=True)
            case "restart" | "join":
                if act.kind == "restart" and body.status is not Status.DEAD:
                    control.kill(number)
                    yield world.stand_down(number, Status.DEAD, reason)
                body.incarnation += 1
                # It takes part only once its process has come and its place is free.
                control.start(number, body.incarnation)
                self._coming[number] = f"{reason}: process {body.incarnation}"

    def _looked_at(self, number: int, finding: str) -> Iterator[Event]:
        if finding:
            yield Event(self._world.tick, LOOKED_AT, number, finding)

    def _bring_in(self, number: int, control: ProcessControl) -> Iterator[Event]:
        """Let a robot that was started take part, as soon as its process is ready and its place is free."""
        world = self._world
        try:
            if not control.arrived(number):
                return
        except NotStarted as why:
            del self._coming[number]
            yield world.stand_down(number, Status.LOST, str(why))
            return
        body = world.bodies[number]
        if body.away and (blockers := world.in_the_way(number)):
            # Said once, however many ticks it waits.
            if number not in self._waiting:
                self._waiting.add(number)
                yield Event(world.tick, WAITING, number, f"its start is taken by {', '.join(blockers)}")
            return
        self._waiting.discard(number)
        yield world.wake(number, self._coming.pop(number))
