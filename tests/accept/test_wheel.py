"""The built wheel in an empty environment without extras: what a robot installs, and how quickly its command begins."""

import json
import os
import re
import resource
import subprocess
import sys
import tomllib
import venv
from collections.abc import Callable
from pathlib import Path

import pytest

from patrol.kernel_cache import runs_shipped

pytestmark = [pytest.mark.accept, pytest.mark.timeout(3600)]

ROOT = Path(__file__).resolve().parents[2]
EXTRAS_ONLY = {
    *("dask", "distributed", "matplotlib", "mcap", "mcap-ros2-support", "plotly", "rosbags", "scipy", "shapely"),
    *("starlette", "uvicorn", "websockets"),
}
HELP_S = 1.0
"""Processor time that the help of an agent may take, s."""

Installed = Callable[..., subprocess.CompletedProcess[str]]


def run(*command: str | Path, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a command away from the sources, which it would find before what is installed."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    words = [str(word) for word in command]
    return subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of its own; the tests are skipped where pip reaches no index."""
    folder = tmp_path_factory.mktemp("wheel")
    asked = run(sys.executable, "-m", "pip", "download", "--no-deps", "-d", folder / "one", "mdurl", folder=folder)
    if asked.returncode != 0:
        pytest.skip(f"pip reaches no package index: {asked.stderr.strip().splitlines()[-1]}")
    return folder


@pytest.fixture(scope="module")
def installed(folder: Path) -> Installed:
    """Runs what the wheel has installed into an empty environment, without extras."""
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = folder.glob("fogwatch-*.whl")
    venv.create(folder / "env", with_pip=True)
    done = run(folder / "env/bin/pip", "install", wheel, folder=folder)
    assert done.returncode == 0, done.stderr
    return lambda program, *words: run(folder / "env/bin" / program, *words, folder=folder)


def test_no_extras_library_comes_along(installed: Installed) -> None:
    names = {package["name"].lower() for package in json.loads(installed("pip", "list", "--format", "json").stdout)}
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    for_runs = {name for name in EXTRAS_ONLY if any(name in line for extra in extras.values() for line in extra)}
    assert for_runs == EXTRAS_ONLY, "the list is of the extras' libraries"
    assert not names & EXTRAS_ONLY
    assert {"fogwatch", "eclipse-zenoh", "numba", "numpy", "pydantic", "typer"} <= names


@pytest.mark.parametrize(
    ("program", "words"),
    [
        ("fogwatch", ["agent", "--help"]),
        ("fogwatch", ["agent", "--robot", "ros2", "--help"]),
        ("fogwatch", ["--help"]),
        ("fogwatch", ["version"]),
        ("python", ["-m", "agent", "--help"]),
        ("python", ["-m", "worldsim", "--help"]),
        ("python", ["-m", "monitor", "--help"]),
        ("python", ["-m", "fogwatch.router", "--help"]),
    ],
)
def test_help_needs_no_extra(program: str, words: list[str], installed: Installed) -> None:
    done = installed(program, *words)
    assert done.returncode == 0, done.stderr
    assert done.stdout
    assert not done.stderr


def test_the_help_of_an_agent_takes_less_than_a_second(installed: Installed) -> None:
    installed("fogwatch", "agent", "--help")  # compiles the sources
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert installed("fogwatch", "agent", "--help").returncode == 0
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < HELP_S


def test_who_misses_an_extra_is_told_which(installed: Installed, folder: Path) -> None:
    words = "open --robots 1 --point 1 --duration 2 --in-process --quiet --out finished"
    assert installed("fogwatch", "run", *words.split()).returncode == 0
    for asked, extra in (
        (["replay", "finished"], "monitor"),
        (["report", "finished"], "monitor"),
        (["record", "finished", "--out", "one.mcap"], "monitor"),
        (["compare", "finished", "finished"], "monitor"),
        (["doctor", "--connect", "tcp/127.0.0.1:9", "--wait", "1"], "ros2"),
        (["sweep", str(ROOT / "examples/sweeps/claims.yaml"), "--cluster", "127.0.0.1:9"], "experiments"),
    ):
        done = installed("fogwatch", *asked)
        assert done.returncode == 2, (asked, done.stderr)
        (line,) = done.stderr.splitlines()
        assert line.endswith(f"install it with: pip install 'fogwatch[{extra}]'"), (asked, line)
    assert not (folder / "one.mcap").exists()


@pytest.mark.skipif(not runs_shipped(), reason="this processor does not run what the wheel for x86-64 holds")
def test_the_wheel_for_x86_64_runs_a_fleet_without_git_and_make_and_compiles_nothing(folder: Path) -> None:
    python = ("env", f"PYTHONPATH={ROOT}", sys.executable, "-P")
    made = run(*python, ROOT / "deploy/wheels.py", folder / "dist", folder=folder)
    assert made.returncode == 0, made.stderr
    (wheel,) = (folder / "dist").glob("*x86_64.whl")
    venv.create(folder / "all", with_pip=True)
    locked = (ROOT / "requirements-run.lock").read_text(encoding="utf-8")
    versions = re.sub(r" \\\n +--hash=\S+", "", locked)
    (folder / "locked.txt").write_text(versions, encoding="utf-8")
    done = run(folder / "all/bin/pip", "install", "-c", "locked.txt", f"{wheel}[sim,monitor]", folder=folder)
    assert done.returncode == 0, done.stderr
    only = ("env", "-i", f"HOME={folder}/home", f"PATH={folder}/all/bin", folder / "all/bin/fogwatch")
    done = run(*only, "run", "site", "--robots", "2", "--duration", "5", "--out", "first", folder=folder)
    assert done.returncode == 0, done.stderr
    assert (folder / "first" / "report.html").is_file()
    assert not [*(folder / "home").rglob("*.nbc")], "kernels were compiled"


PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PYTHONS = [kind.rpartition(" ")[2] for kind in PROJECT["classifiers"] if kind.startswith("Programming Language")]


@pytest.mark.parametrize("machine", ["aarch64", "x86_64"])
@pytest.mark.parametrize("python", PYTHONS)
def test_each_dependency_of_a_robot_has_a_wheel_for_each_python_named(machine: str, python: str, folder: Path) -> None:
    needed, target = PROJECT["dependencies"], folder / f"{machine}-{python}"
    platforms = [word for glibc in ("2_28", "2_17") for word in ("--platform", f"manylinux_{glibc}_{machine}")]
    done = run(
        *(sys.executable, "-m", "pip", "download", "--only-binary=:all:", "--python-version", python, *platforms),
        *("--platform", f"manylinux2014_{machine}", "-d", target, *needed),
        folder=folder,
    )
    assert done.returncode == 0, done.stderr
    assert any(path.name.startswith("numba-") and machine in path.name for path in target.iterdir())
