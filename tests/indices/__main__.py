"""Run pytest in a process in which kernels are plain Python and their indices are checked."""

import sys
from importlib import import_module
from pathlib import Path

import pytest

from tests.indices.checked import install

ROOT = Path(__file__).resolve().parents[2]

if __name__ == "__main__":
    install()
    for path in sorted(ROOT.glob("*/kernels/[a-z]*.py")):
        import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))
    sys.exit(pytest.main(["-W", "ignore::RuntimeWarning", *sys.argv[1:]]))
