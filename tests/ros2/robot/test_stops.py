import os
import stat
import threading
import time
from pathlib import Path

import pytest

from patrol.errors import BadInput
from patrol.pose import Pose
from ros2.robot import stops as stops_module
from ros2.robot.hardware import Hardware
from ros2.robot.localisation import Fix
from ros2.robot.options import DriveSettings
from ros2.robot.stops import OLDER, TIMELESS, Standing, StopFiles, Stopper, Stops, StopTopic, moves, state_folder
from ros2.wire.mailbox import Received
from ros2.wire.messages import Bool, Twist
from ros2.wire.names import LATCHED
from tests.ros2.robot.passing import Passing
from tests.ros2_hub import Hub

PATIENCE_S = 300.0
OPERATOR = "stopped by an operator (fogwatch control ... release)"
TOPIC = "stopped by the topic /stop (publish false there to release it)"


def said(stop: bool, sent_ns: int | None, sender: str = "", sequence: int | None = None) -> Received[Bool]:
    return Received(Bool(stop), 0.0, sent_ns, sequence, sender.encode())


def heeded(topic: StopTopic, *received: Received[Bool]) -> tuple[bool, bool, str]:
    """Give messages to a topic, and have it heeded."""
    for one in received:
        topic.put(one)
    return topic.heed()


def hardware_of(hub: Hub, lines: list[str], folder: Path | None = None) -> Hardware:
    """A robot's topics, with its stops noted in a folder, and its lines in `lines`."""
    files = None if folder is None else StopFiles(folder, "r1")
    return Hardware(hub.link("f", "r1"), DriveSettings(), 1.0, lines.append, files)


def test_everybody_who_has_stopped_a_robot_must_release_it() -> None:
    stops = Stops("/stop")
    assert not stops
    assert stops.hold(Stopper.TOPIC)
    assert stops.hold(Stopper.OPERATOR)
    assert not stops.hold(Stopper.OPERATOR)
    assert stops.why == f"{TOPIC}; {OPERATOR}"
    assert stops.release(Stopper.OPERATOR)
    assert not stops.release(Stopper.OPERATOR)
    assert stops.why == TOPIC
    assert stops.release(Stopper.TOPIC)
    assert (bool(stops), stops.why, stops.unsaved()) == (False, "", "")


def test_a_stop_outlives_its_process_until_it_is_released(tmp_path: Path) -> None:
    folder = tmp_path / "made" / "state"
    files = StopFiles(folder, "r1")
    stops = Stops("/stop", files)
    stops.hold(Stopper.OPERATOR)
    assert stops.unsaved(PATIENCE_S) == ""
    (noted,) = folder.iterdir()
    assert stat.S_IMODE(noted.stat().st_mode) == 0o600
    assert noted.read_text(encoding="utf-8") == "r1: stopped by an operator\n"
    again = Stops("/stop", StopFiles(folder, "r1"))
    assert again.why == OPERATOR
    assert not again.hold(Stopper.OPERATOR)
    assert not Stops("/stop", StopFiles(folder, "r2"))
    assert again.release(Stopper.OPERATOR)
    assert again.unsaved(PATIENCE_S) == ""
    assert not Stops("/stop", StopFiles(folder, "r1"))


def test_whatever_is_in_the_place_of_a_note_holds_the_robot(tmp_path: Path) -> None:
    files = StopFiles(tmp_path, "r1")
    damaged, link = tmp_path / "r1.stopped-by-operator", tmp_path / "r1.stopped-by-topic"
    damaged.write_bytes(bytes(10))
    damaged.chmod(0)
    link.symlink_to("nowhere")
    stops = Stops("/stop", files)
    assert stops.why == f"{OPERATOR}; {TOPIC}"
    stops.release(Stopper.OPERATOR)
    stops.release(Stopper.TOPIC)
    assert stops.unsaved(PATIENCE_S) == ""
    assert not any(map(os.path.lexists, (damaged, link)))


def test_a_stop_that_cannot_be_noted_still_holds_and_says_so(tmp_path: Path) -> None:
    folder = tmp_path / "state"
    stops = Stops("/stop", StopFiles(folder, "r1"))
    folder.rmdir()
    stops.hold(Stopper.TOPIC)
    assert stops.unsaved(PATIENCE_S) == f"{folder}/r1.stopped-by-topic: No such file or directory"
    assert stops
    folder.mkdir()
    stops.hold(Stopper.TOPIC)  # said once more, so it is tried once more
    assert stops.unsaved(PATIENCE_S) == ""


def test_a_place_where_nothing_can_be_noted_is_refused_at_once(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(BadInput, match=r"--state .*file: stops cannot be noted there .*; give a folder"):
        StopFiles(tmp_path / "file", "r1")


@pytest.mark.parametrize(
    ("environment", "folder"),
    [
        ({"STATE_DIRECTORY": "/var/lib/a:/var/lib/b", "XDG_STATE_HOME": "/x", "HOME": "/h"}, "/var/lib/a"),
        ({"XDG_STATE_HOME": "/x"}, "/x/fogwatch"),
        ({"XDG_STATE_HOME": "not/absolute"}, "/h/.local/state/fogwatch"),
        ({}, "/h/.local/state/fogwatch"),
    ],
)
def test_where_stops_are_noted(environment: dict[str, str], folder: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/h")
    assert state_folder(None, environment) == Path(folder)
    assert state_folder(Path("mine"), environment) == Path("mine")


def test_a_false_releases_only_what_was_sent_before_it() -> None:
    topic = StopTopic(held=False, clock=lambda: 1000)
    assert heeded(topic, said(False, 1, "a")) == (False, False, "")
    assert heeded(topic, said(True, 10, "b")) == (True, True, "")
    assert heeded(topic, said(False, 9, "a")) == (False, True, OLDER), "it was published first, and comes last"
    assert heeded(topic, said(False, 10, "a")) == (False, True, OLDER), "published at the same moment, it is not later"
    assert heeded(topic, said(False, None, "a")) == (False, True, TIMELESS)
    assert heeded(topic, said(False, 11, "c")) == (False, False, "")


def test_what_was_sent_in_the_moment_of_the_stop_does_not_release_it() -> None:
    """Equal times and equal counts tell no order, and in doubt the robot stays where it is."""
    topic = StopTopic(held=True, clock=lambda: 1000)
    assert heeded(topic, said(False, 1000, "a")) == (False, True, OLDER)
    assert heeded(topic, said(True, 1000, "a", 5), said(False, 1000, "b")) == (True, True, OLDER)
    assert heeded(topic, said(False, 1001, "a", 5)) == (False, True, OLDER), "its own count decides"
    assert heeded(topic, said(True, 1000, "b", 1), said(False, 1000, "b", 1)) == (True, True, OLDER)
    assert heeded(topic, said(False, 1000, "b", 2)) == (False, False, "")
    assert heeded(topic, said(True, 10, "a"), said(False, 10, "b")) == (True, True, OLDER)
    assert heeded(topic, said(False, 11, "b")) == (False, False, "")


def test_a_true_stops_whatever_its_senders_clock_says_and_however_many_false_follow() -> None:
    topic = StopTopic(held=False, clock=lambda: 1000)
    flood = [said(False, 9, "flood")] * 1000
    assert heeded(topic, said(False, 500, "a"), said(True, 10, "late clock"), *flood) == (True, True, OLDER)
    assert heeded(topic, said(True, 10**18, "early clock"), said(False, 1001, "a")) == (True, False, "")


def test_a_true_that_was_sent_before_the_stop_makes_the_stop_no_older() -> None:
    topic = StopTopic(held=False, clock=lambda: 1000)
    assert heeded(topic, said(True, 20, "a"), said(True, 10, "b")) == (True, True, "")
    assert heeded(topic, said(False, 15, "c")) == (False, True, OLDER), "sent before a's true"
    assert heeded(topic, said(False, 21, "c")) == (False, False, "")


def test_one_sender_is_followed_by_its_own_count_even_if_its_clock_is_put_back() -> None:
    topic = StopTopic(held=False, clock=lambda: 1000)
    assert heeded(topic, said(True, 900, "a", 5), said(False, 950, "a", 4)) == (True, True, OLDER)
    assert heeded(topic, said(False, 950, "a", 5)) == (False, True, OLDER)
    assert heeded(topic, said(False, 10, "a", 6)) == (False, False, "")


def test_a_stop_from_before_this_process_is_not_released_by_an_old_false() -> None:
    now = [1000]
    topic = StopTopic(held=True, clock=lambda: now[0])
    assert heeded(topic, said(False, 999, "latched long ago")) == (False, True, OLDER)
    now[0] = 500  # our clock is put back
    assert heeded(topic, said(False, 499, "a")) == (False, True, OLDER)
    assert heeded(topic, said(False, 501, "a")) == (False, False, "")


def test_what_cannot_be_read_stops() -> None:
    topic = StopTopic(held=False, clock=time.time_ns)
    topic.refuse("type", "/stop: is a std_msgs/msg/String, and should be a std_msgs/msg/Bool")
    assert heeded(topic) == (True, True, "")
    assert heeded(topic, said(False, time.time_ns(), "a")) == (False, False, "")


def test_hardware_says_first_refusals_and_notes_the_topics_stop(tmp_path: Path) -> None:
    hub = Hub()
    publisher = hub.link("remote", "r1").publisher("stop", Bool, LATCHED)
    lines: list[str] = []
    hardware = hardware_of(hub, lines, tmp_path)
    for _ in range(3):
        (mailbox,) = (box for _, box in hub.listening["/r1/stop"])
        mailbox.refuse("malformed", "/r1/stop: too short")
        hardware.fix()
    assert lines == ["refused: /r1/stop: too short", "stopped by the topic /r1/stop"]
    assert hardware.stops.unsaved(PATIENCE_S) == ""
    again = hardware_of(hub, lines, tmp_path)
    again.fix()
    assert again.stops
    publisher.send(Bool(False))
    again.fix()
    assert not again.stops
    assert again.stops.unsaved(PATIENCE_S) == ""
    assert list(tmp_path.iterdir()) == []


def test_a_stop_that_cannot_be_noted_is_said_once(tmp_path: Path) -> None:
    hub, folder, lines = Hub(), tmp_path / "state", list[str]()
    hardware = hardware_of(hub, lines, folder)
    folder.rmdir()
    hub.link("remote", "r1").publisher("stop", Bool, LATCHED).send(Bool(True))
    hardware.fix()
    assert hardware.stops.unsaved(PATIENCE_S)
    for _ in range(3):
        hardware.fix()
    unsaved = f"stops are not noted: {folder}/r1.stopped-by-topic: No such file or directory"
    assert lines == ["stopped by the topic /r1/stop", unsaved]


def test_refusals_are_said_once_for_each_reason() -> None:
    hub, lines = Hub(), list[str]()
    hardware = hardware_of(hub, lines)
    ((_, box),) = hub.listening["/r1/odom"]
    hardware.fix()
    assert lines == []
    box.refuse("hash", "a")
    box.refuse("hash", "b")
    box.refuse("type", "c")
    for _ in range(2):
        hardware.fix()
        assert lines == ["refused: a", "refused: c"]


def fix(vx: float = 0.0, vy: float = 0.0, turn_rate: float = 0.0) -> Fix:
    return Fix(Pose(0.0, 0.0, 0.0), Twist(vx, vy, turn_rate))


@pytest.mark.parametrize(
    ("twist", "is_moving"),
    [
        ((0.03, 0.04, 0.0), False),  # 0.05
        ((0.03, 0.041, 0.0), True),
        ((0.03, 0.0, 0.02), False),
        ((-0.03, 0.0, -0.021), True),
        ((0.0, 0.0, -0.06), True),
    ],
)
def test_a_robot_moves_by_more_than_the_noise_of_its_odometry(
    twist: tuple[float, float, float], is_moving: bool
) -> None:
    assert moves(fix(*twist)) is is_moving


@pytest.mark.parametrize(("factor", "stands_s"), [(1.0, 0.6), (4.0, 0.15)])
def test_a_robot_stands_once_all_odometry_since_the_stop_has_said_so(
    factor: float, stands_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """For 0.6 s of its own time, from when it was told, or moved last, or was last unheard."""
    Passing().put_into(monkeypatch, stops_module, "Condition")
    standing = Standing(factor)
    for begun_s, interrupt in ((0.0, fix(0.1)), (10.0, None), (20.0, "told")):
        if interrupt == "told":
            standing.told()
        else:
            standing.look(interrupt, "", begun_s - 0.01)  # type: ignore[arg-type]
        standing.look(fix(), "its goal", begun_s)
        standing.look(fix(), "its goal", begun_s + stands_s - 0.01)
        assert standing.doubt() == "it has not come to rest yet"
        standing.look(fix(), "its goal", begun_s + stands_s + 0.01)
        assert standing.doubt() == "its goal"
        standing.look(fix(), "", begun_s + stands_s + 0.02)
        assert standing.doubt() == ""


def test_an_operator_waits_for_three_seconds_from_the_stop_and_one_later(monkeypatch: pytest.MonkeyPatch) -> None:
    passing = Passing()
    passing.put_into(monkeypatch, stops_module, "Condition")
    standing = Standing(1.0)
    passing.now_s += 50.0
    standing.told()
    for passed_s in (0.5, 0.0, 60.0):
        passing.now_s += passed_s
        assert standing.doubt() == "it has not come to rest yet"
    assert passing.waits == [2.5, 1.0, 1.0]


def test_a_source_of_a_stop_waits_a_second_for_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    passing = Passing()
    passing.put_into(monkeypatch, stops_module, "Condition")
    monkeypatch.setattr(stops_module, "Thread", lambda **_how: threading.Thread())  # a disk that hangs
    stops = Stops("/stop", StopFiles(tmp_path, "r1"))
    stops.hold(Stopper.OPERATOR)
    assert stops.unsaved() == "the disk is slow"
    assert passing.waits == [1.0]
