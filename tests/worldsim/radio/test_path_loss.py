"""The model path-loss: how often frames are lost, by distance, walls and interference, measured against the formula."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from statistics import NormalDist
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from patrol.ground.terrain import Terrain
from patrol.journal.records import FORGED, frame_sequence
from patrol.pose import Pose
from patrol.random import Purpose, draw, gauss, mix
from patrol.scenario.radio_spec import PathLossOptions
from worldsim.kernels.radio import below, normals
from worldsim.radio.models import ModelSetup, OnAir
from worldsim.radio.path_loss import PathLoss

TICKS = 3000
SURE = 4.5
"""Standard deviations that a share may be off: by chance once in 150 000 such tests."""
STEP = 0.5
PLAIN: Mapping[str, Any] = {"shadowing": 0.0, "edge": 0.0, "airtime": 0.0}
"""Reception is certain or impossible, by distance and walls alone."""


def ground(*walls: float) -> Terrain:
    """A field of 300 m by 20 m with walls of 1 m across it, by their x."""
    passable = np.ones((20, 300), dtype=np.bool_)
    for x in walls:
        passable[:, int(x)] = False
    return Terrain("field", passable, 1.0)


def model(terrain: Terrain | None = None, seed: int = 3, **options: Any) -> PathLoss:
    return PathLoss(ModelSetup(PathLossOptions(**options), seed, STEP, terrain or ground()))


def lost(
    radio: PathLoss, places: Sequence[float], k: int = 0, origins: Sequence[int] | None = None, **more: Any
) -> NDArray[np.bool_]:
    """The losses of one frame of each robot, (sender, receiver); robots stand in a row at some x."""
    numbers = np.arange(1, len(places) + 1)
    origin = numbers if origins is None else np.array(origins)
    sequence, on_the_way = np.full(origin.size, frame_sequence(k, 0)), origin[:, None] != numbers[None, :]
    poses = {number: Pose(x, 10.5, 0.0) for number, x in enumerate(places, start=1)}
    air = OnAir(k, [b"frame"] * origin.size, origin, origin, sequence, numbers, on_the_way, poses)
    air = replace(air, **more)
    return radio.lost(air) & air.on_the_way


def shares(radio: PathLoss, places: Sequence[float]) -> NDArray[np.float64]:
    """The share of frames lost in many ticks, (sender, receiver)."""
    share: NDArray[np.float64] = np.mean([lost(radio, places, k) for k in range(TICKS)], axis=0)
    return share


def agrees(share: float, chance: float) -> bool:
    return abs(share - chance) <= SURE * math.sqrt(chance * (1.0 - chance) / TICKS)


# --- distance, walls, shadowing --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "walls", "reach"),
    [
        ({}, (), 100.0),  # 0 - 40 - 25 log10(100) = -90
        ({}, (30.0,), 57.54),  # 6 dB less: 10^(-6/25) of it
        ({"wall": 10.0}, (30.0, 35.0), 15.85),  # 20 dB less is nearer than the walls: see below
        ({"exponent": 2.0, "power": -20.0}, (), 31.62),
        ({"exponent": 3.0, "reference": 60.0, "sensitivity": -105.0}, (), 31.62),
    ],
)
def test_the_reach_is_where_the_formula_has_it(options: dict[str, Any], walls: Sequence[float], reach: float) -> None:
    radio = model(ground(*walls), **PLAIN, **options)
    if walls and reach < walls[-1]:
        expected = [[False, False, True], [False] * 3, [True, False, False]]
        assert lost(radio, [1.5, 29.0, walls[-1] + 1.5]).tolist() == expected
        return
    assert not lost(radio, [1.5, 1.5 + reach - 0.1]).any()
    assert lost(radio, [1.5, 1.5 + reach + 0.1]).sum() == 2


@pytest.mark.parametrize("distance", [0.2, 40.0, 80.0, 100.0, 150.0, 250.0])
@pytest.mark.parametrize("walls", [0, 1, 3])
def test_losses_by_distance_and_walls_are_as_often_as_shadowing_makes_them(distance: float, walls: int) -> None:
    terrain = ground(*(10.0 + 2.0 * place for place in range(walls)))
    radio = model(terrain, edge=0.0, airtime=0.0, redraw=STEP, shadowing=5.0)
    between = walls if distance > 20.0 else 0
    level = -40.0 - 25.0 * math.log10(max(distance, 1.0)) - 6.0 * between
    chance = NormalDist(0.0, 5.0).cdf(-90.0 - level)
    share = shares(radio, [3.5, 3.5 + distance])
    assert agrees(share[0, 1], chance)
    assert agrees(share[1, 0], chance)


@pytest.mark.parametrize("distance", [70.0, 90.0, 100.0, 110.0, 140.0])
def test_losses_at_the_edge_follow_the_packet_error_curve(distance: float) -> None:
    radio = model(shadowing=0.0, edge=2.0, airtime=0.0)
    margin = 50.0 - 25.0 * math.log10(distance)
    chance = 1.0 / (1.0 + math.exp(margin / 2.0))
    share = shares(radio, [0.5, 0.5 + distance])
    assert agrees(share[0, 1], chance)
    assert agrees(share[1, 0], chance)


def test_shadowing_is_a_draw_of_each_directed_link_and_stays_until_it_is_drawn_anew() -> None:
    row = [0.5 + 100.0 * (place % 2) + 0.01 * place for place in range(20)]  # 100 m apart: half of the links work
    radio, anew = (model(edge=0.0, airtime=0.0, redraw=redraw) for redraw in (None, 5.0))
    first = lost(radio, row)
    assert not np.array_equal(first, first.T)
    assert all(np.array_equal(lost(radio, row, k), first) for k in (1, 9, 10, 500))
    by_window = [lost(anew, row, k) for k in (0, 9, 10, 19, 20)]
    same = [np.array_equal(before, after) for before, after in pairwise(by_window)]
    assert same == [True, False, True, False]
    assert not np.array_equal(first, lost(model(edge=0.0, airtime=0.0, seed=4), row))


def test_the_fate_of_a_frame_depends_on_no_other_link() -> None:
    row = [0.5, 60.0, 100.0, 140.0]
    whole = lost(model(airtime=0.0), row)
    for some in ((1, 2), (2, 4), (1, 3, 4)):
        part = lost(model(airtime=0.0), row, origins=some)
        assert np.array_equal(part, whole[[number - 1 for number in some]])


@given(st.integers(0, 2**63), st.lists(st.integers(0, 65535), max_size=4), st.lists(st.integers(0, 65535), max_size=4))
def test_the_normal_draws_of_many_links_are_those_of_each(seed: int, senders: list[int], receivers: list[int]) -> None:
    states = np.array([mix(seed, Purpose.RADIO, 0, 7, sender) for sender in senders], dtype=np.uint64)
    found = normals(states, np.array(receivers, dtype=np.int64))
    each = [[gauss(seed, Purpose.RADIO, 0, 7, sender, to) for to in receivers] for sender in senders]
    assert found.shape == (len(senders), len(receivers))
    assert np.allclose(found, np.array(each).reshape(found.shape), rtol=0.0, atol=1e-12)


def test_the_draws_of_many_links_are_those_of_each() -> None:
    seed, fault, rate = 2**63 + 5, 3, 0.3
    sources, receivers, sequences = [1, 2, 900], [1, 7, 65535], [0, 12, 2**29 + 12]
    states = np.array([mix(seed, Purpose.ETHER, fault, source) for source in sources], dtype=np.uint64)
    rates = np.broadcast_to(rate, (len(sources), len(receivers)))
    found = below(states, np.array(receivers, dtype=np.int64), np.array(sequences, dtype=np.int64), rates)
    expected = [
        [draw(seed, Purpose.ETHER, fault, source, receiver, sequence) < rate for receiver in receivers]
        for source, sequence in zip(sources, sequences, strict=True)
    ]
    assert found.tolist() == expected
    assert 0 < found.sum() < found.size


# --- interference ----------------------------------------------------------------------------------------------------


def test_frames_are_lost_as_often_as_one_of_two_others_overlaps_them() -> None:
    airtime = 0.1
    share = shares(model(shadowing=0.0, edge=0.0, airtime=airtime), [10.0, 30.0, 50.0])
    # At r2, r1 and r3 are equally strong. Of moments in the middle of the tick the shares 2 q each are near, at its
    # ends fewer: the chance that neither r2 nor r3 is near is the mean of (1 - near)^2 over the tick.
    q = airtime / STEP
    neither = (1.0 - 2.0 * q) ** 3 + 2.0 / 3.0 * ((1.0 - q) ** 3 - (1.0 - 2.0 * q) ** 3)
    assert agrees(share[0, 1], 1.0 - neither)
    assert agrees(share[2, 1], 1.0 - neither)
    assert not shares(model(shadowing=0.0, edge=0.0, airtime=0.0), [10.0, 30.0, 50.0]).any()


def test_two_robots_alone_miss_each_other_while_they_send() -> None:
    airtime = 0.1
    share = shares(model(shadowing=0.0, edge=0.0, airtime=airtime), [10.0, 12.0])
    overlap = 1.0 - (1.0 - airtime / STEP) ** 2
    assert agrees(share[0, 1], overlap)
    assert share[0, 1] == share[1, 0]


@pytest.mark.parametrize(("distance", "heard"), [(30.0, True), (20.0, False)])
def test_the_stronger_frame_is_heard_if_it_is_strong_enough(distance: float, heard: bool) -> None:
    # 10 dB are needed. r1 is 10 m from r2; a sender at 30 m is 11.9 dB weaker there, one at 20 m 7.5 dB.
    radio = model(shadowing=0.0, edge=0.0, airtime=STEP, noise=-130.0, sensitivity=-120.0)
    found = lost(radio, [10.0, 20.0, 20.0 + distance], origins=(1, 3))
    assert found[:, 1].tolist() == [not heard, True]


def test_a_frame_that_a_fault_has_dropped_on_a_link_does_not_disturb_there() -> None:
    radio = model(shadowing=0.0, edge=0.0, airtime=STEP)
    row, origins = [10.0, 20.0, 30.0], (1, 3)
    assert lost(radio, row, origins=origins)[:, 1].all()
    cut = np.array([[False, True, True], [True, False, False]])
    assert not lost(radio, row, origins=origins, on_the_way=cut)[0, 1]


def test_a_strangers_frames_come_from_nowhere_and_disturb_none() -> None:
    radio = model(shadowing=0.0, edge=0.0, airtime=STEP)
    here = np.array([[True, True], [False, True]])
    found = lost(radio, [10.0, 20.0], origins=(0, 1), source=np.array([FORGED, 1]), on_the_way=here)
    assert not found.any()
    assert not lost(radio, [10.0, 20.0], origins=(0, 0), on_the_way=np.ones((2, 2), dtype=np.bool_)).any()


def test_a_robots_own_frames_follow_each_other_and_do_not_collide() -> None:
    radio = model(shadowing=0.0, edge=0.0, airtime=STEP)
    sequences = np.array([frame_sequence(0, place) for place in range(3)])
    assert not lost(radio, [10.0, 20.0], origins=(1, 1, 1), sequence=sequences).any()


def test_a_robot_whose_frame_a_fault_has_dropped_for_all_hears_as_if_it_did_not_send() -> None:
    radio = model(shadowing=0.0, edge=0.0, airtime=STEP)  # any two frames of a tick overlap
    assert lost(radio, [0.5, 10.5]).tolist() == [[False, True], [True, False]]
    silenced = np.array([[False, True], [False, False]])
    assert not lost(radio, [0.5, 10.5], on_the_way=silenced).any()
