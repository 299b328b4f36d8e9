"""The ticks that robots without a world count, whatever one member of their fleet says, in one process."""

import math
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.own_robot import LateClock, WatchedRadio
from agent.robots.clock import KeptClock, epoch_of, latest_tick
from agent.robots.direct import ROOM, DirectRadio, Skew
from patrol.pose import Pose
from patrol.radio.message import MAX_SEQUENCE, MAX_TIME_MS, Position, encode, ms_to_s
from runtime.messages.phases import PHASE_B_SHARE
from runtime.net.mailbox import FrameMailbox
from runtime.security.keys import FleetKeys

# Not the product's own, so that a wrong one there is noticed.
COMPLAIN_S = 10.0
FOLLOW_AGAIN_S = 300.0
APART = 2
LONG = 64
REMEMBERED = 9

STEP_S = 5.0
"""So long that a test needs few ticks."""

KEYS = FleetKeys("f")
LIAR = "liar"
DAY_S = 86_400.0

QUIET_TICKS = LONG + round(FOLLOW_AGAIN_S / STEP_S)
"""After a liar's last word: until it no longer counts, and then until each robot may be followed again."""

Words = Mapping[str, Sequence[int]]
"""By hearer, the ticks that the liar tells it."""


def frame_of(number: int, k: int) -> bytes:
    return encode(Position.of(number, k, 0.0, Pose(1.0, 1.0, 0.0)))


@dataclass
class Robot:
    """An honest robot; it listens only when it is told to, so that no thread is needed."""

    name: str
    number: int
    clock: LateClock
    mailbox: FrameMailbox
    watched: WatchedRadio
    said: list[str]
    ks: list[int] = field(default_factory=list)
    followed: list[tuple[float, str]] = field(default_factory=list)  # when, and whom


class Fleet:
    """Honest robots that hear each other, and a member that tells each of them whatever it likes."""

    def __init__(self, ages_s: Sequence[float], began_s: float = 1.8e9, *, given: Sequence[str] = ()) -> None:
        """Let robots r1, r2, ... have counted for so long; those in `given` were told when tick 0 was."""
        self.now_s = began_s
        names = {f"r{number}": number for number in range(1, len(ages_s) + 1)}
        self.names = {**names, LIAR: len(names) + 1}
        self.robots = [
            self._robot(name, self._epoch(age_s), name in given) for name, age_s in zip(names, ages_s, strict=True)
        ]
        self.apart_in: set[frozenset[str]] = set()  # pairs that do not hear each other
        self.tick()

    def _epoch(self, age_s: float) -> float:
        """The time of a robot's tick 0; ticks begin in the first half of the fleet's, which makes them end in time."""
        begin_s = self.now_s - age_s
        return begin_s - max(0.0, begin_s % STEP_S - 0.5 * STEP_S)

    def _robot(self, name: str, epoch_s: float, is_given: bool) -> Robot:
        others = {other: number for other, number in self.names.items() if other != name}
        keys = {KEYS.position(other): number for other, number in others.items()}
        clock = LateClock()
        said: list[str] = []
        sent: list[bytes] = []
        clock.keeper = KeptClock(STEP_S, epoch_s, lambda: self.now_s, self._pass_by)
        mailbox = FrameMailbox(keys, ROOM)
        skew = Skew({number: other for other, number in others.items()}, STEP_S)
        radio = DirectRadio(mailbox, sent.append, keys, clock, skew)
        latest: Callable[[], int] | None = None if is_given else lambda: latest_tick(STEP_S, self.now_s)
        watched = WatchedRadio(radio, clock, latest, said.append, lambda: self.now_s)
        return Robot(name, self.names[name], clock, mailbox, watched, said)

    @staticmethod
    def _pass_by(_seconds: float) -> bool:
        return False

    def tick(self, words: Words | None = None, asleep: Container[str] = ()) -> None:
        """One tick: all robots send, the liar says its words, all hear, but for those that are asleep."""
        self.now_s = (math.floor(self.now_s / STEP_S) + 1 + 0.6 + PHASE_B_SHARE) * STEP_S
        awake = [robot for robot in self.robots if robot.name not in asleep]
        for robot in awake:
            k = robot.clock.tick()
            assert k is not None
            assert not robot.ks or k > robot.ks[-1], "ticks never go back"
            robot.ks.append(k)
            for hearer in self.robots:
                if hearer is not robot and frozenset((hearer.name, robot.name)) not in self.apart_in:
                    hearer.mailbox.put(KEYS.position(robot.name), frame_of(robot.number, k))
        for hearer in self.robots:
            for k in (words or {}).get(hearer.name, ()):
                hearer.mailbox.put(KEYS.position(LIAR), frame_of(self.names[LIAR], min(k, MAX_SEQUENCE)))
        for hearer in awake:
            before = len(hearer.said)
            assert hearer.watched.hear() is not None
            for line in hearer.said[before:]:
                if "this robot counts on from there" in line:
                    hearer.followed.append((self.now_s, line.split()[0]))

    def run(self, ticks: int, words: Callable[[int], Words] = lambda _: {}) -> None:
        for number in range(ticks):
            self.tick(words(number))

    def say(self, lead: int, *hearers: str) -> Words:
        """Words by which the liar leads hearers by so many ticks."""
        return {robot.name: [robot.ks[-1] + 1 + lead] for robot in self.robots if robot.name in hearers}

    def epochs(self) -> list[int]:
        """The time of each robot's tick 0, in ticks, as it counts now."""
        return [round(self.now_s / STEP_S) - robot.ks[-1] for robot in self.robots]

    def is_together(self) -> bool:
        return max(self.epochs()) - min(self.epochs()) <= APART

    def followed(self, name: str) -> list[str]:
        """Whom a robot has followed, in order."""
        return [other for robot in self.robots if robot.name == name for _, other in robot.followed]


def settle(fleet: Fleet) -> int:
    """Run until the robots count alike, and return how many ticks it took."""
    for number in range(10 * QUIET_TICKS):
        if fleet.is_together():
            return number
        fleet.tick()
    raise AssertionError(fleet.epochs())


# --- without a liar --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ages_s", [(0.0, 1000.0), (500.0, 0.0, 1000.0, 10 * DAY_S), (10 * DAY_S, 0.0, 0.0)])
def test_robots_that_began_apart_count_as_the_first(ages_s: tuple[float, ...]) -> None:
    fleet = Fleet(ages_s)
    assert settle(fleet) <= 3 * (REMEMBERED + round(COMPLAIN_S / STEP_S))
    assert min(robot.ks[-1] for robot in fleet.robots) * STEP_S >= max(ages_s)


@pytest.mark.parametrize(
    "is_asleep", [lambda k: k % 8 == 0, lambda k: k % 2 == 0, lambda k: k % 10 > 0, lambda k: k % 80 > 7]
)
def test_a_slow_robot_that_skips_ticks_counts_as_the_first(is_asleep: Callable[[int], bool]) -> None:
    fleet = Fleet([0.0, 1000.0])
    for k in range(20 * REMEMBERED):
        fleet.tick(asleep={"r1"} if is_asleep(k) else ())
    assert fleet.followed("r1") == ["r2"]
    fleet.tick()
    assert fleet.is_together()
    assert fleet.robots[0].said == [line for line in fleet.robots[0].said if "counts on from there" in line]


def test_a_chain_of_robots_counts_as_its_oldest() -> None:
    """r1 and r4 only hear by way of the others."""
    fleet = Fleet([0.0, 100.0, 200.0, 5000.0])
    fleet.apart_in = {frozenset(pair) for pair in (("r1", "r3"), ("r1", "r4"), ("r2", "r4"))}
    settle(fleet)
    assert fleet.robots[0].ks[-1] >= 1000


def test_a_robot_that_was_told_when_tick_0_was_follows_nobody() -> None:
    fleet = Fleet([0.0, 1000.0], given=["r1"])
    fleet.run(3 * QUIET_TICKS, lambda _: fleet.say(10_000, "r1"))
    assert fleet.followed("r1") == []
    assert "positions are refused" in fleet.robots[0].said[-1]


# --- one member lies -------------------------------------------------------------------------------------------------


def test_two_robots_that_were_told_different_counts_end_at_one() -> None:
    """The one that has to follow has just followed the other one, which began first."""
    fleet = Fleet([0.0, 1000.0])
    settle(fleet)
    assert fleet.followed("r1") == ["r2"]
    for number in range(2 * REMEMBERED):
        fleet.tick({"r1": [3295 + number], "r2": [12295 + number]})
    assert [robot.ks[-1] // 1000 for robot in fleet.robots] == [3, 12]
    for robot, told in zip(fleet.robots, (3295, 12295), strict=True):
        lines = [line for line in robot.said if line.startswith(f"{LIAR} has counted ticks for longer, by ")]
        assert len(lines) == 1
        assert told - 300 < int(lines[0].split(" by ")[1].split()[0]) < told
    fleet.run(REMEMBERED + round(COMPLAIN_S / STEP_S))
    assert "r2 has been followed within the last 300 s, and is ahead again" in fleet.robots[0].said[-1]
    assert settle(fleet) <= QUIET_TICKS
    assert min(robot.ks[-1] for robot in fleet.robots) > 12295


def test_a_member_that_leads_again_is_named_and_not_followed() -> None:
    fleet = Fleet([0.0, 0.0])
    fleet.run(3 * REMEMBERED, lambda _: fleet.say(1000, "r1", "r2"))
    for robot in fleet.robots:
        assert fleet.followed(robot.name) == [LIAR]
        assert f"{LIAR} has been followed within the last 300 s, and is ahead again" in robot.said[-1]
    assert max(robot.ks[-1] for robot in fleet.robots) < 1000 + 4 * REMEMBERED + 2


@pytest.mark.parametrize(("early_ticks", "is_followed"), [(1, False), (0, True)])
def test_a_member_is_followed_again_when_its_time_is_over(early_ticks: int, is_followed: bool) -> None:
    fleet = Fleet([0.0])
    fleet.tick({"r1": [fleet.robots[0].ks[-1] + 101] * REMEMBERED})
    assert fleet.followed("r1") == [LIAR]
    fleet.run(round(FOLLOW_AGAIN_S / STEP_S) - early_ticks - 1)
    fleet.tick({"r1": [fleet.robots[0].ks[-1] + 101] * REMEMBERED})
    assert fleet.followed("r1") == [LIAR] * (1 + is_followed)


@pytest.mark.parametrize(("lead", "is_followed"), [(APART, False), (APART + 1, True)])
def test_counts_that_are_almost_alike_are_left_alone(lead: int, is_followed: bool) -> None:
    fleet = Fleet([0.0])
    fleet.tick({"r1": [fleet.robots[0].ks[-1] + 1 + lead] * REMEMBERED})
    assert fleet.followed("r1") == [LIAR] * is_followed


@pytest.mark.parametrize("robots", [1, 2, 4])
def test_a_member_moves_each_robot_once_in_a_time(robots: int) -> None:
    """However long it goes on: what it may do is given back, and runs out each time."""
    fleet = Fleet([0.0] * robots)
    names = [robot.name for robot in fleet.robots]
    ticks = 10 * QUIET_TICKS
    fleet.run(ticks, lambda number: fleet.say(100 + number, *names))
    times = 1 + math.floor(ticks * STEP_S / FOLLOW_AGAIN_S)
    for robot in fleet.robots:
        assert fleet.followed(robot.name).count(LIAR) <= times
        for other in {*names, LIAR}:
            at_s = [now_s for now_s, name in robot.followed if name == other]
            assert all(later - earlier >= FOLLOW_AGAIN_S for earlier, later in pairwise(at_s))
    assert sum(fleet.followed(name).count(LIAR) for name in names) >= 5, "the liar has not been followed"
    assert settle(fleet) <= QUIET_TICKS


def test_a_count_that_no_fleet_can_have_is_refused_by_all() -> None:
    """Whatever one robot may follow, the others may: none is led to where those cannot come."""
    for began_s in (1.8e9, 1.8e9 + 9 * DAY_S, 1.8e9 + 17 * DAY_S):
        fleet = Fleet([0.0, 100.0], began_s)
        settle(fleet)
        fleet.run(3 * REMEMBERED, lambda _: {"r1": [MAX_SEQUENCE, 2**31]})
        assert LIAR not in fleet.followed("r1")
        assert f"{LIAR} is " in fleet.robots[0].said[-1]
        most = latest_tick(STEP_S, fleet.now_s)
        for number in range(3 * REMEMBERED):
            fleet.tick({"r1": [most + number]})
        assert fleet.followed("r1")[-1] == LIAR
        assert settle(fleet) <= QUIET_TICKS
        assert fleet.robots[1].ks[-1] >= most


def test_a_robot_that_was_led_away_before_the_limit_moved_says_what_helps() -> None:
    """Nothing that robots hear tells r2 which of both lies; r1, started again, counts as r2 does."""
    block_s = 0.2 * ms_to_s(MAX_TIME_MS)
    fleet = Fleet([0.0, 0.0], math.ceil(1.8e9 / block_s) * block_s - 3 * STEP_S)
    most = latest_tick(STEP_S, fleet.now_s)
    fleet.tick({"r1": [most] * REMEMBERED})
    fleet.run(2 * QUIET_TICKS)
    assert fleet.followed("r1") == [LIAR]
    assert not fleet.is_together()
    r1, r2 = fleet.robots
    assert all("further than" not in line for line in r2.said)
    assert r1.said[-1].endswith("; this robot counts further than others follow: start it again")
    assert epoch_of(frame_of(1, r1.ks[-1]), fleet.now_s, STEP_S) is None
    began_s = epoch_of(frame_of(2, r2.ks[-1]), fleet.now_s, STEP_S)
    assert began_s == fleet.now_s - r2.ks[-1] * STEP_S


@pytest.mark.parametrize("step_s", [0.1, 0.5, 5.0])
def test_the_latest_tick_fits_into_frames_and_is_the_same_moment_for_all(step_s: float) -> None:
    for now_s in (1.8e9 + days * DAY_S for days in range(0, 60, 3)):
        left_s = ms_to_s(MAX_TIME_MS) - latest_tick(step_s, now_s) * step_s
        assert left_s > 9 * DAY_S
        assert latest_tick(step_s, now_s) * step_s > 29 * DAY_S
    began = [1.8e9 + seconds - latest_tick(step_s, 1.8e9 + seconds) * step_s for seconds in range(0, 3600, 7)]
    assert max(began) - min(began) <= step_s


@pytest.mark.parametrize("age_days", [15, 25, 29])
def test_a_fleet_of_four_weeks_is_joined_whenever_that_is(age_days: int) -> None:
    block_s = 0.2 * ms_to_s(MAX_TIME_MS)
    for phase in (0.001, 0.5, 0.999):
        fleet = Fleet([0.0, age_days * DAY_S, age_days * DAY_S], (math.ceil(1.8e9 / block_s) + phase) * block_s)
        assert settle(fleet) <= QUIET_TICKS
        assert fleet.robots[0].ks[-1] * STEP_S > age_days * DAY_S


def test_a_robot_that_starts_does_not_begin_at_a_count_that_no_fleet_can_have() -> None:
    most = latest_tick(STEP_S, 1.8e9)
    assert epoch_of(frame_of(1, most), 1.8e9, STEP_S) == 1.8e9 - most * STEP_S
    for k in (most + 1, MAX_SEQUENCE):
        assert epoch_of(frame_of(1, k), 1.8e9, STEP_S) is None


def test_the_last_words_of_a_silent_member_are_forgotten() -> None:
    skew = Skew({1: LIAR}, STEP_S)
    for k in range(REMEMBERED):
        skew.hear(k, [frame_of(1, k + 100)])
    for k in range(REMEMBERED, REMEMBERED + LONG - 1):
        assert skew.ticks == {LIAR: 100}
        skew.hear(k, [])
    skew.hear(REMEMBERED + LONG - 1, [])
    assert skew.ticks == {}
    assert skew.complaint() is None


LEADS = st.one_of(
    st.integers(-50, 50),
    st.integers(-(10**4), 10**6),
    st.sampled_from([MAX_SEQUENCE, APART, APART + 1, round(20 * DAY_S / STEP_S), round(39 * DAY_S / STEP_S)]),
)
SPELL = st.tuples(
    st.integers(1, 2 * REMEMBERED),  # how many ticks it says this
    st.dictionaries(st.sampled_from(["r1", "r2", "r3"]), st.lists(LEADS, max_size=REMEMBERED), max_size=3),
)


@settings(max_examples=60, deadline=None)
@given(
    ages_s=st.lists(st.integers(0, 10**5).map(float), min_size=2, max_size=3),
    began_s=st.sampled_from([1.8e9, 1.8e9 + 5 * DAY_S, 1.8e9 + 15 * DAY_S]),
    spells=st.lists(SPELL, max_size=8),
)
def test_whatever_one_member_says_the_others_count_alike_in_the_end(
    ages_s: list[float], began_s: float, spells: list[tuple[int, dict[str, list[int]]]]
) -> None:
    fleet = Fleet(ages_s, began_s)
    for ticks, leads in spells:
        for _ in range(ticks):
            heads = {robot.name: robot.ks[-1] + 1 for robot in fleet.robots}
            fleet.tick(
                {name: [max(0, heads[name] + lead) for lead in said] for name, said in leads.items() if name in heads}
            )
    most = latest_tick(STEP_S, fleet.now_s)
    hops = len(fleet.robots) * (REMEMBERED + round(COMPLAIN_S / STEP_S) + 1)
    fleet.run(QUIET_TICKS + hops)
    assert fleet.is_together(), fleet.epochs()
    assert max(robot.ks[-1] for robot in fleet.robots) <= most + QUIET_TICKS + hops
    for robot in fleet.robots:
        for name in {other for _, other in robot.followed}:
            at_s = [now_s for now_s, other in robot.followed if other == name]
            assert all(later - earlier >= FOLLOW_AGAIN_S for earlier, later in pairwise(at_s))
