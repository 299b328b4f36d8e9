"""An operator's controls: taken between ticks, written to the journal, and answered.

Ticks can be held, let go and paced. In lockstep a pace is a limit: the world still waits for every robot, so the trace
does not depend on it. What is asked for while the ticks are held is done before the next one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from patrol.errors import BadInput
from patrol.journal.records import Event
from patrol.scenario.controls import OPERATOR, Answer, Control, Go, Pace, Pause, Step, amended, as_detail
from patrol.scenario.faults.kinds import PROCESS_KINDS

if TYPE_CHECKING:
    from patrol.scenario import Scenario
    from worldsim.world import World

POLL_S = 0.05
"""How long the world waits for a control at a time while its ticks are held."""

HANDLESS = "control: robots' processes were not started by this run, so that nobody here can kill, pause or start them"


@dataclass(frozen=True, slots=True)
class Asked:
    """What somebody asks for. control: what, or why it cannot be read. answer: to be called once."""

    control: Control | BadInput
    answer: Callable[[Answer], None]


class Desk(Protocol):
    """Where controls come in."""

    def get(self, timeout_s: float) -> Asked | None:
        """The next one, or None when none came in time."""
        ...


class Rested(Protocol):
    """A fleet that can be kept waiting between ticks."""

    def rest(self) -> None:
        """No tick is due for now."""
        ...

    def hasten(self, step_s: float) -> None:
        """Steps take so long from now on (s of wall time), where the fleet sees to that itself."""
        ...


@dataclass(frozen=True, slots=True)
class Manner:
    """How the ticks go. running: by themselves. pace: the factor of real time that was asked for, None for none."""

    running: bool
    pace: float | None


class Operator:
    """Does what is asked for between the ticks of a world.

    handy: whether somebody can kill, pause and start robots. now: wall clock, s. amended: told of each new scenario.
    rest: called again and again while no tick is due.
    """

    def __init__(
        self,
        world: World,
        fleet: Rested,
        desk: Desk,
        now: Callable[[], float],
        *,
        handy: bool,
        amended: Callable[[Scenario], None] = lambda _scenario: None,
    ) -> None:
        self._world = world
        self._fleet = fleet
        self._desk = desk
        self._now = now
        self._handy = handy
        self._amended = amended
        self._waits = world.scenario.factor is None
        self.rest: Callable[[], None] = lambda: None
        self._held = False
        self._steps = 0
        self._pace = world.scenario.factor
        self._due = -math.inf

    @property
    def manner(self) -> Manner:
        """How the ticks go now."""
        return Manner(not self._held, self._pace)

    def between(self, stop: Callable[[], bool]) -> Iterator[Event]:
        """Do what is asked for until the next tick is due; what is done, as the journal has it.

        stop: asked while that takes time, whether to give up waiting.
        """
        while not stop():
            wait_s = self._wait_s()
            asked = self._desk.get(min(wait_s, POLL_S))
            if asked is not None:
                yield from self._do(asked)
            elif wait_s <= 0.0:
                break
            else:
                if self._held:
                    self._fleet.rest()
                self.rest()
        if self._held:
            self._steps -= 1
        elif self._pace is not None:
            self._due = max(self._due + self._world.step / self._pace, self._now())

    def _wait_s(self) -> float:
        """How long until the next tick is due."""
        if self._held and not self._steps:
            return math.inf
        if self._held or self._pace is None or not self._waits:
            return 0.0
        return max(0.0, self._due - self._now())

    def _do(self, asked: Asked) -> Iterator[Event]:
        try:
            if isinstance(asked.control, BadInput):
                raise asked.control
            text = self._obey(asked.control)
        except (BadInput, RecursionError) as refused:
            asked.answer(Answer(False, str(refused)))
            return
        yield Event(self._world.tick, OPERATOR, None, as_detail(asked.control))
        asked.answer(Answer(True, text))

    def _obey(self, control: Control) -> str:
        """Do it; what to tell the one who asked."""
        k = self._world.tick
        match control:
            case Pause():
                self._held, self._steps = True, 0
                return f"paused before tick {k}"
            case Go():
                self._held, self._steps = False, 0
                return f"going on with tick {k}"
            case Step(ticks=ticks):
                self._steps = ticks if not self._held else self._steps + ticks
                self._held = True
                return f"paused before tick {k + self._steps}"
            case Pace(factor=factor):
                return self._hurry(factor)
        scenario, text = amended(self._world.scenario, k, control)
        kinds = {fault.kind for fault in scenario.faults if fault not in self._world.scenario.faults}
        if not self._handy and kinds & set(PROCESS_KINDS):
            raise BadInput(HANDLESS)
        self._world.amend(scenario)
        self._amended(scenario)
        return text

    def _hurry(self, factor: float | None) -> str:
        if factor is None and not self._waits:
            raise BadInput("control: factor = null: this run keeps to the clock; give a factor of real time")
        if factor is not None:
            self._fleet.hasten(self._world.step / factor)
        self._pace, self._due = factor, self._now()
        return "as fast as it goes" if factor is None else f"{factor:g} x real time"
