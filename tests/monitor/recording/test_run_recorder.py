import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.interfaces import QosDurability, QosHistory, QosReliability
from rosbags.rosbag2.metadata import parse_qos

from monitor.recording.ros_file import grid_values
from monitor.recording.run_recorder import Recorder, key_frame_ticks, scale_of
from monitor.replay.replay import play
from monitor.replay.run import Run, open_run
from patrol.errors import BadInput
from patrol.ground.fog import Fog
from tests.monitor.conftest import QUIET, cut, run_of
from tests.recordings import decoded, read_recording


def record(run: Run, out: Path) -> Path:
    recorder = Recorder(run, out)
    assert play(run, [recorder]) is None
    recorder.close()
    return out


def test_a_recording_says_what_the_run_was(faulty: Any, tmp_path: Path) -> None:
    run = faulty.open()
    topics = decoded(record(run, tmp_path / "out.mcap"))
    terrain, step = run.prepared.terrain, run.step
    each = {f"/{name}/{what}" for name in run.names for what in ("pose", "decision_ms")}
    scalars = {"/mfow", "/fog_mean", "/seen_share", "/alive", "/delivered_share"}
    assert set(topics) == {"/map", "/fog", "/tf", "/rosout"} | each | scalars

    [(_, walls)] = topics["/map"]
    assert (walls.info.width, walls.info.height) == (terrain.width, terrain.height)
    assert walls.info.resolution == pytest.approx(terrain.point)
    assert (walls.info.origin.position.x, walls.info.origin.position.y) == terrain.origin
    assert np.array_equal(np.array(walls.data).reshape(terrain.shape) == 0, terrain.passable)

    assert [value.data for _, value in topics["/mfow"]] == (run.mfow * step).tolist()
    assert [value.data for _, value in topics["/alive"]] == (run.status == 1).sum(axis=1).tolist()
    assert [at for at, _ in topics["/fog"]] == [0.0, 10.0, 20.0, 30.0, 39.5]
    wanted: Any = None
    for at, grid in topics["/fog"]:
        k = round(at / step)
        fog = Fog.resumed(run.prepared.patrolled, faulty.truth[k])
        wanted = grid_values(fog, k, scale_of(run) / step)
        assert np.array_equal(np.array(grid.data).reshape(terrain.shape), wanted)
        assert grid.header.frame_id == "map"
    assert wanted[~run.prepared.patrolled].max() == wanted.min() == -1
    assert wanted.max() <= 100

    poses = topics["/r2/pose"]
    assert len(poses) == run.ticks
    for k, (at, stamped) in enumerate(poses):
        place, turn = stamped.pose.position, stamped.pose.orientation
        assert at == k * step == stamped.header.stamp.sec + stamped.header.stamp.nanosec / 1e9
        heading = 2.0 * math.atan2(turn.z, turn.w)
        assert (place.x, place.y) == tuple(run.poses[k, 1, :2])
        assert math.remainder(heading - run.poses[k, 1, 2], 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)
    assert [t.child_frame_id for t in topics["/tf"][5][1].transforms] == list(run.names)
    assert len(topics["/r1/decision_ms"]) == np.count_nonzero(~np.isnan(run.decision_ms[:, 0]))

    said = [(at, log.name, log.msg, log.level) for at, log in topics["/rosout"]]
    assert said[0][1] == "recording"
    assert len(said) == 1 + len(run.events)
    (dead,) = [log for log in said if log[2].startswith("dead")]
    assert (dead[0], dead[1], dead[3]) == (22.0, "r1", 30)


def test_a_scale_beyond_all_ages_takes_no_more_room_than_the_run() -> None:
    fog = Fog(np.ones((3, 4), dtype=bool))
    assert [np.unique(grid_values(fog, 5, scale)).tolist() for scale in (2.0**53, 6.0)] == [[0], [83]]


def test_metadata_scenario_and_chunks(quiet: Any, tmp_path: Path) -> None:
    run = quiet.open()
    with record(run, tmp_path / "out.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        (facts,) = reader.iter_metadata()
        (scenario,) = reader.iter_attachments()
        assert reader.get_header().profile == "ros2"
    assert summary is not None
    assert {index.compression for index in summary.chunk_indexes} == {"zstd"}
    assert {schema.encoding for schema in summary.schemas.values()} == {"ros2msg"}
    assert {channel.message_encoding for channel in summary.channels.values()} == {"cdr"}
    assert facts.metadata["scenario_hash"] == run.journal.header.scenario_hash
    assert float(facts.metadata["fog_scale_s"]) == scale_of(run)
    assert facts.metadata["ended"] == "completed"
    assert scenario.data == (run.folder / "scenario.yaml").read_bytes()


@pytest.mark.parametrize("share", [0.3, 0.77])
def test_a_run_that_was_killed_is_recorded_that_far(quiet: Any, copied: Callable[..., Path], share: float) -> None:
    folder = copied(quiet)
    cut(folder, share)
    run = open_run(folder)
    assert 0 < run.ticks < 80
    topics = decoded(record(run, folder / "out.mcap"))
    assert len(topics["/mfow"]) == run.ticks
    assert "cut off" in topics["/rosout"][-1][1].msg


def test_no_robot_is_called_as_the_map_or_a_topic(tmp_path: Path) -> None:
    robots = [{"name": name, "model": "holonomic"} for name in ("map", "fog", "robot_map")]
    run = run_of(tmp_path, {**QUIET, "duration": 5, "robots": robots}).open()
    topics = decoded(record(run, tmp_path / "out.mcap"))
    frames = [body.child_frame_id for body in topics["/tf"][0][1].transforms]
    assert len(frames) == len(set(frames)) == 3
    tops = {topic.split("/")[1] for topic in topics if topic.count("/") == 1}
    assert not tops & set(frames)
    assert {"map", "fog"} <= tops
    assert {f"/{frame}/pose" for frame in frames} <= set(topics)


def test_who_plays_a_recording_again_offers_what_we_did(quiet: Any, tmp_path: Path) -> None:
    """Read by rosbags, as rosbag2 keeps it: a map that whoever comes late gets, and all else as it happens."""
    with record(quiet.open(), tmp_path / "out.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    offers = {one.topic: parse_qos(one.metadata["offered_qos_profiles"]) for one in summary.channels.values()}
    assert {len(profiles) for profiles in offers.values()} == {1}
    latched = {topic for topic, [offer] in offers.items() if offer.durability is QosDurability.TRANSIENT_LOCAL}
    assert latched == {"/map"}
    assert {offer.reliability for [offer] in offers.values()} == {QosReliability.RELIABLE}
    assert {offer.history for [offer] in offers.values()} == {QosHistory.KEEP_LAST}
    kinds = {QosDurability.TRANSIENT_LOCAL, QosDurability.VOLATILE}
    assert all(offer.durability in kinds and offer.depth > 0 for [offer] in offers.values())


def test_grids_are_fewer_in_a_long_run_of_a_large_map(quiet: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    run = quiet.open()
    assert key_frame_ticks(run) == 20
    monkeypatch.setattr("monitor.recording.run_recorder.GRID_MEMORY", 2 * run.prepared.patrolled.size)
    assert key_frame_ticks(run) == 40


def test_nothing_half_written_is_left(quiet: Any, tmp_path: Path) -> None:
    run = quiet.open()
    recorder = Recorder(run, tmp_path / "out.mcap")
    assert not (tmp_path / "out.mcap").exists()
    recorder.abandon()
    assert not list(tmp_path.iterdir())
    for path, words in (
        (tmp_path / "none" / "out.mcap", "cannot be written"),
        (tmp_path, "is a folder"),
        (Path(), "is a folder"),
    ):
        with pytest.raises(BadInput, match=words):
            Recorder(run, path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("share", [0.5, 0.9, 0.999])
def test_a_recording_that_was_cut_off_is_read_up_to_there(faulty: Any, tmp_path: Path, share: float) -> None:
    """Half of it has its map too, so that tools such as `mcap recover` save both."""
    whole, torn = record(faulty.open(), tmp_path / "out.mcap"), tmp_path / "torn.mcap"
    torn.write_bytes(whole.read_bytes()[: int(whole.stat().st_size * share)])
    recording = read_recording(torn)
    assert not recording.is_whole
    assert recording.facts == read_recording(whole).facts
    assert len(recording.topics["/map"]) == 1
    assert 0 < len(recording.topics["/mfow"]) <= len(decoded(whole)["/mfow"])
