"""The ether: every directed pair for itself, every frame accounted for, and what the faults do to frames."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.faults.kinds import Wait
from patrol.ground.terrain import Terrain
from patrol.journal.records import MAX_TICKS, Status, frame_sequence, sent_at
from patrol.pose import Pose
from patrol.radio.message import MAX_FRAMES
from patrol.scenario import Scenario, load_scenario
from tests.worldsim.conftest import Lab
from worldsim.faults import Timeline
from worldsim.radio.ether import OVERSIZED, RECEIVER_ABSENT, RECEIVER_DEAD, RECEIVER_PAUSED, Delivery, Ether, ether_of
from worldsim.radio.rules import Burst, waited
from worldsim.robots.senses import Senses

ALIVE = Status.ALIVE


def scenario_of(*faults: dict[str, Any], robots: int = 4, **more: Any) -> Scenario:
    return load_scenario(
        {"terrain": {"builtin": "open"}, "robots": {"count": robots}, "faults": list(faults), "seed": 3, **more}
    )


@dataclass
class Air:
    """An ether that carries a frame of 20 bytes from each robot in each tick."""

    scenario: Scenario
    terrain: Terrain
    statuses: dict[int, Status] = field(default_factory=dict)
    poses: dict[int, Pose] = field(default_factory=dict)
    sent: Counter[tuple[int, int]] = field(default_factory=Counter)
    settled: Counter[tuple[int, int]] = field(default_factory=Counter)
    ticks: list[Delivery] = field(default_factory=list)

    def __post_init__(self) -> None:
        numbers = [spec.number for spec in self.scenario.roster]
        self.statuses = dict.fromkeys(numbers, ALIVE) | self.statuses
        self.poses = {n: Pose(2.0 * n, 3.0, 0.0) for n in numbers} | self.poses
        timeline = Timeline(self.scenario)
        senses = Senses(self.scenario, timeline, self.terrain)
        self.ether = ether_of(self.scenario, timeline, self.terrain, senses)

    def tick(self, frames: Mapping[int, Sequence[bytes]] | None = None) -> Delivery:
        alive = [n for n, status in self.statuses.items() if status is ALIVE]
        k = len(self.ticks)
        frames = {n: [bytes([n]) * 20] for n in alive} if frames is None else frames
        delivery = self.ether.carry(k, frames, self.statuses, self.poses)
        there = [n for n, status in self.statuses.items() if status not in (Status.ABSENT, Status.LEFT)]
        self.sent.update((a, b) for a, sent in frames.items() for _ in sent for b in there if a != b)
        self.sent.update((a, b) for a, b, _, _ in delivery.copies)
        self.settled.update((a, b) for a, b, _ in delivery.arrived)
        self.settled.update((a, b) for a, b, _, _ in delivery.dropped)
        assert self.sent.total() == self.settled.total() + self.ether.in_flight.total()
        self.ticks.append(delivery)
        return delivery

    def run(self, ticks: int) -> list[Delivery]:
        for _ in range(ticks):
            self.tick()
        return self.ticks

    def arrivals(self) -> dict[tuple[int, int, int], list[int]]:
        """The ticks in which frames arrived, by link."""
        found: dict[tuple[int, int, int], list[int]] = {}
        for k, delivery in enumerate(self.ticks):
            for link in delivery.arrived:
                found.setdefault(link, []).append(k)
        return found

    def causes(self) -> Counter[str]:
        return Counter(cause for delivery in self.ticks for *_, cause in delivery.dropped)


@pytest.fixture
def air(lab: Lab) -> Any:
    def of(*faults: dict[str, Any], robots: int = 4, **more: Any) -> Air:
        return Air(scenario_of(*faults, robots=robots), lab.room, **more)

    return of


def alive(*numbers: int) -> dict[int, Status]:
    return dict.fromkeys(numbers, ALIVE)


def test_every_frame_reaches_all_others_in_the_same_tick() -> None:
    delivery = Ether().carry(5, {3: [b"c"], 1: [b"a"], 2: ()}, alive(1, 2, 3), {})
    assert delivery.heard == {1: [b"c"], 2: [b"a", b"c"], 3: [b"a"]}
    assert delivery.arrived == ((1, 2, 5), (1, 3, 5), (3, 1, 5), (3, 2, 5))
    assert delivery.dropped == ()


@pytest.mark.parametrize(
    ("status", "cause"),
    [
        *((Status.DEAD, RECEIVER_DEAD), (Status.LOST, RECEIVER_DEAD), (Status.PAUSED, RECEIVER_PAUSED)),
        *((Status.ABSENT, None), (Status.LEFT, None)),
    ],
)
def test_frames_to_those_who_do_not_listen_are_dropped_and_counted(status: Status, cause: str | None) -> None:
    """A robot that is not there is no receiver."""
    delivery = Ether().carry(0, {1: [b"a"]}, {**alive(1, 3), 2: status}, {})
    assert delivery.heard == {1: [], 3: [b"a"]}
    assert delivery.dropped == (() if cause is None else ((1, 2, 0, cause),))
    assert delivery.arrived == ((1, 3, 0),)


def test_an_oversized_frame_is_dropped_whatever_it_holds(air: Any) -> None:
    for ether in (Ether(), air({"kind": "delay", "delay": {"constant": 0.0}}).ether):
        both, poses = alive(1, 2, 3, 4), {n: Pose(1.0, n, 0.0) for n in (1, 2, 3, 4)}
        assert ether.carry(0, {1: [bytes(64)]}, both, poses).heard[2] == [bytes(64)]
        delivery = ether.carry(1, {1: [bytes(65)]}, both, poses)
        assert delivery.heard[2] == []
        assert delivery.dropped == tuple((1, n, 1, OVERSIZED) for n in (2, 3, 4))


def test_each_of_a_senders_frames_has_a_number_of_its_own() -> None:
    delivery = Ether().carry(5, {1: [b"position", b"first", b"second"]}, alive(1, 2), {})
    assert delivery.heard[2] == [b"position", b"first", b"second"]
    assert delivery.arrived == tuple((1, 2, frame_sequence(5, place)) for place in range(3))
    most = frame_sequence(MAX_TICKS, MAX_FRAMES - 1)
    assert most < 2**32
    assert len({frame_sequence(k, place) for k in (0, 1, MAX_TICKS) for place in range(MAX_FRAMES)}) == 3 * MAX_FRAMES
    assert all(sent_at(frame_sequence(k, place)) == k for k in (0, 7, MAX_TICKS) for place in (0, 4, 900))


LOSS = {"kind": "loss", "rate": 0.5}


def test_a_loss_is_drawn_for_each_directed_pair_alone(lab: Lab) -> None:
    def arrived(robots: int) -> set[tuple[int, int, int]]:
        air = Air(scenario_of(LOSS, robots=robots), lab.room)
        air.run(100)
        assert air.settled == {(i, j): 100 for i in range(1, robots + 1) for j in range(1, robots + 1) if i != j}
        return {link for link in air.arrivals() if max(link[:2]) <= 2}

    small, large = arrived(2), arrived(4)
    assert small == large
    assert 60 < len(small) < 140
    assert {k for i, _, k in small if i == 1} != {k for i, _, k in small if i == 2}


def test_a_tick_without_faults_is_as_if_there_were_none(air: Any) -> None:
    faulty, plain = air({**LOSS, "at": 5.0, "for": 2.0}), air()
    same = [delivery == other for delivery, other in zip(faulty.run(20), plain.run(20), strict=True)]
    assert same == [not 10 <= k < 14 for k in range(20)]


def test_a_loss_keeps_to_its_links_and_its_time(air: Any) -> None:
    lossy = air({"kind": "loss", "rate": 1.0, "from": "r1", "to": ["r2", "r3"], "at": 1.0, "for": 1.0, "id": "gone"})
    lossy.run(6)
    dropped = {fate for delivery in lossy.ticks for fate in delivery.dropped}
    assert dropped == {(1, to, k, "loss:gone") for to in (2, 3) for k in (2, 3)}


@pytest.mark.parametrize(("rate", "burst"), [(0.2, 4.0), (0.5, 8.0), (0.85, 8.0), (0.5, 1.0)])
def test_bursts_have_the_rate_and_the_length_asked_for(air: Any, rate: float, burst: float) -> None:
    bursty = air({"kind": "loss", "rate": rate, "mean_burst": burst}, robots=3)
    ticks = 3000
    bursty.run(ticks)
    lost = {fate[:3] for delivery in bursty.ticks for fate in delivery.dropped}
    links = [(i, j) for i in (1, 2, 3) for j in (1, 2, 3) if i != j]
    rows = [[(*link, k) in lost for k in range(ticks)] for link in links]
    share = sum(map(sum, rows)) / (ticks * len(links))
    begun = sum(now and not before for row in rows for before, now in pairwise(row))
    assert share == pytest.approx(rate, abs=0.05)
    assert sum(map(sum, rows)) / begun == pytest.approx(burst, rel=0.15)


def test_links_begin_bad_as_often_as_asked_and_bursts_go_on_while_nothing_is_sent() -> None:
    (entry,) = Timeline(scenario_of({"kind": "loss", "rate": 0.3, "mean_burst": 5, "at": 2.0})).entries
    links = [(source, to) for source in range(1, 41) for to in range(1, 41) if source != to]
    first = [Burst(3, entry, 0.3, 5.0, link).bad(entry.begin) for link in links]
    assert abs(sum(first) / len(links) - 0.3) < 5.0 * math.sqrt(0.21 / len(links))
    always, seldom = (Burst(3, entry, 0.3, 5.0, (1, 2)) for _ in range(2))
    each = [always.bad(k) for k in range(entry.begin, entry.begin + 700)]
    assert [seldom.bad(k) for k in range(entry.begin, entry.begin + 700, 7)] == each[::7]
    assert all(each[lag:] != each[:-lag] for lag in range(1, 200)), "no chain comes round"


def test_a_burst_is_a_function_of_the_tick_and_takes_contacts_along(air: Any) -> None:
    fault = {"kind": "loss", "rate": 0.5, "mean_burst": 3.0}
    always, now_and_then = air(fault), air(fault)
    always.run(60)
    for k in range(60):
        now_and_then.tick(None if k % 7 == 0 else {})
    reached = {link for link in always.arrivals() if link[2] % 7 == 0}
    assert reached == set(now_and_then.arrivals())
    together = air(fault)
    for _ in range(60):
        together.tick({1: [b"position", b"contact"]})
    by_tick = Counter((to, sent_at(sequence)) for _, to, sequence in together.arrivals())
    assert set(by_tick.values()) == {2}


@pytest.mark.parametrize(
    ("seconds", "ticks"), [(0.0, 0), (0.1, 0), (0.11, 1), (0.5, 1), (0.6, 1), (0.61, 2), (1.0, 2), (5.0, 10)]
)
def test_a_delay_counts_from_phase_a_to_the_next_phase_b(air: Any, seconds: float, ticks: int) -> None:
    late = air({"kind": "delay", "delay": {"constant": seconds}, "from": "r1", "to": "r2", "for": 5.0, "id": "late"})
    late.run(25)
    arrivals = late.arrivals()
    assert [arrivals[1, 2, k] for k in range(10)] == [[k + ticks] for k in range(10)]
    assert [arrivals[2, 1, k] for k in range(10)] == [[k] for k in range(10)]
    held = [fate for delivery in late.ticks for fate in delivery.delayed]
    assert held == ([(1, 2, k, "late") for k in range(10)] if ticks else [])


def test_delays_of_several_faults_add_up(air: Any) -> None:
    half = {"kind": "delay", "delay": {"constant": 0.5}}
    late = air(half, half, {"kind": "reorder", "rate": 1.0})
    late.run(8)
    arrived = {link[:2]: times for link, times in late.arrivals().items() if link[2] == 0}
    assert arrived == {(i, j): [3] for i in range(1, 5) for j in range(1, 5) if i != j}
    assert late.ether.in_flight.total() == 3 * 12


def test_a_reordered_frame_is_overtaken_and_heard_in_order_of_arrival(air: Any) -> None:
    mixed = air({"kind": "reorder", "rate": 0.5, "hold": 1.0}, robots=2)
    mixed.run(60)
    times = [mixed.arrivals()[1, 2, k][0] for k in range(50)]
    assert {time - k for k, time in enumerate(times)} == {0, 2}
    assert times != sorted(times)


def test_a_copy_arrives_too_and_is_counted_as_sent(air: Any) -> None:
    double = air({"kind": "duplicate", "rate": 1.0, "delay": {"constant": 1.0}, "for": 2.0}, robots=2)
    double.run(10)
    arrivals = double.arrivals()
    assert [arrivals[1, 2, k] for k in range(10)] == [*([k, k + 2] for k in range(4)), *([k] for k in range(4, 10))]
    assert double.sent == {(1, 2): 14, (2, 1): 14}
    assert [sum(d.arrived.count((1, 2, 0)) for d in double.ticks[:1]), double.ether.in_flight.total()] == [1, 0]


def test_copies_without_a_delay_arrive_side_by_side(air: Any) -> None:
    double = air({"kind": "duplicate", "rate": 1.0}, {"kind": "duplicate", "rate": 1.0, "id": "again"}, robots=2)
    delivery = double.tick()
    assert delivery.arrived == ((1, 2, 0),) * 3 + ((2, 1, 0),) * 3
    assert delivery.copies[:2] == ((1, 2, 0, "f1"), (1, 2, 0, "again"))


PARTITION = {"kind": "partition", "groups": [["r1", "r2"]]}
SILENCE = {"kind": "silence", "who": "r2"}
ACROSS, BACK = {(1, 3), (1, 4), (2, 3), (2, 4)}, {(3, 1), (3, 2), (4, 1), (4, 2)}
IN, OUT = {(1, 2), (3, 2), (4, 2)}, {(2, 1), (2, 3), (2, 4)}


@pytest.mark.parametrize(
    ("fault", "direction", "cut"),
    [
        (PARTITION, "both", ACROSS | BACK),
        (PARTITION, "one-way", ACROSS),
        (SILENCE, "in", IN),
        (SILENCE, "out", OUT),
        (SILENCE, "both", IN | OUT),
    ],
)
def test_a_cut_goes_between_groups_or_around_a_robot(
    air: Any, fault: dict[str, Any], direction: str, cut: set[tuple[int, int]]
) -> None:
    split = air({**fault, "direction": direction})
    assert {fate[:2] for fate in split.tick().dropped} == cut
    assert split.causes() == {f"{fault['kind']}:f1": len(cut)}


def test_a_radio_reaches_so_far(air: Any) -> None:
    places = {1: Pose(2.0, 2.0, 0.0), 2: Pose(5.0, 6.0, 0.0), 3: Pose(2.0, 7.01, 0.0), 4: Pose(12.0, 2.0, 0.0)}
    near = air({"kind": "range", "who": ["r1"], "reach": 5.0}, poses=places)
    assert {fate[:2] for fate in near.tick().dropped} == {(1, 3), (1, 4)}


def test_walls_stop_a_radio_that_needs_a_line_of_sight(air: Any) -> None:
    """The room has a wall over x in [10, 10.5) below y = 7.5."""
    places = {1: Pose(8.0, 3.0, 0.0), 2: Pose(13.0, 3.0, 0.0), 3: Pose(8.0, 9.0, 0.0), 4: Pose(13.0, 9.0, 0.0)}
    through = air({"kind": "range", "reach": 50.0}, poses=places)
    assert through.tick().dropped == ()
    sight = air({"kind": "range", "reach": 50.0, "through_walls": False}, poses=places)
    assert {fate[:2] for fate in sight.tick().dropped} == {(1, 2), (2, 1), (1, 4), (4, 1), (2, 3), (3, 2)}


def test_bandwidth_is_a_bucket_of_a_second(air: Any) -> None:
    """100 bytes at first and 50 a tick, of which a tick's two frames of 30 take 60: the second lacks now and then."""
    narrow = air({"kind": "bandwidth", "who": "r1", "bytes_per_s": 100.0}, robots=2)
    for _ in range(40):
        narrow.tick({1: [bytes(30), bytes(30)], 2: [bytes(60)]})
    assert narrow.causes() == {"bandwidth:f1": (60 * 40 - (100 + 50 * 39)) // 30 + 1}
    assert len([link for link in narrow.arrivals() if link[0] == 2]) == 40


def test_a_frame_that_one_bandwidth_drops_uses_up_nothing_of_another(air: Any) -> None:
    """The frame that the narrow one drops in tick 1 stays in the wide one, which is then full for tick 2."""
    wide = {"kind": "bandwidth", "who": "r1", "bytes_per_s": 100.0, "id": "wide"}
    narrow = {"kind": "bandwidth", "who": "r1", "bytes_per_s": 8.0, "id": "narrow", "for": 1.0}
    both = air(wide, narrow, robots=2)
    for lengths in ([60], [60], [60, 40]):
        both.tick({1: [bytes(length) for length in lengths], 2: []})
    assert [[why for *_, why in delivery.dropped] for delivery in both.ticks] == [[], ["bandwidth:narrow"], []]


@pytest.mark.parametrize("bytes_per_s", [30.0, 200.0])
@given(bursts=st.lists(st.tuples(st.integers(1, 400), st.lists(st.integers(1, 64), max_size=8)), max_size=40))
def test_no_span_of_ticks_holds_more_than_its_bandwidth_and_a_bucket(
    bytes_per_s: float, bursts: list[tuple[int, list[int]]]
) -> None:
    """Robots that were silent for long, as in a pause, have saved up no more than a second's worth."""
    made = scenario_of({"kind": "bandwidth", "bytes_per_s": bytes_per_s}, robots=2, duration=10_000.0)
    terrain = Terrain("room", np.ones((10, 10), dtype=np.bool_), 1.0)
    ether = ether_of(made, Timeline(made), terrain, Senses(made, Timeline(made), terrain))
    poses = {1: Pose(1.0, 1.0, 0.0), 2: Pose(3.0, 3.0, 0.0)}
    k, passed = 0, []
    for wait, lengths in bursts:
        k += wait
        frames = [bytes(length) for length in lengths]
        arrived = ether.carry(k, {1: frames, 2: frames}, {1: ALIVE, 2: ALIVE}, poses).arrived
        sizes = [[lengths[seq // (MAX_TICKS + 1)] for source, _, seq in arrived if source == n] for n in (1, 2)]
        assert sizes[0] == sizes[1], "each sender has its own"
        passed.append((k, sum(sizes[0])))
    most = max(64.0, bytes_per_s)
    for first, (begin, _) in enumerate(passed):
        for last, (end, _) in enumerate(passed[first:], first):
            assert sum(size for _, size in passed[first : last + 1]) <= most + bytes_per_s * 0.5 * (end - begin) + 1e-6


def test_the_least_bandwidth_lets_the_longest_frame_through_in_the_end(air: Any) -> None:
    narrow = air({"kind": "bandwidth", "bytes_per_s": 8.0}, robots=2)
    for _ in range(100):
        narrow.tick({1: [bytes(64)], 2: []})
    assert [k for _, _, k in narrow.arrivals()] == [0, 16, 32, 48, 64, 80, 96]


def test_the_first_cause_is_named(air: Any) -> None:
    faults = [
        {"kind": "loss", "rate": 1.0, "id": "l"},
        {"kind": "bandwidth", "bytes_per_s": 1.0, "id": "b", "who": ["r1", "r2", "r3"]},
        {"kind": "range", "reach": 3.0, "id": "r", "who": ["r1", "r2"]},
        {"kind": "partition", "groups": [["r1"]], "id": "p"},
        {"kind": "silence", "who": "r4", "id": "s", "direction": "in"},
    ]
    poses = {1: Pose(1.0, 1.0, 0.0), 2: Pose(2.0, 1.0, 0.0), 3: Pose(9.0, 1.0, 0.0), 4: Pose(9.0, 2.0, 0.0)}
    troubled = air(*faults, poses=poses)
    troubled.tick({n: [bytes(60)] for n in (1, 2, 3, 4)})
    found = {fate[:2]: fate[3] for fate in troubled.tick().dropped}
    assert found == {
        (1, 2): "partition:p", (1, 3): "partition:p", (1, 4): "silence:s",
        (2, 1): "partition:p", (2, 3): "range:r", (2, 4): "silence:s",
        (3, 1): "partition:p", (3, 2): "bandwidth:b", (3, 4): "silence:s",
        (4, 1): "partition:p", (4, 2): "loss:l", (4, 3): "loss:l",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("status", "cause"),
    [
        *((Status.DEAD, RECEIVER_DEAD), (Status.PAUSED, RECEIVER_PAUSED), (Status.LEFT, RECEIVER_ABSENT)),
        *((Status.LOST, RECEIVER_DEAD), (ALIVE, None)),
    ],
)
def test_a_frame_in_flight_is_lost_on_arrival_where_the_robot_has_gone(
    air: Any, status: Status, cause: str | None
) -> None:
    """It reaches a robot that has been restarted meanwhile."""
    late = air({"kind": "delay", "delay": {"constant": 1.0}, "for": 0.5}, robots=2)
    late.tick()
    late.statuses[2] = Status.DEAD if status is ALIVE else status
    late.tick()
    late.statuses[2] = status
    delivery = late.tick()
    assert ((1, 2, 0) in delivery.arrived) == (cause is None)
    assert cause is None or delivery.dropped[0] == (1, 2, 0, cause)


def test_a_uniform_wait_lies_between_both_of_its_ends() -> None:
    waits = [waited(Wait(uniform=(2.0, 3.0)), 7, number) for number in range(1000)]
    assert 2.0 <= min(waits) < 2.05
    assert 2.95 < max(waits) < 3.0
    assert sum(waits) / 1000 == pytest.approx(2.5, abs=0.05)
