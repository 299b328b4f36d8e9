from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from patrol.process.memory.file_pages import unchanged

SMAPS = """\
1000-3000 r-xp 00000000 08:01 5                          /lib/plain.so
Rss:                   8 kB
Private_Dirty:         0 kB
Anonymous:             0 kB
Swap:                  0 kB
SwapPss:               0 kB
VmFlags: rd ex mr mw me
3000-4000 r-xp 00000000 08:01 6                          /lib/with a debugger's changes.so
Rss:                   4 kB
Private_Dirty:         4 kB
Anonymous:             4 kB
Swap:                  0 kB
SwapPss:               0 kB
VmFlags: rd ex mr mw me
4000-5000 r--p 00001000 08:01 5                          /lib/plain.so
Anonymous:             0 kB
Swap:                  0 kB
SwapPss:               0 kB
VmFlags: rd mr mw me
5000-6000 r--p 00002000 08:01 5                          /lib/plain.so
Anonymous:             4 kB
Swap:                  0 kB
SwapPss:               0 kB
VmFlags: rd mr mw me ac
6000-7000 rw-p 00003000 08:01 5                          /lib/plain.so
Anonymous:             0 kB
Swap:                  0 kB
SwapPss:               0 kB
VmFlags: rd wr mr mw me ac
7000-9000 r--s 00000000 08:01 7                          /run/grid that was just written.npy
Shared_Dirty:          8 kB
Anonymous:             0 kB
Swap:                  0 kB
SwapPss:               0 kB
VmFlags: rd mr me ms
9000-a000 rw-s 00000000 08:01 8                          /run/written here.npy
Anonymous:             0 kB
Swap:                  0 kB
SwapPss:               0 kB
VmFlags: rd wr mr mw me ms
a000-b000 r-xp 00000000 00:00 0                          [vdso]
Anonymous:             0 kB
Swap:                  0 kB
SwapPss:               0 kB
VmFlags: rd ex mr mw me de
b000-c000 r-xp 00000000 00:00 0
Anonymous:             0 kB
Swap:                  0 kB
SwapPss:               0 kB
VmFlags: rd ex mr mw me
c000-d000 r--p 00000000 08:01 9                          /lib/changed and swapped out.so
Rss:                   0 kB
Anonymous:             0 kB
Swap:                 16 kB
SwapPss:               0 kB
VmFlags: rd mr mw me ac
d000-e000 r--p 00000000 08:01 9                          /lib/of which the system does not say.so
Anonymous:             0 kB
VmFlags: rd mr mw me ac
"""

RESIDENT = """
import sys
import numpy as np
from patrol.process.memory.file_pages import give_back_file_pages

def resident():
    with open("/proc/self/smaps") as mappings:
        for line in mappings:
            if line.rstrip().endswith(sys.argv[1]):
                mappings.readline()
                fields = dict(mappings.readline().split()[:2] for _ in range(3))
                return int(fields["Rss:"])

np.save(sys.argv[1], np.arange(1 << 20))
grid = np.load(sys.argv[1], mmap_mode="r")
total = int(grid.sum())
before = resident()
give_back_file_pages()
after = resident()
print(before, after, total == int(grid.sum()))
"""


def test_what_is_mapped_read_only_goes_back_unless_it_was_changed() -> None:
    assert list(unchanged(SMAPS.splitlines())) == [(0x1000, 0x3000), (0x4000, 0x5000), (0x7000, 0x9000)]


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux says what a process has mapped")
def test_pages_of_a_file_that_was_read_go_back_and_can_be_read_again(tmp_path: Path) -> None:
    command = [sys.executable, "-P", "-c", RESIDENT, str(tmp_path / "grid.npy")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
    before, after, same = done.stdout.split()
    assert int(before) > 8000, "kB of the eight million bytes are there once they were read"
    assert int(after) < 1000
    assert same == "True"
