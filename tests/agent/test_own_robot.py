"""Robots of one's own: what is said of a scenario that they cannot patrol, and whose ticks they count."""

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from agent.own_robot import drive
from examples.my_robot import MyRobot
from patrol.radio.message import MAX_FRAME, decode
from runtime.net.link import open_link
from runtime.net.mailbox import Mailbox
from runtime.security.keys import fleet_keys, robot_of
from tests.worldsim.test_fleet_by_hand import Hand

# Not the product's own, so that a wrong one there is noticed.
APART = 2

ROOT = Path(__file__).parents[2]
DRIVER = """
import sys
from argparse import Namespace
from agent.own_robot import Ticks, patrol_with
from examples.my_robot import MyRobot
from runtime.process.context import run_with
from patrol.scenario import load_scenario
scenario, router, fleet, name, epoch_s = sys.argv[1:]
options = Namespace(credentials=None, router=router, fleet=fleet, radio=None, wait=600.0)
ticks = Ticks(float(epoch_s) if epoch_s else None, 600.0, alone_s=0.0)
sys.exit(run_with(options, name, lambda it: patrol_with(it, MyRobot, load_scenario(scenario), name, ticks)))
"""


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (
            "radio: {via: direct}\nzones: [{name: vault, polygon: [[900, 1], [901, 1], [901, 2]], weight: 2}]",
            "zones.0: vault lies outside of open",
        ),
        ("", "radio.via = ether: only a world carries frames so; set radio: {via: direct}"),
    ],
)
def test_the_scenarios_file_is_named(more: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    site = tmp_path / "site.yaml"
    site.write_text(f"terrain: {{builtin: open}}\npace: realtime\nrobots: [{{name: r1}}]\n{more}\n")
    assert drive(MyRobot, scenario=site, robot="r1", router="tcp/127.0.0.1:9", fleet="night", wait_s=0.1) == 2
    assert f"{site}: {said}" in capsys.readouterr().err


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[Hand]:
    hand = Hand(tmp_path)
    robots = [{"name": name, "model": "holonomic"} for name in ("anna", "bert", "carl")]
    hand.write({"terrain": {"builtin": "open"}, "pace": "realtime", "robots": robots, "radio": {"via": "direct"}})
    yield hand
    hand.end()


def start(hand: Hand, name: str, epoch_s: str = "") -> None:
    command = [sys.executable, "-c", DRIVER, str(hand.scenario), hand.router, hand.fleet, name, epoch_s]
    with hand.log(name).open("ab") as output:
        hand.processes[name] = subprocess.Popen(command, stdout=output, stderr=output, cwd=ROOT)


@pytest.mark.processes
def test_robots_that_began_alone_count_as_the_one_that_began_first(fleet: Hand) -> None:
    fleet.start_router()
    fleet.until(lambda: "router ready" in fleet.said("router"))
    start(fleet, "anna")
    fleet.until(lambda: "ticks count from now" in fleet.said("anna"))
    start(fleet, "carl")
    fleet.until(lambda: "patrols with fleet" in fleet.said("carl"))
    start(fleet, "bert", f"{time.time() - 1000.0}")
    keys = fleet_keys(fleet.fleet)
    mailbox: Mailbox[bytes] = Mailbox([keys.position(name) for name in ("anna", "bert", "carl")], bytes, MAX_FRAME, 64)
    with closing(open_link(fleet.router, 60.0)) as link:
        link.subscribe(keys.position("*"), mailbox)
        counts: dict[str, int] = {}

        def count_alike() -> bool:
            while (news := mailbox.get()) is not None:
                counts[robot_of(news[0])] = decode(news[1]).sequence
            return len(counts) == 3 and max(counts.values()) - min(counts.values()) <= APART

        fleet.until(count_alike)
    assert min(counts.values()) >= 2000, "bert has begun 1,000 s before"
    for late in ("anna", "carl"):
        assert "has counted ticks for longer" in fleet.said(late)
