"""An operator's controls on a world in this process: when they act, what they leave, and the same trace again."""

from __future__ import annotations

import errno
from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from agent.build import Shared, build_mind
from fogwatch.inprocess import InProcessFleet, Outcome, run_in_process
from patrol.errors import BadInput
from patrol.exchange import FIRST_INCARNATION
from patrol.journal.records import Event, Status, TickRecord
from patrol.prepare import Prepared, prepare
from patrol.scenario import Scenario, load_scenario, scenario_hash
from patrol.scenario.controls import (
    OPERATOR,
    Answer,
    amended,
    as_detail,
    in_force,
    intruders_there,
    read_control,
    worded,
)
from patrol.scenario.load import FILE, keep_scenario
from tests.fleets import COARSE, end_of
from worldsim.controls import TIMELINE, ControlRequest, Operator, keep_timeline
from worldsim.fleet.loop import run_ticks
from worldsim.output.record import Recorder, header_of
from worldsim.run_record import MemoryJournal
from worldsim.verdict.judge import judge
from worldsim.world import World

FAULTS = [{"kind": "loss", "rate": 0.2, "at": 2}, {"kind": "leave", "who": "r4", "at": 3}]
SMALL: dict[str, Any] = {**COARSE, "duration": 20, "robots": 4 * [{}], "faults": FAULTS}


class Hour:
    """A clock that only waiting moves."""

    def __init__(self) -> None:
        self.s = 0.0

    def __call__(self) -> float:
        return self.s


class Script:
    """A requests at which controls come before given ticks."""

    def __init__(self, hour: Hour, controls: Mapping[int, list[dict[str, Any]]]) -> None:
        self.world: World | None = None
        self.answers: list[tuple[int, Answer]] = []
        self.waited: deque[float] = deque()
        self._hour = hour
        self._controls = {k: deque(asked) for k, asked in controls.items()}

    def get(self, timeout_s: float) -> ControlRequest | None:
        assert self.world is not None
        k = self.world.tick
        if self._controls.get(k):
            control: Any = self._controls[k].popleft()
            try:
                control = read_control(control)
            except BadInput as bad:
                control = bad
            return ControlRequest(control, lambda answer: self.answers.append((k, answer)))
        self._hour.s += timeout_s
        return None


class Rests:
    """Counts how often nothing was due."""

    def __init__(self) -> None:
        self.times = 0
        self.steps: list[float] = []

    def rest(self) -> None:
        self.times += 1

    def set_step(self, step_s: float) -> None:
        self.steps.append(step_s)


def run(
    prepared: Prepared,
    controls: Mapping[int, list[dict[str, Any]]],
    *,
    controls_processes: bool = True,
    ticks: int = 10**9,
    amended: Callable[[Scenario], None] = lambda _scenario: None,
) -> tuple[MemoryJournal, Script, Rests, list[float]]:
    """Run a world to its end under these controls; also the time of each tick."""
    hour, rests = Hour(), Rests()
    requests = Script(hour, controls)
    world = requests.world = World(prepared, operated=True)
    make = partial(build_mind, Shared(prepared))
    fleet = InProcessFleet({number: make(number, FIRST_INCARNATION) for number in world.living}, make)
    journal = MemoryJournal(header_of(world))
    recorder = Recorder(journal, world.scenario.spares)
    times: list[float] = []

    def on_tick(record: TickRecord) -> None:
        recorder.tick(record)
        times.append(hour.s)

    operator = Operator(world, rests, requests, hour, controls_processes=controls_processes, amended=amended)
    stop = lambda: hour.s > 1000.0 or world.tick >= ticks  # noqa: E731
    recorder.end(run_ticks(world, fleet, on_tick, recorder.event, stop, fleet, operator))
    return journal, requests, rests, times


def again(prepared: Prepared, journal: MemoryJournal) -> Outcome:
    """The run once more, with what the operator asked for as faults: valid, and with the same end."""
    outcome = run_in_process(prepared.as_operated(journal.events))
    assert outcome.verdict.valid, outcome.verdict.failed
    assert end_of(outcome.journal) == end_of(journal)
    return outcome


def failed_without_operator(prepared: Prepared, journal: MemoryJournal) -> set[str]:
    """The checks that fail where the journal says nothing of the operator."""
    journal.events = tuple(event for event in journal.events if event.kind != OPERATOR)
    return {check.name for check in judge(journal, {}, prepared).failed}


EVERYTHING: dict[int, list[dict[str, Any]]] = {
    5: [{"do": "fault", "fault": {"kind": "kill", "who": "r2", "wreck": "removed"}}],
    8: [{"do": "fault", "fault": {"kind": "loss", "rate": 0.9}, "instead": "f1"}, {"do": "pace", "factor": 5}],
    9: [
        {"do": "fault", "fault": {"kind": "join", "who": "r4"}},
        {"do": "fault", "fault": {"kind": "restart", "who": "r2", "at": 1.2}},
        {"do": "intruder", "place": [30, 30], "for": 3},
    ],
    14: [{"do": "fault", "fault": {"kind": "spoof", "as": "r1", "payload": {"replay": 2.0}, "for": 3}}],
    15: [{"do": "fault", "fault": {"kind": "delay", "delay": {"exponential": 1.0}}}, {"do": "pace", "factor": None}],
    17: [{"do": "fault", "fault": {"kind": "pause", "who": "r1", "id": "nap"}}],
    18: [
        {"do": "fault", "fault": {"kind": "loss", "id": "slid", "rate": 1.0}},
        {"do": "fault", "fault": {"kind": "loss", "rate": 0.5, "mean_burst": 3}, "instead": "slid"},
    ],
    20: [{"do": "intruder", "place": [60, 30]}, {"do": "intruder", "place": [10, 20], "for": None}],
    21: [{"do": "heal", "id": "nap"}, {"do": "heal", "id": "op6"}],
    22: [{"do": "fault", "fault": {"kind": "silence", "who": "minority", "direction": "in", "for": 4}}],
    23: [{"do": "fault", "fault": {"kind": "drift", "who": "half", "noise": 0.4}}],
    25: [{"do": "heal", "id": "intruder2"}],
    24: [{"do": "fault", "fault": {"kind": "bandwidth", "bytes_per_s": 40}}, {"do": "step", "ticks": 3}],
    27: [{"do": "fault", "fault": {"kind": "kill", "who": "one"}}, {"do": "go"}],
}


def test_all_that_an_operator_does_is_judged_and_gives_the_same_trace_again() -> None:
    prepared = prepare(load_scenario(SMALL))
    journal, requests, rests, _ = run(prepared, EVERYTHING)
    assert [answer.text for _, answer in requests.answers if not answer.done] == []
    assert rests.times == 0  # whoever holds the ticks for no time keeps nobody waiting
    verdict = judge(journal, {}, prepared)
    assert verdict.valid, verdict.failed
    told = again(prepared, journal).journal.events
    assert end_of(run_in_process(prepared).journal) != end_of(journal)
    assert failed_without_operator(prepared, journal) >= {"statuses", "radio"}
    assert journal.events == told


def test_ticks_are_held_stepped_and_paced_without_changing_the_trace() -> None:
    prepared = prepare(load_scenario(SMALL))
    untouched, *_ = run(prepared, {})
    state: dict[int, list[dict[str, Any]]] = {
        4: [{"do": "pause"}, {"do": "step", "ticks": 2}],
        6: [{"do": "pace", "factor": 0.5}, {"do": "go"}],
    }
    journal, requests, rests, times = run(prepared, state)
    assert journal.end == untouched.end
    assert all(answer.done for _, answer in requests.answers)
    assert times[5] == times[0] == 0.0
    assert [round(later - sooner, 6) for sooner, later in pairwise(times[6:])] == [1.0] * 33
    assert rests.steps == [1.0]


def test_a_held_world_waits_until_it_is_told_to_stop() -> None:
    prepared = prepare(load_scenario(SMALL))
    journal, _, rests, times = run(prepared, {4: [{"do": "pause"}]})
    assert len(times) == 4
    assert rests.times > 100
    assert journal.end is not None
    assert journal.end.reason == "interrupted"
    assert judge(journal, {}, prepared).valid


DOORS: dict[str, Any] = {
    **SMALL,
    "patrol": {"policy": "potential-field"},
    "closures": [
        {"name": "gate", "polygon": [[30, 0], [32, 0], [32, 60], [30, 60]], "closed": [[4, 9]]},
        {"name": "door", "polygon": [[50, 20], [52, 20], [52, 60], [50, 60]], "closes": 0.2, "opens": 0.2},
        {"name": "crate", "polygon": [[88, 54], [98, 54], [98, 62], [88, 62]]},
    ],
}


def hold(kind: str, closure: str, **more: Any) -> dict[str, Any]:
    return {"do": "fault", "fault": {"kind": kind, "closure": closure, **more}}


def test_closures_that_an_operator_closes_and_opens_are_judged_and_do_so_again() -> None:
    prepared = prepare(load_scenario(DOORS))
    controls = {
        5: [hold("close", "crate"), hold("open", "door")],
        10: [hold("open", "gate")],
        14: [{"do": "heal", "id": "op3"}, hold("close", "door", at=2)],
        20: [hold("open", "crate")],
        30: [{"do": "heal", "id": "op5"}, {"do": "heal", "id": "op4"}],
    }
    journal, requests, *_ = run(prepared, controls)
    assert [answer.text for _, answer in requests.answers] == [
        "op1 close crate from tick 5 on; heal op1 takes it back",
        "op2 open door from tick 5 on; heal op2 takes it back",
        "op3 open gate from tick 10 on; heal op3 takes it back",
        "op3 ends with tick 14",
        "op4 close door from tick 18 on; heal op4 takes it back",
        "op5 open crate from tick 20 on; heal op5 takes it back",
        "op5 ends with tick 30",
        "op4 ends with tick 30",
    ]
    gate, crate = ([(e.k, e.kind) for e in journal.events if e.detail == name] for name in ("gate", "crate"))
    assert gate == [(8, "closed"), (10, "opened"), (14, "closed"), (18, "opened")]
    assert crate == [(5, "closed"), (20, "opened")]
    verdict = judge(journal, {}, prepared)
    assert verdict.valid, verdict.failed
    told = again(prepared, journal).journal.events
    assert end_of(run_in_process(prepared).journal) != end_of(journal)
    assert "closures" in failed_without_operator(prepared, journal)
    assert journal.events == told


def test_an_operators_last_word_on_a_closure_replaces_the_one_before() -> None:
    scenario = load_scenario({**DOORS, "faults": [{"kind": "close", "closure": "gate", "at": 2}]})
    scenario, _ = amended(scenario, 6, read_control(hold("open", "gate")))
    scenario, _ = amended(scenario, 8, read_control(hold("close", "crate")))
    scenario, _ = amended(scenario, 8, read_control(hold("close", "gate", id="mine", at=2)))

    def ids(k: int) -> list[str]:
        return [fault["id"] for fault in in_force(scenario, k)]

    assert [ids(k) for k in (5, 6, 8, 11, 12)] == [["f1"], ["op1"], ["op1", "op2"], ["op1", "op2"], ["op2", "mine"]]
    scenario, _ = amended(scenario, 14, read_control({"do": "heal", "id": "mine"}))
    assert ids(14) == ["op2"]


REFUSED: dict[str, dict[str, Any]] = {
    "no robot r9": {"do": "fault", "fault": {"kind": "kill", "who": "r9"}},
    "r1 cannot join": {"do": "fault", "fault": {"kind": "join", "who": "r1"}},
    "there is no closure gate; the scenario has none; list it in closures": hold("close", "gate"),
    "fault.closure: missing; give name of a closure": {"do": "fault", "fault": {"kind": "open"}},
    "no such fault": {"do": "heal", "id": "f7"},
    "has not begun": {"do": "heal", "id": "f1"},
    "happens at once": {"do": "heal", "id": "f2"},
    "s are kept": {"do": "fault", "fault": {"kind": "spoof", "as": "r1", "payload": {"replay": 5000.0}}},
    "rename one": {"do": "fault", "fault": {"kind": "loss", "rate": 0.1, "id": "f1"}},
    "would never happen": {"do": "fault", "fault": {"kind": "loss", "rate": 0.1, "at": 40}},
    "seconds from now": {"do": "fault", "fault": {"kind": "loss", "rate": 0.1, "at": -1}},
    "fault.at = 1e+308: expected seconds from now, from 0 to 1e+09": hold("close", "gate", at=1e308),
    "0000...: expected seconds from now": hold("close", "gate", at=10**400),
    "from 0 to 1": {"do": "fault", "fault": {"kind": "loss", "rate": 1.1}},
    "did you mean loss": {"do": "fault", "fault": {"kind": "los", "rate": 1.0}},
    "did you mean pause": {"do": "pause_"},
    "expected [x, y]": {"do": "intruder", "place": "here"},
    'fault.kind = "\\ud800": holds half of a character': {"do": "fault", "fault": {"kind": "\ud800"}},
    'key "\\ud800" of fault: holds half': {"do": "fault", "fault": {"kind": "kill", "\ud800": 1}},
    "place = [500, 40]: not on open, which spans x 0 to": {"do": "intruder", "place": [500, 40]},
    "place: missing; give [12, 30]": {"do": "intruder"},
    "fault = 3: expected a fault such as {kind: loss": {"do": "fault", "fault": 3},
    "at: unknown key; known are place, for": {"do": "intruder", "place": [30, 30], "at": 2},
    "go takes no value; leave it out": {"do": "go", "ticks": 2},
    "no such fault or intruder; the latest are f1, f2": {"do": "heal", "id": "intruder1"},
}


@pytest.mark.parametrize("why", REFUSED)
def test_what_cannot_be_is_refused_and_leaves_no_trace(why: str) -> None:
    prepared = prepare(load_scenario(SMALL))
    journal, requests, *_ = run(prepared, {1: [REFUSED[why]]}, ticks=3)
    ((_, answer),) = requests.answers
    assert not answer.done
    assert why in answer.text
    assert answer.text.startswith("control: ")
    assert not [event for event in journal.events if event.kind == OPERATOR]


def test_whatever_a_request_brings_to_light_refuses_it_and_ends_nothing(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    prepared = prepare(load_scenario(SMALL))
    untouched, *_ = run(prepared, {})

    def mistaken(*_: object) -> None:
        raise KeyError("a mistake")

    monkeypatch.setattr("worldsim.controls.amended", mistaken)
    journal, requests, *_ = run(prepared, {1: [{"do": "fault", "fault": {"kind": "kill", "who": "r2"}}]})
    ((_, answer),) = requests.answers
    assert answer == Answer(False, "control: the request cannot be handled (KeyError); the world's log says more")
    assert journal.end == untouched.end
    assert "a mistake" in capfd.readouterr().err


def test_a_changed_scenario_that_cannot_be_kept_is_in_force_all_the_same() -> None:
    prepared = prepare(load_scenario(SMALL))

    def full(_scenario: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    loss = {"do": "fault", "fault": {"kind": "loss", "rate": 0.9}}
    journal, requests, *_ = run(prepared, {1: [loss]}, amended=full)
    ((_, answer),) = requests.answers
    assert answer.done
    assert answer.text.endswith("the changed scenario could not be written (No space left on device)")
    assert [event.kind for event in journal.events if event.kind == OPERATOR] == [OPERATOR]
    assert judge(journal, {}, prepared).valid


def test_what_is_refused_on_other_grounds() -> None:
    """An intruder in a wall, and a kill of a robot that nobody here started."""
    prepared = prepare(load_scenario({**SMALL, "terrain": {"builtin": "yards"}}))
    row, col = np.argwhere(~prepared.terrain.passable)[0]
    intruder = {"do": "intruder", "place": list(prepared.terrain.centre(int(row), int(col)))}
    kill = {"do": "fault", "fault": {"kind": "kill", "who": "r1"}}
    journal, requests, *_ = run(prepared, {1: [intruder, kill]}, controls_processes=False, ticks=3)
    assert [answer.done for _, answer in requests.answers] == [False, False]
    assert "in an obstacle of yards; move it" in requests.answers[0][1].text
    assert "did not start" in requests.answers[1][1].text
    assert not [event for event in journal.events if event.kind == OPERATOR]


def test_what_an_operator_has_asked_for_is_in_force_until_it_ends() -> None:
    scenario = load_scenario(SMALL)
    silence = {"do": "fault", "fault": {"kind": "silence", "id": "hush", "who": "r1"}}
    for control in (silence, {"do": "fault", "fault": {"kind": "loss", "id": "fade", "rate": 0.4, "for": 2}}):
        scenario, _ = amended(scenario, 6, read_control(control))
    scenario, _ = amended(scenario, 6, read_control({"do": "fault", "fault": {"kind": "pause", "who": "r2"}}))

    def ids(k: int) -> list[str]:
        return [fault["id"] for fault in in_force(scenario, k, len(SMALL["faults"]))]

    assert [ids(k) for k in (5, 6, 9, 10)] == [[], ["hush", "fade"], ["hush", "fade"], ["hush"]]
    assert [fault["kind"] for fault in in_force(scenario, 10)] == ["loss", "silence"]
    scenario, _ = amended(scenario, 12, read_control({"do": "heal", "id": "hush"}))
    assert ids(11) == ["hush"]
    assert ids(12) == []


def test_an_intruder_leaves_when_it_is_healed() -> None:
    scenario = load_scenario({**SMALL, "intruders": [{"place": [30, 30], "at": 2, "for": 4}]})
    scenario, _ = amended(scenario, 6, read_control({"do": "intruder", "place": [40, 30]}))
    scenario, text = amended(scenario, 6, read_control({"do": "intruder", "place": [50, 30], "for": 3.0}))
    assert text == "intruder3 at (50, 30) from tick 6 on"

    def names(k: int) -> list[str]:
        return [name for *_, name in intruders_there(scenario, k)]

    all_three = ["intruder1", "intruder2", "intruder3"]
    assert [names(k) for k in (3, 5, 6, 11, 12)] == [[], ["intruder1"], all_three, all_three, ["intruder2"]]
    scenario, _ = amended(scenario, 8, read_control({"do": "heal", "id": "intruder2"}))
    assert names(7) == all_three
    assert names(8) == ["intruder1", "intruder3"]
    for name, why in (("intruder2", "has left already"), ("intruder9", "no such fault or intruder")):
        with pytest.raises(BadInput, match=why):
            amended(scenario, 9, read_control({"do": "heal", "id": name}))
    with pytest.raises(BadInput, match="has not come yet; it comes at 2 s"):
        amended(scenario, 3, read_control({"do": "heal", "id": "intruder1"}))


def test_an_intruder_that_is_healed_at_once_never_comes_and_others_keep_their_names() -> None:
    scenario = load_scenario(SMALL)
    for place in ([30, 30], [40, 30]):
        scenario, _ = amended(scenario, 7, read_control({"do": "intruder", "place": place}))
    scenario, _ = amended(scenario, 7, read_control({"do": "heal", "id": "intruder1"}))
    assert [intruders_there(scenario, k) for k in (6, 7, 8)] == [(), *2 * [((40.0, 30.0, "intruder2"),)]]


LOSS = {"do": "fault", "fault": {"kind": "loss", "rate": 0.5, "who": ["r1", "r2"]}}


def test_events_of_controls_are_in_words() -> None:
    controls: dict[str, dict[str, Any]] = {
        "loss: rate 0.5, who [r1, r2], instead of f1": LOSS | {"instead": "f1"},
        "ends intruder1": {"do": "heal", "id": "intruder1"},
        "places an intruder at (30, 30) for 3 s": {"do": "intruder", "place": [30, 30], "for": 3},
    }
    for words, control in controls.items():
        assert worded(Event(3, OPERATOR, None, as_detail(read_control(control)))).detail == words


def test_a_fault_that_is_replaced_before_it_has_acted_never_acts() -> None:
    """A loss that is moved while the run is paused: the last one counts."""
    scenario = load_scenario(SMALL)
    for name, rate, instead in (("a", 0.5, None), ("b", 0.3, "a"), ("c", 0.1, "b")):
        control = {"do": "fault", "fault": {"kind": "loss", "id": name, "rate": rate}, "instead": instead}
        scenario, _ = amended(scenario, 8, read_control(control))
    own = len(SMALL["faults"])
    assert [fault["rate"] for fault in in_force(scenario, 8, own)] == [0.1]
    assert [fault.id for fault in scenario.faults[own:]] == ["a", "b", "c"], "places go into draws"
    scenario, _ = amended(scenario, 8, read_control({"do": "heal", "id": "c"}))
    assert not in_force(scenario, 8, own)


def test_a_spare_robot_can_be_called_and_is_replayed() -> None:
    faults = [
        {"kind": "loss", "rate": 0.2, "at": 2},
        {"kind": "spoof", "as": "all", "payload": "random", "at": 3, "for": 3},
        {"kind": "kill", "who": "one", "at": 14},
    ]
    prepared = prepare(load_scenario({**SMALL, "robots": {"count": 3, "spare": 2}, "faults": faults}))
    unasked, *_ = run(prepared, {})
    journal, requests, *_ = run(prepared, {5: [{"do": "fault", "fault": {"kind": "join", "who": "r5"}}]})
    assert [answer.done for _, answer in requests.answers] == [True]
    there = [row.status for row in journal.records[-1].robots]
    assert sorted(there[:3]) == [Status.ALIVE, Status.ALIVE, Status.DEAD]
    assert there[3:] == [Status.ABSENT, Status.ALIVE]
    assert len({(row.x, row.y) for record in journal.records[6:] for row in record.robots[4:]}) > 5
    again(prepared, journal)
    without = run_in_process(prepare(load_scenario({**SMALL, "robots": {"count": 3}, "faults": faults})))
    assert end_of(without.journal) == end_of(unasked)


def test_a_timeline_moves_with_the_folder_that_has_its_map(tmp_path: Path) -> None:
    Image.new("L", (30, 20), 254).save(tmp_path / "plan.png")
    (tmp_path / "plan.yaml").write_text(
        "image: plan.png\nresolution: 1.0\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.6\nfree_thresh: 0.2\n",
        encoding="utf-8",
    )
    scenario = load_scenario({"terrain": {"map": str(tmp_path / "plan.yaml")}, "robots": {"count": 1}})
    out = tmp_path / "out"
    out.mkdir()
    keep_scenario(scenario, out)
    keep_timeline(out, scenario)
    for gone in ("plan.png", "plan.yaml"):
        (tmp_path / gone).unlink()
    out.rename(tmp_path / "moved")
    again = load_scenario(tmp_path / "moved" / TIMELINE)
    assert scenario_hash(again) == scenario_hash(load_scenario(tmp_path / "moved" / FILE))
