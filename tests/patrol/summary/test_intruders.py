"""The figures of intruders, from ticks and frames that are written down here."""

from types import SimpleNamespace
from typing import Any

import pytest

from patrol.journal import RobotTick, Status
from patrol.journal.records import FORGED, SURROUNDING
from patrol.radio.message import CONTACT, Position, encode
from patrol.scenario import load_scenario
from patrol.scenario.load import as_mapping
from patrol.summary.intruders import IntruderTotals, intruder_lines, intruder_table
from patrol.summary.model import Summary

STEP_S = 0.5
NEAR, FAR = (20.0, 20.0), (40.0, 20.0)
INTRUDERS = [{"place": list(NEAR), "at": 1.0, "for": 3.0}, {"place": list(FAR), "at": 2.0}]
SCENARIO = load_scenario(
    {
        "terrain": {"builtin": "open"},
        "step": STEP_S,
        "robots": {"count": 3, "model": "holonomic"},
        "patrol": {"surround_distance": 2.0},
        "intruders": INTRUDERS,
    }
)


def frame(number: int, x: float, y: float) -> bytes:
    return encode(Position(number, 1, 0, round(100 * x), round(100 * y), 0))


def contact(x: float, y: float) -> bytes:
    return frame(CONTACT, x, y)


def tick(k: int, *frames: tuple[int, bytes], robots: Any = ()) -> Any:
    rows = [
        RobotTick(number, status, x, y, 0.0, 0.0, 0.0, False, state, None, None, None)
        for number, ((x, y), status, state) in enumerate(robots, 1)
    ]
    return SimpleNamespace(k=k, frames=frames, robots=tuple(rows))


def figures(*ticks: Any) -> list[dict[str, Any]]:
    header: Any = SimpleNamespace(scenario=as_mapping(SCENARIO))
    totals = IntruderTotals(header, [])
    for record in ticks:
        totals.tick(record)
    found: list[dict[str, Any]] = totals.figures([])["intruders"]
    return found


def own(number: int) -> tuple[int, bytes]:
    return number, frame(number, 1.0, 1.0)


def test_reports_count_by_tick_for_the_intruder_that_is_nearest_to_what_was_reported() -> None:
    near, far = figures(
        tick(1, own(1), (1, contact(20.4, 20.0))),  # before anybody came
        tick(2, own(1), own(2)),
        tick(3, own(1), (1, contact(20.4, 20.0)), own(2), (2, contact(20.0, 20.3))),  # one tick, however many report
        tick(4, own(1), (1, contact(21.0, 20.0)), (1, contact(39.0, 20.0))),  # two contacts of one robot
        tick(7, own(1), (1, contact(29.9, 20.0))),  # nearer to the first, which is in its last tick
        tick(8, own(1), (1, contact(29.9, 20.0))),  # 4 s: it has gone, and the other one is left
    )
    assert (near["first_reported_s"], near["reported_s"]) == (3 * STEP_S, 3 * STEP_S)
    assert (far["first_reported_s"], far["reported_s"]) == (4 * STEP_S, 2 * STEP_S)
    assert (near["place_m"], near["at_s"], near["until_s"]) == ([20.0, 20.0], 1.0, 4.0)
    assert (far["place_m"], far["at_s"], far["until_s"]) == ([40.0, 20.0], 2.0, None)


@pytest.mark.parametrize(
    "frames",
    [
        [(1, contact(*NEAR))],  # the first frame of a robot is its own position
        [own(1), (2, contact(*NEAR))],
        [own(1), (FORGED, contact(*NEAR)), (FORGED, contact(*NEAR))],
        [own(1), (1, frame(2, *NEAR))],
        [own(1), (1, b"no frame")],
    ],
    ids=["first", "of another", "forged", "of a robot", "broken"],
)
def test_what_is_no_contact_reports_nothing(frames: list[tuple[int, bytes]]) -> None:
    near, far = figures(tick(3, *frames))
    assert [(facts["first_reported_s"], facts["reported_s"]) for facts in (near, far)] == [(None, 0.0)] * 2


def test_robots_stand_around_an_intruder_within_one_and_a_half_times_the_distance() -> None:
    at, beyond = (23.0, 20.0), (23.01, 20.0)  # 3 m is 1.5 times 2 m
    stands = (at, Status.ALIVE, SURROUNDING)
    near, far = figures(
        tick(2, robots=[stands, stands, ((20.0, 23.0), Status.ALIVE, SURROUNDING)]),
        tick(3, robots=[stands, (beyond, Status.ALIVE, SURROUNDING)]),
        tick(4, robots=[stands, (at, Status.PAUSED, SURROUNDING), (at, Status.ALIVE, "patrolling")]),
        tick(5, robots=[stands, stands]),
        tick(8, robots=[stands, stands, stands]),  # it has gone
    )
    assert (near["surrounded_s"], near["most_robots"]) == (2 * STEP_S, 3)
    assert (far["surrounded_s"], far["most_robots"]) == (0.0, 0)


def test_a_robot_stands_around_the_nearest_intruder_alone() -> None:
    mapping = as_mapping(SCENARIO) | {
        "intruders": [{"place": [20.0, 20.0], "at": 0.0}, {"place": [22.0, 20.0], "at": 0.0}]
    }
    totals = IntruderTotals(SimpleNamespace(scenario=mapping), [])  # type: ignore[arg-type]
    robots = [((20.9, 20.0), Status.ALIVE, SURROUNDING), ((19.0, 20.0), Status.ALIVE, SURROUNDING)]
    totals.tick(tick(0, robots=[*robots, ((21.1, 20.0), Status.ALIVE, SURROUNDING)]))
    found = totals.figures([])["intruders"]
    assert [(facts["most_robots"], facts["surrounded_s"]) for facts in found] == [(2, STEP_S), (1, 0.0)]


def summary_of(*intruders: tuple[float, float | None, float, float, int]) -> Summary:
    keys = ("at_s", "first_reported_s", "reported_s", "surrounded_s", "most_robots")
    return Summary.model_validate({"intruders": [dict(zip(keys, facts, strict=True)) for facts in intruders]})


BOTH = "intruders   2 of 2 found"


@pytest.mark.parametrize(
    ("intruders", "lines"),
    [
        ([], []),
        ([(5.0, None, 0.0, 0.0, 0)] * 2, ["intruders   0 of 2 found"]),
        (
            [(5.0, 9.0, 1.0, 0.0, 1), (2.0, 7.5, 1.0, 0.0, 0), (1.0, None, 0.0, 0.0, 0)],
            ["intruders   2 of 3 found, the first at 7.5 s, 5.5 s after it came; never surrounded"],
        ),
        (
            [(8.0, 9.0, 1.0, 4.0, 2), (2.0, 12.0, 1.0, 1.5, 3)],
            [f"{BOTH}, the first at 9 s, 1 s after it came; surrounded for 5.5 s, by at most 3 robots"],
        ),
    ],
)
def test_the_line_says_how_soon_and_for_how_long(intruders: Any, lines: list[str]) -> None:
    assert intruder_lines(summary_of(*intruders)) == lines


def test_the_table_has_a_row_for_each_that_came() -> None:
    table = intruder_table(summary_of((1.0, 1.5, 2.0, 0.5, 3), (2.0, None, 0.0, 0.0, 1)), SCENARIO, 3.5)
    assert table.rows == [
        ("intruder1", "at (20, 20)", "1", "3.5", "1.5", "2", "0.5", "3"),
        ("intruder2", "at (40, 20)", "2", "3.5", "never", "0", "0", "1"),
    ]
    assert [table.heads[column] for column in table.numbers] == list(table.heads[2:])
    unfinished = intruder_table(
        Summary(), SCENARIO, 2.0
    )  # a run without figures; the second did not come before its end
    assert unfinished.rows == [("intruder1", "at (20, 20)", "1", "2", "-", "-", "-", "-")]
