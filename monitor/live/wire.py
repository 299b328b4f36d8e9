"""What connects a viewer with a fleet: batches of its journal, questions for the fog so far, and controls."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Protocol

from monitor.source import Answer
from patrol.errors import BadInput
from patrol.net.feed import FOG, MAX_BATCH, TICKS, Batch, Garbled, SoFar, read_batch, read_so_far
from patrol.net.keys import WORLD, FleetKeys
from patrol.net.mailbox import Mailbox, Presence
from patrol.scenario.controls import ASK, read_answer, request

if TYPE_CHECKING:
    from patrol.net.link import Link

ROOM = 512
"""Batches that wait at most; a viewer that is slower misses some, and asks for the fog again."""
FOG_S = 20.0
CONTROL_S = 15.0
"""How long a world may take to answer, s of wall time."""


class Wire(Protocol):
    """What connects a viewer with a world."""

    def batch(self, timeout_s: float) -> Batch | None:
        """The next batch, or None when none came in time."""
        ...

    def so_far(self) -> bytes | None:
        """The world's answer to the question for all so far, None without one."""
        ...

    def ask(self, control: Mapping[str, Any]) -> Answer:
        """The world's answer to a control."""
        ...

    @property
    def may_ask(self) -> bool:
        """Whether controls are obeyed at all."""
        ...

    @property
    def present(self) -> bool:
        """Whether there is a world."""
        ...

    def close(self) -> None:
        """No more is wanted."""
        ...


class FeedWire:
    """A `Wire` over Zenoh. token: the right to control the fleet, or None."""

    def __init__(self, link: Link, keys: FleetKeys, token: str | None = None) -> None:
        self._link = link
        self._keys = keys
        self._token = token
        ticks, world = keys.truth(TICKS), keys.alive(WORLD)
        self._mailbox: Mailbox[Batch | Presence] = Mailbox([ticks, world], read_batch, MAX_BATCH, ROOM)
        self._present = False
        link.subscribe(ticks, self._mailbox)
        link.watch(world, self._mailbox)

    @property
    def may_ask(self) -> bool:
        """Whether there is a token."""
        return self._token is not None

    @property
    def present(self) -> bool:
        """Whether there is a world."""
        return self._present

    def batch(self, timeout_s: float) -> Batch | None:
        """The next batch, or None when none came in time."""
        arrived = self._mailbox.get(timeout_s)
        while arrived is not None and isinstance(arrived[1], Presence):
            self._present = arrived[1].present
            arrived = self._mailbox.get(0.0)
        return None if arrived is None or isinstance(arrived[1], Presence) else arrived[1]

    def so_far(self) -> bytes | None:
        """The world's answer to the question for all so far."""
        return self._link.ask(self._keys.truth(FOG), b"", FOG_S)

    def ask(self, control: Mapping[str, Any]) -> Answer:
        """The world's answer to a control."""
        payload = self._link.ask(self._keys.control(ASK), request(self._token or "", control), CONTROL_S)
        try:
            answer = None if payload is None else read_answer(payload)
        except ValueError:
            answer = None
        return Answer(False, "the world does not answer") if answer is None else Answer(answer.done, answer.text)

    def close(self) -> None:
        """No more is wanted."""
        self._link.close()


def first_answer(
    wire: FeedWire, fleet: str, stopped: Callable[[], bool], waits: Callable[[float], bool]
) -> SoFar | None:
    """All so far of a fleet's run, once there is a world that tells; None when told to stop.

    waits: waits so long (s), and says whether to give up. Raises BadInput for a world of another version.
    """
    while not stopped():
        payload = wire.so_far()
        if payload is not None:
            try:
                return read_so_far(payload)
            except Garbled as garbled:
                raise BadInput(f"--fleet {fleet}: its world speaks another version ({garbled})") from None
        if waits(0.2):
            return None
    return None
