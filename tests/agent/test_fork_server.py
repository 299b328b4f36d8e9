"""The fork server loads all that its agents need: none loads kernels while others wait for its decision."""

import subprocess
import sys

import pytest

PATIENCE_S = 300.0
PROGRAM = """
import sys
from agent.fork_server import _load_modules
_load_modules([])
loaded = set(sys.modules)
from fogwatch.inprocess import run_in_process
from patrol.measures.best_tour import best_tour
from patrol.prepare import prepare
from patrol.scenario import load_scenario
robots = {"count": 3, "model": sys.argv[1]}
scenario = load_scenario({"duration": 10, "terrain": {"builtin": "yards"}, "point": 0.5, "robots": robots})
best_tour(prepare(scenario))
before = set(sys.modules)  # agents find prepared fields in files, and the tour is the judge's business
run_in_process(scenario)
print("BLAS:", "scipy.linalg" in loaded)
print("kernels:", *sorted(name for name in loaded if ".kernels." in name))
print("later:", *sorted(name for name in set(sys.modules) - before if ".kernels." in name))
"""


@pytest.mark.parametrize("model", ["car", "holonomic", "differential"])
def test_an_agent_that_patrols_loads_no_kernels(model: str) -> None:
    command = [sys.executable, "-P", "-c", PROGRAM, model]
    ran = subprocess.run(command, capture_output=True, text=True, check=True, timeout=PATIENCE_S)
    kernels, later = (line.split()[1:] for line in ran.stdout.splitlines() if line.startswith(("kernels:", "later:")))
    assert "agent.kernels.wave" in kernels
    assert "BLAS: False" in ran.stdout
    assert [name for name in later if name.startswith(("agent.", "patrol."))] == []
