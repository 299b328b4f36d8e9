from __future__ import annotations

import subprocess
import sys

import pytest

from patrol.process.starting.forking import can_fork

pytestmark = [pytest.mark.processes, pytest.mark.skipif(not can_fork(), reason="this system has no fork server")]

ADOPTING = """
from contextlib import ExitStack
from patrol.process.starting.forking import adopting_orphans, adopts_orphans

said = [adopts_orphans()]
with ExitStack() as always:
    for _ in range(2):
        first, second = ExitStack(), ExitStack()
        assert first.enter_context(adopting_orphans()) and second.enter_context(adopting_orphans())
        first.close()
        said.append(adopts_orphans())
        second.close()
        said.append(adopts_orphans())
        always.enter_context(adopting_orphans())
print(said)
"""


def test_a_process_takes_in_orphans_until_the_last_of_its_runs_is_over() -> None:
    done = subprocess.run(
        [sys.executable, "-P", "-c", ADOPTING], capture_output=True, text=True, timeout=300, check=True
    )
    assert done.stdout == "[False, True, False, True, True]\n"
