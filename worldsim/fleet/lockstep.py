"""A fleet of processes in lockstep: in each phase the world waits for all living robots."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

from patrol.exchange import Reply, Sensed
from patrol.journal import Status
from runtime.messages.phases import ReplyA, ReplyB
from runtime.process.deadline import ANSWER_S
from worldsim.fleet.router_watch import RouterWatch
from worldsim.fleet.sessions import POLL_S, Sessions

RESEND_S = 1.0
QUIET_S = 0.5
"""Time without an answer after which it is asked whether the router is at work, s."""
SAY_S = 5.0, 2.0
"""Wait of a tick after which it is said whom it waits for, and time until that is said again, s."""
_DRAINED = 16

T = TypeVar("T", ReplyA, ReplyB)


class LockstepFleet:
    """A `worldsim.fleet.loop.Fleet` of processes in lockstep.

    A phase's messages are sent again every `RESEND_S` to robots that have not answered. A robot that has not answered
    within the deadline, or whose process is gone, is lost. Waiting time is summed over short slices of bounded length,
    so that a pause of the world's own process (a suspended machine) loses no robot. While the router does not answer,
    the world waits, and robots have the whole deadline again from when it does.

    `meanwhile` is called now and then while a tick is waited for, and `aside` once a tick, when all robots have begun
    to decide, for work that no robot waits for.
    """

    def __init__(
        self,
        sessions: Sessions,
        deadline_s: float = ANSWER_S,
        router: RouterWatch | None = None,
        waiting: Callable[[list[str], float, int], None] = lambda _names, _waited_s, _k: None,
    ) -> None:
        """Drive the robots that have sessions.

        The deadline is wall time; in the first tick it is at least `ANSWER_S`. `router` is None where there is none
        between world and robots. `waiting` is called now and then with the names that a tick waits for, for how
        long it has, and its number.
        """
        self._waiting = waiting
        self._sessions = sessions
        self._deadline_s = deadline_s
        self._router = router
        self.meanwhile: Callable[[], None] = lambda: None
        self.aside: Callable[[], None] = lambda: None
        self._lost: list[tuple[int, Status, str]] = []

    def phase_a(self, k: int, reports: Mapping[int, Sensed]) -> Mapping[int, Sequence[bytes]]:
        """Send phase A and return the frames of the robots that answer in time, by number."""
        answers = self._ask_robots(k, "A", reports, ReplyA)
        return {number: answer.frames for number, answer in answers.items()}

    def phase_b(self, k: int, heard: Mapping[int, list[bytes]]) -> Mapping[int, Reply]:
        """Send phase B and return the replies of the robots that answer in time, by number."""
        answers = self._ask_robots(k, "B", heard, ReplyB, self.aside)
        return {number: answer.reply for number, answer in answers.items()}

    def lost(self) -> list[tuple[int, Status, str]]:
        """Return the robots lost since the last call: number, status and reason."""
        lost, self._lost = self._lost, []
        return lost

    def rest(self) -> None:
        """Handle messages that arrive while no tick is due."""
        drain(self._sessions)

    def set_step(self, _step_s: float) -> None:
        """Do nothing: the world alone decides when the next tick begins."""

    def finish(self, k: int) -> None:
        """Dismiss all robots after tick k."""
        self._sessions.close(k, "the run is over")

    def notes(self) -> dict[str, Any]:
        """Return notes on the pace for the journal's end: for how long the router was silent, if it was."""
        return router_notes(self._router)

    def _ask_robots(
        self,
        k: int,
        phase: str,
        tell: Mapping[int, Sensed | list[bytes]],
        kind: type[T],
        aside: Callable[[], None] = lambda: None,
    ) -> dict[int, T]:
        """Tell each robot its senses or frames, do the work that can be done aside, and wait for all answers."""
        sessions = self._sessions
        # The bytes are kept: sent again, they must be the same.
        sent = {number: sessions.send(number, k, phase_data) for number, phase_data in tell.items()}
        aside()
        answers: dict[int, T] = {}
        # In the first tick robots may still load what they need.
        deadline_s = self._deadline_s if k else max(self._deadline_s, ANSWER_S)
        waited_s = 0.0
        began = before = sessions.now
        resend, say_at = before + RESEND_S, before + SAY_S[0]
        while len(answers) < len(sent):
            arrived = sessions.take(POLL_S)
            if arrived is not None:
                number, answer = arrived
                # An answer may be to an earlier phase that was sent again.
                if isinstance(answer, kind) and answer.k == k and number in sent and number not in answers:
                    answers[number] = answer
                    continue
            now = sessions.now
            # A longer slice means that this process stood still, which is not the robots' fault.
            waited_s += min(now - before, 2.0 * POLL_S)
            before = now
            if arrived is None:
                self.meanwhile()
            # Only after a while: most phases are over before the router could be asked.
            if now >= began + QUIET_S and not self._router_answers():
                waited_s = 0.0
                continue
            waiting = [number for number in sent if number not in answers]
            ended = dict.fromkeys(sessions.gone(waiting), f"its process was gone in phase {phase} of tick {k}")
            lost = ended | sessions.failed(waiting)
            if waited_s >= deadline_s:
                # The right side replaces the left: that a process has ended says more than a deadline.
                lost = dict.fromkeys(waiting, f"no answer in phase {phase} of tick {k} for {deadline_s:g} s") | lost
            for number, reason in lost.items():
                self._lose_robot(number, reason)
                del sent[number]
            if now >= say_at and sent.keys() - answers:
                say_at = now + SAY_S[1]
                self._waiting([sessions.name(number) for number in sent if number not in answers], now - began, k)
            if now >= resend:
                resend = now + RESEND_S
                for number in waiting:
                    if number in sent:
                        sessions.repeat(number, sent[number])
        # In the order of the robots and not of arrival, so that runs are alike.
        return {number: answers[number] for number in tell if number in answers}

    def _router_answers(self) -> bool:
        return self._router is None or self._router.answers()

    def _lose_robot(self, number: int, reason: str) -> None:
        self._lost.append((number, Status.LOST, reason))
        self._sessions.dismiss(number, f"left out: {reason}", orderly=False)


def router_notes(router: RouterWatch | None) -> dict[str, Any]:
    """Return `router_silent_s`, wall time, for the journal's end; nothing if the router was never silent."""
    return {} if router is None or not router.silent_s else {"router_silent_s": round(router.silent_s, 3)}


def drain(sessions: Sessions) -> None:
    """Handle messages that arrived between two ticks, when no answer is due."""
    # Bounded, so that no flood of messages holds up the next tick.
    for _ in range(_DRAINED):
        sessions.take(0.0)
