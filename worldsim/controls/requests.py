"""Takes operators' requests from the network, and keeps the scenario that they have changed.

Only requests of clients that know the fleet's token come through (`patrol.net.security.control_auth`). All others are
counted and get no answer.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from patrol.files.whole_file import write_whole
from patrol.net.security.control_auth import Admitted, ControlGate, RequestRefused
from patrol.scenario import dump_scenario
from patrol.scenario.controls import read_control
from patrol.scenario.file.copying import MAP
from worldsim.controls.operator import ControlRequest, refusal

if TYPE_CHECKING:
    from collections import Counter
    from collections.abc import Callable

    from patrol.scenario import Scenario
    from patrol.scenario.controls import Answer
    from worldsim.mailbox import CountingMailbox

TIMELINE = "timeline.yaml"
MOST_AT_ONCE = 64
"""Requests of strangers that are read at once, at most, so that a flood of them takes little of a tick."""


class Question(Protocol):
    """The port of a request that came over the network, so that it can be tested without one."""

    @property
    def payload(self) -> bytes:
        """The content of the request."""
        ...

    @property
    def answer(self) -> Callable[[bytes], None]:
        """Sends the answer."""
        ...


class ControlMailbox:
    """A `worldsim.controls.operator.ControlRequests` that takes requests from operators who know the fleet's token."""

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
            timeout_s = 0.0
            question = arrived[1]
            try:
                admitted = self._gate.open(question.payload)
            except RequestRefused:
                self._mailbox.refused["token"] += 1
                continue
            if admitted.answered is None:
                return _request(admitted, question)
            question.answer(admitted.answered)
        return None


def _request(admitted: Admitted, question: Question) -> ControlRequest:
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
