"""Where an operator's requests come in over Zenoh, and where the scenario that they come to is kept."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from patrol.errors import BadInput
from patrol.scenario import dump_scenario
from patrol.scenario.controls import Answer, answer_bytes, read_request
from patrol.scenario.copying import MAP
from worldsim.operator import Asked

if TYPE_CHECKING:
    from collections.abc import Callable

    from patrol.scenario import Scenario
    from worldsim.mailbox import Mailbox

TIMELINE = "timeline.yaml"


class Question(Protocol):
    """What a `patrol.net.link.Question` offers here."""

    @property
    def payload(self) -> bytes:
        """What is asked."""
        ...

    @property
    def answer(self) -> Callable[[bytes], None]:
        """Sends the answer."""
        ...


class FrontDesk:
    """A `worldsim.operator.Desk`: takes requests from those who have the fleet's token."""

    def __init__(self, mailbox: Mailbox[Question], token: str) -> None:
        self._mailbox = mailbox
        self._token = token

    def get(self, timeout_s: float) -> Asked | None:
        """The next request, or None when none came in time."""
        arrived = self._mailbox.get(timeout_s)
        if arrived is None:
            return None
        question = arrived[1]

        def answer(answer: Answer) -> None:
            question.answer(answer_bytes(answer))

        try:
            return Asked(read_request(question.payload, self._token), answer)
        except BadInput as bad:
            return Asked(bad, answer)


def keep_timeline(folder: Path, scenario: Scenario) -> None:
    """Write the scenario as operators have made it, whole or not at all; by its copy here, where a map has one."""
    if scenario.terrain.map is not None:
        copy = Path(MAP) / Path(scenario.terrain.map).name
        if (folder / copy).is_file():
            terrain = scenario.terrain.model_copy(update={"map": str(copy)})
            scenario = scenario.model_copy(update={"terrain": terrain})
    part = folder / f"{TIMELINE}.part"
    part.write_text(dump_scenario(scenario), encoding="utf-8")
    part.replace(folder / TIMELINE)
