"""Viewers that ask for the fog: how many are answered at once, how often, and during a tick that is long."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from agent.build import Shared, build_mind
from fogwatch.inprocess import InProcessFleet
from patrol.exchange import FIRST_INCARNATION
from patrol.journal import JournalWriter, TickRecord
from patrol.prepare import prepare
from patrol.scenario import load_scenario
from runtime.messages.feed import read_so_far
from runtime.net.mailbox import Question
from worldsim.controls import RunState
from worldsim.fleet.loop import run_ticks
from worldsim.output.feed_publisher import Feed
from worldsim.output.record import header_of
from worldsim.world import World

# Not the product's own, so that a wrong one there is noticed.
ANSWER_S = 0.5
ANSWER_SHARE = 0.1
MOST_ASKING = 16

SMALL = {"terrain": {"builtin": "open"}, "point": 1.0, "duration": 5, "robots": 2 * [{}]}


class Asking:
    """Somebody who asks again and again."""

    def __init__(self) -> None:
        self.left = 0
        self.answers: list[bytes] = []

    def get(self, timeout_s: float = 0.0) -> tuple[str, Question] | None:  # noqa: ARG002 - it is there or it is not
        self.left -= 1
        return ("truth/fog", Question(b"", self.answer)) if self.left >= 0 else None

    def answer(self, payload: bytes) -> None:
        self.answers.append(payload)


class Watched:
    """A feed of a world in this process, with a clock of its own and work that is done when told."""

    def __init__(self, folder: Path, pace: float | None) -> None:
        self.asking, self.now = Asking(), 100.0
        self.work: deque[Callable[[], None]] = deque()
        prepared = prepare(load_scenario(SMALL))
        self.world = World(prepared)
        header = header_of(self.world)
        self.journal = JournalWriter(folder / "journal", header)
        state, post = RunState(True, pace), self.work.append
        given = self.world, self.journal, header, lambda _batch: None, self.asking
        self.feed = Feed(*given, post, lambda: self.now, lambda: state)

    def run(self, ticks: int, during: Callable[[], None]) -> None:
        """Run so many ticks; during each, call something."""
        make = partial(build_mind, Shared(self.world.prepared))
        fleet = InProcessFleet({number: make(number, FIRST_INCARNATION) for number in self.world.living}, make)
        phase_b = fleet.phase_b

        def watched_phase_b(*arguments: object) -> object:
            during()
            return phase_b(*arguments)  # type: ignore[arg-type]

        fleet.phase_b = watched_phase_b  # type: ignore[method-assign, assignment]

        def on_tick(record: TickRecord) -> None:
            self.feed.write(record)
            self.feed.between()

        run_ticks(self.world, fleet, on_tick, self.feed.write, lambda: self.world.tick >= ticks)

    def do(self) -> int:
        """Do the work that was handed over; how many pieces."""
        count = len(self.work)
        while self.work:
            self.work.popleft()()
        return count


def test_a_flood_of_questions_is_one_answer_now_and_then(tmp_path: Path) -> None:
    watched = Watched(tmp_path, None)
    with watched.journal:
        watched.asking.left = 10_000
        watched.feed.between()
        watched.feed.between()
        assert len(watched.work) == 1  # and no second one while it is at work
        assert watched.do() == 1
        assert len(watched.asking.answers) == MOST_ASKING
        watched.feed.between()
        assert watched.do() == 0
        watched.now += ANSWER_S
        watched.feed.between()
        assert watched.do() == 1


def test_answers_take_a_bounded_share_of_the_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(tmp_path, None)
    monkeypatch.setattr(watched.asking, "answer", lambda _payload: setattr(watched, "now", watched.now + 1.0))
    with watched.journal:
        watched.asking.left = 2
        watched.feed.between()
        assert watched.do() == 1  # it took 2 s
        watched.asking.left = 1
        watched.now += 2.0 / ANSWER_SHARE - 0.1
        watched.feed.between()
        assert watched.do() == 0
        watched.now += 0.2
        watched.feed.between()
        assert watched.do() == 1


@pytest.mark.parametrize(("pace", "answered"), [(0.001, 5), (None, 0), (1.0, 0)])
def test_a_long_tick_keeps_no_viewer_waiting(tmp_path: Path, pace: float | None, answered: int) -> None:
    """Between the ticks nobody asks here; in each of them somebody does."""
    watched = Watched(tmp_path, pace)
    answers: list[bytes] = []

    def during() -> None:
        watched.asking.answers.clear()
        watched.asking.left = 1
        watched.feed.during()
        watched.do()
        watched.asking.left = 0
        watched.now += 100.0
        answers.extend(watched.asking.answers)

    with watched.journal:
        watched.run(5, during)
    assert len(answers) == answered
    for k, payload in enumerate(answers):
        so_far = read_so_far(payload)
        assert len(so_far.mfow) == k
        assert int(so_far.last_seen.max()) == k - 1
        assert so_far.pace == pace
