from typing import Any

import numpy as np
import pytest

from monitor.observation.listener import NO_ROBOT, Listener
from patrol.journal.records import FORGED
from patrol.pose import Pose
from patrol.prepare import Prepared, inboxes_of, prepare, sensor_footprint
from patrol.radio.message import Position, encode
from patrol.scenario import load_scenario

OPEN = {
    "name": "field",
    "terrain": {"builtin": "open"},
    "point": 1.0,
    "robots": {"count": 2, "model": "holonomic", "starts": [[10.0, 10.0], [60.0, 50.0]]},
}


@pytest.fixture(scope="module")
def field() -> Prepared:
    return prepare(load_scenario(OPEN))


def listener(prepared: Prepared) -> Listener:
    footprint = sensor_footprint(prepared.scenario, prepared.terrain)
    inboxes = inboxes_of(prepared.scenario, [NO_ROBOT], prepared.terrain.bounds, None)
    return Listener(footprint, prepared.patrolled, inboxes, NO_ROBOT)


def rejected(listener: Listener) -> int:
    return listener.inboxes.rejected(NO_ROBOT)


@pytest.mark.parametrize("which", ["quiet", "hazy"])
def test_who_hears_everything_knows_the_truth(which: str, request: pytest.FixtureRequest) -> None:
    seen = request.getfixturevalue(which)
    run = seen.open()
    hears = listener(run.prepared)
    for record in run.journal.ticks:
        hears.hear(record.k, [frame for _, frame in record.frames])
        assert np.array_equal(hears.fog.last_seen, seen.truth[record.k])
    assert rejected(hears) == 0
    assert sorted(hears.peers) == [1, 2, 3]


def test_forged_frames_are_counted_and_change_nothing(faulty: Any) -> None:
    run = faulty.open()
    honest, all_of_it = listener(run.prepared), listener(run.prepared)
    forged = 0
    for record in run.journal.ticks:
        # A listener next to every robot hears the genuine frame of a robot before anybody's forgery of it.
        frames = sorted(record.frames, key=lambda sent: sent[0] == FORGED)
        forged += sum(source == FORGED for source, _ in frames)
        honest.hear(record.k, [frame for source, frame in frames if source != FORGED])
        all_of_it.hear(record.k, [frame for _, frame in frames])
    assert forged > 0
    assert rejected(all_of_it) - rejected(honest) == forged


def test_a_trail_fills_what_was_missed(field: Prepared) -> None:
    poses = [Pose(10.0 + 2.0 * k, 10.0, 0.0) for k in range(4)]
    frames = [encode(Position.of(1, k, 0.5 * k, pose)) for k, pose in enumerate(poses)]
    whole, gappy = listener(field), listener(field)
    for k, frame in enumerate(frames):
        whole.hear(k, [frame])
    gappy.hear(0, frames[:1])
    gappy.hear(3, [encode(Position.of(1, 3, 1.5, poses[3], ((-200, 0), (-200, 0))))])
    assert np.array_equal(whole.fog.last_seen, gappy.fog.last_seen)


def test_noise_and_strangers_are_dropped(field: Prepared) -> None:
    hears = listener(field)
    stranger = encode(Position.of(9, 0, 0.0, Pose(10.0, 10.0, 0.0)))
    outside = encode(Position.of(1, 0, 0.0, Pose(-500.0, 10.0, 0.0)))
    hears.hear(0, [b"", b"\xff" * 30, stranger, outside])
    assert (rejected(hears), hears.fog.seen, len(hears.peers)) == (4, 0, 0)
