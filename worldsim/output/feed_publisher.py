"""Publishes a run while it goes on: viewers get what the journal gets, in batches, unless they are slow.

Viewers cost the ticks one message each `BATCH_S` of wall time, which is dropped where it cannot be sent at once. A
viewer that joins late asks for the fog so far; that is copied between two ticks and packed on another thread.
"""

from __future__ import annotations

from array import array
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from patrol.changing.ground import part_of
from patrol.energy.batteries import Batteries
from patrol.journal import pack
from patrol.journal.records import Event, TickRecord
from patrol.scenario.controls import OPERATOR
from runtime.messages.feed import Batch, Ground, SoFar, batch_bytes, so_far_bytes, thinned

if TYPE_CHECKING:
    from patrol.journal import JournalWriter
    from patrol.journal.records import Header, Record
    from patrol.prepare import Prepared
    from runtime.net.mailbox import Question
    from worldsim.controls import RunState
    from worldsim.mailbox import Mailbox
    from worldsim.world import World

BATCH_S = 0.05
"""Wall time between two batches, s."""
BATCH_BYTES = 1 << 15
"""A batch of this size is sent at once: what fits into one piece is dropped without delay where it must be."""
ANSWER_S = 0.5
"""Least wall time between two answers, s; all viewers that ask meanwhile share the next."""
ANSWER_SHARE = 0.1
"""The greatest share of the time in which an answer is packed and sent."""
MOST_ASKING = 16
"""Viewers that share an answer; those beyond ask again."""
LONG_TICK_S = 1.0
"""Wall time of a tick during which viewers are answered as well, s."""
MOST_EVENTS = 2000
MOST_POINTS = 5000
"""Events and points of the curves that an answer holds at most."""


class Feed:
    """A `worldsim.run_record.Writer` that passes records on to a journal and to viewers."""

    def __init__(
        self,
        world: World,
        journal: JournalWriter,
        header: Header,
        post: Callable[[bytes], None],
        questions: Mailbox[Question],
        submit: Callable[[Callable[[], None]], None],
        now: Callable[[], float],
        state: Callable[[], RunState],
    ) -> None:
        """Publish a run."""
        self._world = world
        self._journal = journal
        self._post = post
        self._questions = questions
        self._submit = submit
        self._now = now
        self._run_state = state
        self._said = state()
        self._header = pack(header)
        self._ground = ground_of(world.prepared)
        self._number = 1
        self._waiting: list[bytes] = []
        self._size = 0
        self._due = self._answer_due = 0.0
        self._last: bytes | None = None
        self._batteries = Batteries(world.scenario.roster, world.scenario.docks, world.scenario.step)
        self._events: deque[bytes] = deque(maxlen=MOST_EVENTS)
        self._happened = 0
        self._asked: list[bytes] = []
        self._ground_events: dict[str, bytes] = {}
        self._mfow, self._fog_mean = array("f"), array("f")
        self._asking: list[Question] = []
        self._answering = False
        self._before: SoFar | None = None
        """The run before the tick that is under way, if that is long."""
        self._kept_at = 0.0
        self._keep_state()

    def write(self, record: Record) -> None:
        """Write a record to the journal, and send a batch when one is due."""
        payload = pack(record)
        self._journal.append(payload)
        self._number += 1
        self._waiting.append(payload)
        self._size += len(payload)
        if isinstance(record, TickRecord):
            self._last = payload
            self._batteries.tick(record.robots)
            self._mfow.append(record.mfow)
            self._fog_mean.append(record.fog_mean)
        elif isinstance(record, Event):
            self._events.append(payload)
            self._happened += 1
            if record.kind == OPERATOR:
                self._asked.append(payload)
            elif name := part_of(record):
                # Of each part of the ground only the latest event: it says whether the part is closed now.
                self._ground_events[name] = payload
        if self._size >= BATCH_BYTES or self._now() >= self._due:
            self.flush()

    def between(self) -> None:
        """Between two ticks: answer viewers that have asked for the fog."""
        self._keep_state()
        self._answer_questions(self._so_far)

    def during(self) -> None:
        """While a tick is waited for: send what there is, and answer viewers with the fog before it, if it is long."""
        if self._waiting or self._run_state() != self._said:
            self.flush()
        before, state = self._before, self._run_state()
        if before is None and self._now() >= self._kept_at + LONG_TICK_S:
            # Looks of this tick may be in the fog already; the viewer takes them in with its record.
            so_far = self._so_far()
            seen = np.minimum(so_far.last_seen, max(self._world.tick - 1, -1))
            before = self._before = replace(so_far, last_seen=seen)
        if before is not None:
            self._answer_questions(lambda: replace(before, running=state.running, pace=state.pace))

    def rest(self) -> None:
        """Send what there is while no tick is due, so that viewers need not wait for it."""
        if self._waiting or self._run_state() != self._said:
            self.flush()
        self.between()

    def _keep_state(self) -> None:
        pace, self._kept_at = self._run_state().pace, self._now()
        self._before = self._so_far() if pace is not None and self._world.step >= LONG_TICK_S * pace else None

    def _answer_questions(self, so_far: Callable[[], SoFar]) -> None:
        while len(self._asking) < MOST_ASKING and (arrived := self._questions.get()) is not None:
            self._asking.append(arrived[1])
        if not self._asking or self._answering or self._now() < self._answer_due:
            return
        # All who have asked so far share one answer: packing it takes long.
        asking, self._asking = self._asking, []
        answer = so_far()
        self._answering = True

        def work() -> None:
            began = self._now()
            try:
                payload = so_far_bytes(answer)
                for question in asking:
                    question.answer(payload)
            finally:
                ended = self._now()
                # The longer it took, the longer the pause.
                self._answer_due = ended + max(ANSWER_S, (ended - began) / ANSWER_SHARE)
                self._answering = False

        self._submit(work)

    def flush(self) -> None:
        """Send what there is."""
        records, self._waiting = tuple(self._waiting), []
        self._size = 0
        self._due = self._now() + BATCH_S
        self._said = self._run_state()
        self._post(batch_bytes(Batch(self._number - len(records), records, self._said.running, self._said.pace)))

    def _so_far(self) -> SoFar:
        # Rounded up, so that no more than `MOST_POINTS` values are left.
        every = -(-max(len(self._mfow), 1) // MOST_POINTS)
        state = self._run_state()
        return SoFar(
            number=self._number,
            header=self._header,
            last=self._last,
            last_seen=self._world.truth.fog.last_seen.copy(),
            events=tuple(self._events),
            event=self._happened - len(self._events),
            asked=(*self._asked, *self._ground_events.values()),
            every=every,
            mfow=thinned(self._mfow, every),
            fog_mean=thinned(self._fog_mean, every),
            running=state.running,
            pace=state.pace,
            charge=self._batteries.shares,
            ground=self._ground,
        )


def ground_of(prepared: Prepared) -> Ground:
    """Return the grids of a prepared scenario, for viewers."""
    # By identity: robots of one kind share their fields.
    areas = {id(fields): fields.patrolled for fields in prepared.fields.values()}
    places = {key: index for index, key in enumerate(areas)}
    area_of = {number: places[id(fields)] for number, fields in prepared.fields.items()}
    return Ground(prepared.terrain.passable, prepared.terrain.keep_out, tuple(areas.values()), area_of)
