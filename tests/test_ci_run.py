"""What CI runs: a failure ends what runs beside it, and its log is printed."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

RUN = Path(__file__).parents[1] / ".ci" / "run"
MAKE = """#!/bin/sh
case "$2" in
    test-ros) echo the log of ROS; echo $$ >ros.pid; {ros} ;;
    test-rest) until [ -s ros.pid ]; do sleep 0.1; done; {rest} ;;
esac
"""


@pytest.mark.processes
@pytest.mark.parametrize(
    ("ros", "rest", "code"), [("exit 0", "exit 0", 0), ("exit 5", "exit 0", 5), ("sleep 1000 & wait", "exit 3", 3)]
)
def test_a_failure_ends_the_tests_of_ros_too_and_their_log_is_printed(
    ros: str, rest: str, code: int, tmp_path: Path
) -> None:
    (tmp_path / ".ci").mkdir()
    script = Path(shutil.copy(RUN, tmp_path / ".ci" / "run"))
    make = tmp_path / "bin" / "make"
    make.parent.mkdir()
    make.write_text(MAKE.format(ros=ros, rest=rest), encoding="utf-8")
    make.chmod(0o755)
    path = {**os.environ, "PATH": f"{make.parent}:{os.environ['PATH']}"}
    done = subprocess.run(["bash", str(script)], env=path, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == code
    assert done.stdout.count("the log of ROS") == 1
    group = int((tmp_path / "ros.pid").read_text(encoding="ascii"))
    for _ in range(3000):
        listed = subprocess.run(["ps", "-eo", "pgid=,stat="], capture_output=True, text=True, check=True).stdout
        if not [row for row in map(str.split, listed.splitlines()) if row[0] == str(group) and row[1][0] != "Z"]:
            return
    raise AssertionError("the tests of ROS go on")
