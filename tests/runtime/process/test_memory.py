import os
import subprocess
import sys

import pytest

FAULTS = """
import resource
import numpy as np
from runtime.starting.environment import keep_freed_memory

keep_freed_memory()

def work():
    return sum(int(grid[-1]) for grid in [np.full(1 << 20, 7, dtype=np.uint8) for _ in range(6)])

def faults():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt

work()
before = faults()
assert work() == 42
print(faults() - before)
"""


@pytest.mark.skipif("CS_GNU_LIBC_VERSION" not in os.confstr_names, reason="the C library is not glibc")
def test_grids_that_are_freed_and_made_again_need_no_new_pages() -> None:
    environment = {**os.environ, "NUMPY_MADVISE_HUGEPAGE": "0"}  # a large page would hide many small ones
    done = subprocess.run(
        [sys.executable, "-P", "-c", FAULTS], capture_output=True, text=True, timeout=300, check=True, env=environment
    )
    pages = (1 << 20) // os.sysconf("SC_PAGE_SIZE")
    assert int(done.stdout) < pages, "six grids take fewer new pages than one of them has"
