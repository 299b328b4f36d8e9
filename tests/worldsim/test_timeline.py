from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.faults.targets import size_of
from patrol.scenario import RobotGroup, Scenario, load_scenario
from worldsim.faults import Act, Timeline

SPARED = RobotGroup(count=5, spare=2)
OPEN: dict[str, Any] = {"terrain": {"builtin": "open"}, "duration": 100, "step": 0.5}


def scenario(*faults: dict[str, Any], robots: int = 5, **more: Any) -> Scenario:
    return load_scenario({**OPEN, "robots": {"count": robots}, "faults": list(faults), **more})


def timeline(*faults: dict[str, Any], **more: Any) -> Timeline:
    return Timeline(scenario(*faults, **more))


# --- who -------------------------------------------------------------------------------------------------------------

TARGETS: list[Any] = ["one", "minority", "half", "all", {"fraction": 0.3}, {"fraction": 1.0}, {"count": 1}]


@pytest.mark.parametrize(
    ("who", "sizes"),
    [
        *(("one", [1, 1, 1, 1, 1, 1]), ("minority", [1, 1, 1, 2, 2, 3]), ("half", [1, 1, 1, 2, 2, 3])),
        *(("all", [1, 2, 3, 4, 5, 6]), ({"fraction": 0.3}, [1, 1, 1, 1, 2, 2])),
        *(({"fraction": 0.5}, [1, 1, 2, 2, 3, 3]), ({"fraction": 0.01}, [1, 1, 1, 1, 1, 1])),
    ],
)
def test_targets_by_size_are_so_many(who: Any, sizes: list[int]) -> None:
    sizes_of = range(2, 8) if who == "minority" else range(1, 7)
    found = [len(timeline({"kind": "silence", "who": who}, robots=robots).entries[0].who) for robots in sizes_of]
    assert found == sizes


def test_all_is_everybody_and_names_are_themselves() -> None:
    faults = [{"kind": "silence", "who": who} for who in ("all", "r3", ["r5", "r2"])]
    assert [entry.who for entry in timeline(*faults).entries] == [(1, 2, 3, 4, 5), (3,), (2, 5)]


@given(st.integers(0, 2**63 - 1), st.sampled_from(TARGETS), st.integers(2, 12), st.sampled_from(TARGETS))
def test_who_is_drawn_from_the_seed_and_the_place_alone(seed: int, who: Any, robots: int, other: Any) -> None:
    fault = {"kind": "silence", "who": who}
    rest: dict[str, Any] = {"kind": "kill", "who": other, "at": 3}
    alone = timeline(rest, fault, robots=robots, seed=seed).entries[1]
    among = timeline({"kind": "loss", "rate": 0.5, "from": other}, fault, rest, robots=robots, seed=seed).entries[1]
    later = timeline(rest, {**fault, "at": 40, "for": 10}, robots=robots, seed=seed).entries[1]
    assert alone.who == among.who == later.who == tuple(sorted(set(alone.who)))
    word = load_scenario({**OPEN, "faults": [fault]}).faults[0].who  # type: ignore[attr-defined]
    assert len(alone.who) == size_of(word, robots)
    assert set(alone.who) <= set(range(1, robots + 1))


@given(st.integers(0, 2**63 - 1), st.integers(2, 12))
def test_larger_targets_hold_the_smaller_ones(seed: int, robots: int) -> None:
    def who(count: int) -> set[int]:
        return set(timeline({"kind": "silence", "who": {"count": count}}, robots=robots, seed=seed).entries[0].who)

    assert all(who(count) < who(count + 1) for count in range(1, robots))


def test_every_robot_is_drawn_as_often() -> None:
    drawn = [timeline({"kind": "kill", "who": "one"}, seed=seed).entries[0].who[0] for seed in range(500)]
    assert all(70 <= drawn.count(number) <= 130 for number in range(1, 6))


def test_the_ends_of_a_link_fault_are_drawn_apart() -> None:
    ends = [timeline({"kind": "loss", "rate": 0.1, "from": "half", "to": "half"}, seed=s).entries[0] for s in range(40)]
    assert any(entry.sources != entry.targets for entry in ends)
    assert {len(entry.sources) for entry in ends} == {len(entry.targets) for entry in ends} == {2}
    assert not any(entry.who for entry in ends)


@given(st.integers(0, 2**63 - 1), st.integers(2, 12), st.sampled_from(["halves", "one"]))
def test_a_partition_puts_everybody_into_one_group(seed: int, robots: int, groups: str) -> None:
    found = timeline({"kind": "partition", "groups": groups}, robots=robots, seed=seed).entries[0].groups
    assert sorted(number for group in found for number in group) == list(range(1, robots + 1))
    assert len(found[0]) == (1 if groups == "one" else robots // 2)
    assert len(found) == 2


def test_robots_in_no_group_form_one_more() -> None:
    found = timeline({"kind": "partition", "groups": [["r4"], ["r3", "r1"]]}).entries[0].groups
    assert found == ((4,), (1, 3), (2, 5))


def test_a_spoof_knows_its_forger_and_its_victims() -> None:
    insider = {"kind": "spoof", "by": "r2", "as": ["r3", "r1"], "payload": "freeze"}
    stranger = {"kind": "spoof", "payload": "random"}
    inside, outside = timeline(insider, stranger).entries
    assert (inside.sources, inside.who) == ((2,), (1, 3))
    assert outside.sources == (0,)
    assert len(outside.who) == 1


# --- when ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("at", "lasts", "begin", "end"),
    [
        *((0, None, 0, None), (0, 0.1, 0, 1), (0.5, 0.5, 1, 2), (0.6, 1.0, 2, 4)),
        *((0.1 * 3, 1.24, 1, 3), (0, 1.25, 0, 3), (10, 30, 20, 80)),
    ],
)
def test_times_become_ticks(at: float, lasts: float | None, begin: int, end: int | None) -> None:
    entry = timeline({"kind": "silence", "who": "all", "at": at, "for": lasts}).entries[0]
    assert (entry.begin, entry.end) == (begin, end)


def test_a_time_that_is_a_tick_but_for_rounding_is_that_tick() -> None:
    for k in range(1, 300):
        assert timeline({"kind": "kill", "who": "one", "at": k * 0.1}, step=0.1).entries[0].begin == k


def test_what_is_active_is_listed_by_index() -> None:
    silence = {"kind": "silence", "who": "all"}
    line = timeline(
        {**silence, "at": 10}, {**silence, "at": 5, "for": 10}, {"kind": "pause", "who": "all", "for": 20}, silence
    )
    active = {k: [entry.index for entry in line.at(k)] for k in (0, 9, 10, 19, 20, 29, 30, 10**6)}
    assert active == {0: [3], 9: [3], 10: [1, 3], 19: [1, 3], 20: [0, 1, 3], 29: [0, 1, 3], 30: [0, 3], 10**6: [0, 3]}
    assert timeline({**silence, "at": 10}).at(3) == ()
    assert timeline().at(0) == ()


@given(st.lists(st.tuples(st.integers(0, 180), st.none() | st.integers(1, 40)), max_size=6), st.integers(0, 250))
def test_a_fault_is_active_from_its_beginning_to_before_its_end(times: list[tuple[int, int | None]], k: int) -> None:
    silence = {"kind": "silence", "who": "all"}
    line = timeline(*({**silence, "at": a * 0.5, "for": None if n is None else n * 0.5} for a, n in times))
    active = [index for index, (a, n) in enumerate(times) if a <= k and (n is None or k < a + n)]
    assert [entry.index for entry in line.at(k)] == active


def test_acts_are_by_fault_and_then_by_robot() -> None:
    line = timeline(
        {"kind": "kill", "who": ["r4", "r2"], "at": 10, "wreck": "removed"},
        {"kind": "restart", "who": "r1", "at": 10},
        {"kind": "pause", "who": ["r3"], "for": 10, "id": "nap"},
        {"kind": "resume", "who": "r5", "at": 10},
        {"kind": "silence", "who": "all", "at": 10},
    )
    kills = Act("kill", 2, "f1", "removed"), Act("kill", 4, "f1", "removed")
    assert line.acts(20) == (*kills, Act("restart", 1, "f2"), Act("resume", 3, "nap"), Act("resume", 5, "f4"))
    assert line.acts(0) == (Act("pause", 3, "nap"),)
    assert line.acts(1) == ()
    assert line.needs_process_control
    assert not timeline({"kind": "silence", "who": "all"}).needs_process_control


def test_who_joins_is_absent_from_the_beginning_unless_it_leaves_before() -> None:
    join = {"kind": "join", "who": ["r4", "r5"], "at": 20}
    line = timeline(join, {"kind": "leave", "who": "r1"})
    assert line.starts_absent == {4, 5}
    assert line.acts(40) == (Act("join", 4, "f1"), Act("join", 5, "f1"))
    leaves = [{"kind": "leave", "who": ["r1", "r4"], "at": 10}, {"kind": "leave", "who": "r5", "at": 30}]
    assert timeline(join, *leaves, {"kind": "join", "who": "r1", "at": 40}).starts_absent == {5}


def test_a_fault_means_the_same_robots_with_spare_ones_and_without() -> None:
    faults: list[dict[str, Any]] = [
        {"kind": "kill", "at": 1, "who": "half"},
        {"kind": "drift", "who": {"fraction": 0.4}},
        {"kind": "partition", "groups": "halves"},
        {"kind": "loss", "rate": 0.5},
    ]
    plain = timeline(*faults).entries
    spared = Timeline(scenario(*faults).model_copy(update={"robots": SPARED}))
    assert spared.starts_absent == {6, 7}
    assert [entry.who for entry in spared.entries[:2]] == [entry.who for entry in plain[:2]]
    assert spared.entries[2].groups == (plain[2].groups[0], (*plain[2].groups[1], 6, 7))
    assert spared.entries[3].sources == spared.entries[3].targets == (1, 2, 3, 4, 5, 6, 7)


# --- what is told ----------------------------------------------------------------------------------------------------


def test_beginnings_and_endings_are_events() -> None:
    line = timeline(
        {"kind": "loss", "from": "r1", "rate": 0.25, "at": 5, "for": 5},
        {"kind": "kill", "who": "r2", "at": 5},
        {"kind": "partition", "groups": [["r1", "r2"]], "at": 10},
        {"kind": "spoof", "as": "r1", "payload": {"offset": [5, 0]}, "at": 20},
    )
    told = [(event.k, event.kind, event.detail) for k in range(50) for event in (*line.endings(k), *line.beginnings(k))]
    assert told == [
        (10, "fault", "f1 loss begins: r1 to all, rate 0.25"),
        (10, "fault", "f2 kill happens: r2"),
        (20, "fault", "f1 loss ends"),
        (20, "fault", "f3 partition begins: r1 r2 | r3 r4 r5"),
        (40, "fault", "f4 spoof begins: stranger as r1, payload {offset: [5, 0]}"),
    ]


@pytest.mark.parametrize(
    ("faults", "healed"),
    [
        ([], 0),
        ([{"kind": "silence", "who": "all", "at": 5, "for": 10}], 30),
        ([{"kind": "silence", "who": "all", "at": 5}], None),
        ([{"kind": "kill", "who": "one", "at": 5}, {"kind": "restart", "who": "all", "at": 25}], 50),
        ([{"kind": "pause", "who": "one", "at": 5, "for": 5}, {"kind": "pause", "who": "one"}], 20),
    ],
)
def test_a_run_is_healed_when_nothing_happens_any_more(faults: list[dict[str, Any]], healed: int | None) -> None:
    assert timeline(*faults).healed == healed


# --- the nemesis in time ---------------------------------------------------------------------------------------------

AFTER = {"kill": "dead", "restart": "alive", "pause": "paused", "resume": "alive", "join": "alive", "leave": "left"}
BEFORE = {"kill": {"alive"}, "restart": {"alive", "dead"}, "pause": {"alive"}, "resume": {"paused"}}
BEFORE |= {"join": {"absent", "left"}, "leave": {"alive"}}


@given(st.integers(0, 2**63 - 1), st.integers(1, 8), st.sampled_from([0.1, 0.5, 1.0 / 3.0]), st.integers(2, 60))
def test_a_nemesis_makes_sense_leaves_somebody_and_heals(seed: int, robots: int, step: float, interval: int) -> None:
    nemesis = {"interval": interval, "seed": seed, "quiet": 40}
    found = load_scenario({**OPEN, "robots": {"count": robots}, "step": step, "nemesis": nemesis})
    line = Timeline(found)
    status = {number: "absent" if number in line.starts_absent else "alive" for number in range(1, robots + 1)}
    for k in range(found.ticks):
        for act in line.acts(k):
            assert status[act.number] in BEFORE[act.kind], act
            status[act.number] = AFTER[act.kind]
        assert "alive" in status.values()
    assert set(status.values()) == {"alive"}
    assert line.healed is not None
    assert line.healed * step <= 60.0 + 1e-6
