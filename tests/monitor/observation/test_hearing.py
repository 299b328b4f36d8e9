from __future__ import annotations

from monitor.observation.hearing import ENOUGH, Hearing
from patrol.messages.telemetry import Traffic

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


def test_a_robot_that_reports_none_of_many_frames_does_not_hear_their_sender() -> None:
    fleet = Fleet()
    for _ in range(3 * ENOUGH):
        fleet.tick()
    assert fleet.wrong() == ["", "", ""]
    for _ in range(ENOUGH - 1):
        fleet.tick({"anna": "carl"})
    assert fleet.wrong() == ["", "", ""]
    fleet.tick({"anna": "carl"})
    assert fleet.wrong() == ["does not hear carl", "", ""]
    assert fleet.wrong(("anna", "bert")) == ["", "", ""], "carl has gone"
    fleet.tick()
    assert fleet.wrong() == ["", "", ""]


def test_who_sends_nothing_is_not_missed_and_a_report_that_is_late_says_nothing() -> None:
    fleet = Fleet()
    for _ in range(3 * ENOUGH):
        fleet.tick(senders=("anna", "bert"))
    for _ in range(3 * ENOUGH):
        fleet.hearing.sent("bert")
    assert fleet.wrong() == ["", "", ""]
    fleet.hearing.take("carl", None)
    assert fleet.wrong() == ["", "", ""]


def test_counts_begin_anew_with_a_robot_s_next_process() -> None:
    fleet = Fleet()
    for _ in range(3 * ENOUGH):
        fleet.tick()
    fleet.counts = {name: dict.fromkeys(heard, 0) for name, heard in fleet.counts.items()}
    for _ in range(ENOUGH):
        fleet.tick({"anna": "carl"}, incarnation=1)
    assert fleet.wrong() == ["", "", ""]
    fleet.tick({"anna": "carl"}, incarnation=1)
    assert fleet.wrong() == ["does not hear carl", "", ""]
