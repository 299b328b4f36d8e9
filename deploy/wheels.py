#!/usr/bin/env python3
"""The wheels of a release: one for all machines, and one with compiled kernels for this Python on x86-64 Linux.

    make wheels                         # into dist/, with the Python of .venv
    make wheels PYTHON=python3.13       # after `make clean`, for another Python

pip takes the second where it fits. With the versions of numba, llvmlite and numpy that are locked here, nothing is
compiled then (`patrol/kernel_cache.py`); with others, and on other machines, the first start compiles.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.wheel import WheelBuilder

from patrol.kernel_cache import SHIPPED, SHIPPED_FOR

ROOT = Path(__file__).resolve().parents[1]
TAG = "cp{0}{1}-cp{0}{1}{2}-manylinux_2_28_x86_64"
"""The oldest C library for which numba has wheels: compiled kernels need nothing newer."""
MAKE = """
from runtime.starting.warmup import SELDOM, warm
warm(("patrol", "agent", "worldsim", "monitor", "experiments"), print, SELDOM)
"""


class CompiledWheel(WheelBuilder):
    """A wheel with entries of the cache of kernels.

    Attributes:
        entries: Their folder.
    """

    entries: Path

    def get_default_build_data(self) -> dict[str, Any]:
        """Return hatchling's settings for the wheel: what goes in, and which Python and machine it is for."""
        tag = TAG.format(*sys.version_info[:2], sys.abiflags)
        included = {str(self.entries): str(SHIPPED.relative_to(ROOT))}
        return {**super().get_default_build_data(), "pure_python": False, "tag": tag, "force_include": included}


def make_entries(folder: Path) -> Path:
    """Compile all kernels for the processor of wheels.

    Args:
        folder: An empty one.

    Returns:
        The folder of the entries.
    """
    kept = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    asked = {"NUMBA_CPU_NAME": SHIPPED_FOR, "NUMBA_CPU_FEATURES": ""}
    caches = {"NUMBA_CACHE_DIR": str(folder), "XDG_CACHE_HOME": str(folder)}
    environment = {**kept, **asked, **caches, "PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, "-P", "-c", MAKE], cwd=folder, env=environment, check=True)
    entries = folder / "entries"
    shutil.copytree(folder / "fogwatch", entries, ignore=shutil.ignore_patterns("lock"))
    return entries


def main(out: Path) -> None:
    """Build both wheels.

    Args:
        out: Where they go.
    """
    builders = [WheelBuilder(str(ROOT))]
    with tempfile.TemporaryDirectory() as folder:
        if os.uname().machine == "x86_64":
            compiled = CompiledWheel(str(ROOT))
            compiled.entries = make_entries(Path(folder))
            builders.append(compiled)
        for builder in builders:
            print(*builder.build(directory=str(out), versions=["standard"]))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "dist")
