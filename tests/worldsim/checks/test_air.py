"""The verdict on reach, delays, copies and reorderings, from the journal alone: each check passes, and can fail."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from shapely import LineString, box

from patrol.ground.terrain import Terrain
from patrol.journal import TickRecord
from patrol.journal.records import sent_at
from patrol.random import draw, mix
from tests.worldsim.checks.judged import Run, change, check_of, checks, failures, result_of, spares, stops
from tests.worldsim.conftest import Lab
from worldsim.checks.arrivals import DelaysAsAsked, LinkDraws, LossesAsAsked, alarm_of
from worldsim.checks.check import unexplained
from worldsim.checks.journal import FaultsOnTime
from worldsim.checks.reach import Sightlines
from worldsim.faults import Timeline
from worldsim.output.record import header_of
from worldsim.radio import rules
from worldsim.radio.rules import RadioRules, arrival
from worldsim.run_record import MemoryJournal
from worldsim.world import World

# Not the product's own, so that a wrong one there is noticed.
GRAZING_M = 1e-5

NEAR = {"kind": "range", "reach": 8.0, "id": "near"}
SEEN = {"kind": "range", "reach": 100.0, "through_walls": False, "id": "seen"}
LATE = {"kind": "delay", "delay": {"constant": 1.2}, "id": "late"}
SPREAD = {"kind": "delay", "delay": {"uniform": [0.7, 1.5]}, "id": "spread"}
TWICE = {"kind": "duplicate", "rate": 0.5, "delay": {"constant": 0.8}, "id": "twice"}
MIXED = {"kind": "reorder", "rate": 0.3, "hold": 1.0, "id": "mixed"}


# --- when faults happen ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("at", [0.0, 0.1, 3.0, 3.3])
@pytest.mark.parametrize("lasts", [None, 0.01, 0.05, 0.24, 0.25, 2.3])
def test_faults_happen_when_they_should(lab: Lab, at: float, lasts: float | None) -> None:
    times = {"at": at} if lasts is None else {"at": at, "for": lasts}
    faults = [{"kind": "silence", "who": "r1", **times}, {"kind": "kill", "who": "r2", "at": at}]
    world = lab.patrol(faults=faults, step=0.1)
    timeline = Timeline(world.scenario)

    def ok() -> bool:
        return check_of(FaultsOnTime, world.prepared, MemoryJournal(header_of(world)), timeline).result().ok

    assert ok()
    silence, kill = timeline.entries
    wrong = [replace(entry, begin=entry.begin + shift) for entry in (silence, kill) for shift in (-1, 1)]
    wrong += [replace(kill, end=kill.begin + 1), replace(kill, end=None)]
    if silence.end is None:
        wrong.append(replace(silence, end=90))
    else:
        wrong += [replace(silence, end=end) for end in (silence.end - 1, silence.end + 1, None)]
        wrong += [replace(silence, begin=silence.begin + shift, end=silence.end + shift) for shift in (-1, 1)]
    for entry in wrong:
        timeline.entries = (entry,)
        assert not ok()


@pytest.mark.parametrize(
    ("name", "ticks", "says"),
    [
        ("ticks_of", lambda *_: 1, "from tick 4 to before tick 5"),
        ("tick_of", lambda *_: 0, "from tick 0 to before tick 10"),
    ],
)
def test_a_timeline_with_other_times_fails(
    run: Run, name: str, ticks: Any, says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"worldsim.faults.{name}", ticks)
    detail = f"f1 is scheduled {says}, which is not what its `at` and `for` say"
    assert failures(run({"kind": "silence", "who": "r1", "at": 2.0, "for": 5.0})) == {"fault times": detail}


# --- reach -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("fault", [NEAR, SEEN], ids=["distance", "walls"])
def test_reach_is_told_from_true_places(run: Run, fault: dict[str, Any]) -> None:
    result = run(fault, LATE, {"kind": "spoof", "by": "r2", "as": "r1", "payload": "freeze"}, ticks=80)
    assert failures(result) == {}
    stopped = sum(why == f"range:{fault['id']}" for record in result[1].ticks for *_, why in record.dropped)
    assert stopped > 0
    assert checks(result)["reach"].detail == f"{stopped} frames were out of reach, and no other was stopped"


@pytest.mark.parametrize("fault", [NEAR, SEEN], ids=["distance", "walls"])
@pytest.mark.parametrize("late", [False, True])
def test_a_radio_that_reaches_farther_fails(
    run: Run, fault: dict[str, Any], late: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(RadioRules, "stop", spares())
    found = failures(run(fault, LATE) if late else run(fault))
    assert list(found) == ["reach"]
    assert f"got through range {fault['id']}" in found["reach"]


@pytest.mark.parametrize("fault", [NEAR, SEEN], ids=["distance", "walls"])
def test_a_radio_that_does_not_reach_so_far_fails(
    run: Run, fault: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(RadioRules, "stop", stops(f"range:{fault['id']}"))
    found = failures(run({**fault, "reach": 100.0}))
    assert list(found) == ["reach"]
    assert f"was stopped by range {fault['id']} although it was within reach" in found["reach"]


def test_a_frame_that_only_the_record_lets_through_fails(run: Run) -> None:
    world, journal = run(NEAR)
    k, drop = next((record.k, drop) for record in journal.ticks for drop in record.dropped)
    record = journal.records[k]
    dropped = tuple(other for other in record.dropped if other != drop)
    change(journal, k, dropped=dropped, deliveries=tuple(sorted((*record.deliveries, drop[:3]))))
    source, to, *_ = drop
    found = failures((world, journal))
    assert set(found) == {"radio", "reach"}
    assert found["reach"] == f"a frame from r{source} to r{to} of tick {k} got through range near"


def test_walls_on_a_line_are_those_that_geometry_finds() -> None:
    chance = np.random.default_rng(5)
    passable = chance.random((13, 9)) < 0.9
    terrain = Terrain("rubble", passable, 0.5, (-1.0, 2.0))
    sight = Sightlines(terrain)
    squares = [
        box(-1.0 + 0.5 * col, 2.0 + 0.5 * row, -0.5 + 0.5 * col, 2.5 + 0.5 * row) for row, col in np.argwhere(~passable)
    ]
    clear = 0
    for _ in range(400):
        a, b = ((-1.0 + 4.5 * x, 2.0 + 6.5 * y) for x, y in chance.random((2, 2)))
        line = LineString([a, b])
        through = sum(line.intersection(square).length > 4.0 * GRAZING_M for square in squares)
        near = sum(line.distance(square) <= 2.0 * GRAZING_M for square in squares)
        assert through <= sight.walls(a, b, GRAZING_M) <= near
        assert through <= sight.walls(a, b, -GRAZING_M) <= near
        clear += near == 0
    assert 40 < clear < 360


@pytest.mark.parametrize(
    ("a", "b"),
    [
        ((0.5, 1.0), (3.5, 1.0)),  # along the crack between two rows, one of them wall
        ((2.0, 0.5), (2.0, 3.5)),  # the same between two columns
        ((0.5, 2.5), (2.5, 0.5)),  # past the corner of a wall
    ],
)
def test_a_line_that_touches_a_wall_may_count_as_either(a: tuple[float, float], b: tuple[float, float]) -> None:
    passable = np.ones((4, 4), dtype=np.bool_)
    passable[0, 1] = passable[2, 2] = False
    sight = Sightlines(Terrain("posts", passable, 1.0))
    assert sight.walls(a, b, -GRAZING_M) == 0
    assert sight.walls(a, b, GRAZING_M) > 0


# --- when frames arrive ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "faults",
    [
        [LATE],
        [SPREAD],
        [LATE, SPREAD, TWICE, MIXED],
        [{**LATE, "delay": {"normal": [0.1, 0.3]}}, {**TWICE, "delay": {"exponential": 0.2}}, MIXED],
        [{**LATE, "delay": {"constant": 0.05}}, {**TWICE, "delay": {"constant": 0.06}}, {**MIXED, "hold": 0.05}],
        [{**LATE, "delay": {"normal": [0.6, 0.0]}}, {**MIXED, "hold": None}, {**TWICE, "delay": None}],
        [{**LATE, "at": 4.0, "for": 3.0, "from": "r1"}, {"kind": "kill", "who": "r2", "at": 5.0}, TWICE],
        [{"kind": "loss", "rate": 0.2}],
    ],
)
def test_frames_arrive_when_the_faults_let_them(run: Run, faults: list[dict[str, Any]]) -> None:
    result = run(*faults)
    assert failures(result) == {}
    arrived = sum(len(record.deliveries) for record in result[1].ticks)
    arrived += sum(why.startswith("receiver") for record in result[1].ticks for *_, why in record.dropped)
    assert checks(result)["on time"].detail == f"{arrived} frames arrived in time"


@pytest.mark.parametrize(
    ("shift", "says"),
    [(1, "should have arrived by tick 3"), (-1, "arrived in tick 2 and should not have before tick 3")],
)
def test_a_radio_that_is_late_or_early_fails(run: Run, shift: int, says: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("worldsim.radio.ether.arrival", lambda k, s, step: arrival(k, s, step) + shift * (s > 0.0))
    found = failures(run(LATE))
    assert list(found) == ["on time"]
    assert found["on time"] == f"frame 0 from r1 to r2 {says}"


@pytest.mark.parametrize("seconds", [0.55, 2.15])
def test_a_delay_beyond_its_bounds_fails(run: Run, seconds: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("worldsim.radio.rules.waited", lambda *_: seconds)
    assert "on time" in failures(run(SPREAD))


def test_frames_that_nothing_holds_up_arrive_at_once_and_once(run: Run) -> None:
    world, journal = run({"kind": "loss", "rate": 0.2, "at": 10.0})
    good = journal.records[4:6]
    link = good[0].deliveries[0]
    change(journal, 4, deliveries=good[0].deliveries[1:])
    change(journal, 5, deliveries=(link, *good[1].deliveries))
    assert failures((world, journal))["on time"] == "frame 4 from r1 to r2 arrived in tick 5"
    journal.records[4:6] = good
    change(journal, 4, deliveries=(link, *good[0].deliveries))
    assert failures((world, journal))["on time"] == "frame 4 from r1 to r2 arrived 2 times"
    change(journal, 4, deliveries=good[0].deliveries, delayed=((*link, "f1"),))
    says = "frame 4 from r1 to r2 was copied or delayed by f1, which is not active"
    assert failures((world, journal))["on time"] == says


def first(journal: MemoryJournal, what: str) -> TickRecord:
    return next(record for record in journal.ticks if getattr(record, what))


@pytest.mark.parametrize(
    ("what", "says"), [("copies", "once too often"), ("delayed", "was not delayed and should have been")]
)
def test_a_copy_or_a_delay_that_is_not_told_of_fails(run: Run, what: str, says: str) -> None:
    world, journal = run(LATE, {**TWICE, "rate": 1.0})
    record = first(journal, what)
    change(journal, record.k, **{what: getattr(record, what)[1:]})
    assert says in failures((world, journal))["on time"]


@pytest.mark.parametrize("what", ["copies", "delayed"])
def test_a_fault_that_did_not_do_it_cannot_be_named(run: Run, what: str) -> None:
    world, journal = run(LATE, TWICE)
    record = first(journal, what)
    (link, _), *rest = ((row[:3], row[3]) for row in getattr(record, what))
    wrong, does = ("late", "copy") if what == "copies" else ("twice", "delay")
    change(journal, record.k, **{what: ((*link, wrong), *((*other, fault) for other, fault in rest))})
    assert f"by {wrong}, which does not {does} it" in failures((world, journal))["on time"]


def test_a_fault_copies_a_frame_once(run: Run) -> None:
    world, journal = run({**TWICE, "delay": None})
    record = first(journal, "copies")
    *link, fault = again = record.copies[0]
    arrivals = tuple(sorted((*record.deliveries, tuple(link))))
    change(journal, record.k, copies=tuple(sorted((*record.copies, again))), deliveries=arrivals)
    says = f"frame {link[2]} from r{link[0]} to r{link[1]} was copied by {fault}, which does not copy it"
    assert failures((world, journal))["on time"] == says


def test_what_a_dead_receiver_does_not_hear_arrives_all_the_same(run: Run) -> None:
    world, journal = run(LATE, {"kind": "kill", "who": "r2", "at": 5.0})
    record = journal.records[12]
    assert {sent_at(sequence) for _, to, sequence, _ in record.dropped if to == 2} == {9}
    early = tuple(drop for drop in journal.records[13].dropped if drop[1] == 2)
    change(journal, 12, dropped=tuple(sorted((*record.dropped, *early))))
    assert "arrived in tick 12 and should not have before tick 13" in failures((world, journal))["on time"]


# --- how often -------------------------------------------------------------------------------------------------------


def shares(world: World, journal: MemoryJournal) -> Any:
    return result_of(DelaysAsAsked, world.prepared, journal)


SERIES = [
    TWICE,
    MIXED,
    SPREAD,
    {"kind": "delay", "delay": {"normal": [0.6, 0.2]}, "id": "normal"},
    {"kind": "delay", "delay": {"exponential": 1.0}, "id": "exponential"},
]


@pytest.mark.parametrize(
    ("fault", "asked"),
    [
        (TWICE, {"rate": 0.3}),
        (MIXED, {"rate": 0.6}),
        (SPREAD, {"delay": {"uniform": [0.7, 2.5]}}),
        (SERIES[3], {"delay": {"normal": [1.0, 0.2]}}),
        (SERIES[4], {"delay": {"exponential": 2.0}}),
    ],
    ids=["duplicate", "reorder", "uniform", "normal", "exponential"],
)
def test_another_share_than_asked_for_fails(lab: Lab, run: Run, fault: dict[str, Any], asked: dict[str, Any]) -> None:
    _, journal = run(fault, ticks=200)
    check = shares(lab.patrol(ticks=200, faults=[{**fault, **asked}]), journal)
    assert not check.ok
    assert f"{fault['id']}: " in check.detail
    assert "configured" in check.detail


def test_a_radio_with_loaded_dice_fails(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("worldsim.radio.rules.draw", lambda *_: 0.9)
    assert list(failures(run(TWICE, MIXED, ticks=100))) == ["delays and copies"]


def test_what_is_not_decided_when_a_run_ends_does_not_count(run: Run) -> None:
    world, journal = run({**SPREAD, "delay": {"uniform": [0.0, 40.0]}}, ticks=60)
    check = shares(world, journal)
    assert (check.ok, check.judged) == (True, True)
    assert "of 240 frames took longer than 40 ticks" in check.detail
    assert failures((world, journal)) == {}


def test_too_few_frames_or_none_are_not_judged_and_say_so(run: Run) -> None:
    for kind, fault in ((DelaysAsAsked, TWICE), (LossesAsAsked, LOSSY)):
        world, journal = run({**fault, "from": "r1", "to": "r2"}, ticks=8)
        few = result_of(kind, world.prepared, journal)
        assert (few.ok, few.judged) == (True, False)
        assert few.detail.endswith("too few to judge")
    unseen = shares(*run(LATE, {**MIXED, "hold": 0.05}))
    assert (unseen.ok, unseen.judged, unseen.detail) == (True, False, "none of these faults is random")


def test_all_series_of_a_run_share_one_rate_of_false_alarms(lab: Lab) -> None:
    bursts = {"kind": "loss", "rate": 0.5, "mean_burst": 3.0}
    later = {"kind": "duplicate", "rate": 0.5, "delay": {"exponential": 3.0}}
    world, journal = lab.driven(ticks=200, faults=[bursts, {**TWICE, "delay": None}, later, MIXED, SPREAD, NEAR])
    timeline = Timeline(world.scenario)
    judged = [check_of(kind, world.prepared, journal, timeline) for kind in (DelaysAsAsked, LossesAsAsked)]
    series = sum(len(draws.series) for check in judged for each in check._draws.values() for draws in each)
    assert series == 5 * (3 + 1 + 5 + 1 + 2)
    assert series * alarm_of(timeline) <= 1e-9
    assert failures((world, journal)) == {}


# --- independence ----------------------------------------------------------------------------------------------------

LINKS = [(source, to) for source in (1, 2, 3, 4) for to in (1, 2, 3, 4) if source != to]


@pytest.mark.parametrize("p", [0.05, 0.5, 0.9])
def test_independent_draws_raise_no_alarm_more_often_than_promised(p: float) -> None:
    """1,500 runs of 20 ticks, judged after each tick at one in a hundred, by each of the five series."""
    rng, alarms = np.random.default_rng(3), np.zeros(5)
    for _ in range(1500):
        draws, ever = LinkDraws(p, "{hits} of {draws}", "", 4), np.zeros(5, dtype=np.bool_)
        for _ in range(20):
            draws.add(LINKS, rng.random(12) < p)
            ever |= [unexplained(series.hits, series.draws, p, 0.01) for series in draws.series]
        alarms += ever
    assert alarms.max() <= 1500 * 0.01 + 3.0 * np.sqrt(1500 * 0.01)


@pytest.mark.parametrize(
    ("what", "number"), [((0, 2), 1), ((1, 2), 2), ((0, 1), 3)], ids=["sender", "receiver", "link"]
)
@pytest.mark.parametrize("p", [0.3, 0.7])
def test_draws_that_are_one_are_found_by_their_series(what: tuple[int, int], number: int, p: float) -> None:
    """Draws of sender and tick, of receiver and tick, or of the link alone."""
    draws = LinkDraws(p, "{hits} of {draws}", "", 4)
    for k in range(60):
        draws.add(LINKS, [draw(8, *((source, to, k)[index] for index in what)) < p for source, to in LINKS])
    assert draws.series[number].hits == draws.series[number].draws > 0
    assert draws.series[number].problem(1e-9).startswith("after a hit ")


def test_the_two_links_of_a_pair_are_one_draw_after_the_link_back() -> None:
    """The link that is drawn first follows no hit of its tick, and hits of other ticks count elsewhere."""
    draws = LinkDraws(0.5, "{hits} of {draws}", "", 2)
    back = draws.series[4]
    draws.add([(1, 2), (2, 1)], [True, True])
    assert (back.draws, back.hits) == (1, 1)
    draws.add([(1, 2), (2, 1)], [False, True])
    assert (back.draws, back.hits) == (1, 1)
    draws.add([(1, 2), (2, 1)], [True, False])
    assert (back.draws, back.hits) == (2, 1)


LOSSY = {"kind": "loss", "rate": 0.4, "id": "lossy"}
BURSTS = {"kind": "loss", "rate": 0.4, "mean_burst": 3.0, "id": "bursts"}
LATER = {"kind": "duplicate", "rate": 0.3, "delay": {"uniform": [0.5, 6.5]}, "id": "later"}
NORMAL = {"kind": "delay", "delay": {"normal": [4.0, 1.5]}, "id": "normal"}


def with_values(change: Callable[[list[int]], list[int]]) -> Callable[[Any], Any]:
    """Draw by other values than the radio's."""
    return lambda real: lambda first, *values: real(first, *change(list(values)))


WAITING = {"kind": "delay", "delay": {"exponential": 2.0}, "id": "waiting"}
DEPENDENT: dict[str, tuple[dict[str, Any], str, Callable[[Any], Any]]] = {
    "a loss once for each sender": (LOSSY, "below", lambda real: lambda of, to, *more: real(of, 0 * to, *more)),
    "a loss once for each link": (LOSSY, "below", lambda real: lambda of, to, k, *more: real(of, to, 0 * k, *more)),
    "a loss once for each receiver": (LOSSY, "below", lambda real: lambda of, *more: real(0 * of, *more)),
    "a delay once for each sender": (NORMAL, "waited", with_values(lambda of: [*of[:4], 0, *of[5:]])),
    "a delay once for each receiver": (NORMAL, "waited", with_values(lambda of: [*of[:3], 0, *of[4:]])),
    "a delay once for each link": (NORMAL, "waited", with_values(lambda of: [*of[:5], 0])),
    "half of a delay's deviation": (NORMAL, "waited", lambda real: lambda wait, *of: 0.5 * (4.0 + real(wait, *of))),
    "no delay above one and a half means": (
        WAITING,
        "waited",
        lambda real: lambda wait, *of: min(real(wait, *of), 3.0),
    ),
    "a copy's delay by the draw of the copy": (LATER, "waited", with_values(lambda of: of[:6])),
    "copies once for each sender": (LATER, "draw", lambda real: lambda *of: real(*of[:4], 0, *of[5:])),
    "what is held back once for each sender": (MIXED, "draw", lambda real: lambda *of: real(*of[:4], 0, *of[5:])),
    "what is held back once for each link": (MIXED, "draw", lambda real: lambda *of: real(*of[:5], 0)),
    "bursts once for each sender": (BURSTS, "draw", lambda real: lambda *of: real(*of[:4], 0, *of[5:])),
    "bursts once for both directions": (
        BURSTS,
        "draw",
        lambda real: lambda *of: real(*of[:3], *sorted(of[3:5]), *of[5:]),
    ),
    "bursts once for each receiver": (BURSTS, "draw", lambda real: lambda *of: real(*of[:3], 0, *of[4:])),
}
"""A fault, what its draws are made by, and how these are wrong."""


@pytest.mark.parametrize("what", DEPENDENT)
def test_draws_that_depend_on_each_other_fail(run: Run, monkeypatch: pytest.MonkeyPatch, what: str) -> None:
    fault, name, make = DEPENDENT[what]
    monkeypatch.setattr(rules, name, make(getattr(rules, name)))
    world, journal = run(fault, ticks=300)
    kind = LossesAsAsked if fault["kind"] == "loss" else DelaysAsAsked
    assert not result_of(kind, world.prepared, journal).ok


def test_faults_of_a_kind_draw_for_themselves(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """One fault's effect on a frame says nothing about another's; the verdict finds losses of one draw."""
    faults = [{"kind": "duplicate", "rate": 0.4}] * 2 + [{"kind": "reorder", "rate": 0.4, "hold": 1.0}] * 2
    _, journal = run(*faults, ticks=150)
    befell = {row for record in journal.ticks for row in (*record.copies, *record.delayed)}
    links = [(*link, record.k) for record in journal.ticks for link in LINKS]
    hit = np.array([[(*link, fault) in befell for link in links] for fault in ("f1", "f2", "f3", "f4")])
    alike = np.corrcoef(hit.astype(np.float64)) - np.eye(4)
    assert np.abs(alike).max() < 5.0 / np.sqrt(len(links))
    assert np.abs(hit.mean(axis=1) - 0.4).max() < 5.0 * np.sqrt(0.24 / len(links))
    world, journal = run(LOSSY, {**LOSSY, "id": "again"}, ticks=60)
    assert result_of(LossesAsAsked, world.prepared, journal).ok
    monkeypatch.setattr(rules, "mix", lambda seed, purpose, _, source: mix(seed, purpose, 0, source))
    world, journal = run(LOSSY, {**LOSSY, "id": "again"}, ticks=60)
    assert "again: 0 of " in result_of(LossesAsAsked, world.prepared, journal).detail


GOOD = [LOSSY, BURSTS, LATER, *SERIES, {**NORMAL, "id": "far"}, WAITING]


SEVERAL = (LOSSY, BURSTS, {**LOSSY, "rate": 0.6, "id": "more"})


@pytest.mark.parametrize(
    "faults", [*((one,) for one in GOOD), SEVERAL], ids=lambda faults: f"{len(faults)} {faults[-1]['id']}"
)
def test_draws_that_are_as_asked_pass(run: Run, faults: tuple[dict[str, Any], ...]) -> None:
    world, journal = run(*faults, ticks=300)
    kind = LossesAsAsked if faults[0]["kind"] == "loss" else DelaysAsAsked
    check = result_of(kind, world.prepared, journal)
    assert (check.ok, check.judged) == (True, True), check.detail
