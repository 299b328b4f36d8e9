"""Some of the runs whose trace hashes are written down, so that a change of what robots decide is seen at once.

All of them: tests/accept/test_traces.py.
"""

import json

import pytest

from tests.accept.test_traces import WRITTEN
from tests.accept.trace_cases import cases, made_on, trace_of

SOME = (
    "yards differential stochastic-faults",
    "clutter car stochastic-small",
    "clutter car committed-small",
    "yards holonomic committed-faults",
    "yards holonomic every-separation",
    "clutter car claims-faults",
    "open holonomic surround-faults",
    "yards differential stochastic-charging",
)
"""Both patrols of ours, the paper's with all that keeps robots apart, the three bodies, faults, an
intruder, and batteries."""


@pytest.mark.parametrize("name", SOME)
def test_robots_decide_as_they_did(name: str) -> None:
    written = json.loads(WRITTEN.read_text(encoding="utf-8"))
    if written["made_on"] != made_on():
        pytest.skip(f"traces.json was written on another machine or lock file: {written['made_on']}")
    assert trace_of((name, dict(cases())[name])) == (name, written["hashes"][name])
