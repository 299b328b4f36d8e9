"""Others' work while a benchmark runs: what the cores did, less what the benchmark's own processes did."""

from __future__ import annotations

import subprocess
import sys
import time

import pytest

from experiments.bench.tools.measure import Unmeasured
from experiments.bench.tools.others import LEAST_S, Clocks, OthersWork, clocks, own_s

BURN = "import time\nwhile time.process_time() < {seconds}: pass"


def test_what_we_do_ourselves_is_not_others_work() -> None:
    readings: list[Clocks] = [
        (100.0, 50.0, 10.0),
        (110.0, 65.0, 20.0),  # 15 s of cores, 10 of which are ours
        (110.0 + LEAST_S / 2.0, 67.0, 20.0),  # too soon
        (120.0, 75.0, 20.0),  # and counted from the reading before that
        (130.0, 84.9, 30.0),  # the clocks do not agree exactly
    ]
    times = iter(readings)
    others = OthersWork(lambda: next(times))
    assert [others.cores() for _ in readings[1:]] == [0.5, None, 1.0, 0.0]


def test_where_the_kernel_does_not_say_nothing_is_told() -> None:
    def unsaid() -> Clocks:
        raise Unmeasured("no such file")

    assert OthersWork(unsaid).cores() is None


@pytest.mark.processes
def test_our_own_time_includes_that_of_children_and_theirs_that_have_ended() -> None:
    before = own_s()
    child = f"import subprocess, sys\nsubprocess.run([sys.executable, '-c', {BURN.format(seconds=0.2)!r}])\n"
    subprocess.run([sys.executable, "-c", f"{child}{BURN.format(seconds=0.2)}"], check=True)
    assert own_s() - before > 0.35
    begun = time.process_time()
    while time.process_time() - begun < 0.2:
        pass
    assert own_s() - before > 0.5


def test_the_clocks_of_this_machine_only_go_on() -> None:
    if sys.platform != "linux":
        pytest.skip("needs Linux")
    before = clocks()
    assert all(later >= earlier for later, earlier in zip(clocks(), before, strict=True))
