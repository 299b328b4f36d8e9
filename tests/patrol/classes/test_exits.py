"""Foreign code that ends its process: it raises there, and ends what it forks."""

import subprocess
import sys

import pytest

PROGRAM = """
import multiprocessing, os, posix, sys
from patrol.classes.exits import end_now, keep_process

keep_process()
keep_process()
for leave in (os._exit, posix._exit):
    try:
        leave(0)
    except SystemExit as asked:
        assert asked.code == 0
fork = os.fork()
if fork == 0:
    os._exit(7)
assert os.waitstatus_to_exitcode(os.waitpid(fork, 0)[1]) == 7
worker = multiprocessing.get_context("fork").Process(target=keep_process)
try:
    worker.start()
finally:
    print("started", flush=True)  # once: the worker ends in start()
worker.join()
assert worker.exitcode == 0
print("went on", flush=True)
end_now(3)
"""


@pytest.mark.processes
def test_it_raises_in_the_process_that_is_kept_and_ends_forks() -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=300, check=False)
    assert (done.stdout, done.returncode) == ("started\nwent on\n", 3), done.stderr
