"""The figures of batteries, against a run whose charge is added up by hand."""

from types import SimpleNamespace
from typing import Any

import pytest

from patrol.journal import RobotTick, Status
from patrol.journal.records import CHARGING, DOCKING
from patrol.scenario import load_scenario
from patrol.scenario.load import as_mapping
from patrol.summary.batteries import BatteryTotals, battery_lines, battery_table
from patrol.summary.model import BatteryFigures, RobotFigures, Summary

CAPACITY_J = 3600.0
BATTERY = {"capacity": 1.0, "idle": 10.0, "drive": 100.0, "charge": 210.0, "start": 0.2}
DISC = {"model": "holonomic", "speed": 2.0, "radius": 0.4, "battery": BATTERY}
STEP_S = 0.5

WAY: list[tuple[float, float, Status, str]] = [
    # x, speed, status, state; each tick uses 5 J, and driving at 2 m/s 100 J more; a dock gives 105 J
    *[(20.0, 2.0, Status.ALIVE, "patrolling")] * 3,
    (5.0, 0.0, Status.ALIVE, DOCKING),
    *[(5.0, 0.0, Status.ALIVE, CHARGING)] * 2,
    *[(20.0, 2.0, Status.ALIVE, "patrolling")] * 2,
    (5.0, 0.0, Status.ALIVE, CHARGING),
    *[(20.0, 2.0, Status.ALIVE, "patrolling")] * 4,
    *[(20.0, 0.0, Status.PAUSED, DOCKING)] * 2,
]
CHANGES_J = {"patrolling": -105.0, DOCKING: 100.0, CHARGING: 100.0}


def figures(way: list[tuple[float, float, Status, str]]) -> dict[str, Any]:
    docks = [{"place": [5.0, 5.0], "radius": 1.0}]
    mapping = as_mapping(load_scenario({"terrain": {"builtin": "open"}, "robots": [DISC] * 2, "docks": docks}))
    names = [SimpleNamespace(number=1, name="r1"), SimpleNamespace(number=2, name="r2")]
    header: Any = SimpleNamespace(scenario=mapping, robots=names)
    totals = BatteryTotals(header, [])
    for k, (x, speed, status, state) in enumerate(way):
        row = RobotTick(1, status, x, 5.0, 0.0, speed, 0.0, False, state, None, 1.0, 0)
        absent = RobotTick(2, Status.ABSENT, 0.0, 0.0, 0.0, 0.0, 0.0, False, "", None, None, None)
        record: Any = SimpleNamespace(k=k, robots=(row, absent))
        totals.tick(record)
    robots: dict[str, Any] = totals.figures([])["robots"]
    assert (
        robots["r2"]["battery"] | {"least_share": 0.2, "end_share": 0.2, "patrol_share": None}
        == robots["r2"]["battery"]
    )
    battery: dict[str, Any] = robots["r1"]["battery"]
    return battery


def test_the_figures_are_those_of_the_way() -> None:
    level_j, levels_j = 0.2 * CAPACITY_J, []
    for _, _, status, state in WAY:
        level_j += CHANGES_J[state] if status is Status.ALIVE else -5.0
        levels_j.append(level_j)
    battery = figures(WAY)
    assert battery["least_share"] == pytest.approx(min(levels_j) / CAPACITY_J)
    assert battery["end_share"] == pytest.approx(levels_j[-1] / CAPACITY_J)
    assert (battery["charges"], battery["docked_s"], battery["empty_s"]) == (2, 4 * STEP_S, None)
    # Of 13 ticks alive it was on its way to a dock, or at one, in 4; a pause is no time of its life.
    assert battery["patrol_share"] == pytest.approx(1.0 - 4 / 13)


def test_the_least_charge_is_not_that_of_the_end() -> None:
    battery = figures(WAY[:4])
    assert battery["least_share"] == pytest.approx((720.0 - 3 * 105.0) / CAPACITY_J)
    assert battery["end_share"] == pytest.approx((720.0 - 3 * 105.0 + 100.0) / CAPACITY_J)


def test_the_first_time_that_it_is_empty_counts() -> None:
    battery = figures([WAY[0]] * 8 + [WAY[3]] * 3 + [WAY[0]] * 4)
    # 720 J last for six ticks of 105 J and most of a seventh, which begins at 3 s.
    assert (battery["empty_s"], battery["least_share"]) == (6 * STEP_S, 0.0)


def test_the_share_on_patrol_counts_the_time_in_which_a_robot_missed_decisions() -> None:
    def robot(decisions: int, missed: int, patrol_share: float) -> Any:
        battery = SimpleNamespace(least_share=0.4, charges=1, patrol_share=patrol_share, empty_s=None)
        return SimpleNamespace(decisions=decisions, missed=missed, battery=battery)

    summary: Any = SimpleNamespace(robots={"a": robot(300, 600, 0.75), "b": robot(100, 0, 1.0)})
    (line,) = battery_lines(summary)
    assert line.endswith(", 78 % of the time on patrol")  # (0.75 * 900 + 100) / 1000


def test_line_and_table_say_each_robots_charge() -> None:
    full = BatteryFigures(least_share=0.6, end_share=0.9, charges=2, docked_s=30.4)
    low = BatteryFigures(least_share=0.0, end_share=0.156, charges=5, docked_s=99.6, patrol_share=0.75, empty_s=12.5)
    spare = BatteryFigures(least_share=1.0, end_share=1.0, patrol_share=None)
    robots = {
        "a": RobotFigures(battery=full, decisions=10, missed=0),
        "b": RobotFigures(battery=low, decisions=10, missed=0),
        "c": RobotFigures(battery=spare),
        "d": RobotFigures(),
    }
    summary = Summary(robots=robots)
    (line,) = battery_lines(summary)
    assert line == "batteries   least charge 0 % (b), charged 7 times, 88 % of the time on patrol; empty: b"
    table = battery_table(summary, load_scenario({"terrain": {"builtin": "open"}}), 60.0)
    assert table.rows == [
        ("a", "60", "90", "2", "30", "100", "never"),
        ("b", "0", "16", "5", "100", "75", "12.5"),
        ("c", "100", "100", "0", "0", "-", "never"),
    ]
    assert [table.heads[column] for column in table.numbers] == list(table.heads[1:])
    assert battery_lines(Summary(robots={"d": RobotFigures()})) == []
    (line,) = battery_lines(Summary(robots={f"e{n}": RobotFigures(battery=low) for n in range(41)}))
    assert line.partition("empty: ")[2].split(", ") == [f"e{n}" for n in range(40)]
