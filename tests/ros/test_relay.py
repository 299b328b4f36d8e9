"""The relay between DDS and Zenoh, by itself."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

from tests.ros.site import ROOT
from tests.routers import PATIENCE_S, free_endpoint, routed

pytestmark = pytest.mark.ros

RELAY = [sys.executable, str(ROOT / "deploy" / "ros" / "relay.py")]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--connect", "nowhere"], "--connect nowhere:"),
        (["--connect", free_endpoint(), "--wait", "0.1"], "is a Zenoh router running there?"),
        (["--connect", "tcp/127.0.0.1:1", "--topics", "("], "--topics (: no regular expression"),
        ([], "the following arguments are required: --connect"),
    ],
)
def test_what_it_refuses(words: list[str], says: str) -> None:
    done = subprocess.run([*RELAY, *words], capture_output=True, text=True, check=False, timeout=PATIENCE_S)
    assert done.returncode == 2
    assert says in done.stderr
    assert "Traceback" not in done.stderr


def test_it_teaches() -> None:
    done = subprocess.run([*RELAY, "--help"], capture_output=True, text=True, check=True, timeout=PATIENCE_S)
    assert "zenoh-bridge-ros2dds" in done.stdout


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_leaves_when_it_is_told_to(number: signal.Signals) -> None:
    with routed() as where:
        relay = subprocess.Popen(
            [*RELAY, "--connect", where], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert relay.stdout is not None
        assert relay.stdout.readline().startswith("relays to")
        relay.send_signal(number)
        _, errors = relay.communicate(timeout=PATIENCE_S)
    assert (relay.returncode, errors) == (130, "")
