"""The draws of a nemesis: within their bounds, and the same in each version."""

import json
from hashlib import sha256
from typing import Any

import pytest

from patrol.faults.nemesis import DRAWN, NemesisSpec, RobotsHit, When, draw_fault, room_for
from patrol.random import Draws, Purpose

NAMES = ("a", "b", "c", "d")
STEP = 0.5


def drawn(kind: str, seeds: range = range(300), names: tuple[str, ...] = NAMES) -> list[list[dict[str, Any]]]:
    """Draws of one kind from 5 s to 20 s, one for each seed, without those that were not possible."""
    found = []
    for seed in seeds:
        draws = Draws(seed, Purpose.NEMESIS, 0)
        found.append(draw_fault(draws, [kind], RobotsHit(names, set()), When(STEP, 10, 40)))
    return [faults for faults in found if faults]


BOUNDS: dict[str, dict[str, tuple[float, float]]] = {
    "loss": {"rate": (0.05, 1.0), "mean_burst": (1.0, 12.0)},
    "duplicate": {"rate": (0.05, 1.0)},
    "reorder": {"rate": (0.05, 1.0), "hold": (0.05, 2.5)},
    "range": {"reach": (5.0, 60.0)},
    "bandwidth": {"bytes_per_s": (5.0, 100.0)},
    "clock": {"offset": (-60.0, 60.0), "rate": (-0.2, 0.2)},
    "drift": {"noise": (0.0, 0.5)},
    "motion": {"speed": (0.0, 0.4), "turning": (0.0, 0.4), "veer": (0.0, 0.4)},
}


@pytest.mark.parametrize(("kind", "field"), [(kind, field) for kind, bounds in BOUNDS.items() for field in bounds])
def test_numbers_fill_their_bounds(kind: str, field: str) -> None:
    least, most = BOUNDS[kind][field]
    values = [fault[field] for fault, *_ in drawn(kind) if field in fault]
    margin = 0.1 * (most - least)
    assert least <= min(values) < least + margin
    assert most - margin < max(values) <= most


HEALERS = {"kill": {"restart"}, "resume": {"resume"}, "leave": {"join"}}


@pytest.mark.parametrize("kind", DRAWN)
def test_a_fault_begins_and_is_healed_when_it_should(kind: str) -> None:
    for fault, *healing in drawn(kind):
        assert fault["at"] == 5.0
        assert fault.get("for", 15.0) == 15.0
        assert [heal["at"] for heal in healing] == [20.0] * len(healing)
        assert all(heal["who"] == fault["who"] for heal in healing)
    assert {heal["kind"] for _, *healing in drawn(kind) for heal in healing} == HEALERS.get(kind, set())


@pytest.mark.parametrize(("kind", "most"), [("kill", 3), ("pause", 3), ("leave", 3), ("join", 3), ("restart", 4)])
def test_at_least_one_robot_is_left_alone_but_by_a_restart(kind: str, most: int) -> None:
    assert {len(fault["who"]) for fault, *_ in drawn(kind)} == set(range(1, most + 1))


def test_who_suffers_a_fault_suffers_no_other_meanwhile() -> None:
    robots = RobotsHit(NAMES, {"d"})
    draws = Draws(1, Purpose.NEMESIS, 0)
    first = robots.take(draws, 10, 20)
    assert set(first) < {"a", "b", "c"}
    left = [name for name in "abc" if name not in first]
    assert robots.free(20, 30) == robots.free(0, 10) == left
    assert robots.free(21, 30) == robots.free(0, 9) == ["a", "b", "c"]


@pytest.mark.parametrize(
    ("interval", "quiet", "ticks", "end", "length"),
    [
        (10.0, None, 120, 80, 20.0),
        (10.0, 0.0, 120, 119, 20.0),  # the last tick begins no fault
        (0.5, 59.0, 120, 2, 1.0),
        (10.0, 59.5, 120, 1, 20.0),
        (0.5, 0.0, 1001, 1000, 1.0),  # 1000 faults fit
    ],
)
def test_the_room_for_faults_ends_before_the_quiet_window(
    interval: float, quiet: float | None, ticks: int, end: int, length: float
) -> None:
    assert room_for(NemesisSpec(interval=interval, quiet=quiet), STEP, ticks) == (end, length)


@pytest.mark.parametrize(
    ("interval", "quiet", "ticks", "says"),
    [
        (10.0, 59.75, 120, "leaves no room for faults in a run of 60 s"),
        (0.49, None, 120, "shorter than one step of 0.5 s"),
        (0.5, 0.0, 1002, "makes 1001 faults, at most 1000 fit"),
    ],
)
def test_without_room_a_nemesis_is_refused(interval: float, quiet: float | None, ticks: int, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        room_for(NemesisSpec(interval=interval, quiet=quiet), STEP, ticks)


def test_a_seed_means_the_same_faults_in_each_version() -> None:
    """A change here is one of every scenario with a nemesis, which the changelog has to name."""
    everything = {kind: drawn(kind, range(40)) for kind in DRAWN}
    alone = {kind: drawn(kind, range(10), ("a",)) for kind in DRAWN}
    text = json.dumps([everything, alone], sort_keys=True)
    assert sha256(text.encode()).hexdigest()[:16] == "24a52b2dd9da7508"
