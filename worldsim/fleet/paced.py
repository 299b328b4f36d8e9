"""A fleet of processes at the pace of the wall clock: the world waits for no robot.

Tick k begins k steps after the first. Its phase A goes out at once, phase B as soon as all frames have come, at the
latest a fifth of a step after phase A, and the step ends with the commands that have come by then. A frame that comes
later is lost; a command that comes later counts for the tick it comes in, when that has none of its own. Each is a
missed deadline. Where robots hear each other directly, the world only listens to their frames, and none can be late.

Two things move deadlines, because they are no robot's fault:

- The world sends late. A robot has a fifth of a step from when phase A has left, and half a step from when phase B has.
  What has come when the world looks is there in time, however long the world was busy.
- The world is woken late from a wait, as on a machine that stands still for a moment. Robots have that time again, up
  to a step in each tick, and the world counts it (`PacedFleet.held_up_s`).

A tick that ends late is made up for by the next ones, which may last as little as half a step and the time to the last
frame. Where that is not enough, the world falls behind and counts by how much (`PacedFleet.slipped_s`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence, Set
from typing import TYPE_CHECKING, Any

from patrol.exchange import Reply, Sensed
from patrol.journal import Status
from runtime.messages.phases import PHASE_B_SHARE, ReplyA, ReplyB
from worldsim.fleet.lockstep import drain, router_notes
from worldsim.fleet.sessions import Sessions

if TYPE_CHECKING:
    from worldsim.fleet.router_watch import RouterWatch
    from worldsim.radio.listener import Listener


COMMAND_SHARE = 0.5
"""The least share of a step that robots have from phase B to their commands."""
WAKING_S = 0.002
"""Usual delay of the world's waking, s; a longer one counts as held up."""
LOOK_S = 0.005
"""Time that the world waits for a message at once, s; as much of a hold-up may pass unnoticed."""


class PacedFleet:
    """A `worldsim.fleet.loop.Fleet` of processes that keeps to the clock.

    By robot number, `late_frames` and `late_commands` count the ticks in which none was there in time, and `too_late`
    the frames that came after the deadline and reached no robot. All times are wall time: `slipped_s` is by how much
    the world itself has fallen behind without catching up, `held_up_s` by how much deadlines were moved because the
    world was woken late, and `longest_held_up_s` the most of that in one tick.

    `meanwhile` is called now and then while a tick is waited for, and `aside` once a tick, when all robots have been
    sent phase A, for work that no robot waits for.
    """

    def __init__(
        self, sessions: Sessions, step_s: float, listener: Listener | None = None, router: RouterWatch | None = None
    ) -> None:
        """Drive the robots that have sessions; `step_s` is the wall time of a tick.

        `listener` hears a direct radio, and is None where the world carries the frames. `router` is None where there is
        none between world and robots.
        """
        self.late_frames: Counter[int] = Counter()
        self.late_commands: Counter[int] = Counter()
        self.too_late: Counter[int] = Counter()
        self.slipped_s = 0.0
        self.held_up_s = self.longest_held_up_s = 0.0
        self.meanwhile: Callable[[], None] = lambda: None
        self.aside: Callable[[], None] = lambda: None
        self._sessions = sessions
        self._listener = listener
        self._router = router
        self._step_s = self._tick_s = step_s
        self._k = 0
        self._closed = False  # no frame of this tick is taken any more
        self._held_up_s = 0.0  # in this tick
        self._begins: float | None = None
        self._living: list[int] = []
        self._commands: dict[int, ReplyB] = {}

    def phase_a(self, k: int, reports: Mapping[int, Sensed]) -> Mapping[int, Sequence[bytes]]:
        """Return the frames that have come when phase B is due, none for the others."""
        self._living = list(reports)
        self._k = k
        self._closed = False
        self._held_up_s = 0.0
        self._begin_tick()
        for number, report in reports.items():
            self._sessions.send(number, k, report)
        told_at = self._sessions.now
        self.aside()
        frames: dict[int, Sequence[bytes]] = {}
        answering = reports.keys() if self._listener is None else None
        self._collect_answers(frames, told_at, PHASE_B_SHARE, PHASE_B_SHARE, answering)
        # What comes from here on is late, though the tick goes on.
        self._closed = True
        if self._listener is not None:
            received = self._listener.frames(k)
            return {number: received.get(number, ()) for number in reports}
        self.late_frames.update(number for number in reports if number not in frames)
        return {number: frames.get(number, ()) for number in reports}

    def phase_b(self, k: int, heard: Mapping[int, list[bytes]]) -> Mapping[int, Reply | None]:
        """Return the newest commands that have come when the step ends, None for robots that sent none."""
        for number, frames in heard.items():
            self._sessions.send(number, k, frames)
        self._collect_answers({}, self._sessions.now, 1.0, COMMAND_SHARE)
        # A command that came late in the tick before counts now, where there is none of this tick.
        commands, self._commands = self._commands, {}
        self.late_commands.update(number for number in heard if number not in commands or commands[number].k != k)
        return {number: commands[number].reply if number in commands else None for number in heard}

    def lost(self) -> list[tuple[int, Status, str]]:
        """Return the robots whose process is gone or whose mind has failed.

        One that is only slow or paused is not lost: its watchdog has stopped it. Nor is one that was cut off and comes
        back (`Sessions.gone`). While the router does not answer, the ticks go on, every robot misses its deadlines, and
        none is lost.
        """
        if self._router is not None:
            self._router.answers()
        reasons = dict.fromkeys(self._sessions.gone(self._living), "its process was gone")
        # A reason that the mind gives says more than that its process is gone.
        reasons |= self._sessions.failed(self._living)
        for number, reason in reasons.items():
            self._sessions.dismiss(number, f"left out: {reason}", orderly=False)
        return [(number, Status.LOST, reason) for number, reason in sorted(reasons.items())]

    def rest(self) -> None:
        """Deal with messages that arrive while no tick is due; the next tick begins when it is asked for."""
        drain(self._sessions)
        self._begins = None

    def set_step(self, step_s: float) -> None:
        """Set the wall time of the steps from now on, s; it makes a tick that is under way shorter, but not longer."""
        self._step_s = step_s
        if self._begins is not None and step_s < self._tick_s:
            self._tick_s = step_s
            # At most a step ago, or the time of the longer step would count as fallen behind.
            self._begins = max(self._begins, self._sessions.now - step_s)

    def finish(self, k: int) -> None:
        """Dismiss all robots."""
        self._sessions.close(k, "the run is over")

    def notes(self) -> dict[str, Any]:
        """Return the pace for the journal's end: missed deadlines by robot number, and the world's own slip."""
        return {
            "late_frames": dict(sorted(self.late_frames.items())),
            "too_late": dict(sorted(self.too_late.items())),
            "late_commands": dict(sorted(self.late_commands.items())),
            "slipped_s": self.slipped_s,
            "held_up_s": self.held_up_s,
            "longest_held_up_s": self.longest_held_up_s,
            **router_notes(self._router),
            **({} if self._listener is None else self._listener.notes()),
        }

    def _begin_tick(self) -> None:
        """Set when this tick begins: a step after the last one, or now when that is more than a step ago."""
        now = self._sessions.now
        start_s = now if self._begins is None else self._begins + self._tick_s
        # Only now: the tick that has just ended had the old length.
        self._tick_s = self._step_s
        # Less than a step is made up for by shorter ticks; more is given up, and counted.
        if now > start_s + self._step_s:
            self.slipped_s += now - start_s
            start_s = now
        self._begins = start_s

    def _collect_answers(
        self,
        frames: dict[int, Sequence[bytes]],
        told_at: float,
        share: float,
        least: float,
        answering: Set[int] | None = None,
    ) -> None:
        """Take what has come and what comes, up to a moment of the tick.

        Frames of this tick go into `frames`, by robot number. It ends `share` of a step after the tick's beginning, but
        not before `least` of a step after `told_at`; earlier only if there are frames of all of `answering` (None:
        never earlier).
        """
        assert self._begins is not None
        held_up_s = 0.0
        while answering is None or not answering <= frames.keys():
            now = self._sessions.now
            remaining_s = max(self._begins + share * self._tick_s, told_at + least * self._tick_s) + held_up_s - now
            if remaining_s <= 0.0:
                # No more than waits now, so that a flood of messages keeps no tick open.
                for _ in range(self._sessions.waiting):
                    self._take_answer(0.0, frames)
                return
            look_s = min(remaining_s, LOOK_S)
            arrived = self._take_answer(look_s, frames)
            # A wait that took longer than asked for is the world's own delay, so robots get it back.
            held_up_s += self._woken_late(self._sessions.now - now - look_s)
            if not arrived:
                self.meanwhile()

    def _take_answer(self, timeout_s: float, frames: dict[int, Sequence[bytes]]) -> bool:
        """Take one answer, if one comes in time; return whether it did."""
        arrived = self._sessions.take(timeout_s)
        if arrived is not None:
            self._note_answer(*arrived, frames)
        return arrived is not None

    def _woken_late(self, late_s: float) -> float:
        """Count a wait that took so much longer than it should; return the time that robots get back for it, s."""
        if late_s <= WAKING_S:
            return 0.0
        # At most a step, or a machine that stands still would stretch one tick without end.
        credit = min(late_s, max(0.0, self._tick_s - self._held_up_s))
        self._held_up_s += credit
        self.held_up_s += credit
        self.longest_held_up_s = max(self.longest_held_up_s, self._held_up_s)
        return credit

    def _note_answer(self, number: int, answer: ReplyA | ReplyB, frames: dict[int, Sequence[bytes]]) -> None:
        if isinstance(answer, ReplyA):
            # Once phase B is put together, a frame reaches no robot any more.
            if answer.k == self._k and not self._closed:
                frames[number] = answer.frames
            else:
                self.too_late[number] += len(answer.frames)
        # The newest tick wins, in whatever order commands come.
        elif number not in self._commands or answer.k >= self._commands[number].k:
            self._commands[number] = answer
