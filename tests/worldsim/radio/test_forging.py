"""Forged frames: what they say, who hears them, and what a key changes."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from patrol.errors import BadInput
from patrol.journal.records import FORGED, Status, frame_sequence
from patrol.pose import Pose
from patrol.radio.message import MAX_FRAME, Position, Rejected, RejectReason, decode, encode
from patrol.scenario import load_scenario
from tests.worldsim.conftest import Lab
from worldsim.faults import Timeline
from worldsim.radio.ether import Delivery, Ether, ether_of
from worldsim.robots.senses import Senses

KEY = b"a key of a fleet"
ALIVE = Status.ALIVE


class Band:
    """Three robots of a fleet, each at x = 2 k + its number at tick k, and an ether with faults."""

    def __init__(self, lab: Lab, faults: list[dict[str, Any]], key: Path | None) -> None:
        radio = {} if key is None else {"key": str(key)}
        facts = {"terrain": {"builtin": "open"}, "robots": {"count": 3}}
        self.scenario = load_scenario({**facts, "faults": faults, "radio": radio})
        timeline = Timeline(self.scenario)
        self.key = None if key is None else KEY
        self.terrain = lab.room
        self.senses = Senses(self.scenario, timeline, lab.room)
        self.ether: Ether = ether_of(self.scenario, timeline, lab.room, self.senses)
        self.statuses = dict.fromkeys((1, 2, 3), ALIVE)
        self.k = 0
        self.sent: list[dict[int, bytes]] = []

    def pose(self, number: int, k: int) -> Pose:
        return Pose(0.5 * k + number, 5.0, 0.0)

    def tick(self) -> Delivery:
        k = self.k
        self.k += 1
        alive = [n for n, status in self.statuses.items() if status is ALIVE]
        told = {n: self.senses.pose(n, k, self.pose(n, k)) for n in alive}
        frames = {n: encode(Position.of(n, k, self.senses.clock(n, k), told[n]), self.key) for n in alive}
        self.sent.append(frames)
        poses = {n: self.pose(n, k) for n in self.statuses}
        return self.ether.carry(k, {n: [frame] for n, frame in frames.items()}, self.statuses, poses)


@pytest.fixture
def key(tmp_path: Path) -> Path:
    path = tmp_path / "fleet.key"
    path.write_bytes(KEY)
    return path


@pytest.fixture
def band(lab: Lab) -> Callable[..., Band]:
    return lambda *faults, key=None: Band(lab, list(faults), key)


def forged(delivery: Delivery, key: bytes | None = None) -> list[Position]:
    return [decode(one.frame, key) for one in delivery.forged]


def test_an_offset_shifts_what_the_victim_says_of_itself(band: Callable[..., Band]) -> None:
    drift = {"kind": "drift", "who": "r2", "bias": [0.0, 1.0]}
    clock = {"kind": "clock", "who": "r2", "offset": 9.0}
    spoof = {"kind": "spoof", "as": ["r2"], "payload": {"offset": [3.0, -2.0]}, "id": "lie"}
    team = band(drift, clock, spoof)
    team.tick()
    delivery = team.tick()
    assert [(one.origin, one.fault) for one in delivery.forged] == [(0, "lie")]
    (said,) = forged(delivery)
    assert (said.robot, said.sequence, said.time_ms, said.pose) == (2, 1, 9500, Pose(5.5, 4.0, 0.0))
    assert delivery.heard[1] == [delivery.forged[0].frame, team.sent[1][2], team.sent[1][3]]
    assert [link for link in delivery.arrived if link[0] == FORGED] == [(FORGED, n, 1) for n in (1, 2, 3)]


def test_a_frozen_victim_stays_where_it_was_when_the_fault_began(band: Callable[..., Band]) -> None:
    team = band({"kind": "spoof", "as": ["r1"], "payload": "freeze", "at": 1.0, "for": 2.0})
    said = [forged(team.tick()) for _ in range(8)]
    assert [len(row) for row in said] == [0, 0, 1, 1, 1, 1, 0, 0]
    assert {row[0].pose for row in said[2:6]} == {team.pose(1, 2)}
    assert [row[0].sequence for row in said[2:6]] == [2, 3, 4, 5]


def test_a_replay_is_the_victims_own_frame_byte_by_byte(band: Callable[..., Band], key: Path) -> None:
    team = band({"kind": "spoof", "as": ["r3", "r1"], "payload": {"replay": 1.2}, "at": 1.0}, key=key)
    told = [[one.frame for one in team.tick().forged] for _ in range(6)]
    assert told[:3] == [[], [], []]
    assert told[3:] == [[team.sent[k - 3][1], team.sent[k - 3][3]] for k in (3, 4, 5)]
    for frame in told[5]:
        decode(frame, KEY)


def test_nothing_is_repeated_of_one_who_sent_nothing(band: Callable[..., Band]) -> None:
    team = band({"kind": "spoof", "as": ["r1"], "payload": {"replay": 0.5}})
    team.statuses[1] = Status.DEAD
    assert [team.tick().forged for _ in range(3)] == [(), (), ()]


def test_random_places_lie_on_the_terrain_and_are_drawn_anew(band: Callable[..., Band]) -> None:
    team = band({"kind": "spoof", "as": ["r1"], "payload": "random"})
    poses = [forged(team.tick())[0].pose for _ in range(200)]
    assert len({(pose.x, pose.y) for pose in poses}) == 200
    x_min, y_min, x_max, y_max = team.terrain.bounds
    assert all(x_min <= pose.x <= x_max and y_min <= pose.y <= y_max for pose in poses)
    assert max(pose.x for pose in poses) > 18.0
    assert min(pose.x for pose in poses) < 2.0


def test_a_sequence_ahead_is_the_victims_own_position_under_another_number(band: Callable[..., Band]) -> None:
    team = band({"kind": "spoof", "as": ["r2"], "payload": {"ahead": 1000}})
    team.tick()
    (said,) = forged(team.tick())
    assert (said.robot, said.sequence, said.time_ms, said.pose) == (2, 1001, 500, team.pose(2, 1))


def test_invented_robots_have_numbers_that_nobody_has(band: Callable[..., Band]) -> None:
    team = band({"kind": "spoof", "payload": {"invented": 9}})
    delivery = team.tick()
    assert [position.robot for position in forged(delivery)] == list(range(4, 13))
    assert [link for link in delivery.arrived if link[1] == 1][:9] == [(0, 1, frame_sequence(0, p)) for p in range(9)]


def test_a_strangers_tag_is_wrong_and_an_insiders_is_right(band: Callable[..., Band], key: Path) -> None:
    payload = {"payload": "random", "as": ["r2"]}
    team = band({"kind": "spoof", **payload}, {"kind": "spoof", "by": "r3", **payload}, key=key)
    stranger, insider = team.tick().forged
    with pytest.raises(Rejected) as why:
        decode(stranger.frame, KEY)
    assert why.value.reason is RejectReason.TAG
    assert decode(insider.frame, KEY).robot == 2
    assert (stranger.origin, insider.origin) == (0, 3)
    assert len(stranger.frame) == len(encode(decode(stranger.frame), KEY))


@pytest.mark.parametrize("payload", ["freeze", "random", {"offset": [1.0, 1.0]}, {"invented": 3}], ids=str)
def test_forged_frames_are_as_long_as_any(band: Callable[..., Band], key: Path, payload: Any) -> None:
    delivery = band({"kind": "spoof", "as": "all", "payload": payload}, key=key).tick()
    assert len(delivery.forged) == 3
    assert all(len(one.frame) <= MAX_FRAME for one in delivery.forged)


def test_an_insider_is_subject_to_its_own_radio_and_a_stranger_is_not(band: Callable[..., Band]) -> None:
    payload = {"payload": "random", "as": ["r1"]}
    trouble = [
        {"kind": "loss", "rate": 1.0, "to": "r1"},
        {"kind": "silence", "who": "r3", "direction": "out", "id": "s"},
    ]
    team = band({"kind": "spoof", **payload}, {"kind": "spoof", "by": "r3", **payload}, *trouble)
    delivery = team.tick()
    second = frame_sequence(0, 1)
    fates = {(to, sequence): why for source, to, sequence, why in delivery.dropped if source == FORGED}
    assert fates == {(1, second): "silence:s", (2, second): "silence:s", (3, second): "own"}
    assert [link for link in delivery.arrived if link[0] == FORGED] == [(FORGED, n, 0) for n in (1, 2, 3)]


def test_a_robot_that_hears_nothing_hears_no_stranger(band: Callable[..., Band]) -> None:
    quiet = {"kind": "silence", "who": "r2", "direction": "in"}
    delivery = band({"kind": "spoof", "as": ["r1"], "payload": "random"}, quiet).tick()
    assert [link[1] for link in delivery.arrived if link[0] == FORGED] == [1, 3]


def test_a_dead_robot_forges_nothing(band: Callable[..., Band]) -> None:
    team = band({"kind": "spoof", "by": "r3", "as": ["r1"], "payload": "random"})
    assert len(team.tick().forged) == 1
    team.statuses[3] = Status.PAUSED
    assert team.tick().forged == ()


def test_an_insider_needs_the_key_before_anything_starts(lab: Lab, tmp_path: Path) -> None:
    faults = [{"kind": "spoof", "by": "r1", "as": "r2", "payload": "random"}]
    with pytest.raises(BadInput, match=r"radio\.key: cannot read"):
        lab.patrol(faults=faults, radio={"key": str(tmp_path / "none.key")})
