"""The example of a robot of one's own: it patrols with two simulated ones, over a direct radio."""

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from tests.worldsim.test_fleet_by_hand import Hand

pytestmark = pytest.mark.processes

EXAMPLES = Path(__file__).parents[2] / "examples"
GUEST = EXAMPLES / "my_robot.py"


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[Hand]:
    hand = Hand(tmp_path)
    scenario = yaml.safe_load((EXAMPLES / "own-robot.yaml").read_text(encoding="utf-8"))
    hand.write({**scenario, "point": 1.0, "duration": 60, "pace": 4})
    yield hand
    hand.end()


def start_guest(hand: Hand, *arguments: str) -> None:
    command = [sys.executable, "-P", str(GUEST), *hand.common(), "--robot", "guest", *arguments]
    with hand.log("guest").open("ab") as output:
        hand.processes["guest"] = subprocess.Popen(command, stdout=output, stderr=output)


def test_a_robot_of_ones_own_patrols_with_two_simulated_ones(fleet: Hand) -> None:
    fleet.start_router()
    fleet.start_world()
    start_guest(fleet)
    fleet.until(lambda: "listens for a position" in fleet.said("guest"))
    fleet.start_agent("r1")
    fleet.start_agent("r2")
    assert fleet.code("world") == 0, fleet.said("world")
    fleet.processes["guest"].send_signal(signal.SIGINT)
    assert fleet.code("guest") == 130, fleet.said("guest")
    summary = json.loads((fleet.out / "summary.json").read_text(encoding="utf-8"))
    links = summary["direct"]["links"]
    for one, other in (("guest", "r1"), ("guest", "r2"), ("r1", "guest"), ("r2", "guest")):
        assert links[f"{one} to {other}"]["heard"] > 0, links


def test_a_guest_that_hears_nobody_says_so(fleet: Hand) -> None:
    fleet.start_router()
    fleet.until(lambda: "router ready" in fleet.said("router"))
    start_guest(fleet, "--wait", "5")
    assert fleet.code("guest") == 2
    assert "no position was heard within 5 s" in fleet.said("guest")


def test_a_guest_of_no_roster_says_so(fleet: Hand) -> None:
    start_guest(fleet, "--robot", "stranger")
    assert fleet.code("guest") == 2
    assert "robot 'stranger': no robot of" in fleet.said("guest")
