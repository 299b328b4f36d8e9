"""Fleets that are attacked while they run."""

import os
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from patrol.journal import read_journal
from runtime.net.link import open_link
from runtime.security.access import FILE, read_access
from runtime.security.control_auth import ControlClient, Unanswered
from runtime.security.keys import fleet_keys
from tests.fleets import COARSE
from tests.fogwatch.conftest import Run, start
from tests.hostile.attacker import Attacker

__all__ = ["start"]


class Target:
    """A running fleet, its operator, and somebody on its network."""

    def __init__(self, run: Run) -> None:
        self.run = run
        run.until((run.folder / FILE).exists)
        self.access = read_access(run.folder, "test")
        self.keys = fleet_keys(self.access.fleet)
        self.link = open_link(self.access.router, 30.0, credentials=self.access.credentials)
        self.attacker = Attacker(run.folder)
        self.attacker.listen()
        self.run.until(lambda: self.asked(do="pause"))

    def asked(self, **control: Any) -> bool:
        """Return True if the world has done what it was asked for."""
        return self._answer(control) is not None

    def step(self, ticks: int) -> int:
        """Do so many more ticks; how many there are then."""
        held = self.begin(ticks)
        self.run.until(lambda: self.run.ticks() == held)
        return held

    def begin(self, ticks: int) -> int:
        """Let so many more ticks begin; how many there will be then."""
        answer = self._answer({"do": "step", "ticks": ticks})
        assert answer is not None
        # The last tick before the pause may not be written down yet, so only the world can tell.
        return int(answer.rpartition("paused before tick ")[2])

    def _answer(self, control: dict[str, Any]) -> str | None:
        """Return the world's word of what it has done; None where it has not, or does not answer."""
        client = ControlClient(self.link, self.keys, self.access.token, time.monotonic, os.urandom)
        try:
            answer = client.ask(control, 60.0).answer
        except Unanswered:
            return None
        return answer.text if answer.done else None

    def go(self) -> None:
        """Let the ticks go on."""
        assert self.asked(do="go")

    def refused(self) -> dict[str, int]:
        """Counts of the messages that the world has refused, once the run is over."""
        end = read_journal(self.run.folder / "journal").end
        assert end is not None
        counts: dict[str, int] = end.notes["refused"]
        return counts

    def scenario_hash(self) -> str:
        """The hash of the run's scenario."""
        return read_journal(self.run.folder / "journal").header.scenario_hash

    def close(self) -> None:
        """Leave the network."""
        self.attacker.close()
        self.link.close()


Attack = Callable[..., Target]
"""The fixture `attack`."""


@pytest.fixture
def attack(start: Callable[..., Run]) -> Iterator[Callable[..., Target]]:
    """Starts fleets, each with somebody on its network; their ticks are held."""
    targets: list[Target] = []

    def begin(scenario: dict[str, Any], *arguments: str) -> Target:
        targets.append(Target(start({**COARSE, **scenario}, *arguments)))
        return targets[-1]

    yield begin
    for target in targets:
        target.close()
