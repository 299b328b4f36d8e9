"""The figures of closures, from events that are written down here."""

from types import SimpleNamespace
from typing import Any

from patrol.journal import Event
from patrol.scenario import load_scenario
from patrol.summary.closures import ClosureTotals, closure_lines, closure_table
from patrol.summary.model import ClosureFigures, Summary


def figures(ticks: int, *events: Event) -> dict[str, Any]:
    header: Any = SimpleNamespace(scenario={"step": 0.5, "closures": [{"name": "door"}, {"name": "box"}]})
    totals = ClosureTotals(header, events)
    for _ in range(ticks):
        totals.tick(None)  # type: ignore[arg-type]  # only counted
    found: dict[str, Any] = totals.figures(events)["closures"]
    return found


def test_times_are_counted_from_closing_to_opening_or_the_end() -> None:
    door = [Event(k, kind, None, "door") for k, kind in ((0, "closed"), (4, "opened"), (10, "closed"))]
    box = [Event(3, "closed", None, "box"), Event(6, "opened", None, "box"), Event(7, "stays open", None, "box")]
    found = figures(17, *sorted([*door, *box, Event(2, "closed", None, "gate")], key=lambda event: event.k))
    assert found == {"door": {"closings": 2, "closed_s": (4 + 7) * 0.5}, "box": {"closings": 1, "closed_s": 1.5}}


def test_a_closing_after_the_last_tick_takes_no_time() -> None:
    found = figures(5, Event(5, "closed", None, "door"))
    assert found == {"door": {"closings": 1, "closed_s": 0.0}, "box": {"closings": 0, "closed_s": 0.0}}


def test_lines_and_table_say_what_was_closed_longest() -> None:
    closures = {
        "door": ClosureFigures(closings=3, closed_s=4.5),
        "gate": ClosureFigures(closings=1, closed_s=9.5),
        "never": ClosureFigures(),
    }
    assert closure_lines(Summary(closures=closures)) == ["closures    closed 4 times, gate longest, 9.5 s"]
    table = closure_table(Summary(closures=closures), load_scenario({"terrain": {"builtin": "open"}}), 60.0)
    assert table.rows == [("door", "3", "4.5"), ("gate", "1", "9.5"), ("never", "0", "0")]
    assert [table.heads[column] for column in table.numbers] == ["times closed", "closed for (s)"]
    assert closure_lines(Summary(closures={"never": ClosureFigures()})) == ["closures    closed 0 times"]
    assert closure_lines(Summary()) == []
