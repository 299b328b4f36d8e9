"""The hunt itself: what it calls a breakage, what it writes, what it has never met, and planted faults."""

from dataclasses import replace
from pathlib import Path

import pytest

import tests.chaos.examine
from fogwatch.inprocess import InProcessFleet
from patrol.errors import BadInput
from patrol.faults.kinds import KINDS
from patrol.pose import MODELS
from patrol.scenario import load_scenario
from tests.chaos.__main__ import hunt
from tests.chaos.bugs import BUGS
from tests.chaos.coverage import SINGLES
from tests.chaos.examine import Breakage, Ran, attempt
from tests.chaos.planted import Seeds, find
from tests.chaos.swarm import random_fleet
from tests.chaos.table import ENOUGH, ENOUGH_FOR_PAIRS, missing
from tests.random_building import draws_into
from worldsim.checks.check import CheckResult
from worldsim.run_record import COMPLETED, INTERRUPTED
from worldsim.verdict.judge import CHECKS, Verdict

GOOD = Ran("trace", Verdict("valid", (CheckResult("complete", True, ""),)), COMPLETED)
BAD = Verdict("invalid", (CheckResult("fog", False, "thick"), CheckResult("trace", True, "")))

IN_PROCESSES = ("exit codes", "links add up", "the paused stand still", "router")
"""Checks of runs as processes; their faults are planted into a record (`test_records.py`)."""

QUICK = (
    *("a mind fails", "moves are uneven without a fault", "one robot sees nothing"),
    *("the fog counts a tick less", "an act that makes no sense is skipped unseen"),
)
"""Planted faults that every run of the tests looks for; `make accept` looks for all."""


@pytest.mark.parametrize(
    ("ran", "kind", "detail"),
    [
        (KeyError(0), "b: KeyError at the hunt itself", "KeyError: 0"),
        (BadInput("x = 3: no"), "b: refused", "x = 3: no"),
        (replace(GOOD, verdict=BAD), "b: invalid by fog", "fog: thick"),
        (replace(GOOD, verdict=Verdict("unknown", ())), "b: unknown by ", ""),
        (replace(GOOD, ended=INTERRUPTED), "b: not completed", INTERRUPTED),
    ],
)
def test_what_breaks_is_told(ran: Ran | Exception, kind: str, detail: str) -> None:
    def way() -> Ran:
        if isinstance(ran, Exception):
            raise ran
        return ran

    found = attempt("b", way)
    assert isinstance(found, Breakage)
    assert found.kind == kind
    assert detail in found.detail
    assert attempt("b", lambda: GOOD) is GOOD


def test_a_seed_that_breaks_leaves_its_scenario_with_few_faults_and_the_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_: InProcessFleet, number: int) -> None:
        raise RuntimeError(f"robot {number} stays")

    monkeypatch.setattr(InProcessFleet, "leave", fail)
    seed = next(seed for seed in range(100) if _leaves(seed, tmp_path))
    line = hunt(seed, tmp_path / "hunt", processes=False)
    assert str(line["broke"]).startswith("in process: RuntimeError at worldsim.fleet.acts:")
    said = capsys.readouterr().out
    again = f"make chaos RUNS=1 SEED={seed}"
    assert again in said
    files = [tmp_path / "hunt" / f"seed-{seed}" / name for name in ("scenario.yaml", "fewer.yaml")]
    for file in files:
        assert file.read_text(encoding="utf-8").startswith(f"# {again} breaks: in process: RuntimeError")
    kinds = [fault.kind for fault in load_scenario(files[1]).faults if getattr(fault, "offset", 1.0) != 0.0]
    assert kinds == ["leave"]


def _leaves(seed: int, folder: Path) -> bool:
    return any(
        fault.kind == "leave" for fault in random_fleet(seed, folder, draw_building=draws_into(folder)).scenario.faults
    )


def test_what_takes_too_long_is_no_success(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tests.chaos.examine, "LIMIT_S", 0.0)
    assert hunt(3, tmp_path, processes=False)["broke"] == "too slow"


def test_a_seed_that_holds_leaves_nothing_behind(tmp_path: Path) -> None:
    line = hunt(3, tmp_path, processes=False)
    assert line["broke"] is None
    assert set(line["met"]) <= set(SINGLES)  # type: ignore[call-overload]
    assert list(tmp_path.iterdir()) == []


def test_what_was_never_met_fails_after_enough_seeds() -> None:
    most = [name for name in SINGLES if name != "fault loss"]
    assert missing([{"met": most}] * (ENOUGH["fault"] - 1)) == []
    assert missing([{"met": most}] * ENOUGH["fault"]) == ["fault loss"]
    assert missing([{"met": []}] * min(ENOUGH.values())) == [f"body {model}" for model in MODELS]
    apart = [{"met": most}, {"met": ["fault loss"]}] * ENOUGH_FOR_PAIRS
    assert "fault delay with fault loss" in missing(apart)


@pytest.fixture(scope="module")
def seeds(tmp_path_factory: pytest.TempPathFactory) -> Seeds:
    return Seeds(tmp_path_factory.mktemp("seeds"))


def test_every_kind_of_fault_and_every_check_has_a_planted_fault() -> None:
    assert {bug.kind for bug in BUGS.values()} - {""} == set(KINDS)
    checks = {bug.check for bug in BUGS.values()} | set(IN_PROCESSES)
    assert {check.name for check in CHECKS} <= checks


@pytest.mark.parametrize(
    "what", [name if name in QUICK else pytest.param(name, marks=pytest.mark.accept) for name in BUGS]
)
def test_planted_faults_are_found(what: str, seeds: Seeds) -> None:
    found = find(BUGS[what], seeds)
    assert found is not None
    assert BUGS[what].check in found[2]
