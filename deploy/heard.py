"""Writes down who hears whom in a fleet with a direct radio, as its robots report: `deploy/testbed.py` starts it.

    python deploy/heard.py FOLDER heard.jsonl r1 r2       # the folder of a viewer, the file to write, and the robots

A line is the time (Unix time, s), a robot, and how many frames it has heard so far of each other.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from runtime.messages.telemetry import MAX_VIEW, Traffic, read_traffic
from runtime.net.link import open_link
from runtime.net.mailbox import Mailbox
from runtime.security.credentials import read_credentials
from runtime.security.keys import fleet_keys, robot_of

PATIENCE_S = 600.0
WAIT_S = 1.0


def main(folder: Path, out: Path, robots: Sequence[str]) -> None:
    """Write until this process is ended."""
    credentials = read_credentials(folder, "FOLDER")
    keys = fleet_keys(credentials.fleet)
    link = open_link(credentials.router, PATIENCE_S, credentials=credentials)
    reports: Mailbox[Traffic] = Mailbox(list(map(keys.telemetry, robots)), read_traffic, MAX_VIEW)
    link.subscribe(keys.telemetry("*"), reports)
    with out.open("w", encoding="utf-8") as file:
        while True:
            if (news := reports.get(WAIT_S)) is not None:
                file.write(f"{json.dumps([time.time(), robot_of(news[0]), news[1].heard])}\n")
                file.flush()


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:])
