"""The summary's tables of links and of faults: every frame counted where it belongs."""

from __future__ import annotations

from typing import Any

import pytest

from tests.worldsim.checks import judged
from tests.worldsim.checks.judged import failures
from tests.worldsim.conftest import Lab

TICKS = 20


def summary_of(lab: Lab, *faults: dict[str, Any]) -> dict[str, Any]:
    world = lab.patrol(ticks=TICKS, faults=list(faults))
    result = world, lab.run(world)
    assert failures(result) == {}
    return judged.summary_of(result).document()


def test_without_faults_every_link_delivers_everything(lab: Lab) -> None:
    summary = summary_of(lab)
    whole = {"sent": TICKS, "delivered": TICKS, "dropped": {}, "in_flight": 0}
    names = ["r1", "r2", "r3", "r4"]
    assert summary["links"] == {a: {b: whole for b in names if b != a} for a in names}
    assert summary["faults"] == {}


@pytest.mark.parametrize(
    ("fault", "counts"),
    [
        # Ten ticks long; frames, dropped, delayed, duplicated.
        ({"kind": "loss", "rate": 1.0, "from": "r1", "to": ["r2", "r3"]}, (20, 20, 0, 0)),
        ({"kind": "delay", "delay": {"constant": 0.5}, "from": "r1"}, (30, 0, 30, 0)),
        ({"kind": "delay", "delay": {"constant": 0.1}}, (120, 0, 0, 0)),
        ({"kind": "duplicate", "rate": 1.0, "to": "r4"}, (30, 0, 0, 30)),
        ({"kind": "reorder", "rate": 1.0, "from": "r1", "to": "r2"}, (10, 0, 10, 0)),
        ({"kind": "partition", "groups": [["r1"]]}, (60, 60, 0, 0)),
        ({"kind": "partition", "groups": [["r1"]], "direction": "one-way"}, (30, 30, 0, 0)),
        ({"kind": "silence", "who": "r1", "direction": "in"}, (30, 30, 0, 0)),
        ({"kind": "silence", "who": ["r1", "r2"], "direction": "out"}, (60, 60, 0, 0)),
        ({"kind": "silence", "who": ["r1", "r2"]}, (100, 100, 0, 0)),
        ({"kind": "range", "who": "r1", "reach": 0.001}, (30, 30, 0, 0)),
        ({"kind": "bandwidth", "who": "r1", "bytes_per_s": 0.001}, (30, 18, 0, 0)),
        ({"kind": "spoof", "as": ["r1"], "payload": "random"}, (40, 0, 0, 0)),
        ({"kind": "spoof", "by": "r2", "as": ["r1", "r3"], "payload": "random"}, (80, 0, 0, 0)),
    ],
    ids=lambda value: value["kind"] if isinstance(value, dict) else "",
)
def test_a_faults_frames_and_what_it_did_to_them(
    lab: Lab, fault: dict[str, Any], counts: tuple[int, int, int, int]
) -> None:
    summary = summary_of(lab, {**fault, "id": "x", "at": 2.0, "for": 5.0})
    told = dict(zip(("frames", "dropped", "delayed", "duplicated"), counts, strict=True))
    assert summary["faults"] == {"x": {"kind": fault["kind"], **told}}
    for row in summary["links"].values():
        for link in row.values():
            assert link["sent"] == link["delivered"] + sum(link["dropped"].values()) + link["in_flight"]
    genuine = [link for name, row in summary["links"].items() if name != "forger" for link in row.values()]
    assert sum(link["sent"] for link in genuine) == 12 * TICKS + told["duplicated"] == summary["messages"]["sent"]


def test_what_is_in_flight_at_the_end_is_told(lab: Lab) -> None:
    summary = summary_of(lab, {"kind": "delay", "delay": {"constant": 2.0}, "from": "r1", "to": "r2"})
    assert summary["links"]["r1"]["r2"] == {"sent": 20, "delivered": 16, "dropped": {}, "in_flight": 4}
    assert summary["messages"]["in_flight"] == summary["robots"]["r1"]["in_flight"] == 4


def test_forged_frames_are_a_sender_of_their_own(lab: Lab) -> None:
    summary = summary_of(lab, {"kind": "spoof", "by": "r2", "as": ["r1"], "payload": "random", "for": 5.0})
    heard = {"sent": 10, "delivered": 10, "dropped": {}, "in_flight": 0}
    own = {**heard, "delivered": 0, "dropped": {"own": 10}}
    assert summary["links"]["forger"] == {"r1": heard, "r2": own, "r3": heard, "r4": heard}
    assert summary["messages"]["forged"] == 10
