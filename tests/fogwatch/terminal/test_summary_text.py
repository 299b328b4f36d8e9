"""The lines in which a run's summary is printed."""

import io
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from fogwatch.terminal.summary_text import measures, print_files, print_summary
from patrol.summary.model import (
    CheckFacts,
    Deadlines,
    DirectFacts,
    Messages,
    RobotFigures,
    Stalest,
    Stalests,
    Summary,
    VerdictFacts,
)

SIGHT = "all ground stays in sight, so no robot has to move; give --sensor-range if the sensor sees less"


@pytest.mark.parametrize(
    ("late_s", "seen_share", "said"),
    [(0.0, 1.0, True), (0.1, 1.0, False), (0.0, 0.19, False)],  # the last one: a run that ended at its first tick
)
def test_a_fleet_that_had_nothing_to_do_is_named(late_s: float, seen_share: float, said: bool) -> None:
    lines = measures(Summary(ticks=9, mfow_mean_s=0.2, mfow_late_mean_s=late_s, mfow_max_s=1.0, seen_share=seen_share))
    assert (SIGHT in " ".join(lines)) is said


@pytest.mark.parametrize(
    ("share", "lines"), [(None, []), (0.934, ["planned     93.4 % of the time on patrol; else robots chose freely"])]
)
def test_the_share_of_planned_time_is_named_where_there_is_a_plan(share: float | None, lines: list[str]) -> None:
    summary = Summary(ticks=9, mfow_mean_s=0.2, mfow_max_s=1.0, planned_share=share)
    assert [line for line in measures(summary) if line.startswith("planned")] == lines


def printed(summary: Summary, folder: Path) -> list[str]:
    text = io.StringIO()
    console = Console(file=text, width=100)
    print_summary(console, summary)
    print_files(console, folder)
    return text.getvalue().splitlines()


SEEN: dict[str, Any] = {"name": "five", "simulated_s": 60.0, "ticks": 120, "ended": "completed"}
SEEN |= {"mfow_late_mean_s": 1.0}


def told(**facts: Any) -> Summary:
    return Summary(**(SEEN | facts))


@pytest.mark.parametrize(
    ("robots", "listed", "more"), [(40, 40, ""), (41, 40, "and 1 more robots, which are in summary.json")]
)
def test_up_to_forty_robots_are_listed(robots: int, listed: int, more: str, tmp_path: Path) -> None:
    fleet = {f"r{n}": RobotFigures(status="alive") for n in range(robots)}
    lines = printed(told(robots=fleet), tmp_path)
    assert sum(line.startswith("r") and "alive" in line for line in lines) == listed
    assert [line for line in lines if line.startswith("and ")] == ([more] if more else [])


@pytest.mark.parametrize(("warnings", "more"), [(20, []), (21, ["  1 more warnings are in summary.json"])])
def test_up_to_twenty_warnings_are_listed(warnings: int, more: list[str], tmp_path: Path) -> None:
    verdict = VerdictFacts(outcome="valid", valid=True, warnings=[f"w{n}" for n in range(warnings)], checks=[])
    lines = printed(told(verdict=verdict), tmp_path)
    assert [line for line in lines if line.startswith("  warning: ")] == [f"  warning: w{n}" for n in range(20)]
    assert [line for line in lines if "more warnings" in line] == more


def test_checks_that_failed_or_could_not_be_judged_are_listed_and_those_that_passed_counted(tmp_path: Path) -> None:
    checks = [
        CheckFacts(name="one", ok=True, detail="fine"),
        CheckFacts(name="two", ok=True, detail="unknown", judged=False),
        CheckFacts(name="three", ok=True, detail="fine"),
    ]
    lines = printed(told(verdict=VerdictFacts(outcome="valid", valid=True, checks=checks)), tmp_path)
    assert "verdict     valid: 2 checks passed" in lines
    assert [line for line in lines if line.startswith("  ")] == ["  two: unknown"]
    failed = VerdictFacts(outcome="invalid", checks=[*checks, CheckFacts(name="four", ok=False, detail="a hole")])
    lines = printed(told(verdict=failed), tmp_path)
    assert "verdict     invalid" in lines
    assert [line for line in lines if line.startswith("  ")] == ["  two: unknown", "  four: a hole"]


def test_each_robot_has_its_own_numbers_in_a_row(tmp_path: Path) -> None:
    fleet = {
        "r1": RobotFigures(
            status="paused",
            distance_m=12.6,
            dead_end_share=0.125,
            collisions=3,
            decisions=456,
            decision_ms_p50=7.04,
            decision_ms_p99=8.06,
        ),
        "r2": RobotFigures(status="alive"),
        "r3": RobotFigures(status="absent"),
    }
    lines = [line.split() for line in printed(told(robots=fleet), tmp_path)]
    assert ["r1", "paused", "13", "12.5", "3", "456", "7.0", "8.1"] in lines
    assert ["r2", "alive", "0", "0.0", "0", "0", "-", "-"] in lines
    assert not [line for line in lines if line[:1] == ["r3"]]


@pytest.mark.parametrize(
    ("facts", "line"),
    [
        ({}, "five: 60 s in 120 ticks"),
        ({"ended": "stopped"}, "five: 60 s in 120 ticks, stopped"),
        ({"ended": None}, "five: 60 s in 120 ticks, cut off"),
        (
            {"wall_s": 65.4, "realtime_factor": 0.917},
            "five: 60 s in 120 ticks; 1 min 05 s of wall time, 0.9 x real time",
        ),
    ],
)
def test_the_first_line_says_how_long_it_was_and_how_it_ended(facts: dict[str, Any], line: str) -> None:
    assert measures(told(**facts))[0] == line


@pytest.mark.parametrize(
    ("messages", "direct", "lines"),
    [
        (
            {"frames": 9, "bytes_per_robot_s": 3.6, "sent": 18, "delivered": 12, "dropped": 5, "rejected": 2},
            None,
            ["messages    9 sent, 4 bytes per robot per second", "received    12 of 18, 5 dropped, 2 rejected"],
        ),
        (
            {"frames": 9, "sent": 18, "delivered": 12, "dropped": 5, "rejected": 2, "in_flight": 1},
            None,
            [
                "messages    9 sent, 0 bytes per robot per second",
                "received    12 of 18, 5 dropped, 2 rejected, 1 under way at the end",
            ],
        ),
        (
            {"frames": 9, "sent": 16, "delivered": 12, "rejected": 2},
            DirectFacts(heard_share=0.7512),
            [
                "messages    9 sent, 0 bytes per robot per second",
                "received    12 of 16 (75.1 %) by direct radio, 2 rejected",
            ],
        ),
        (
            {"frames": 9, "sent": 16, "delivered": 12, "rejected": 2},
            DirectFacts(),
            ["messages    9 sent, 0 bytes per robot per second", "received    12 of 16 by direct radio, 2 rejected"],
        ),
    ],
)
def test_messages_are_told_by_their_fate(
    messages: dict[str, Any], direct: DirectFacts | None, lines: list[str]
) -> None:
    summary = told(messages=Messages(**messages), **({} if direct is None else {"direct": direct}))
    assert [line for line in measures(summary) if line.startswith(("messages", "received"))] == lines


def test_deadlines_are_summed_over_robots() -> None:
    late = Deadlines(
        late_frames={"a": 1, "b": 2}, too_late={"a": 4, "b": 5}, late_commands={"a": 7, "b": 8}, slipped_s=1.0
    )
    assert "deadlines   missed by 15 commands and 3 frames; 9 of them came too late" in measures(told(deadlines=late))
    assert not [line for line in measures(told(deadlines=late)) if "held up" in line]
    held = late.model_copy(update={"held_up_s": 2.345, "longest_held_up_s": 0.456})
    line = "            moved by 2.35 s while the world was held up, 0.46 s at most in one tick"
    assert line in measures(told(deadlines=held))


def test_the_stalest_places_are_told_in_order() -> None:
    worst = Stalest(x=1.26, y=2.34, age_s=7.5, at_s=20.0, seen=False, nearest="r2", nearest_m=3.6)
    end = Stalest(x=5.0, y=6.0, age_s=8.25, at_s=60.0, seen=True, nearest=None, nearest_m=None)
    (line,) = (line for line in measures(told(stalest=Stalests(worst=worst, end=end))) if line.startswith("stalest"))
    assert line == (
        "stalest     over the run (1.3, 2.3), 7.5 s at 20 s, never seen until then, nearest robot r2 4 m away; "
        "at the end (5.0, 6.0), 8.25 s at 60 s"
    )


def test_ratios_are_to_tour_and_bound() -> None:
    settled = {"mfow_mean_s": 30.0, "bound_s": 8.0, "best_tour_s": 15.0, "seen_share": 1.0}
    assert "bounds      best tour found 15.0 s, ratio 2.00; lower bound 8.0 s, ratio 3.75" in measures(told(**settled))
    short = settled | {"simulated_s": 59.9}  # four times the tour is 60 s
    assert "bounds      best tour found 15.0 s; lower bound 8.0 s, ratio 3.75" in measures(told(**short))
