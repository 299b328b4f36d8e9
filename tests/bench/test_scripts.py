"""The benchmarks as scripts: each measures something and writes what pyperf reads."""

import subprocess
import sys
from pathlib import Path

import pyperf
import pytest

ROOT = Path(__file__).resolve().parents[2]
FLEETS = ("--skipped", "2", "--counted", "3")
PROCESSES = ("--duration", "5", "--tick", "3")


def measured(script: str, folder: Path, *words: str) -> dict[str, pyperf.Benchmark]:
    """Run a script with the least work that it has, and return the benchmarks that it writes, by name."""
    result = folder / "result.json"
    command = [sys.executable, "-m", f"bench.{script}", "--debug-single-value", "-q", "-o", str(result), *words]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    return {one.get_name(): one for one in pyperf.BenchmarkSuite.load(str(result)).get_benchmarks()}


@pytest.mark.processes
@pytest.mark.parametrize(
    ("script", "name", "words"),
    [
        ("kernels", "a record of five robots, decoded", ()),
        ("kernels", "a look of 10 m at 0.1 m", ()),
        pytest.param("decisions", "a decision, open, stochastic", (), marks=pytest.mark.accept),
        ("fleets", "a robot's tick, 5 robots, 20 % of frames lost", FLEETS),
        pytest.param("router", "a delivery, 10 members: bytes both ways", (), marks=pytest.mark.accept),
        pytest.param("processes", "five cars, yards: a tick, wall", PROCESSES, marks=pytest.mark.accept),
        pytest.param("processes", "five cars, yards: memory of an agent", PROCESSES, marks=pytest.mark.accept),
    ],
)
def test_one_benchmark_is_measured(script: str, name: str, words: tuple[str, ...], tmp_path: Path) -> None:
    (benchmark,) = measured(script, tmp_path, "--only", name.upper(), *words).values()
    assert benchmark.get_name() == name
    assert all(value > 0.0 for value in benchmark.get_values())
    assert {"fogwatch_version", "numba_version"} <= benchmark.get_metadata().keys()


@pytest.mark.processes
@pytest.mark.parametrize(
    ("script", "words", "says"),
    [
        ("kernels", ("--only", "nosuch"), "--only nosuch: no benchmark has this in its name: wave, "),
        ("links", ("--losses", "x"), "--losses: x: expected shares from 0 to 1"),
        ("links", ("--losses", "0.1,2"), "--losses: 0.1,2: expected shares from 0 to 1"),
        ("links", ("--ways", "post"), "--ways: post: choose among multicast"),
        ("sizes", ("--robots", "x"), "--robots x: give multiples of 3"),
    ],
)
def test_options_that_make_no_sense_are_errors(script: str, words: tuple[str, ...], says: str) -> None:
    command = [sys.executable, "-m", f"bench.{script}", *words]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert says in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.processes
def test_rivals_are_measured_beside_ours_where_they_are_installed(tmp_path: Path) -> None:
    pytest.importorskip("scipy")
    ours, theirs = measured("kernels", tmp_path, "--only", "dilatation, 400 x 400 open points")
    assert ours.endswith(": ours")
    assert ": scipy " in theirs
