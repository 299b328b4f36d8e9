"""Checks of one's own policies, robots and sensors, for one's own tests (docs/testing.md).

    from fogwatch.testing import check_policy
    from my_package import Mine

    def test_my_policy():
        check_policy(Mine, options={"near": 4})

`draw_situation` makes what a policy sees from a drawing, to test a single choice. Each check plays through what a class
meets in a fleet. It raises `RuleBroken` for the first rule that the class breaks.
"""

from fogwatch.testing.broken import RuleBroken
from fogwatch.testing.policy import PolicyReport, check_policy
from fogwatch.testing.robot import check_robot
from fogwatch.testing.sensor import SensorReport, check_sensor
from fogwatch.testing.situation import Situation, draw_situation

__all__ = ["PolicyReport", "RuleBroken", "SensorReport", "Situation", "check_policy", "check_robot", "check_sensor"]
__all__ += ["draw_situation"]
