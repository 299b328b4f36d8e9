from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from patrol.errors import BadInput
from patrol.process.starting.warmup import COMPILING, WAITING, cache_home, kernel_files, warm

KERNEL = """
from numba import njit

@njit("int64(int64)", cache=True)
def double(n):
    return 2 * n
"""

ALONE = """
import sys
from patrol.process.starting.warmup import numba_alone
numba_alone()
import toy.kernels.sums
print([str(toy.kernels.sums.double(21)), str("scipy" in sys.modules)])
import scipy.linalg
"""

TWO_STARTS = """
import sys
from patrol.process.starting.warmup import warm
said = []
warm(("toy",), said.append)
print(said)
"""


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package with one kernel, and a cache of its own."""
    folder = tmp_path / "toy" / "kernels"
    folder.mkdir(parents=True)
    (tmp_path / "toy" / "__init__.py").touch()
    (folder / "__init__.py").touch()
    (folder / "sums.py").write_text(KERNEL, encoding="utf-8")
    monkeypatch.setenv(
        "PYTHONPATH", os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
    )
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path


def start(code: str = TWO_STARTS, **environment: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-P", "-c", code]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, **environment}
    )


def said(process: subprocess.Popen[str]) -> list[str]:
    output, errors = process.communicate(timeout=600)
    assert process.returncode == 0, errors
    lines: list[str] = json.loads(output.replace("'", '"'))
    return lines


@pytest.mark.usefixtures("toy")
def test_kernels_run_without_scipy_which_can_still_be_imported_later() -> None:
    assert said(start(ALONE)) == ["42", "False"]


def test_every_kernel_of_ours_is_found() -> None:
    found = kernel_files("patrol")
    assert "patrol.ground.kernels.fog" in found
    assert all(path.is_file() for path in found.values())
    assert kernel_files("experiments") == {}


def test_a_warm_machine_compiles_and_says_nothing() -> None:
    packages = ("patrol", "agent", "worldsim")
    warm(packages, lambda _line: None)
    lines: list[str] = []
    warm(packages, lines.append)
    assert lines == []


@pytest.mark.processes
def test_processes_that_start_together_compile_once(toy: Path) -> None:
    processes = [start() for _ in range(3)]
    lines = [said(process) for process in processes]
    assert sum(COMPILING in told for told in lines) == 1
    assert all(told in ([], [COMPILING], [WAITING]) for told in lines)
    assert said(start()) == []
    assert list((toy / "cache").rglob("sums.double-*.nbi"))


@pytest.mark.processes
def test_a_changed_source_and_a_lost_cache_are_compiled_again(toy: Path) -> None:
    assert said(start()) == [COMPILING]
    source = toy / "toy" / "kernels" / "sums.py"
    source.write_text(f"{KERNEL}\n# changed\n", encoding="utf-8")
    assert said(start()) == [COMPILING]
    for index in (toy / "cache").rglob("*.nbi"):
        index.unlink()
    assert said(start()) == [COMPILING]
    assert said(start()) == []


@pytest.mark.processes
def test_where_nothing_can_be_kept_the_error_is_kind(toy: Path) -> None:
    process = start(NUMBA_CACHE_LOCATOR_CLASSES="IPythonCacheLocator")
    _, errors = process.communicate(timeout=600)
    assert process.returncode != 0
    assert "set NUMBA_CACHE_DIR to a folder" in errors.splitlines()[-1]
    (toy / "file").touch()
    process = start(NUMBA_CACHE_DIR=str(toy / "file"))
    assert "set NUMBA_CACHE_DIR to a folder" in process.communicate(timeout=600)[1]


def test_the_stamp_goes_where_numba_keeps_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
    kernel = tmp_path / "kernels" / "k.py"
    assert cache_home([kernel]) == tmp_path / "kernels" / "__pycache__"
    (tmp_path / "closed").touch()
    assert cache_home([tmp_path / "closed" / "k.py"]) == tmp_path / "user" / "fogwatch"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "closed"))
    with pytest.raises(BadInput, match="NUMBA_CACHE_DIR"):
        cache_home([tmp_path / "closed" / "k.py"])
