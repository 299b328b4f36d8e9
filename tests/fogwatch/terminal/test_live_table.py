import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from fogwatch.terminal import live_table
from fogwatch.terminal.summary_text import measures, print_files, print_summary
from patrol.journal import Status
from patrol.summary.model import Summary
from runtime.messages.telemetry import FREE, TRAPPED, Metrics, Notice, RobotView

ROBOTS = (RobotView("anna", 1, "patrolling", 1.0, 2.0, 0.0), RobotView("bert", 4, "", 3.0, 4.0, 0.0))
METRICS = Metrics(120, 600, 60.0, 20.0, 12.5, 30.0, 0.75, 40.0, ROBOTS)
WORST = {"x": 1.5, "y": 2.0, "age_s": 90.0, "at_s": 250.0, "seen": True, "nearest": "anna", "nearest_m": 7.1}
AT_END = {"x": 3.0, "y": 4.0, "age_s": 50.0, "at_s": 300.0, "seen": True, "nearest": None, "nearest_m": None}
ANNA = {"status": "alive", "distance_m": 100.0, "dead_end_share": 0.05, "collisions": 2, "decisions": 600}
BERT = {"status": "lost", "distance_m": 10.0, "dead_end_share": 0.0, "collisions": 0, "decisions": 0}
LATE = {"late_frames": {"anna": 1}, "too_late": {"anna": 1}, "late_commands": {"anna": 2, "bert": 3}, "slipped_s": 0.0}
MESSAGES = {"frames": 5, "sent": 10, "delivered": 8, "dropped": 1, "in_flight": 1, "rejected": 0}
NOBODY_LOST = {"name": "nobody lost", "ok": False, "detail": "bert", "judged": True}
SUMMARY: dict[str, Any] = {"name": "five", "simulated_s": 300.0, "ticks": 600, "ended": "completed", "wall_s": 100.0}
SUMMARY |= {"realtime_factor": 3.0, "mfow_mean_s": 60.0, "mfow_max_s": 90.0, "fog_mean_s": 20.0, "bound_s": 40.0}
SUMMARY |= {"best_tour_s": 48.0, "seen_share": 1.0, "patrolled_area_m2": 8800.0, "deadlines": LATE}
SUMMARY |= {"stalest": {"worst": WORST, "end": AT_END}, "messages": {**MESSAGES, "bytes_per_robot_s": 56.0}}
SUMMARY["robots"] = {
    "anna": {**ANNA, "decision_ms_p50": 12.0, "decision_ms_p99": 20.0},
    "bert": {**BERT, "decision_ms_p50": None, "decision_ms_p99": None},
}
SUMMARY["trace_hash"] = "0123456789abcdef" * 4
SUMMARY["verdict"] = {"outcome": "invalid", "valid": False, "checks": [NOBODY_LOST]}


def summary(**changed: Any) -> Summary:
    return Summary.model_validate({**SUMMARY, **changed})


def printed(of: Summary, folder: Path, width: int = 80) -> str:
    text = io.StringIO()
    console = Console(file=text, width=width)
    print_summary(console, of)
    print_files(console, folder)
    return text.getvalue()


class Terminal(live_table.LiveTable):
    """A live table, and what it has written."""

    def __init__(self) -> None:
        self.text = io.StringIO()
        super().__init__(Console(file=self.text, force_terminal=True, width=120, color_system=None))

    def shown(self) -> str:
        self.close()
        return self.text.getvalue()


def test_one_line_says_how_far_and_how_fast() -> None:
    assert live_table.headline(METRICS) == (
        "tick 120/600 (60 s); MFoW 20.0 s, mean 12.5 s; seen 75.0 %; 1/2 robots (1 lost); 40.0 ticks/s, "
        "20.0 x real time; 12 s to go"
    )
    assert "; MFoW 20.0 s at (26.3, 9.7), mean 12.5 s; " in live_table.headline(
        replace(METRICS, stalest=(26.31, 9.667))
    )


def test_plain_lines_come_now_and_then() -> None:
    text = io.StringIO()
    plain = live_table.PlainDisplay(Console(file=text, width=80))
    for _ in range(3):
        plain.metrics(METRICS)
    plain.notice(Notice(120, "lost", "bert", "no answer [for 10 s]"))
    plain.close()
    assert text.getvalue().splitlines() == [live_table.headline(METRICS), "tick 120: bert lost: no answer [for 10 s]"]


def test_plain_lines_say_how_far_the_steps_of_the_end_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """One when a step begins, others now and then, and none for its end."""
    now = [0.0]
    monkeypatch.setattr("fogwatch.terminal.live_table.time.monotonic", lambda: now[0])
    text = io.StringIO()
    plain = live_table.PlainDisplay(Console(file=text, width=80))
    for now[0], step, share in (
        (0.0, "writing a", None),
        (1.0, "writing b", 0.0),
        (2.0, "writing a", 0.2),
        (6.0, "writing a", 0.4),
        (6.5, "writing b", None),
        (12.0, "writing a", 1.0),
    ):
        plain.progress(step, share)
    assert text.getvalue().splitlines() == ["writing a ...", "writing b ...", "writing a: 40 %", "writing b ..."]


def test_a_terminal_gets_a_bar_for_each_step_of_the_end() -> None:
    table = Terminal()
    table.metrics(METRICS)
    table.progress("writing a", 0.5)
    table.progress("writing b")
    shown = table.shown()
    assert "writing a" in shown
    assert "writing b" in shown
    table = Terminal()
    table.progress("writing a", 1.0)
    assert "writing a" not in table.shown()


def test_a_terminal_gets_a_table_of_the_robots() -> None:
    table = Terminal()
    table.close()
    table.metrics(METRICS)
    table.say("[news]")
    table.close()
    shown = table.shown()
    for words in ("anna", "patrolling", "bert", "lost", "[news]", "tick 120/600"):
        assert words in shown


def test_the_line_after_a_long_table_widens_no_column(tmp_path: Path) -> None:
    """At 80 columns a row of this length would break the heads of all columns."""
    fleet = {f"r{number}": SUMMARY["robots"]["anna"] for number in range(1, 61)}
    lines = printed(summary(robots=fleet), tmp_path).splitlines()
    head = next(number for number, line in enumerate(lines) if line.startswith("robot"))
    heads = "robot status driven m dead ends % collisions decisions p50 ms p99 ms"
    assert " ".join(lines[head].split()) == heads
    assert lines[head + 1].split()[:2] == ["r1", "alive"]
    assert lines[head + 40].split()[0] == "r40"
    assert lines[head + 41] == "and 20 more robots, which are in summary.json"


def test_robots_that_never_came_are_not_listed(tmp_path: Path) -> None:
    absent = {**SUMMARY["robots"]["bert"], "status": "absent"}
    assert "absent" not in printed(summary(robots={**SUMMARY["robots"], "zoe": absent}), tmp_path)
    views = (*METRICS.robots, RobotView("zoe", Status.ABSENT, "", 0.0, 0.0, 0.0))
    table = Terminal()
    table.metrics(replace(METRICS, robots=views))
    assert "zoe" not in table.shown()
    assert "1/2 robots (1 lost)" in live_table.headline(replace(METRICS, robots=views))


def test_who_sends_with_nobody_to_hear_it_sends_all_the_same() -> None:
    alone = {**SUMMARY["messages"], "frames": 600, "sent": 0, "delivered": 0, "dropped": 0, "in_flight": 0}
    lines = measures(summary(messages=alone))
    assert "messages    600 sent, 56 bytes per robot per second; no other robot was there to receive them" in lines
    assert not [line for line in lines if line.startswith("received")]


@pytest.mark.parametrize(
    ("first", "around", "words"),
    [
        (
            32.5,
            40.0,
            "1 of 2 found, the first at 32.5 s, 12.5 s after it came; surrounded for 40 s, by at most 5 robots",
        ),
        (32.5, 0.0, "1 of 2 found, the first at 32.5 s, 12.5 s after it came; never surrounded"),
        (None, 0.0, "0 of 2 found"),
    ],
)
def test_the_summary_says_what_became_of_the_intruders(first: float | None, around: float, words: str) -> None:
    one = {"at_s": 20.0, "first_reported_s": first, "surrounded_s": around, "most_robots": 5}
    other = {"at_s": 0.0, "first_reported_s": None, "surrounded_s": 0.0, "most_robots": 0}
    (line,) = [line for line in measures(summary(intruders=[one, other])) if line.startswith("intruders")]
    assert line == f"intruders   {words}"


def test_the_summary_says_how_old_the_ground_of_each_zone_got() -> None:
    ages = {"fog_mean_s": 2.6, "mfow_mean_s": 11.4, "mfow_max_s": 34.5}
    vault = {"weight": 10.0, "wanted_s": 12.0, "kept_share": 0.9, **ages}
    weighted = {"mfow_weighted_mean_s": 133.5, "mfow_weighted_max_s": 345.0, "best_weighted_s": 127.0}
    zones = {"vault": vault, "elsewhere": {"weight": 1.0, **ages}}
    told = measures(summary(**weighted, zones=zones))
    (place,) = (number for number, line in enumerate(told) if line.startswith("weighted"))
    said = "mean age 2.6 s, stalest point 11.4 s in the mean, 34.5 s at most"
    assert told[place + 1 : place + 3] == [
        f"            vault (last weight 10): {said}; wanted 12 s, kept 90.0 % of the time",
        f"            elsewhere (weight 1): {said}",
    ]


def test_robots_that_took_no_part_do_not_count_in_the_time_on_patrol() -> None:
    battery = {"least_share": 0.5, "end_share": 0.8}
    worked, joined_late = battery | {"patrol_share": 0.75}, battery | {"patrol_share": 1.0}
    robots = {
        "r1": {"decisions": 800, "missed": 100, "battery": worked},
        "r2": {"decisions": 100, "battery": joined_late},
        "r3": {"battery": battery | {"patrol_share": None}},
    }
    (line,) = (line for line in measures(summary(robots=robots)) if line.startswith("batteries"))
    assert line.endswith("78 % of the time on patrol")  # (900 * 0.75 + 100 * 1) / 1000


def test_where_it_shows_depends_on_where_it_goes() -> None:
    assert type(live_table.make_display(quiet=True)) is live_table.RunDisplay
    display = live_table.make_display(quiet=False)
    assert isinstance(display, live_table.GuardedDisplay)
    assert isinstance(display.shown, live_table.PlainDisplay)


class _Failing(live_table.RunDisplay):
    """Shows lines, and fails at all else."""

    def __init__(self) -> None:
        self.said: list[str] = []

    def say(self, line: str) -> None:
        self.said.append(line)

    def metrics(self, metrics: Metrics) -> None:
        raise ZeroDivisionError(f"tick {metrics.k}")


class _Mute(_Failing):
    def say(self, line: str) -> None:
        raise OSError(28, line)


def test_a_display_that_fails_is_reported_once_and_never_to_the_run() -> None:
    failing = _Failing()
    display = live_table.GuardedDisplay(failing)
    display.progress("writing report.html", share=0.5)
    for _ in range(3):
        display.metrics(METRICS)
    display.say("on it goes")
    assert failing.said == ["the display failed (ZeroDivisionError: tick 120); the run goes on", "on it goes"]
    display.close()
    assert failing.said[2:] == ["3 lines or tables could not be shown"]
    mute = live_table.GuardedDisplay(_Mute())
    mute.metrics(METRICS)
    mute.say("?")
    mute.close()
    assert mute.failures >= 2, "it cannot even say so"


def test_names_and_rates_that_make_no_sense_are_shown_all_the_same() -> None:
    odd = replace(METRICS, ticks_per_s=1e-300, robots=(RobotView("[/red]", 1, "[/b]", 1.0, 2.0, 0.0),))
    table = Terminal()
    table.metrics(odd)
    assert "[/red]" in table.shown()
    assert "to go" not in live_table.headline(odd)
    assert "to go" in live_table.headline(METRICS)
    assert "to go" not in live_table.headline(replace(METRICS, k=1)), "the first tick says little about the others"


def test_the_report_says_what_matters(tmp_path: Path) -> None:
    for name in ("summary.json", "fog.png"):
        (tmp_path / name).touch()
    shown = printed(summary(), tmp_path, 100)
    for words in (
        "five: 300 s in 600 ticks; 1 min 40 s of wall time, 3.0 x real time",
        "MFoW        mean 60.0 s, maximum 90.0 s",
        "bounds      best tour found 48.0 s, ratio 1.25; lower bound 40.0 s, ratio 1.50",
        "stalest     over the run (1.5, 2.0), 90 s at 250 s, nearest robot anna 7 m away; at the end (3.0, 4.0), 50 s",
        "coverage    100.00 % of 8800 m² to patrol",
        "messages    5 sent, 56 bytes per robot per second\n",
        "received    8 of 10, 1 dropped, 0 rejected, 1 under way at the end\n",
        "missed by 5 commands and 1 frames; 1 of them came too late",
        "verdict     invalid",
        "nobody lost: bert",
        "trace       0123456789abcdef",
        f"{tmp_path}: fog.png, summary.json",
    ):
        assert words in shown


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"seen_share": 0.995}, "best tour found 48.0 s; lower bound 40.0 s"),
        ({"simulated_s": 100.0}, "best tour found 48.0 s; lower bound 40.0 s"),
        (
            {"bound_s": 0.0, "best_tour_s": None},
            "lower bound 0: discs of the sensor's range around the robots have a larger area than the ground",
        ),
    ],
    ids=["not all seen", "too short", "bound of 0"],
)
def test_a_run_is_held_against_bounds_only_where_it_has_settled(changed: dict[str, Any], told: str) -> None:
    assert measures(summary(**changed))[2] == f"bounds      {told}"


def test_a_summary_of_an_older_version_says_what_it_has() -> None:
    older = {name: value for name, value in SUMMARY.items() if name not in ("best_tour_s", "stalest")}
    assert measures(Summary.model_validate(older))[2:4] == [
        "bounds      lower bound 40.0 s, ratio 1.50",
        "mean fog    20.0 s",
    ]


def test_a_valid_run_with_warnings_says_so_at_once(tmp_path: Path) -> None:
    warnings = [f"r{n} was trapped" for n in range(30)]
    verdict = {"outcome": "valid", "valid": True, "warnings": warnings, "checks": []}
    lines = printed(summary(verdict=verdict), tmp_path, 100).splitlines()
    at = lines.index("verdict     valid, with warnings: 0 checks passed")
    assert lines[at + 1] == "  warning: r0 was trapped"
    assert lines[at + 20 : at + 22] == ["  warning: r19 was trapped", "  10 more warnings are in summary.json"]


def test_a_robot_without_progress_is_told_as_a_sentence() -> None:
    text = io.StringIO()
    display = live_table.PlainDisplay(Console(file=text, width=100))
    display.notice(Notice(1368, TRAPPED, "r2", "within 3.2 m of (26.3, 9.7) since 504 s; nobody has seen"))
    display.notice(Notice(1500, FREE, "r2", "after 246 s within 3.2 m of (26.3, 9.7)"))
    assert text.getvalue().splitlines() == [
        "tick 1368: r2 trapped within 3.2 m of (26.3, 9.7) since 504 s; nobody has seen",
        "tick 1500: r2 no longer trapped after 246 s within 3.2 m of (26.3, 9.7)",
    ]


def test_the_report_of_a_run_without_ticks() -> None:
    empty = summary(ticks=0, simulated_s=0.0, wall_s=None, ended=None, mfow_mean_s=None)
    assert measures(empty) == ["five: 0 s in 0 ticks, cut off"]


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (59.4, "59 s"),
        (59.5, "1 min 00 s"),
        (60, "1 min 00 s"),
        (3599, "59 min 59 s"),
        (3600, "1 h 00 min"),
        (7259, "2 h 00 min"),
        (7260, "2 h 01 min"),
    ],
)
def test_durations_turn_to_minutes_and_hours_at_sixty(seconds: float, words: str) -> None:
    assert live_table.duration_text(seconds) == words


@pytest.mark.parametrize(
    ("changed", "ending"),
    [
        ({"k": 2, "time_s": 1.0}, "40.0 ticks/s, 20.0 x real time; 15 s to go"),
        ({"k": 600, "time_s": 300.0}, "40.0 ticks/s, 20.0 x real time"),
        ({"ticks_per_s": 481.0 / 1e9}, "0.0 ticks/s, 0.0 x real time; 277200 h 16 min to go"),
        ({"ticks_per_s": 479.0 / 1e9}, "0.0 ticks/s, 0.0 x real time"),
    ],
)
def test_the_time_to_go_follows_from_the_rate(changed: dict[str, Any], ending: str) -> None:
    assert live_table.headline(replace(METRICS, **changed)).endswith(f"; {ending}")


def test_all_that_became_of_robots_is_counted() -> None:
    statuses = [*[Status.ALIVE] * 3, Status.PAUSED, *[Status.DEAD] * 2, Status.LEFT, *[Status.ABSENT] * 4]
    views = tuple(RobotView(f"r{n}", status, "", 0.0, 0.0, 0.0) for n, status in enumerate(statuses))
    assert "; 3/7 robots (1 paused, 2 dead, 1 left); " in live_table.headline(replace(METRICS, robots=views))
    assert "; 3/3 robots; " in live_table.headline(replace(METRICS, robots=views[:3]))


def test_plain_lines_come_every_five_seconds_and_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr("fogwatch.terminal.live_table.time.monotonic", lambda: now[0])
    text = io.StringIO()
    plain = live_table.PlainDisplay(Console(file=text, width=80))
    for now[0], k in ((100.0, 10), (104.9, 20), (105.0, 30), (106.0, 599), (106.5, 600)):
        plain.metrics(replace(METRICS, k=k))
    assert [line.split()[1] for line in text.getvalue().splitlines()] == ["10/600", "30/600", "600/600"]


@pytest.mark.parametrize(("robots", "more"), [(20, ""), (21, "and 1 more robots")])
def test_up_to_twenty_robots_are_in_the_table(robots: int, more: str) -> None:
    table = Terminal()
    table.metrics(
        replace(METRICS, robots=tuple(RobotView(f"r{n}", 1, "holding", 0.0, 0.0, 0.0) for n in range(robots)))
    )
    shown = table.shown()
    assert shown.count("holding") == 20
    assert ("more robots" in shown) == bool(more)
    assert more in shown


def test_the_table_has_each_robots_own_place_and_state() -> None:
    views = (
        RobotView("anna", Status.ALIVE, "", 1.26, 2.34, 0.0),
        RobotView("bert", Status.PAUSED, "patrolling", 3.0, 4.0, 0.0),
        RobotView("carl", Status.ALIVE, "dead-end", 5.0, 6.0, 0.0),
    )
    table = Terminal()
    table.metrics(replace(METRICS, robots=views))
    rows = [line.split() for line in table.shown().splitlines()]
    for row in (
        ["anna", "waiting", "1.3", "2.3"],
        ["bert", "paused", "3.0", "4.0"],
        ["carl", "dead-end", "5.0", "6.0"],
    ):
        assert row in rows
