"""Takes operators' requests from the network, and keeps the scenario that they have changed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from patrol.errors import BadInput
from patrol.scenario import dump_scenario
from patrol.scenario.controls import Answer, answer_bytes, read_request
from patrol.scenario.copying import MAP
from worldsim.operator import ControlRequest

if TYPE_CHECKING:
    from collections.abc import Callable

    from patrol.scenario import Scenario
    from worldsim.mailbox import Mailbox

TIMELINE = "timeline.yaml"


class Question(Protocol):
    """What the world needs of a question that came over the network, so that it can be tested without one."""

    @property
    def payload(self) -> bytes:
        """What is asked."""
        ...

    @property
    def answer(self) -> Callable[[bytes], None]:
        """Sends the answer."""
        ...


class ControlMailbox:
    """A `worldsim.operator.ControlRequests` that takes requests from operators who have the fleet's token."""

    def __init__(self, mailbox: Mailbox[Question], token: str) -> None:
        """Take requests.

        Args:
            mailbox: Where they arrive.
            token: The fleet's token, which each must carry.
        """
        self._mailbox = mailbox
        self._token = token

    def get(self, timeout_s: float) -> ControlRequest | None:
        """Take the next request.

        Args:
            timeout_s: How long to wait for one, s.

        Returns:
            The request, or None when none came in time.
        """
        arrived = self._mailbox.get(timeout_s)
        if arrived is None:
            return None
        question = arrived[1]

        def answer(answer: Answer) -> None:
            question.answer(answer_bytes(answer))

        try:
            return ControlRequest(read_request(question.payload, self._token), answer)
        except BadInput as bad:
            return ControlRequest(bad, answer)


def keep_timeline(folder: Path, scenario: Scenario) -> None:
    """Write the scenario as operators have changed it to `TIMELINE`, whole or not at all.

    Args:
        folder: The run's folder. Where it holds a copy of the scenario's map, the scenario refers to that.
        scenario: The scenario.
    """
    if scenario.terrain.map is not None:
        copy = Path(MAP) / Path(scenario.terrain.map).name
        if (folder / copy).is_file():
            terrain = scenario.terrain.model_copy(update={"map": str(copy)})
            scenario = scenario.model_copy(update={"terrain": terrain})
    part = folder / f"{TIMELINE}.part"
    part.write_text(dump_scenario(scenario), encoding="utf-8")
    part.replace(folder / TIMELINE)
