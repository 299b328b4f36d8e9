from typing import Any

import pytest

from monitor.observation.hearing import ENOUGH, Hearing
from runtime.messages.telemetry import Traffic

ALL = ("anna", "bert", "carl")


class Fleet:
    """Three robots; all are heard here, and each hears the others but for those it is said not to hear."""

    def __init__(self) -> None:
        self.hearing = Hearing()
        self.counts = {name: dict.fromkeys(set(ALL) - {name}, 0) for name in ALL}

    def tick(self, deaf: dict[str, str] | None = None, senders: tuple[str, ...] = ALL, incarnation: int = 0) -> None:
        for sender in senders:
            self.hearing.sent(sender)
        for robot, heard in self.counts.items():
            for sender in heard:
                heard[sender] += sender in senders and (deaf or {}).get(robot) != sender
            self.hearing.take(robot, Traffic(incarnation, 0, dict(heard), 0, False))

    def wrong(self, present: tuple[str, ...] = ALL) -> list[str]:
        return [self.hearing.wrong(name, present) for name in ALL]

    def ticks(self, count: int, deaf: dict[str, str] | None = None, **more: Any) -> None:
        for _ in range(count):
            self.tick(deaf, **more)


def test_a_robot_that_reports_none_of_many_frames_does_not_hear_their_sender() -> None:
    fleet = Fleet()
    fleet.ticks(3 * ENOUGH)
    assert fleet.wrong() == ["", "", ""]
    fleet.ticks(ENOUGH - 1, {"anna": "carl"})
    assert fleet.wrong() == ["", "", ""]
    fleet.tick({"anna": "carl"})
    assert fleet.wrong() == ["does not hear carl", "", ""]
    assert fleet.wrong(("anna", "bert")) == ["", "", ""], "carl has gone"
    fleet.tick()
    assert fleet.wrong() == ["", "", ""]


def test_who_sends_nothing_is_not_missed_and_a_report_that_is_late_says_nothing() -> None:
    fleet = Fleet()
    fleet.ticks(3 * ENOUGH, senders=("anna", "bert"))
    for _ in range(3 * ENOUGH):
        fleet.hearing.sent("bert")
    assert fleet.wrong() == ["", "", ""]
    fleet.hearing.take("carl", None)
    assert fleet.wrong() == ["", "", ""]


def test_counts_begin_anew_with_a_robot_s_next_process() -> None:
    fleet = Fleet()
    fleet.ticks(3 * ENOUGH)
    fleet.counts = {name: dict.fromkeys(heard, 0) for name, heard in fleet.counts.items()}
    fleet.ticks(ENOUGH, {"anna": "carl"}, incarnation=1)
    assert fleet.wrong() == ["", "", ""]
    fleet.tick({"anna": "carl"}, incarnation=1)
    assert fleet.wrong() == ["does not hear carl", "", ""]


@pytest.mark.parametrize(("unheard", "suffix"), [(8, ""), (9, ", ...")])
def test_up_to_eight_senders_are_named_in_order(unheard: int, suffix: str) -> None:
    hearing, names = Hearing(), [f"s{n}" for n in range(unheard)]
    for _ in range(2 * ENOUGH):
        for name in names:
            hearing.sent(name)
        hearing.take("anna", Traffic(0, 0, dict.fromkeys(reversed(names), 0), 0, False))
    assert hearing.wrong("anna", names) == f"does not hear {', '.join(names[:8])}{suffix}"
    assert hearing.wrong("bert", names) == ""


def test_a_frame_that_is_heard_in_the_end_begins_the_count_anew() -> None:
    fleet = Fleet()
    fleet.ticks(ENOUGH, {"anna": "carl"})
    fleet.tick()
    fleet.ticks(ENOUGH - 1, {"anna": "carl"})
    assert fleet.wrong() == ["", "", ""]
    fleet.tick({"anna": "carl"})
    assert fleet.wrong() == ["does not hear carl", "", ""]
