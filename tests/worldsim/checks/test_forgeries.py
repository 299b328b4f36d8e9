"""The verdict on what is forged: as asked it passes; a forger that does anything else is found out."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import pytest

from patrol.journal import Status
from patrol.pose import Pose
from patrol.radio.message import Position, decode, encode
from tests.worldsim.checks.judged import Run, failures, move
from tests.worldsim.conftest import Lab
from worldsim.radio.fates import Forged
from worldsim.radio.forging import Forger

TICKS = 30
DRIFT = {"kind": "drift", "who": "r2", "bias": [30.0, 0.0], "noise": 0.3}
CLOCK = {"kind": "clock", "who": "r2", "offset": 2.0, "rate": 0.3}
PAYLOADS: tuple[Any, ...] = (
    *({"offset": [0.337, -0.252]}, "freeze", {"replay": 1.7}),
    *("random", {"invented": 3}, {"ahead": 64}),
)


def spoof(payload: Any, **more: Any) -> dict[str, Any]:
    return {"kind": "spoof", "as": ["r2", "r3"], "payload": payload, "at": 2.0, "for": 8.0, "id": "lie", **more}


@pytest.mark.parametrize("payload", PAYLOADS, ids=str)
@pytest.mark.parametrize("by", ["stranger", "r4"])
@pytest.mark.parametrize(
    "others",
    [
        [DRIFT, CLOCK],
        [{"kind": "kill", "who": "r2", "at": 1.0}, {"kind": "kill", "who": "r4", "at": 4.0}],
        [{"kind": "join", "who": "r2", "at": 4.0}, {"kind": "leave", "who": "r3", "at": 5.0}, DRIFT],
        [{"kind": "pause", "who": "r2", "at": 3.0, "for": 2.0}, DRIFT],
    ],
    ids=["senses", "killed", "absent", "paused"],
)
def test_what_is_forged_as_asked_passes(run: Run, payload: Any, by: str, others: list[dict[str, Any]]) -> None:
    assert failures(run(spoof(payload, by=by), spoof(payload, id="more", at=3.3), *others)) == {}


@pytest.mark.parametrize("payload", PAYLOADS, ids=str)
def test_a_spoof_that_never_happens_fails(run: Run, payload: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Forger, "forge", lambda *_: [])
    found = failures(run(spoof(payload)))
    assert list(found) == ["forgeries"]
    assert found["forgeries"].startswith(f"tick {8 if 'replay' in payload else 4}: lie ") or "replay" in payload


def honest() -> Any:
    """A forger whose frames say where their victims say that they are, or are where they say nothing any more."""
    good = Forger.forge

    def forge(self: Forger, k: int, frames: Any, statuses: Any, poses: Mapping[int, Pose]) -> list[Forged]:
        def truly(frame: bytes) -> bytes:
            said = decode(frame)
            sent = frames.get(said.robot)
            true = decode(sent[0]) if sent else Position.of(said.robot, k, 0.0, poses[said.robot])
            return encode(replace(said, x_cm=true.x_cm, y_cm=true.y_cm, heading_mrad=true.heading_mrad))

        return [replace(one, frame=truly(one.frame)) for one in good(self, k, frames, statuses, poses)]

    return forge


@pytest.mark.parametrize("payload", ["freeze", {"offset": [5.0, 5.0]}], ids=str)
@pytest.mark.parametrize("others", [[], [DRIFT], [{"kind": "kill", "who": ["r2", "r3"], "at": 1.0}]])
def test_a_spoof_that_tells_the_truth_fails(
    run: Run, payload: Any, others: list[dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    dead = payload == "freeze" and others and others[0]["kind"] == "kill"
    monkeypatch.setattr(Forger, "forge", honest())
    found = failures(run(spoof(payload), *others))
    assert list(found) == ([] if dead else ["forgeries"])  # who is dead stays where it is


def forging(change: Callable[[Forger, int, list[Forged]], list[Forged]]) -> Any:
    good = Forger.forge
    return lambda self, k, *of: change(self, k, good(self, k, *of))


def edited(**values: Any) -> Callable[[Forger, int, list[Forged]], list[Forged]]:
    return lambda _, k, forged: [
        replace(one, frame=encode(replace(said, **{name: change(said, k) for name, change in values.items()})))
        for one in forged
        for said in [decode(one.frame)]
    ]


def with_each(**fields: Any) -> Callable[[Forger, int, list[Forged]], list[Forged]]:
    return lambda _forger, _k, forged: [replace(one, **fields) for one in forged]


NAMES = "forges in the names of robots"


@pytest.mark.parametrize(
    ("payload", "change", "says"),
    [
        ({"ahead": 64}, edited(sequence=lambda _, k: k), "claims for robot 2: sequence 4 instead of 68"),
        ({"ahead": 64}, edited(x_cm=lambda said, _: said.x_cm + 1), "claims for robot 2: place ("),
        ("freeze", edited(x_cm=lambda said, k: said.x_cm + (k > 4)), "but it was frozen at ("),
        ({"offset": [1.0, 0.0]}, edited(y_cm=lambda said, _: said.y_cm + 3), "claims for robot 2: place ("),
        ({"offset": [1.0, 0.0]}, edited(time_ms=lambda said, _: said.time_ms + 500), "time 2500 ms instead of 2000 ms"),
        ("random", edited(y_cm=lambda said, _: said.y_cm + 1600), "off the terrain"),
        ({"invented": 3}, edited(robot=lambda said, _: said.robot - 3), f"{NAMES} [2, 3, 4] instead of [5, 6, 7]"),
        ({"invented": 3}, lambda _f, _k, forged: forged[1:], f"{NAMES} [6, 7] instead of [5, 6, 7]"),
        ("random", lambda _f, _k, forged: [*forged, *forged], f"{NAMES} [2, 2, 3, 3] instead of [2, 3]"),
        ({"replay": 1.7}, lambda _f, _k, forged: forged[1:], "does not repeat what its victims sent 4 ticks ago"),
        ({"replay": 1.7}, edited(x_cm=lambda said, _: said.x_cm + 1), "does not repeat what its victims sent"),
        ("random", with_each(frame=b"?"), "sends a frame that cannot be decoded"),
        ("random", with_each(fault="f9"), f"lie {NAMES} []"),
    ],
)
def test_a_forger_that_says_something_else_fails(
    run: Run, payload: Any, change: Any, says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Forger, "forge", forging(change))
    assert says in failures(run(spoof(payload)))["forgeries"]


@pytest.mark.parametrize("age", [3, 5])
def test_a_replay_of_another_time_fails(run: Run, age: int, monkeypatch: pytest.MonkeyPatch) -> None:
    good = Forger.forge
    sent: dict[int, Mapping[int, Sequence[bytes]]] = {}

    def forge(self: Forger, k: int, frames: Mapping[int, Sequence[bytes]], *of: Any) -> list[Forged]:
        sent[k] = frames
        right = [(one, decode(one.frame).robot) for one in good(self, k, frames, *of)]
        return [replace(one, frame=sent[k - age][victim][0]) for one, victim in right if k >= age]

    monkeypatch.setattr(Forger, "forge", forge)
    says = "tick 4: lie does not repeat what its victims sent 4 ticks ago"
    assert failures(run(spoof({"replay": 1.7}))) == {"forgeries": says}


@pytest.mark.parametrize("payload", ["random", {"replay": 0.5}], ids=str)
def test_what_is_forged_by_the_dead_or_out_of_time_fails(run: Run, payload: Any) -> None:
    result = run(spoof(payload, by="r4"))
    for other in (spoof(payload, by="r4", at=3.0), spoof(payload, by="r4", **{"for": 3.0})):
        late, _ = run(other)
        assert failures((late, result[1]))["forgeries"].endswith("lie sends forged frames and should not")
    move(result[1], 6, 4, status=Status.DEAD)
    assert failures(result)["forgeries"] == "tick 6: lie sends forged frames and should not"


def test_nobody_forges_in_the_name_of_a_spare_robot_that_has_not_come(lab: Lab) -> None:
    disc = {"model": "holonomic", "radius": 0.4}
    robots = [disc, {**disc, "spare": True}]
    faults = [spoof("random", **{"as": "all"}), {"kind": "join", "who": "r2", "at": 4.0}]
    world = lab.world(robots, [(3.0, 3.0, 0.0), (6.0, 6.0, 0.0)], duration=10.0, faults=faults)
    journal = lab.run(world)
    assert "forgeries" not in failures((world, journal))
    assert [len(record.forged) for record in journal.ticks][3:10] == [0, 1, 1, 1, 1, 2, 2]
    early = encode(Position.of(2, 5, 2.5, Pose(1.0, 1.0, 0.0)))
    record = journal.records[5]
    journal.records[5] = replace(record, frames=((0, early), *record.frames), forged=("lie", *record.forged))
    assert failures((world, journal))["forgeries"] == "tick 5: lie forges in the names of robots [1, 2] instead of [1]"
