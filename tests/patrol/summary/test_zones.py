"""Words about zones at the end of a run."""

from patrol.scenario import load_scenario
from patrol.summary.model import Summary, ZoneFigures
from patrol.summary.zones import zone_lines, zone_table
from patrol.zones.spec import ELSEWHERE


def test_lines_and_table_hold_each_zones_own_numbers() -> None:
    vault = ZoneFigures(
        weight=4.0, fog_mean_s=1.11, mfow_mean_s=2.22, mfow_max_s=3.33, wanted_s=60.0, kept_share=0.9876
    )
    rest = ZoneFigures(weight=1.5, fog_mean_s=4.44, mfow_mean_s=5.55, mfow_max_s=6.66)
    summary = Summary(
        mfow_weighted_mean_s=7.77,
        mfow_weighted_max_s=8.88,
        best_weighted_s=9.99,
        zones={"vault": vault, ELSEWHERE: rest},
    )
    wanted = "; wanted 60 s, kept 98.8 % of the time"
    assert zone_lines(summary) == [
        "weighted    MFoW mean 7.8 s, maximum 8.9 s; best tours 10.0 s",
        f"            vault (last weight 4): mean age 1.1 s, stalest point 2.2 s in the mean, 3.3 s at most{wanted}",
        f"            {ELSEWHERE} (weight 1.5): mean age 4.4 s, stalest point 5.5 s in the mean, 6.7 s at most",
    ]
    assert zone_lines(summary.model_copy(update={"best_weighted_s": None}))[0].endswith("maximum 8.9 s")
    assert zone_lines(Summary(zones=summary.zones)) == []
    square = [[2, 2], [6, 2], [6, 6], [2, 6]]
    zones = [{"name": name, "polygon": square, "weight": 4.0} for name in ("vault", "unused")]
    scenario = load_scenario({"terrain": {"builtin": "open"}, "zones": zones})
    table = zone_table(summary, scenario, 60.0)
    assert [row[2:] for row in table.rows] == [("1.1", "2.2", "3.3", "98.8"), ("-",) * 4, ("4.4", "5.5", "6.7", "-")]
    assert table.rows[2][:2] == (f"{ELSEWHERE} x1.5", "always")
    assert [row[0].split()[0] for row in table.rows[:2]] == ["vault", "unused"]
    assert [table.heads[column] for column in table.numbers] == list(table.heads[2:])
    assert zone_table(summary, load_scenario({"terrain": {"builtin": "open"}}), 60.0).rows == []
