"""A fleet of real processes is recorded while it goes on, and by whom it is killed."""

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from patrol.journal import read_journal
from runtime.security.access import FILE
from tests.fleets import COARSE
from tests.fogwatch.conftest import Run
from tests.recordings import Topics, decoded, read_recording

pytestmark = pytest.mark.processes

ROBOTS = [{"name": "anna", "model": "holonomic"}, {"name": "b-2", "model": "holonomic"}]
DIRECT: dict[str, Any] = {**COARSE, "point": 0.5, "duration": 20_000, "pace": 4.0, "robots": ROBOTS}
DIRECT["radio"] = {"via": "direct"}
PATIENCE_S = 300.0
ENOUGH = 8
"""Messages of a robot's pose that a recording is to have: those of some seconds, as every half second has one."""


class Recording:
    """A ``fogwatch record`` as a process."""

    def __init__(self, run: Run, out: Path, *arguments: str) -> None:
        command = [sys.executable, "-P", "-m", "fogwatch", "record", "--out", str(out)]
        command += ["--credentials", str(run.folder), *arguments]
        self.out = out
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

        self._read = 0
        self._topics: Topics = {}

    def so_far(self) -> Topics:
        """The messages by now; the file is cut off wherever its writer is."""
        size = self.out.stat().st_size if self.out.exists() else 0
        if size != self._read:
            self._topics = read_recording(self.out).topics
            self._read = size
        return self._topics

    def poses(self, robot: str) -> int:
        return len(self.so_far().get(f"/{robot}/pose", ()))

    def end(self, number: signal.Signals) -> int:
        self.process.send_signal(number)
        self.said, self.errors = self.process.communicate(timeout=PATIENCE_S)
        return self.process.returncode


def both_heard(topics: Topics) -> bool:
    """Return True if both robots have shown themselves and were alive at once, and some grid has a point just seen.

    What was heard before a tick began counts for the tick before: half a second of a scale of ten.
    """
    grids = (grid.data for _, grid in topics.get("/fog", ()))
    return (
        any(value.data == 2.0 for _, value in topics.get("/alive", ()))
        and {log.name for _, log in topics.get("/rosout", ()) if log.msg == "connected"} == {"anna", "b_2"}
        and any(0 <= min(data) <= 5 < max(data) for data in grids)
    )


@pytest.fixture
def record() -> Iterator[Callable[..., Recording]]:
    recordings: list[Recording] = []

    def begin(*arguments: Any) -> Recording:
        recordings.append(Recording(*arguments))
        return recordings[-1]

    yield begin
    for one in recordings:
        one.process.kill()
        one.process.communicate(timeout=PATIENCE_S)


def test_a_fleet_is_recorded_while_it_goes_on(
    start: Callable[..., Run], record: Callable[..., Recording], tmp_path: Path
) -> None:
    run = start(DIRECT)
    run.until(lambda: (run.folder / FILE).exists() and run.ticks() > 5)
    alone = ("--scenario", str(run.folder / "scenario.yaml"))
    heard, killed = record(run, tmp_path / "heard.mcap", *alone), record(run, tmp_path / "killed.mcap", *alone)
    fed = record(run, tmp_path / "fed.mcap")
    run.until(lambda: killed.poses("anna") > ENOUGH)
    run.until(lambda: fed.poses("anna") > ENOUGH)
    run.until(lambda: heard.poses("b_2") > ENOUGH and both_heard(heard.so_far()))

    killed.end(signal.SIGKILL)
    torn = read_recording(killed.out)
    assert not torn.is_whole
    assert len(torn.topics["/anna/pose"]) > ENOUGH

    for one in (heard, fed):
        assert one.end(signal.SIGINT) == 0, one.errors
        assert one.said.startswith(f"recording: {one.out}, ")
        assert read_recording(one.out).is_whole
    run.interrupt()

    ticks = list(read_journal(run.folder / "journal").ticks)
    step = 0.5
    told = decoded(fed.out)
    assert len(told["/anna/pose"]) > ENOUGH
    for at, stamped in told["/anna/pose"]:
        place, row = stamped.pose.position, ticks[round(at / step)].robots[0]
        assert (place.x, place.y) == (row.x, row.y)
    for at, number in told["/mfow"]:
        assert number.data == ticks[round(at / step)].mfow * step
    assert len(told["/mfow"]) >= len(told["/anna/pose"])
    assert len(told["/fog"]) == len(told["/fog_scale"]) >= 2

    topics = decoded(heard.out)
    sent = {(round(tick.robots[1].x, 2), round(tick.robots[1].y, 2)) for tick in ticks}
    places = [(stamped.pose.position.x, stamped.pose.position.y) for _, stamped in topics["/b_2/pose"]]
    assert len(places) > ENOUGH
    assert {(round(x, 2), round(y, 2)) for x, y in places} <= sent
    assert both_heard(topics)
    assert all(0 <= min(grid.data) <= max(grid.data) <= 100 for _, grid in topics["/fog"])
    assert max(value.data for _, value in topics["/alive"]) == 2.0
