"""A robot's own command begins quickly: it loads nothing that a robot does not need."""

import json

import pytest

from tests.fleets import python

pytestmark = pytest.mark.processes

HEAVY = {"llvmlite", "matplotlib", "numba", "PIL", "rosbags", "scipy", "starlette", "uvicorn", "zenoh"}
MORE_HEAVY = {"numpy", "yaml", "experiments", "monitor", "worldsim"}
"""What the help of an agent loads as little."""
REPORTS = {"dask", "distributed", "mcap", "pyarrow"}
REPORTS |= {f"monitor.{part}" for part in ("live", "page", "recording", "replay", "report")}
PROGRAM = """
import json, sys
from {module} import main
sys.argv = {words!r}
try:
    code = main()
except SystemExit as left:
    code = left.code
print()
print(json.dumps([code, sorted(sys.modules)]))
"""


def loaded(module: str, *words: str) -> tuple[int, set[str], str]:
    """The exit code of a command in a fresh interpreter, the modules that it has loaded, and what it has said."""
    program = PROGRAM.format(module=module, words=list(words))
    done = python("-c", program, check=True)
    said, _, last = done.stdout.rstrip().rpartition("\n")
    code, names = json.loads(last)
    return code, set(names), said + done.stderr


@pytest.mark.parametrize(
    ("module", "words"),
    [
        ("fogwatch.cli.main", ["fogwatch", "agent", "--help"]),
        ("fogwatch.cli.main", ["fogwatch", "agent", "--robot", "ros2", "--help"]),
        ("agent.process", ["agent", "--help"]),
    ],
)
def test_an_agents_help_loads_nothing_heavy(module: str, words: list[str]) -> None:
    code, names, said = loaded(module, *words)
    assert code == 0
    assert "robot" in said
    assert not names & (HEAVY | MORE_HEAVY)
    assert module != "agent.process" or "pydantic" not in names


def test_an_error_is_said_before_anything_heavy_is_loaded() -> None:
    code, names, _ = loaded("fogwatch.cli.app", "fogwatch", "run", "nowhere")
    assert code == 2
    assert not names & (HEAVY | REPORTS)


def test_it_is_the_same_command_as_among_all_others() -> None:
    alone = loaded("fogwatch.cli.main", "fogwatch", "agent", "--help")[2]
    assert alone == loaded("fogwatch.cli.app", "fogwatch", "agent", "--help")[2]
    assert "agent" in loaded("fogwatch.cli.main", "fogwatch", "--help")[2]


def test_it_heeds_ctrl_c_before_anything_slow_is_loaded() -> None:
    program = "import sys; sys.modules['typing'] = None; import fogwatch.cli.main; print(*sys.modules)"
    done = python("-c", program, check=True)
    assert not {"pathlib", "rich", "typer"} & set(done.stdout.split())


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["agnt"], "fogwatch: agnt: no such command; did you mean agent?"),
        (["agent", "--credentials", "nowhere", "--scenario", "none"], "agent: --credentials: nowhere cannot be read"),
        (["agent", "--robot", "ros3"], "fogwatch agent: --scenario FILE is missing: the scenario, the same for"),
        (["agent", "--incarnation", "2"], "fogwatch agent: --scenario FILE is missing: the scenario, the same for"),
    ],
)
def test_bad_input_is_one_line(words: list[str], line: str) -> None:
    code, _, said = loaded("fogwatch.cli.main", "fogwatch", *words)
    assert code == 2
    (only,) = said.strip().splitlines()
    assert only.startswith(line)
