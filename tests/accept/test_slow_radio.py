"""On a slow radio, five robots in 1.2 kbit/s altogether patrol nearly as well as without a limit."""

from math import inf
from pathlib import Path
from statistics import mean

import pytest

from fogwatch.inprocess import Outcome, run_in_process
from patrol.files.yaml_text import parse_yaml, read_text
from patrol.scenario import load_scenario

pytestmark = [pytest.mark.accept, pytest.mark.timeout(3600)]

SWEEP = Path(__file__).parents[2] / "examples" / "sweeps" / "radio.yaml"
SEEDS = range(1, 9)
BITS_PER_S = 1200
OVERHEAD = 8
"""Bytes that the radio adds to a frame."""


def run(seed: int, radio: dict[str, object]) -> Outcome:
    sweep = parse_yaml(read_text(SWEEP), str(SWEEP))
    assert isinstance(sweep, dict)
    base = sweep["base"]
    outcome = run_in_process(load_scenario({**base, "seed": seed, "radio": {**base["radio"], **radio}}), keep=False)
    assert outcome.verdict.valid, outcome.verdict.failed
    return outcome


@pytest.fixture(scope="module")
def unlimited_s() -> float:
    """The mean MFoW without a limit, s."""
    return mean(run(seed, {}).summary.mfow_mean_s or inf for seed in SEEDS)


@pytest.mark.parametrize("adaptive", [None, {"error": 2, "silence": 4}], ids=["periodic", "adaptive"])
def test_five_robots_in_1200_bits_a_second_patrol_nearly_as_well(adaptive: object, unlimited_s: float) -> None:
    budget = {"bits_per_s": BITS_PER_S, "overhead": OVERHEAD}
    slow = [run(seed, {"budget": budget, "adaptive": adaptive}).summary for seed in SEEDS]
    for summary in slow:
        sent = summary.messages
        assert 8 * (sent.bytes + OVERHEAD * sent.frames) <= BITS_PER_S * summary.simulated_s
    assert mean(summary.mfow_mean_s or inf for summary in slow) <= 1.1 * unlimited_s
