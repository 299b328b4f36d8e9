"""The features of scenarios are told in one order, each under its own name."""

from patrol.summary.features import FEATURES
from patrol.summary.model import BatteryFigures, ClosureFigures, RobotFigures, Summary, ZoneFigures


def test_each_feature_tells_of_its_own_figures_alone() -> None:
    intruder = {"first_reported_s": None, "surrounded_s": 0.0, "most_robots": 0}
    has = {
        "zones": Summary(mfow_weighted_mean_s=1.0, mfow_weighted_max_s=2.0, zones={"z": ZoneFigures()}),
        "closures": Summary(closures={"c": ClosureFigures()}),
        "closed out": Summary(mfow_reachable_mean_s=1.0, mfow_reachable_max_s=2.0),
        "intruders": Summary.model_validate({"intruders": [intruder]}),
        "batteries": Summary(robots={"r1": RobotFigures(battery=BatteryFigures(least_share=0.5, end_share=0.5))}),
    }
    assert [feature.name for feature in FEATURES] == list(has)
    for name, summary in has.items():
        assert [feature.name for feature in FEATURES if feature.lines(summary)] == [name]
