"""Process control: ends, stops, continues and starts robots' processes.

The world decides when a robot is killed or paused, and what becomes of its body; process control acts on its process.
In a fleet in one process, it drops minds and makes them again (`fogwatch.inprocess`). In a fleet of processes, only
the launcher, their parent, can act on them (`fogwatch.launch.child_control`): the world asks it, one JSON line
for each request and answer, over a socket of their own, so that nothing depends on the router.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from typing import Protocol

from worldsim.faults import STOPPED, UNSEEN
from worldsim.fleet.sessions import Interrupted, Sessions

START_S = 600.0
"""Longest time from the start of a process that lives to its session, s of wall time: longer than on any machine that
is only busy."""
_LOOK_S = 0.5
"""Time between two questions to the launcher whether a process that was started still lives, s."""


class ProcessControl(Protocol):
    """Control over robots' processes; each call returns when it is done. Robots go by number."""

    def kill(self, number: int) -> None:
        """End a robot's process at once."""
        ...

    def pause(self, number: int) -> str:
        """Stop a robot's process where it is, and return its state as it was seen then; empty where it has no process.

        For example `worldsim.faults.STOPPED`.
        """
        ...

    def resume(self, number: int) -> str:
        """Let a process go on where it was stopped; return its state as it was seen just before, as for `pause`."""
        ...

    def leave(self, number: int) -> None:
        """Have it leave in order; it is gone when this returns."""
        ...

    def start(self, number: int, incarnation: int) -> None:
        """Start a new process, with an empty memory, for a robot that has none."""
        ...

    def arrived(self, number: int) -> bool:
        """Return True if the process that was started can be reached by now.

        Raises `NotStarted` if it never will be.
        """
        ...

    def release(self, paused: Iterable[int]) -> None:
        """Let the processes that are stopped go on when the run is over, so that they can leave as well."""
        ...


class NotStarted(Exception):
    """A process that was started did not come; one line says so."""


class ControlFailed(Exception):
    """The launcher does not answer, or could not obey."""


@dataclass(frozen=True, slots=True)
class Request:
    """One request of the world to the launcher."""

    do: str  # "kill", "pause", "resume", "leave", "start", or "look" for whether the process has ended
    robot: int
    incarnation: int = 0  # of the process to start; 0 otherwise

    def line(self) -> bytes:
        """Return the request as a line of JSON.

        For example, ``{"do": "kill", "robot": 2, "incarnation": 0}``.
        """
        return json.dumps(asdict(self)).encode() + b"\n"

    @classmethod
    def read(cls, line: bytes) -> Request:
        """Read a request from a line of JSON."""
        fields = json.loads(line)
        return cls(str(fields["do"]), int(fields["robot"]), int(fields["incarnation"]))


ENDED = "ended"
"""The state of a process that has ended, in the answer to "look"."""


def answer_line(problem: str = "", state: str = "") -> bytes:
    """Build the launcher's answer to a request, a line of JSON.

    For example, after a pause: ``{"problem": "", "state": "T"}``.

    `problem` says why the request could not be met, and is empty when it was. `state` is that of a process that was
    just paused, or is just about to go on, as the system reports it (proc(5)): "T" for one that is stopped; empty where
    the system does not report it. In answer to "look" it is `ENDED`, or empty.
    """
    return json.dumps({"problem": problem, "state": state}).encode() + b"\n"


class LauncherControl:
    """A `ProcessControl` over processes: the launcher sends signals and starts them, sessions say who has come."""

    def __init__(self, ask: Callable[[bytes], bytes], sessions: Sessions, *, waits: bool) -> None:
        """Control the processes of a launcher; `ask` sends it a line and returns its answer.

        If `waits`, `start` waits until the process has opened its session, as in lockstep; otherwise the ticks go on
        meanwhile.
        """
        self._ask = ask
        self._sessions = sessions
        self._waits = waits
        self._until: dict[int, float] = {}
        self._look_at: dict[int, float] = {}

    def kill(self, number: int) -> None:
        """Have SIGKILL sent and the end waited for."""
        self._request_action("kill", number)
        self._sessions.end(number)

    def pause(self, number: int) -> str:
        """Have SIGSTOP sent and the state of the process read."""
        return _state_text(self._request_action("pause", number))

    def resume(self, number: int) -> str:
        """Have the state of the process read and SIGCONT sent."""
        return _state_text(self._request_action("resume", number))

    def leave(self, number: int) -> None:
        """Tell the process to leave, and have its end waited for."""
        # A stopped process could not leave.
        self._request_action("resume", number)
        self._sessions.dismiss(number, "it leaves the fleet", orderly=True)
        self._request_action("leave", number)
        self._sessions.end(number)

    def start(self, number: int, incarnation: int) -> None:
        """Have a new process started; in lockstep wait up to `START_S` for its session, or until it has ended."""
        # Before the start, or the seat would be refused to a process that is quick.
        self._sessions.expect(number, incarnation)
        self._request_action("start", number, incarnation)
        self._until[number] = self._sessions.now + START_S
        self._look_at[number] = self._sessions.now + _LOOK_S
        while self._waits and not self._sessions.is_open(number) and not self._why_given_up(number):
            self._sessions.await_session(number)

    def arrived(self, number: int) -> bool:
        """Return True if the robot's process has opened its session.

        Raises `NotStarted` if it has ended, or has not come within `START_S`.
        """
        if self._sessions.is_open(number):
            return True
        if why := self._why_given_up(number):
            self._sessions.end(number)
            raise NotStarted(why)
        return False

    def _why_given_up(self, number: int) -> str:
        """Return why a process that was started is not waited for any longer; empty while it is."""
        now = self._sessions.now
        if now >= self._until[number]:
            return f"its new process did not come within {START_S:g} s"
        if now < self._look_at[number]:
            return ""
        # Each question is a round trip to the launcher, and this is asked in every tick.
        self._look_at[number] = now + _LOOK_S
        return "its new process has ended" if self._request_action("look", number) == ENDED else ""

    def release(self, paused: Iterable[int]) -> None:
        """Have SIGCONT sent to each of them, unless the launcher is gone."""
        for number in paused:
            try:
                self.resume(number)
            except (Interrupted, ControlFailed):
                return

    def _request_action(self, action: str, number: int, incarnation: int = 0) -> str:
        """Have something done; return the state of the process, where the launcher reports it."""
        return _have_done(self._ask, Request(action, number, incarnation))


def has_ended(ask: Callable[[bytes], bytes], number: int) -> bool:
    """Return True if a robot's process has ended; False also where the launcher cannot say."""
    try:
        return _have_done(ask, Request("look", number)) == ENDED
    except ControlFailed:
        return False


def _have_done(ask: Callable[[bytes], bytes], request: Request) -> str:
    answer = json.loads(ask(request.line()))
    if answer["problem"]:
        raise ControlFailed(f"{request.do} robot {request.robot}: {answer['problem']}")
    return str(answer["state"])


def _state_text(state: str) -> str:
    """Put the state of a process that should be stopped into words."""
    return {"T": STOPPED, "": UNSEEN}.get(state, f"its process has the state {state} and does not stand still")
