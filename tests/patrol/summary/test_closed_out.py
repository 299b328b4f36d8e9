"""The lines and the table about ground that was closed out."""

from patrol.scenario import load_scenario
from patrol.summary.closed_out import closed_out_lines, closed_out_table
from patrol.summary.model import ClosedOut, Summary

SCENARIO = load_scenario({"terrain": {"builtin": "open"}})
DOOR = ClosedOut(since_s=10.0, until_s=32.5, area_m2=64.4, x=17.94, y=3.96)
WRECK = ClosedOut(since_s=100.0, until_s=None, area_m2=7.6, x=2.0, y=3.0)


def test_lines_and_table_say_when_and_where_ground_was_closed_out_and_how_old_the_rest_got() -> None:
    ages = {"mfow_reachable_mean_s": 12.34, "mfow_reachable_max_s": 56.78, "closed_out_share": 0.0125}
    summary = Summary(**ages, closed_out=[DOOR, WRECK])  # type: ignore[arg-type]
    told = "mean 12.3 s, maximum 56.8 s; closed out 1.2 % of ground x time"
    assert closed_out_lines(summary) == [
        f"reachable MFoW {told}",
        "closed out  up to 64 m² around (17.9, 4.0), some ground from 10 s to 32.5 s; 2 times in all",
    ]
    table = closed_out_table(summary, SCENARIO, 60.0)
    assert table.text == f"Reachable MFoW: {told}."
    assert table.rows == [("64 m²", "(17.9, 4.0)", "10 s", "32.5 s"), ("8 m²", "(2.0, 3.0)", "100 s", "the end")]
    never = summary.model_copy(update={"closed_out": []})
    assert closed_out_lines(never) == [f"reachable MFoW {told}"]
    assert not closed_out_table(never, SCENARIO, 60.0).rows
