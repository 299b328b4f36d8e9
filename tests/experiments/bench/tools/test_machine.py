"""The machine of a benchmark, and what the kernel says of processes."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from experiments.bench.tools import procfs
from experiments.bench.tools.machine import this_machine
from experiments.bench.tools.measure import Unmeasured
from experiments.bench.tools.procfs import cores_busy_s, family_of, loopback_bytes, memory_of, peak_mb, since_boot
from tests.fresh_memory import fresh_memory


def test_a_busy_machine_is_warned_of() -> None:
    machine = this_machine()
    assert machine.cores >= 1
    quiet, busy = replace(machine, load=0.0), replace(machine, load=2.0 * machine.cores)
    assert (quiet.busy, quiet.warning) == (False, "")
    assert busy.busy
    assert busy.warning.startswith(f"this machine is busy: load {busy.load:.1f} on {machine.cores} cores")
    assert len(machine.lines) == 2


def test_what_was_measured_beside_others_work_is_doubted_by_what_they_did_meanwhile() -> None:
    machine = replace(this_machine(), cores=2, load=1.8)
    assert machine.doubts(0.05) == ""  # who was busy before is quiet now
    assert machine.doubts(0.9).startswith("measured beside other work (up to 0.9 of 2 cores): processor times differ")
    assert machine.doubts(None).startswith("measured beside other work (load 1.8 on 2 cores before): ")
    assert replace(machine, load=0.1).doubts(None) == ""
    assert replace(machine, load=0.1).doubts(0.9) == machine.doubts(0.9)


def test_the_time_of_cores_that_this_process_may_use_is_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert cores_busy_s() > 0.0
    lines = [
        "cpu 9 9 9 9 9 9 9 9 9 9",
        *(f"cpu{core} {core}00 20 30 4000 5000 60 70 80 999 999" for core in (1, 2, 3)),
        "intr 5",
    ]
    (tmp_path / "stat").write_text("\n".join(lines), encoding="utf-8")
    monkeypatch.setattr(procfs, "PROC", tmp_path)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {1, 3})
    assert cores_busy_s() == (100 + 300 + 2 * (20 + 30 + 60 + 70 + 80)) / os.sysconf("SC_CLK_TCK")
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {4})
    with pytest.raises(Unmeasured, match="does not say for how long each core was busy"):
        cores_busy_s()


def test_a_benchmark_names_its_commit() -> None:
    root = Path(__file__).parents[4]
    command = ["git", "-C", str(root), "rev-parse", "--short", "HEAD"]
    asked = subprocess.run(command, capture_output=True, text=True, check=False)
    if asked.returncode != 0:
        pytest.skip("this is no checkout")
    assert this_machine().commit.removesuffix("+") == asked.stdout.strip()


def test_the_memory_of_a_process_is_what_it_holds() -> None:
    memory = memory_of(os.getpid())
    assert 0.0 < memory.private <= memory.pss <= memory.rss
    with fresh_memory(64_000_000):
        grown = memory_of(os.getpid())
    assert grown.private - memory.private == pytest.approx(64.0, abs=8.0)
    assert peak_mb() >= grown.rss - 1.0


@pytest.mark.parametrize("text", ["", "00 [rollup]\nRss: 5 kB\n", "00 [rollup]\nRss:\n", "00 [rollup]\nRss: many kB\n"])
def test_a_kernel_that_does_not_say_all_of_the_memory_is_no_measure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    (tmp_path / "7").mkdir()
    (tmp_path / "7" / "smaps_rollup").write_text(text, encoding="utf-8")
    monkeypatch.setattr(procfs, "PROC", tmp_path)
    with pytest.raises(Unmeasured, match="does not say all of the process's memory"):
        memory_of(7)


@pytest.mark.processes
def test_a_family_is_a_process_and_all_that_descend_from_it() -> None:
    code = "import subprocess, sys; subprocess.run([sys.executable, '-c', 'print(1, flush=True); input()'])"
    command = [sys.executable, "-c", code]
    begun = since_boot()
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as child:
        assert child.stdin is not None
        assert child.stdout is not None
        assert child.stdout.readline() == b"1\n"
        family = {one.pid: one for one in family_of(child.pid)}
        (grandchild,) = [one for one in family.values() if one.parent == child.pid]
        assert set(family) == {child.pid, grandchild.pid}
        assert grandchild.words[:2] == (sys.executable, "-c")
        assert begun - 0.1 < family[child.pid].began <= grandchild.began <= since_boot()
        child.stdin.close()
    assert family_of(child.pid) == []
    with pytest.raises(Unmeasured, match="cannot be read"):
        memory_of(child.pid)


def test_what_this_machine_sends_itself_is_counted() -> None:
    assert loopback_bytes() >= 0
