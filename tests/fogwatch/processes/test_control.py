"""An operator's controls on real fleets over Zenoh: done between ticks, in the journal, replayed to the same trace."""

import json
import os
import signal
import stat
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import pytest

import fogwatch
from patrol.journal import Event, Status, read_journal
from patrol.scenario.controls import OPERATOR, Answer
from runtime.net.link import Link, open_link
from runtime.security.access import FILE, read_access
from runtime.security.control_auth import ASK, ControlClient, Unanswered
from runtime.security.keys import fleet_keys
from tests.fleets import COARSE
from tests.fogwatch.conftest import Run, Shell
from tests.fogwatch.processes.test_features import SITE
from tests.fogwatch.processes.test_page import address_of

pytestmark = pytest.mark.processes


class Operating:
    def __init__(self, run: Run) -> None:
        self.run = run
        run.until((run.folder / FILE).exists)
        self.access = read_access(run.folder, "test")
        self.keys = fleet_keys(self.access.fleet)
        self.link: Link = open_link(self.access.router, 30.0, credentials=self.access.credentials)
        self.run.until(self.paused)

    def client(self, token: str) -> ControlClient:
        return ControlClient(self.link, self.keys, token, time.monotonic, os.urandom)

    def paused(self) -> bool:
        """Pause the world; return whether it takes controls yet."""
        try:
            return self.client(self.access.token).ask({"do": "pause"}, 30.0).answer.done
        except Unanswered:
            return False

    def ask(self, **control: Any) -> Answer:
        operated = self.client(self.access.token).ask(control, 60.0)
        assert not operated.strangers
        return operated.answer

    def step(self, ticks: int) -> int:
        """So many more ticks, awaited; how many there are then."""
        answer = self.ask(do="step", ticks=ticks)
        assert answer.done, answer.text
        held = int(answer.text.rpartition(" ")[2])
        self.run.until(lambda: self.run.ticks() == held)
        return held

    def go_on(self, ticks: int) -> None:
        """Let the run go on for so many ticks, and interrupt it."""
        assert self.ask(do="go").done
        self.run.pass_ticks(ticks)
        self.run.interrupt()

    def events(self) -> list[Event]:
        return list(read_journal(self.run.folder / "journal").events)

    def fault(self, **fault: Any) -> Answer:
        return self.ask(do="fault", fault=fault)


@pytest.fixture
def operate(start: Callable[..., Run]) -> Any:
    operators: list[Operating] = []

    def begin(scenario: dict[str, Any], *arguments: str) -> Operating:
        operators.append(Operating(start(scenario, *arguments)))
        return operators[-1]

    yield begin
    for one in operators:
        one.link.close()


def test_a_page_that_dies_takes_nothing_with_it_and_is_served_again_at_its_address(
    operate: Callable[..., Operating],
) -> None:
    """It is killed while the fleet drives; held before and after, for a page takes its time to come."""
    pytest.importorskip("starlette")
    at = operate({**COARSE, "duration": 100_000, "robots": 3 * [{}]}, "--page")
    run, address = at.run, address_of(at.run)
    at.step(8)
    for _ in range(2):
        with urlopen(address) as page:
            assert page.status == 200
        assert at.ask(do="go").done
        run.pass_ticks(1)
        os.kill(run.children()["monitor"], signal.SIGKILL)
        run.pass_ticks(20)
        assert at.ask(do="pause").done
        assert run.process.stderr is not None
        line = next(line for line in run.process.stderr if line.startswith("the page"))
        assert line.startswith("the page was killed by SIGKILL; starting it again (")
        run.until(lambda: serves(address))
    run.interrupt()
    assert not run.children()
    assert run.summary()["exit_codes"] == dict.fromkeys(["the router", "the world", "r1", "r2", "r3"], 0)
    run.assert_undisturbed()


def serves(address: str) -> bool:
    with suppress(OSError), urlopen(address) as page:
        return bool(page.status == 200)
    return False


def test_what_an_operator_does_is_seen_and_replayed_to_the_same_trace(
    operate: Callable[..., Operating], shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.nice", lambda _: 0)  # it would hold for all tests after this one
    scenario = {
        **COARSE,
        "duration": 100_000,
        "robots": 4 * [{}],
        "faults": [{"kind": "loss", "rate": 0.1}, {"kind": "leave", "who": "r4", "at": 1}],
    }
    at = operate(scenario)
    held = at.step(8)
    assert at.fault(kind="kill", who="r2").done
    assert at.fault(kind="join", who="r4").done
    assert at.ask(do="fault", fault={"kind": "loss", "rate": 0.7, "to": "half"}, instead="f1").done
    assert at.ask(do="intruder", place=[30, 30]).done
    assert at.run.ticks() == held  # nothing of it happens before the next tick
    assert at.step(7) == held + 7
    said = shell("status", at.run.folder, "--seconds", "0.1", "--json")
    wrong = [robot["wrong"] for robot in json.loads(said.out)["robots"]]
    assert (said.code, wrong) == (1, ["", "its process was killed", "", ""])
    assert at.fault(kind="spoof", by="r1", payload={"replay": 5.0}, **{"as": "r3", "for": 4}).done
    assert at.fault(kind="restart", who="r2", at=2).done
    assert at.fault(kind="pause", who="r3", id="nap").done
    assert at.step(5) == held + 12
    assert at.ask(do="heal", id="nap").done
    at.go_on(20)
    at.run.assert_replayed()
    done = [json.loads(event.detail)["do"] for event in at.events() if event.kind == OPERATOR]
    assert done[-12:] == ["step", *3 * ["fault"], "intruder", "step", *3 * ["fault"], "step", "heal", "go"]
    ticks = at.run.records()
    assert ticks[held - 1].robots[1].status is Status.ALIVE
    assert ticks[held].robots[1].status is Status.DEAD
    assert [tick.robots[2].status for tick in ticks[held + 7 : held + 13]] == 5 * [Status.PAUSED] + [Status.ALIVE]
    assert set(at.run.summary()["faults"]) == {"f1", "f2", "op1", "op2", "op3", "op4", "op5", "nap"}
    assert at.run.summary()["exit_codes"]["r2"] == -9


DOORS = [
    {"name": "gate", "polygon": [[50, 0], [51, 0], [51, 88], [50, 88]], "closed": [[0, 50_000]]},
    {"name": "crate", "polygon": [[20, 40], [24, 40], [24, 44], [20, 44]]},
]
ROBOTS = {"count": 2, "model": "holonomic", "radius": 0.4, "speed": 2.0, "starts": [[10, 10], [90, 70]]}


def test_closures_closed_and_opened_from_a_shell_do_so_again(operate: Callable[..., Operating], shell: Shell) -> None:
    at = operate({**COARSE, "duration": 100_000, "robots": ROBOTS, "closures": DOORS})
    held = at.step(8)

    def control(*words: str) -> tuple[int, str]:
        said = shell("control", at.run.folder, *words)
        return said.code, said.out + said.err

    assert control("open", "gate") == (0, f"op1 open gate from tick {held} on; heal op1 takes it back\n")
    assert control("close", "crate") == (0, f"op2 close crate from tick {held} on; heal op2 takes it back\n")
    refused = "control: fault.closure: there is no closure grate; did you mean gate?\n"
    assert control("close", "grate") == (1, refused)
    at.step(12)
    assert control("close", "gate")[0] == 0
    assert control("heal", "op2")[0] == 0
    at.step(30)
    at.go_on(10)
    events = [event for event in at.events() if event.detail in ("gate", "crate") and event.k >= held]
    told = [(event.k - held, event.kind) for event in events]
    assert told == [(0, "opened"), (0, "closed"), (12, "closed"), (12, "opened")]
    at.run.assert_replayed()


def test_zones_that_an_operator_switches_leave_the_same_trace(
    operate: Callable[..., Operating], tmp_path: Path
) -> None:
    vault, ward = SITE["zones"]
    lasting = [vault | {"times": [[10, 50_000]]}, ward | {"times": [[20, 60_000]]}]
    site = {**SITE, "duration": 100_000, "zones": lasting}
    at = operate(site)
    held = at.step(30)
    assert at.ask(do="zone", name="ward", on=True).text == f"ward is in force from tick {held} on"
    assert at.ask(do="zone", name="vault", weight=0.2).text == f"vault counts 0.2 times from tick {held} on"
    held = at.step(10)
    assert at.ask(do="zone", name="vault", on=False).text == f"vault is out of force from tick {held} on"
    refused = at.ask(do="zone", name="vault", on=False)
    assert (refused.done, refused.text) == (False, "control: name = vault: is not in force, and will not be")
    at.go_on(30)
    at.run.assert_replayed()
    length = {"duration": at.run.summary()["ticks"] * 0.5}
    untouched = fogwatch.run({**site, **length}, out=tmp_path / "untouched", picture=False)
    assert untouched.trace_hash != at.run.summary()["trace_hash"]


@pytest.mark.parametrize("radio", [{}, {"via": "direct"}], ids=["ether", "direct"])
def test_closures_are_closed_by_hand_in_fleets_that_keep_to_the_clock(
    operate: Callable[..., Operating], radio: dict[str, Any]
) -> None:
    at = operate({**COARSE, "duration": 100_000, "pace": 10, "robots": ROBOTS, "closures": DOORS, "radio": radio})
    held = at.step(20)
    assert at.fault(kind="close", closure="crate").done
    at.step(4)
    assert at.ask(do="heal", id="op1").done
    at.go_on(10)
    assert at.run.summary()["verdict"]["valid"], at.run.summary()["verdict"]
    told = [(event.k - held, event.kind) for event in at.events() if event.detail == "crate" and event.k >= held]
    assert told == [(0, "closed"), (4, "opened")]


def test_nothing_is_obeyed_without_the_token_or_that_cannot_be(operate: Callable[..., Operating]) -> None:
    at = operate({**COARSE, "duration": 100_000, "robots": 2 * [{}]})
    file = at.run.folder / "control.json"
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert at.access.token not in "".join(command_lines())
    with pytest.raises(Unanswered, match="somebody answered who does not know the token"):
        at.client(32 * "0").ask({"do": "go"}, 60.0)
    refused = {
        "there is no robot r9": at.fault(kind="kill", who="r9"),
        "cannot join": at.fault(kind="join", who="r1"),
        "no such fault": at.ask(do="heal", id="f1"),
        "s are kept": at.fault(kind="spoof", payload={"replay": 5000}, **{"as": "r1"}),
        "known are": at.ask(do="destroy"),
        "rename one": at.ask(do="fault", fault={"kind": "kill", "who": "r1", "id": ""}),
    }
    for why, answer in refused.items():
        assert not answer.done, why
        assert why in answer.text or why == "rename one", answer.text
    stolen = b'{"token": "' + at.access.token.encode() + b'", "control": {"do": "go"}}'
    for junk in (b"[" * 9000, b"", bytes(200), stolen):
        assert at.link.ask(at.keys.control(ASK), junk, 60.0) is None
    at.step(5)
    done = {json.loads(event.detail)["do"] for event in at.events() if event.kind == OPERATOR}
    assert done == {"pause", "step"}
    at.run.interrupt()
    assert not file.exists()
    assert not (at.run.folder / "timeline.yaml").exists()


def test_a_paced_run_is_paused_hurried_and_ended_while_paused(operate: Callable[..., Operating]) -> None:
    at = operate({**COARSE, "duration": 100_000, "pace": 10, "robots": 2 * [{}]})
    assert at.ask(do="pace", factor=None).text.startswith("control: factor")
    assert at.ask(do="pace", factor=40).done
    held = at.step(1)
    assert at.ask(do="go").done
    at.run.until(lambda: min(commands(at.run, held)) >= 10)
    assert at.ask(do="pause").done
    at.run.interrupt()
    assert at.run.summary()["verdict"]["outcome"] == "valid", at.run.summary()["verdict"]


def commands(run: Run, first: int) -> list[int]:
    """In how many ticks so far from the first on each robot's command came."""
    return [sum(row.decision_ms is not None for row in run.rows(number, first)) for number in (1, 2)]


def command_lines() -> list[str]:
    found = []
    for entry in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            found.append(entry.read_bytes().decode(errors="replace"))
    return found


def test_the_recovery_from_an_operators_first_fault_is_judged_too(operate: Callable[..., Operating]) -> None:
    at = operate({**COARSE, "duration": 600, "robots": 2 * [{}]}, "--recovery")
    at.step(8)
    assert at.fault(kind="loss", rate=0.5, **{"for": 1}).done
    assert at.ask(do="go").done
    assert at.run.end() == 0, at.run.errors
    (check,) = [check for check in at.run.summary()["verdict"]["checks"] if check["name"] == "recovery"]
    assert check["detail"].startswith("every point was seen again in "), check["detail"]
