"""Hands: who can end, stop, continue and start robots' minds, wherever these are.

The world knows when which robot is to be killed and so on, and what becomes of its body. What happens to the mind is
done by somebody's hands: in one process minds are dropped and made anew (`experiments.inprocess`); of a fleet of
processes the launcher has them (`fogwatch.launch.child_control`), and the world asks it, one JSON line for each
request and answer,
over a socket of their own, so that nothing depends on the router.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from typing import Protocol

from worldsim.fleet.sessions import Interrupted, Seats
from worldsim.lifecycle import STOPPED, UNSEEN

START_S = 60.0
"""How long a process that was started may take to take its robot's place, s of wall time."""


class Hands(Protocol):
    """What can be done to a mind; each call returns when it is done."""

    def kill(self, number: int) -> None:
        """End a robot's mind at once; it is gone afterwards, whatever it was doing."""
        ...

    def pause(self, number: int) -> str:
        """Stop it where it is; what was seen of its process then, in words, or nothing where it has none."""
        ...

    def resume(self, number: int) -> str:
        """Let it go on where it was stopped; what was seen of its process just before, as for `pause`."""
        ...

    def leave(self, number: int) -> None:
        """Tell it to go in order; it is gone afterwards."""
        ...

    def start(self, number: int, incarnation: int) -> None:
        """Start a new mind, with an empty memory, for a robot that has none."""
        ...

    def arrived(self, number: int) -> bool:
        """Whether the mind that was started can be reached by now. Raises NoShow when it never will."""
        ...

    def release(self, paused: Iterable[int]) -> None:
        """The run is over: let those that are stopped go on, so that they can leave as well."""
        ...


class NoShow(Exception):
    """A mind that was started did not come; one line says so."""


class Handless(Exception):
    """Whoever had the hands does not answer, or could not do what was asked."""


@dataclass(frozen=True, slots=True)
class Request:
    """What the world asks of the launcher: do ("kill", "pause", "resume", "leave", "start") to the robot's process."""

    do: str
    robot: int
    incarnation: int = 0

    def line(self) -> bytes:
        """As a line."""
        return json.dumps(asdict(self)).encode() + b"\n"

    @classmethod
    def read(cls, line: bytes) -> Request:
        """From a line."""
        says = json.loads(line)
        return cls(str(says["do"]), int(says["robot"]), int(says["incarnation"]))


def answer_line(problem: str = "", state: str = "") -> bytes:
    """The launcher's answer to a request: done, or the problem.

    state: of a process that was just paused, or is just about to go on, as the system tells it (proc(5)): "T" for one
    that is stopped; empty where nobody can tell.
    """
    return json.dumps({"problem": problem, "state": state}).encode() + b"\n"


class SeatedHands:
    """`Hands` over processes: signals and starting are the launcher's, who takes a robot's place is the seats'.

    ask: sends a line to the launcher and returns its answer. waits: whether `start` waits until the process has taken
    its place, as in lockstep; otherwise the ticks go on, and it arrives when it does.
    """

    def __init__(self, ask: Callable[[bytes], bytes], seats: Seats, *, waits: bool) -> None:
        self._ask = ask
        self._seats = seats
        self._waits = waits
        self._until: dict[int, float] = {}

    def kill(self, number: int) -> None:
        """SIGKILL, and waited for."""
        self._do("kill", number)
        self._seats.vacate(number)

    def pause(self, number: int) -> str:
        """SIGSTOP; its process stands still, and was looked at to see that it does."""
        return _seen(self._do("pause", number))

    def resume(self, number: int) -> str:
        """SIGCONT; its process was looked at before, to see that it stood still to the end."""
        seen = _seen(self._do("resume", number))
        self._seats.bear_with(number)
        return seen

    def leave(self, number: int) -> None:
        """Told to go by the world, and its process waited for."""
        self._do("resume", number)
        self._seats.dismiss(number, "it leaves the fleet", orderly=True)
        self._do("leave", number)
        self._seats.vacate(number)

    def start(self, number: int, incarnation: int) -> None:
        """A new process; where the world waits, seated when this returns or never."""
        self._seats.expect(number, incarnation)
        self._do("start", number, incarnation)
        self._until[number] = self._seats.now + START_S
        while self._waits and not self._seats.seated(number) and self._seats.now < self._until[number]:
            self._seats.welcome(number)

    def arrived(self, number: int) -> bool:
        """Whether its process has taken its place."""
        if self._seats.seated(number):
            return True
        if self._seats.now >= self._until[number]:
            self._seats.vacate(number)
            raise NoShow(f"its new process did not come within {START_S:g} s")
        return False

    def release(self, paused: Iterable[int]) -> None:
        """SIGCONT for each of them; without a launcher they are its business."""
        for number in paused:
            try:
                self.resume(number)
            except (Interrupted, Handless):
                return

    def _do(self, what: str, number: int, incarnation: int = 0) -> str:
        """Have something done; the state of the process, where the launcher tells."""
        answer = json.loads(self._ask(Request(what, number, incarnation).line()))
        if answer["problem"]:
            raise Handless(f"{what} robot {number}: {answer['problem']}")
        return str(answer["state"])


def _seen(state: str) -> str:
    """What a state says of a process that is to stand still."""
    return {"T": STOPPED, "": UNSEEN}.get(state, f"its process has the state {state} and does not stand still")
