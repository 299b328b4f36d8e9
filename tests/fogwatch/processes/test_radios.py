"""Every fault of the radio at once over real Zenoh: the same trace as in one process, and the bytes on the wire."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from patrol.errors import Malformed
from patrol.radio.message import MAX_FRAME
from runtime.messages.phases import ReplyA, decode_to_world
from runtime.net.link import open_link
from runtime.net.mailbox import Payload
from runtime.security.keys import ROOT
from runtime.security.private_files import new_key
from tests.fleets import one_and_many
from tests.worldsim.test_fleet_by_hand import PATIENCE_S, Hand

pytestmark = pytest.mark.processes

FAULTS: list[dict[str, Any]] = [
    {"kind": "loss", "rate": 0.2},
    {"kind": "loss", "rate": 0.5, "mean_burst": 4.0, "from": "r1", "at": 3.0},
    {"kind": "delay", "delay": {"normal": [0.5, 0.5]}, "at": 2.0, "for": 10.0},
    {"kind": "duplicate", "rate": 0.3, "delay": {"exponential": 1.0}},
    {"kind": "reorder", "rate": 0.2, "hold": 1.5},
    {"kind": "partition", "groups": "one", "at": 4.0, "for": 3.0},
    {"kind": "silence", "who": "r3", "at": 6.0, "for": 3.0, "direction": "out"},
    {"kind": "range", "reach": 40.0, "through_walls": False, "at": 10.0, "for": 5.0},
    {"kind": "bandwidth", "bytes_per_s": 60.0, "at": 14.0, "for": 4.0},
    {"kind": "spoof", "as": "r2", "payload": {"offset": [1.0, 0.0]}, "at": 1.0, "for": 5.0},
    {"kind": "spoof", "by": "r2", "as": "r1", "payload": "random", "at": 3.0, "for": 8.0},
    {"kind": "spoof", "as": "all", "payload": {"replay": 2.0}, "at": 7.0, "for": 9.0},
    {"kind": "spoof", "payload": {"invented": 12}, "at": 8.0, "for": 4.0},
    {"kind": "spoof", "by": "r1", "as": "r2", "payload": {"ahead": 1000}, "at": 9.0, "for": 6.0},
    {"kind": "drift", "who": "r3", "bias": [0.5, 0.0], "noise": 0.1},
    {"kind": "clock", "who": "r1", "offset": -3.0, "rate": 0.1},
    {"kind": "motion", "who": "all", "speed": 0.1, "veer": 0.05, "jitter": {"size": 0.2, "every": 4}, "at": 5.0},
    {"kind": "motion", "who": "half", "turning": 0.3, "slip": {"rate": 0.2, "every": 1.0}, "at": 10.0, "for": 9.0},
]
SCENARIO: dict[str, Any] = {"terrain": {"builtin": "yards"}, "point": 1.0, "duration": 25}
SCENARIO |= {"robots": {"count": 3, "model": "car"}, "intruders": [{"place": [30.0, 44.0]}]}
SAVINGS: dict[str, Any] = {"trail_every": 2, "budget": {"bits_per_s": 700, "overhead": 4}, "adaptive": {"error": 1.5}}


@pytest.mark.parametrize(
    ("savings", "keyed"),
    [
        pytest.param({}, False, id="plain-open"),
        pytest.param(SAVINGS, True, id="saving-keyed"),
        pytest.param({}, True, id="plain-keyed", marks=pytest.mark.accept),
        pytest.param(SAVINGS, False, id="saving-open", marks=pytest.mark.accept),
    ],
)
def test_a_troubled_radio_gives_the_same_trace_as_processes_and_in_one(
    tmp_path: Path, keyed: bool, savings: dict[str, Any]
) -> None:
    radio: dict[str, Any] = {"trail": 4, **savings}
    if keyed:
        new_key(tmp_path / "fleet.key")
        radio["key"] = str(tmp_path / "fleet.key")
    scenario = {**SCENARIO, "faults": FAULTS, "radio": radio}
    one, many = one_and_many(scenario, tmp_path)
    for what in ("messages", "links", "faults"):
        assert many.summary[what] == one.summary[what]
    links = [link for row in one.summary["links"].values() for link in row.values()]
    assert all(link["sent"] == link["delivered"] + sum(link["dropped"].values()) + link["in_flight"] for link in links)
    assert all(counts["frames"] for counts in one.summary["faults"].values() if "frames" in counts)


class Wire:
    """The traffic from robots to their radio: the bytes of each frame, a reply that is repeated once."""

    def __init__(self) -> None:
        self.frames: dict[tuple[str, int], tuple[bytes, ...]] = {}

    def deliver(self, key: str, payload: Payload) -> None:
        try:
            reply = decode_to_world(bytes(payload))
        except Malformed:
            return
        if isinstance(reply, ReplyA):
            self.frames[key, reply.k] = reply.frames


@pytest.fixture
def hand(tmp_path: Path) -> Iterator[Hand]:
    """Starts router, world and robots one by one; its router asks nobody who they are."""
    hand = Hand(tmp_path)
    yield hand
    hand.end()


@pytest.mark.parametrize(
    "keyed", [pytest.param(False, id="bare", marks=pytest.mark.accept), pytest.param(True, id="trail-and-tag")]
)
def test_the_summarys_bytes_are_those_on_the_wire(hand: Hand, tmp_path: Path, keyed: bool) -> None:
    new_key(tmp_path / "fleet.key")
    radio = {"trail": 4, "key": str(tmp_path / "fleet.key")} if keyed else {}
    hand.write({**SCENARIO, "faults": FAULTS[:1], "radio": radio})
    hand.start_router()
    wire = Wire()
    link = open_link(hand.router, PATIENCE_S)
    try:
        link.subscribe(f"{ROOT}/*/robot/*/reply", wire)  # type: ignore[arg-type]
        hand.start_world()
        robots = ("r1", "r2", "r3")
        for robot in robots:
            hand.start_agent(robot)
        assert [hand.code(name) for name in ("world", *robots)] == [0, 0, 0, 0], hand.said("world")
    finally:
        link.close()
    summary = json.loads((hand.out / "summary.json").read_text(encoding="utf-8"))
    messages = summary["messages"]
    sent = [frame for frames in wire.frames.values() for frame in frames]
    assert messages["frames"] == len(sent)
    assert messages["bytes"] == sum(map(len, sent))
    assert messages["bytes_per_robot_s"] == pytest.approx(messages["bytes"] / (3 * 25))
    assert max(map(len, sent)) <= (MAX_FRAME if keyed else 32)
