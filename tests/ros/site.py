"""A ROS 2 robot in the office with its agent, each a process that can be killed and started again."""

import itertools
import json
import math
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from patrol.maps.load import load_terrain
from patrol.scenario.sections import TerrainSpec
from tests.ros import base
from tests.routers import PATIENCE_S, routed

ROOT = Path(__file__).parents[2]
OFFICE = ROOT / "examples" / "maps" / "office.yaml"
OUT = ROOT / "build" / "ros"
RADIUS = 0.25
START = (3.0, 7.0, 0.0)
FLEET = "patrol"

Record = dict[str, Any]


class Site:
    """A robot, and the processes that drive it.

    Attributes:
        endpoint: The Zenoh router.
        kind: How the agent reaches the robot: over the relay, or as a node of ROS.
        track: What the robot has said of itself in each step, true poses included.
        events: What has been done to it, each with the length of `track` then.
    """

    def __init__(self, endpoint: str, kind: str, folder: Path) -> None:
        self.endpoint, self.kind, self.folder = endpoint, kind, folder
        self.track: list[Record] = []
        self.events: list[tuple[int, str]] = []
        self.running: dict[str, subprocess.Popen[str]] = {}
        self._listeners: list[threading.Thread] = []
        (folder / "robot.log").write_text("", encoding="utf-8")

    def start_base(self, frame: str = "map") -> None:
        """Switch the robot on where it stands."""
        last = self.track[-1] if self.track else dict(zip(("x", "y", "heading"), START, strict=True))
        pose = [str(last[name]) for name in ("x", "y", "heading")]
        process = self._start("base", [str(Path(base.__file__)), *pose, frame], subprocess.PIPE)
        self._listeners.append(threading.Thread(target=self._follow, args=(process,)))
        self._listeners[-1].start()

    def start_relay(self) -> None:
        """Start what carries the robot's topics to Zenoh."""
        if self.kind == "bridge":
            self._start("relay", [str(ROOT / "deploy" / "ros" / "relay.py"), "--connect", self.endpoint])

    def start_agent(self) -> None:
        """Start what drives the robot."""
        bridged = ["--robot", "ros2", "--format", "bridge", "--connect"]
        reach = bridged if self.kind == "bridge" else ["--robot", "rclpy", "--router"]
        words = ["-P", "-m", "ros2.robot", *reach, self.endpoint, "--namespace", base.NAMESPACE]
        body = [
            "--localisation",
            "pose",
            "--map",
            str(OFFICE),
            "--radius",
            str(RADIUS),
            "--speed",
            "1",
            "--wait",
            str(PATIENCE_S),
        ]
        self._start("agent", [*words, *body, "--state", str(self.folder / "state")])

    def kill(self, name: str) -> None:
        """Kill a process (SIGKILL)."""
        self.note(f"kill {name}")
        process = self.running.pop(name)
        process.kill()
        process.wait()

    def switch_off(self, name: str) -> None:
        """End a process politely (SIGINT)."""
        self.note(f"end {name}")
        process = self.running.pop(name)
        process.send_signal(signal.SIGINT)
        process.wait(PATIENCE_S)

    def fogwatch(self, *words: str) -> tuple[int, str]:
        """Run a command; return its exit code and what it printed."""
        command = [sys.executable, "-P", "-m", "fogwatch", *words]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        return done.returncode, done.stdout + done.stderr

    def control(self, *words: str) -> None:
        """Have an operator say something until the robot confirms it; on a busy machine it may take longer to stand."""
        self.note(words[0])
        self.until(lambda: self.fogwatch("control", self.endpoint, *words, "--fleet", FLEET)[0] == 0)

    def doctor(self, *needed: str) -> None:
        """Ask what a patrol lacks until all of this is said: a relay that was just started does not know all topics."""
        words = ["--connect", self.endpoint, "--namespace", base.NAMESPACE, "--localisation", "pose", "--seconds", "1"]
        said = [""]

        def says_it() -> bool:
            said[0] = self.fogwatch("doctor", *words)[1]
            return all(line in said[0] for line in needed)

        self.until(says_it, said)

    def until(self, is_so: Callable[[], bool], why: object = "") -> None:
        """Wait for something."""
        end_s = time.monotonic() + PATIENCE_S
        while not is_so():
            assert time.monotonic() < end_s, (why, self.read_log("agent"))
            time.sleep(0.02)

    def drives(self, way_m: float = 1.0) -> None:
        """Wait until the robot has come so far, and is moving."""
        begin = len(self.track)
        self.until(lambda: length_m(self.track[begin:]) > way_m and abs(self.track[-1]["speed"]) > 0.1)

    def recovers(self, begin: int) -> None:
        """Wait until the agent drives the robot again after something died, when its log was `begin` long.

        DDS may bring the robot's odometry seconds before the robot hears commands. Then the agent holds the robot, as
        one whose wheels are blocked, until an operator releases it.
        """
        self.says("agent", "drives again", begin)
        moves = len(self.track)
        held = "its pose stays where it is, though it was told to go"
        self.until(lambda: length_m(self.track[moves:]) > 0.5 or held in self.read_log("agent")[begin:])
        if held in self.read_log("agent")[begin:]:
            self.control("release")
        self.drives()

    def stands(self) -> None:
        """Wait until the robot stands, and check that it stays where it is for a second of its own steps."""
        self.until(lambda: self.track[-1]["speed"] == self.track[-1]["turn"] == 0.0)
        begin = len(self.track)
        self.until(lambda: len(self.track) >= begin + 20)
        assert length_m(self.track[begin - 1 :]) == 0.0

    def says(self, name: str, text: str, after: int = 0) -> None:
        """Wait until a process's log has a text."""
        self.until(lambda: text in self.read_log(name)[after:], text)

    def read_log(self, name: str) -> str:
        """Return what a process has said in all its lives."""
        path = self.folder / f"{name}.log"
        return path.read_text(encoding="utf-8") if path.exists() else ""

    def note(self, event: str) -> None:
        """Note what is done to the robot, for the picture."""
        self.events.append((len(self.track), event))

    def end(self) -> None:
        """End all that runs, politely; what does not leave then is killed."""
        for process in reversed(self.running.values()):
            process.send_signal(signal.SIGINT)
        try:
            for process in self.running.values():
                process.wait(PATIENCE_S)
        finally:
            for process in self.running.values():
                process.kill()
                process.wait()
            for listener in self._listeners:
                listener.join()

    def _start(self, name: str, words: list[str], stdout: int | None = None) -> subprocess.Popen[str]:
        self.note(f"start {name}")
        with (self.folder / f"{name}.log").open("a", encoding="utf-8") as log:
            process = subprocess.Popen([sys.executable, *words], stdout=stdout or log, stderr=log, text=True)
        self.running[name] = process
        return process

    def _follow(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        with process.stdout as lines, (self.folder / "robot.log").open("a", encoding="utf-8") as log:
            for line in lines:
                if line.endswith("\n"):  # a killed robot may have written half of one
                    self.track.append(json.loads(line))
                    log.write(line)


def length_m(track: list[Record]) -> float:
    """Return the length of the way along some records, m."""
    return math.fsum(math.dist((a["x"], a["y"]), (b["x"], b["y"])) for a, b in itertools.pairwise(track))


def least_clearance_m(track: list[Record]) -> float:
    """Return how near the robot's centre has come to the centre of a wall's point, m."""
    terrain = load_terrain(TerrainSpec(map=str(OFFICE)), 0.1, OFFICE.parent)
    rows, columns = np.nonzero(~terrain.passable)
    walls_x = terrain.origin[0] + (columns + 0.5) * terrain.point
    walls_y = terrain.origin[1] + (rows + 0.5) * terrain.point
    return min(float(np.hypot(walls_x - one["x"], walls_y - one["y"]).min()) for one in track)


def draw(site: Site, path: Path) -> None:
    """Draw the way that the robot has come, and what was done to it."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    terrain = load_terrain(TerrainSpec(map=str(OFFICE)), 0.1, OFFICE.parent)
    figure = Figure(figsize=(12, 8))
    axes = figure.add_subplot()
    xmin, ymin, xmax, ymax = terrain.bounds
    axes.imshow(terrain.passable, origin="lower", extent=(xmin, xmax, ymin, ymax), cmap="gray")
    axes.plot([one["x"] for one in site.track], [one["y"] for one in site.track], linewidth=1.5)
    done = [(number, event) for number, event in site.events if 0 < number <= len(site.track)]
    for count, (number, _) in enumerate(done, start=1):
        one = site.track[number - 1]
        axes.plot(one["x"], one["y"], "o", color="C3", markersize=4)
        axes.annotate(str(count), (one["x"], one["y"]), xytext=(5 + 9 * (count % 4), 5), textcoords="offset points")
    listed = "\n".join(f"{count} {event}" for count, (_, event) in enumerate(done, start=1))
    axes.text(1.02, 1.0, listed, transform=axes.transAxes, va="top")
    title = f"{site.kind}: {length_m(site.track):.1f} m in {len(site.track)} steps of 50 ms"
    axes.set(title=title, xlabel="x (m)", ylabel="y (m)")
    FigureCanvasAgg(figure)
    figure.savefig(path, bbox_inches="tight")


@contextmanager
def site_of(kind: str, folder: Path) -> Iterator[Site]:
    """A robot that patrols; what it leaves is in `OUT`."""
    folder.mkdir(parents=True, exist_ok=True)
    with routed() as endpoint:
        site = Site(endpoint, kind, folder)
        try:
            site.start_base()
            site.start_relay()
            site.start_agent()
            site.until(lambda: bool(site.track))
            yield site
        finally:
            site.end()
            draw(site, folder / "way.png")
