"""Patrol an office in MuJoCo, with a router, the bodies and an agent for each robot as processes, and film it.

    python examples/mujoco/fleet.py --out runs/mujoco                          # eleven minutes
    python examples/mujoco/fleet.py --out runs/ours --bodies ours --exact      # to compare with

The folder gets what robot-sim measured (summary.json), the true poses (poses.csv), the processes' logs, and the last
two minutes as a film (mujoco.webp). Without a display, set MUJOCO_GL as film.py says.
"""

from __future__ import annotations

import argparse
import json
import signal
import socket
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

HERE = Path(__file__).parent
SCENARIO = HERE / "office.yaml"
ROBOTS = ("robot1", "robot2", "robot3")
MARGIN_M = "0.1"
WRONG = ("--pose-noise", "0.03", "--pose-noise-heading", "0.01")
FILM_S = 120.0
GRACE_S = 20.0
LOOK_S = 0.1
BODIES = "robot-sim"


class Processes:
    """The processes of one patrol. Their logs lie in a folder; all are ended together."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._running = ExitStack()
        self._started: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> Processes:
        return self

    def __exit__(self, *_: object) -> None:
        self._running.close()

    def start(self, name: str, *words: str) -> None:
        """Start a process of fogwatch."""
        with (self._folder / f"{name}.log").open("wb") as log:
            process = subprocess.Popen([sys.executable, "-P", "-m", "fogwatch", *words], stdout=log, stderr=log)
        self._running.callback(end, process)
        self._started[name] = process

    def await_first_end(self) -> tuple[str, int]:
        """Wait until one of the processes ends; return its name and exit code."""
        while True:
            for name, process in self._started.items():
                if (code := process.poll()) is not None:
                    return name, code
            time.sleep(LOOK_S)


def end(process: subprocess.Popen[bytes]) -> None:
    """Ask a process to leave, and kill it where it does not."""
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
    try:
        process.wait(GRACE_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def free_port() -> int:
    """Find a port of this machine that nobody uses."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def patrol(out: Path, duration_s: float, *, own_bodies: bool, exact: bool) -> tuple[str, int]:
    """Run it until a process ends, robot-sim if all is well; return its name and exit code."""
    router = f"tcp/127.0.0.1:{free_port()}"
    shared = ["--scenario", str(SCENARIO), "--margin", MARGIN_M, "--connect", router]
    bodies = [] if own_bodies else ["--bodies", f"{HERE / 'bodies.py'}:MujocoBodies"]
    figures = ["--out", str(out / "summary.json"), "--poses", str(out / "poses.csv"), "--duration", f"{duration_s:g}"]
    with Processes(out) as processes:
        processes.start("router", "router", "--listen", router)
        robots = ["--robots", ",".join(ROBOTS), *bodies, *figures, *(() if exact else WRONG)]
        processes.start(BODIES, "robot-sim", *shared, *robots)
        for name in ROBOTS:
            own = ["--robot", "ros2", "--namespace", name, "--state", str(out / "state" / name)]
            processes.start(name, "agent", *own, *shared)
        return processes.await_first_end()


def main() -> int:
    """Patrol, say what came of it, and film it; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="new or empty")
    parser.add_argument("--duration", type=float, default=600.0, metavar="S", help="of the patrol (%(default)g s)")
    parser.add_argument("--bodies", choices=("mujoco", "ours"), default="mujoco", help="what moves (%(default)s)")
    parser.add_argument("--exact", action="store_true", help="localisation that is never wrong")
    options = parser.parse_args()
    out: Path = options.out
    if out.is_dir() and any(out.iterdir()):
        parser.error(f"--out {out}: is not empty; choose another folder")
    out.mkdir(parents=True, exist_ok=True)
    print(f"patrols for {options.duration:g} s; logs are in {out}", flush=True)
    try:
        name, code = patrol(out, options.duration, own_bodies=options.bodies == "ours", exact=options.exact)
    except KeyboardInterrupt:
        return 130
    if name != BODIES or code != 0:
        early = "" if name == BODIES else " before the patrol was over"
        print(f"{name} ended with exit code {code}{early}; {out / f'{name}.log'} says why", file=sys.stderr)
        return 1
    print(json.dumps(json.loads((out / "summary.json").read_text(encoding="utf-8")), indent=1))
    if options.bodies == "ours":
        return 0
    begin = ["--from", f"{max(0.0, options.duration - FILM_S):g}"]
    film = [sys.executable, str(HERE / "film.py"), str(out / "poses.csv"), *begin, "--out", str(out / "mujoco.webp")]
    return subprocess.run(film, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
