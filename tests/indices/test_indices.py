"""No index leaves its array in any kernel: `cases.py`, in a process whose kernels refuse negative indices too."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.processes
def test_no_index_leaves_its_array() -> None:
    """As plain Python: without the compiler's optimisations, and with lists and scratch arrays checked as well."""
    command = [sys.executable, "-m", "tests.indices", "-q", "-p", "no:cacheprovider", "tests/indices/cases.py"]
    done = subprocess.run(
        command, cwd=ROOT, env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout[-8000:] + done.stderr[-2000:]
