"""The two transcripts of an exchange: they agree as long as nobody else has put in a message."""

from __future__ import annotations

import pickle

import pytest

from patrol.security.transcripts import (
    DIGEST,
    LAST,
    LINES,
    MAX_LINES,
    MAX_REPLIES,
    MAX_SPANS,
    MAX_TICKS,
    PHASE_A,
    PHASE_B,
    REPLY_A,
    REPLY_B,
    Line,
    RobotTranscript,
    WorldTranscript,
    as_notes,
    digest_of,
)

PHASES, REPLIES = (PHASE_A, PHASE_B), (REPLY_A, REPLY_B)


def digest(k: int, place: int, what: str = "") -> bytes:
    return digest_of(b"%d %d " % (k, place) + what.encode())


class Exchange:
    """A robot and a world that write down what they do; each message can be lost, or put in by somebody else."""

    def __init__(self) -> None:
        self.robot = RobotTranscript()
        self.world = WorldTranscript()

    def tick(
        self,
        k: int,
        *,
        lost: tuple[int, ...] = (),
        late: tuple[int, ...] = (),
        forged_to_robot: int | None = None,
        forged_to_world: int | None = None,
    ) -> None:
        for place in PHASES:
            self.world.sent(k, place, digest(k, place))
            if place not in lost:
                self.robot.note(k, place, digest(k, place, "forged" if place == forged_to_robot else ""))
        for place in REPLIES:
            if place not in lost:
                self.robot.note(k, place, digest(k, place))
            if place == forged_to_world:
                self.world.acted_on(k, place, digest(k, place, "forged"))
            elif place not in lost and place not in late:
                self.world.acted_on(k, place, digest(k, place))

    def report(self, until: int) -> None:
        for since, complete, lines in self.robot.report(until):
            self.world.compare(since, complete, lines)

    @property
    def apart(self) -> list[tuple[int, int]]:
        """Ticks of the reports that differ."""
        return [(span.first, span.last) for span in self.world.spans if not span.agrees]


def run(ticks: int, **forged: int | None) -> Exchange:
    """Tick 20 is forged; reports as a robot sends them."""
    exchange = Exchange()
    for k in range(ticks):
        if exchange.robot.due:
            exchange.report(k - 1)
        exchange.tick(k, **(forged if k == 20 else {}))  # type: ignore[arg-type]
    exchange.report(LAST)
    return exchange


def test_an_exchange_of_two_agrees_throughout() -> None:
    exchange = run(100)
    (span,) = exchange.world.spans
    assert span.agrees
    assert (span.first, span.last, exchange.world.messages) == (0, 99, 400)
    assert span.phases[0]
    assert span.replies[0]


@pytest.mark.parametrize("place", PHASES)
def test_a_phase_that_the_world_has_not_sent_is_found(place: int) -> None:
    exchange = run(100, forged_to_robot=place)
    assert exchange.apart == [(16, 31)]
    (span,) = (span for span in exchange.world.spans if not span.agrees)
    assert span.phases[0] != span.phases[1]
    assert span.replies[0] == span.replies[1]


@pytest.mark.parametrize("place", REPLIES)
def test_a_reply_that_the_robot_has_not_sent_is_found(place: int) -> None:
    exchange = run(100, forged_to_world=place)
    assert exchange.apart == [(16, 31)]
    (span,) = (span for span in exchange.world.spans if not span.agrees)
    assert span.phases[0] == span.phases[1]
    assert span.replies[0] != span.replies[1]


@pytest.mark.parametrize("place", REPLIES)
def test_a_reply_to_a_tick_that_the_robot_has_missed_is_found(place: int) -> None:
    exchange = Exchange()
    for k in range(6):
        exchange.tick(k, lost=(*PHASES, *REPLIES) if k == 3 else (), forged_to_world=place if k == 3 else None)
    exchange.report(5)
    assert exchange.apart == [(0, 5)]


def test_a_reply_to_the_last_tick_is_found_even_if_the_robot_never_got_so_far() -> None:
    exchange = Exchange()
    for k in range(4):
        exchange.tick(k)
    exchange.world.acted_on(9, REPLY_B, digest(9, REPLY_B))
    exchange.report(3)
    assert exchange.apart == []
    exchange.report(LAST)
    assert exchange.apart == [(9, 9)]


def test_what_is_lost_or_too_late_makes_no_difference() -> None:
    exchange = Exchange()
    for k in range(40):
        lost = {3: (PHASE_B,), 5: (PHASE_A, *REPLIES), 7: (PHASE_A, PHASE_B, *REPLIES), 30: REPLIES}.get(k, ())
        exchange.tick(k, lost=lost, late={9: (REPLY_A,), 11: REPLIES}.get(k, ()))
        if exchange.robot.due:
            exchange.report(k)
    exchange.report(LAST)
    assert exchange.apart == []


def test_a_command_that_was_withdrawn_later_agrees_too() -> None:
    exchange = Exchange()
    exchange.tick(4)
    exchange.report(4)
    exchange.robot.note(4, REPLY_B, digest(4, REPLY_B, "still"))
    exchange.world.acted_on(4, REPLY_B, digest(4, REPLY_B, "still"))
    exchange.tick(5)
    exchange.robot.note(5, REPLY_B, digest(5, REPLY_B, "still"))
    exchange.world.acted_on(5, REPLY_B, digest(5, REPLY_B, "still"))
    exchange.world.acted_on(5, REPLY_B, digest(5, REPLY_B, "still"))  # the world takes it twice
    exchange.report(LAST)
    assert exchange.apart == []


@pytest.mark.parametrize("until", [4, 5, LAST])
@pytest.mark.parametrize("phases", [(b"", b""), (digest(4, PHASE_A), digest(4, PHASE_B))])
@pytest.mark.parametrize("first", ["robot", "forger"])
def test_a_forged_report_hides_nothing_because_the_robots_own_comes_too(
    until: int, phases: tuple[bytes, bytes], first: str
) -> None:
    exchange = Exchange()
    exchange.tick(4, forged_to_world=REPLY_B)
    if first == "robot":
        exchange.report(LAST)
    exchange.world.compare(0, until, [Line(4, (*phases, digest(4, REPLY_A), digest(4, REPLY_B, "forged")))])
    if first == "forger":
        assert exchange.apart == []
        exchange.report(LAST)
    assert exchange.apart == [(4, 4)]


def test_a_robot_that_never_reports_takes_a_bounded_memory() -> None:
    exchange = Exchange()
    sizes = []
    for k in range(3 * MAX_TICKS):
        exchange.tick(k)
        sizes.append(len(pickle.dumps(exchange.world)))
    assert sizes[-1] <= 1.05 * sizes[MAX_TICKS]


def test_forged_replies_without_end_take_a_bounded_memory_and_are_found() -> None:
    exchange, bounded = Exchange(), Exchange()
    for one, ticks, replies in ((exchange, 3 * MAX_TICKS, 20), (bounded, MAX_TICKS, MAX_REPLIES)):
        one.tick(0)
        for k in range(ticks):
            for number in range(replies):
                one.world.acted_on(k, REPLY_B, digest(k, REPLY_B, f"forged {number}"))
    assert len(pickle.dumps(exchange.world)) <= 1.05 * len(pickle.dumps(bounded.world))
    exchange.report(LAST)
    (span,) = exchange.world.spans
    assert not span.agrees
    assert span.last == 3 * MAX_TICKS - 1


def test_what_the_world_has_forgotten_is_not_compared_but_counted() -> None:
    exchange = Exchange()
    for k in range(MAX_TICKS + 8):
        exchange.tick(k)
    exchange.report(LAST)
    assert exchange.apart == []
    assert exchange.world.messages == 4 * MAX_TICKS
    assert exchange.world.missed == 2 * 8


def test_there_are_only_so_many_spans_and_each_difference_stays_one() -> None:
    exchange = Exchange()
    for k in range(4 * LINES * MAX_SPANS):
        exchange.tick(k, forged_to_world=REPLY_B if k // LINES % 2 else None)
        if k % LINES == LINES - 1:
            exchange.report(k)
    spans = exchange.world.spans
    assert len(spans) == MAX_SPANS
    assert [span.agrees for span in spans] == [True, False] * (MAX_SPANS // 2)
    assert (spans[-1].first, spans[-1].last) == (LINES * (MAX_SPANS - 1), 4 * LINES * MAX_SPANS - 1)


def test_a_report_that_is_lost_makes_no_difference_but_is_counted() -> None:
    exchange = Exchange()
    for k in range(30):
        exchange.tick(k)
        if k == 9:
            exchange.report(k)
        if k == 19:
            assert exchange.robot.report(k)  # posted while the router was down
    exchange.robot.note(19, REPLY_B, digest(19, REPLY_B, "still"))
    exchange.world.acted_on(19, REPLY_B, digest(19, REPLY_B, "still"))
    exchange.report(LAST)
    assert exchange.apart == []
    assert exchange.world.missed == 2 * 10
    assert exchange.world.messages == 4 * 20 + 1


def test_a_long_report_comes_in_pieces_each_complete_as_far_as_it_says() -> None:
    exchange = Exchange()
    for k in range(60):
        exchange.tick(k)
    pieces = exchange.robot.report(59)
    ends = [MAX_LINES - 1, 2 * MAX_LINES - 1, 59]
    assert [(since, complete) for since, complete, _ in pieces] == list(
        zip([0, *(e + 1 for e in ends)], ends, strict=False)
    )
    for since, complete, lines in pieces:
        exchange.world.compare(since, complete, lines)
    assert exchange.apart == []
    assert exchange.world.messages == 240


def test_notes_hold_both_accounts_of_each_process() -> None:
    exchange = run(30)
    (span,) = exchange.world.spans
    (note,) = as_notes({(2, 1): exchange.world})
    assert note == {
        "robot": 2,
        "incarnation": 1,
        "asked": 29,
        "messages": 120,
        "missed": 0,
        "closed": True,
        "spans": [[0, 29, *span.phases, *span.replies]],
    }
    assert len(digest(1, 1)) == DIGEST
