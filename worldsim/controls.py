"""An operator's controls: taken between ticks, written to the journal, and answered.

Ticks can be held, let go and paced. In lockstep a pace is a limit: the world still waits for every robot, so the trace
does not depend on it. A request that comes while the ticks are held is done before the next one.

Only requests of clients that know the fleet's token come through (`runtime.security.control_auth`). All others are
counted and get no answer.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from patrol.errors import BadInput
from patrol.faults.kinds import PROCESS_KINDS
from patrol.files.whole_file import write_whole
from patrol.journal.records import Event
from patrol.scenario import dump_scenario
from patrol.scenario.controls import OPERATOR, Answer, Control, Go, Pace, Pause, Step, amended, as_detail, read_control
from patrol.scenario.sections import MAP
from runtime.reporting.logs import crashed
from runtime.security.control_auth import Admitted, ControlGate, RequestRefused

if TYPE_CHECKING:
    from collections import Counter

    from patrol.scenario import Scenario
    from runtime.net.mailbox import Question
    from worldsim.mailbox import CountingMailbox
    from worldsim.world import World


TIMELINE = "timeline.yaml"
MOST_AT_ONCE = 64
"""Requests of strangers that are read at once, at most, so that a flood of them takes little of a tick."""


class ControlMailbox:
    """A `worldsim.controls.ControlRequests` that takes requests from operators who know the fleet's token."""

    def __init__(self, mailbox: CountingMailbox[Question], gate: ControlGate) -> None:
        """Take requests from a mailbox; those of strangers are counted in its `refused`, as ``token``."""
        self._mailbox = mailbox
        self._gate = gate

    def get(self, timeout_s: float) -> ControlRequest | None:
        """Take the next request."""
        for _ in range(MOST_AT_ONCE):
            arrived = self._mailbox.get(timeout_s)
            if arrived is None:
                return None
            # Only the first is waited for: the others are what has come meanwhile.
            timeout_s = 0.0
            question = arrived[1]
            try:
                admitted = self._gate.open(question.payload)
            except RequestRefused:
                self._mailbox.refused["token"] += 1
                continue
            if admitted.answered is None:
                return _read_request(admitted, question)
            question.answer(admitted.answered)
        return None


def _read_request(admitted: Admitted, question: Question) -> ControlRequest:
    def answer(answer: Answer) -> None:
        question.answer(admitted.seal(answer))

    try:
        return ControlRequest(read_control(admitted.control), answer)
    except Exception as error:  # noqa: BLE001 - no request ends a world
        return ControlRequest(refusal(error), answer)


def answer_challenge(gate: ControlGate, question: Question, refused: Counter[str]) -> None:
    """Give a ticket to a client that asks for one; it is of use only with the token.

    What is no such question is counted in `refused`, as ``malformed``.
    """
    try:
        question.answer(gate.challenge(question.payload))
    except RequestRefused:
        refused["malformed"] += 1


def keep_timeline(folder: Path, scenario: Scenario) -> None:
    """Write the scenario as operators have changed it to `TIMELINE`, whole or not at all.

    Where the run's folder holds a copy of the scenario's map, the scenario written refers to that.
    """
    if scenario.terrain.map is not None:
        copy = Path(MAP) / Path(scenario.terrain.map).name
        if (folder / copy).is_file():
            terrain = scenario.terrain.model_copy(update={"map": str(copy)})
            scenario = scenario.model_copy(update={"terrain": terrain})
    write_whole(folder / TIMELINE, dump_scenario(scenario))


POLL_S = 0.05
"""Longest single wait for a request while the ticks are held, s."""

MOST_DURING = 8
"""Requests that are taken at once while a tick is waited for."""

MOST_DEFERRED = 64
"""Requests that wait for the end of a tick; further ones stay where they come in."""

NO_PROCESS_CONTROL = (
    "control: kind: this run did not start the robots' processes, so it cannot kill, pause or start them; "
    "run the scenario with: fogwatch run"
)


@dataclass(frozen=True, slots=True)
class ControlRequest:
    """A request of an operator."""

    control: Control | BadInput  # what is asked for, or why that cannot be read
    answer: Callable[[Answer], None]  # sends the answer; to be called once


class ControlRequests(Protocol):
    """The port for operators' requests."""

    def get(self, timeout_s: float) -> ControlRequest | None:
        """Take the next request."""
        ...


class PacedBetweenTicks(Protocol):
    """A fleet that can wait between ticks."""

    def rest(self) -> None:
        """Deal with requests that arrive while no tick is due."""
        ...

    def set_step(self, step_s: float) -> None:
        """Set the wall time of a step (s), for a fleet that keeps to the clock itself."""
        ...


@dataclass(frozen=True, slots=True)
class RunState:
    """The pace of the ticks: running or held, and how fast."""

    running: bool
    pace: float | None  # factor of real time; None for no limit


class Operator:
    """Obeys operators between the ticks of a world.

    `rest` is called again and again while no tick is due, and after each request.
    """

    def __init__(
        self,
        world: World,
        fleet: PacedBetweenTicks,
        requests: ControlRequests,
        now: Callable[[], float],
        *,
        controls_processes: bool,
        amended: Callable[[Scenario], None] = lambda _scenario: None,
    ) -> None:
        """Take requests for a world.

        `amended` is called with each scenario that operators have changed; it may raise OSError where that cannot be
        kept.
        """
        self._world = world
        self._fleet = fleet
        self._requests = requests
        self._now = now
        self._controls_processes = controls_processes
        self._amended = amended
        self._waits = world.scenario.factor is None
        self.rest: Callable[[], None] = lambda: None
        self._held = False
        self._steps = 0
        self._pace = world.scenario.factor
        self._due = -math.inf
        self._deferred: deque[ControlRequest] = deque()
        self._done: deque[Event] = deque()

    @property
    def state(self) -> RunState:
        """The present pace of the ticks."""
        return RunState(not self._held, self._pace)

    def between(self, stop: Callable[[], bool]) -> Iterator[Event]:
        """Obey requests until the next tick is due, and yield what was done as events for the journal.

        `stop` is asked again and again whether to stop waiting.
        """
        is_asked = False
        while not stop():
            while self._done:
                yield self._done.popleft()
            wait_s = self._wait_s()
            request = self._deferred.popleft() if self._deferred else self._requests.get(min(wait_s, POLL_S))
            if request is not None:
                is_asked = True
                yield from self._do_request(request, self._world.tick)
            # Only without a request: several that wait are all done before the next tick.
            elif wait_s <= 0.0:
                break
            else:
                if self._held:
                    self._fleet.rest()
                self.rest()
        if is_asked:
            self.rest()  # the next tick may be a long one
        if self._held:
            self._steps -= 1
        elif self._pace is not None:
            # A tick that was late is not made up for, or ticks would come in a burst.
            self._due = max(self._due + self._world.step / self._pace, self._now())

    def during(self) -> None:
        """While a tick is waited for: obey requests about the pace, and keep all else for the end of the tick."""
        for _ in range(MOST_DURING):
            if len(self._deferred) >= MOST_DEFERRED or (request := self._requests.get(0.0)) is None:
                return
            if isinstance(request.control, Pause | Go | Step | Pace | BadInput):
                self._done.extend(self._do_request(request, self._world.tick + 1))
            else:
                self._deferred.append(request)

    def _wait_s(self) -> float:
        """Return the time until the next tick is due, s."""
        if self._held and not self._steps:
            return math.inf
        if self._held or self._pace is None or not self._waits:
            return 0.0
        return max(0.0, self._due - self._now())

    def _do_request(self, request: ControlRequest, k: int) -> Iterator[Event]:
        """Obey a request before tick k; an error refuses it and ends nothing else."""
        try:
            if isinstance(request.control, BadInput):
                raise request.control
            detail = as_detail(request.control)
            text = self._obey_control(request.control, k)
        except Exception as error:  # noqa: BLE001 - no request ends a world
            request.answer(Answer(False, str(refusal(error))))
            return
        # Before the answer: what an operator was told is in the journal.
        yield Event(k, OPERATOR, None, detail)
        request.answer(Answer(True, text))

    def _obey_control(self, control: Control, k: int) -> str:
        """Obey a request before tick k; the text of the answer."""
        match control:
            case Pause():
                self._held, self._steps = True, 0
                return f"paused before tick {k}"
            case Go():
                self._held, self._steps = False, 0
                return f"going on with tick {k}"
            case Step(ticks=ticks):
                # A second request while ticks are held adds to the first.
                self._steps = ticks if not self._held else self._steps + ticks
                self._held = True
                return f"paused before tick {k + self._steps}"
            case Pace(factor=factor):
                return self._set_pace(factor)
        scenario, text = amended(self._world.scenario, k, control)
        kinds = {fault.kind for fault in scenario.faults if fault not in self._world.scenario.faults}
        if not self._controls_processes and kinds & set(PROCESS_KINDS):
            raise BadInput(NO_PROCESS_CONTROL)
        self._world.amend(scenario)
        try:
            self._amended(scenario)
        except OSError as error:  # it is done, and the journal has it
            text = f"{text}; the changed scenario could not be written ({error.strerror})"
        return text

    def _set_pace(self, factor: float | None) -> str:
        if factor is None and not self._waits:
            raise BadInput("control: factor = null: this run keeps to the clock; give a factor of real time")
        if factor is not None:
            self._fleet.set_step(self._world.step / factor)
        self._pace, self._due = factor, self._now()
        return "as fast as it goes" if factor is None else f"{factor:g} x real time"


def refusal(error: Exception) -> BadInput:
    """Turn an exception in handling a request into its refusal; a mistake of ours also goes to the log."""
    if isinstance(error, BadInput):
        return error
    if isinstance(error, RecursionError):
        return BadInput("control: the request is nested too deeply; give it fewer levels")
    crashed(error)
    return BadInput(f"control: the request cannot be handled ({type(error).__name__}); the world's log says more")
