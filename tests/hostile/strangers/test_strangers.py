"""Strangers: how they are drawn, what they send, how they are watched and judged, and what a session prints."""

import json
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from patrol.errors import BadInput
from patrol.exchange import Sensed
from patrol.pose import Pose
from patrol.random import Draws, Purpose
from patrol.scenario import as_mapping
from runtime.messages.phases import (
    Failed,
    HelloReply,
    PhaseA,
    PhaseB,
    ReplyA,
    ReplyB,
    Stop,
    decode_to_robot,
    decode_to_world,
    encode,
)
from runtime.messages.telemetry import Metrics
from runtime.security.keys import fleet_keys
from runtime.security.roles import VIEWER
from tests.hostile.strangers.door import LET_IN
from tests.hostile.strangers.judge import Seen, problems
from tests.hostile.strangers.member import ASKED, OVERHEARD
from tests.hostile.strangers.payloads import all_keys, changed, forged, forged_farewell, noise
from tests.hostile.strangers.run import read_log
from tests.hostile.strangers.session import HostileSession
from tests.hostile.strangers.spell import Holds, Spell, draw_spell, role_of_stranger
from tests.hostile.strangers.watch import HUNG_S, SAMPLE_S, SETTLED_S, START_S, Memory, Progress
from worldsim.run_record import COMPLETED, INTERRUPTED

KEYS = fleet_keys("f")
ROBOTS = ("r1", "r2")


def test_a_seed_draws_the_same_spell_again() -> None:
    one, again = draw_spell(7), draw_spell(7)
    assert (one.holds, one.victim, one.page) == (again.holds, again.victim, again.page)
    assert as_mapping(one.scenario) == as_mapping(again.scenario)


def test_all_sorts_of_spells_are_drawn() -> None:
    spells = [draw_spell(seed) for seed in range(60)]
    assert {spell.holds for spell in spells} == set(Holds)
    assert {spell.victim for spell in spells} == {"r1", "r2", "r3"}
    for share in (
        [spell.lockstep for spell in spells],
        [spell.page for spell in spells],
        [bool(spell.scenario.faults) for spell in spells],
    ):
        assert 5 < sum(share) < 55


def test_a_stranger_gets_in_as_what_it_holds() -> None:
    assert role_of_stranger(Holds.NOTHING, "r2") is None
    assert role_of_stranger(Holds.VIEWER, "r2") == VIEWER
    role = role_of_stranger(Holds.ROBOT, "r2")
    assert role is not None
    assert role.user == "robot-r2"


def test_forgeries_are_messages_that_decoders_take() -> None:
    """So that they reach the checks behind the decoders; the others reach the decoders only."""
    newest = PhaseA(1, 77, 5, 9, Sensed(5, Pose(1.0, 2.0, 0.0), False, (), 2.5))
    dice = Draws(3, Purpose.STRANGER)
    kinds: Counter[object] = Counter()
    decoders: dict[str, Callable[[bytes], object]] = {"tick": decode_to_robot, "reply": decode_to_world}
    for heard in (None, newest):
        for _ in range(300):
            key, payload = forged(dice, KEYS, ROBOTS, heard)
            last = key.rpartition("/")[2]
            decode = decoders.get(last)
            message = last if decode is None else decode(payload)
            kinds[message if isinstance(message, str) else type(message)] += 1
            if heard is not None and isinstance(message, ReplyB):
                assert (message.incarnation, message.instance, message.run) == (1, 77, 9)
    assert {PhaseA, PhaseB, Stop, HelloReply, ReplyA, ReplyB, "metrics", "events", "ticks"} <= set(kinds)
    assert isinstance(decode_to_world(encode(forged_farewell(newest))), Failed)


def test_changed_messages_differ_and_noise_is_bounded() -> None:
    dice = Draws(4, Purpose.STRANGER)
    payload = b"\x94\x01\x02\x03\x04" * 8
    changes = {changed(dice, payload) for _ in range(200)}
    assert len(changes) > 100
    assert len(changes - {payload}) > 100
    assert all(len(noise(dice, 64)) <= 64 for _ in range(200))
    assert isinstance(changed(dice, b""), bytes)


def test_every_key_of_a_fleet_is_attacked() -> None:
    keys = all_keys(KEYS, ROBOTS)
    parts = {key.split("/")[2] for key in keys}
    assert parts == {"robot", "position", "telemetry", "truth", "control"}
    assert KEYS.tick("r2") in keys
    assert KEYS.reply("r1") in keys


ME, STRANGER = 10, 77


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


def done(k: int) -> Metrics:
    return Metrics(k, 100, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, ())


def test_a_run_hangs_when_no_tick_comes() -> None:
    clock = Clock()
    progress = Progress(clock)
    clock.now = 1000.0
    progress.begin()
    clock.now += START_S
    assert not progress.hung
    progress.metrics(done(1))
    clock.now += HUNG_S
    progress.metrics(done(2))
    clock.now += HUNG_S
    progress.metrics(done(2))
    assert not progress.hung
    clock.now += 1.0
    assert progress.hung
    assert (progress.ticks, progress.stalled_s) == (2, HUNG_S + 1.0)
    progress.metrics(done(3))
    assert progress.longest_s == HUNG_S + 1.0


def test_a_run_that_never_begins_hangs() -> None:
    clock = Clock()
    progress = Progress(clock)
    clock.now += START_S + 1.0
    assert progress.hung


@pytest.fixture
def proc(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr("tests.hostile.strangers.watch._PROC", tmp_path)
    return tmp_path


def write(proc: Path, number: int, parent: int, peak_mb: float, *words: str) -> None:
    folder = proc / str(number)
    folder.mkdir(exist_ok=True)
    (folder / "stat").write_text(f"{number} (a (name) S) S {parent} 1 1", encoding="utf-8")
    (folder / "status").write_text(f"Name:\tpython\nVmHWM:\t{peak_mb * 1024:.0f} kB\n", encoding="utf-8")
    (folder / "cmdline").write_text("\0".join(["python", *words, ""]), encoding="utf-8")


def test_growth_counts_from_when_the_stranger_comes(proc: Path) -> None:
    clock = Clock()
    memory = Memory(clock, ME)
    peaks = iter([100.0, 200.0, 200.0, 999.0])

    def rest(duration_s: float) -> None:
        clock.now += duration_s
        write(proc, 11, ME, next(peaks), "-m", "worldsim")

    memory.settle(rest, lambda: False)
    assert clock.now == 3 * SAMPLE_S, "a process that has not grown for a while has settled"

    def look(world_mb: float, robot_mb: float) -> None:
        write(proc, 11, ME, world_mb, "-m", "worldsim")
        write(proc, 12, ME, robot_mb, "-m", "agent", "--robot", "r1")
        write(proc, 13, 1, 10 * clock.now, "-m", "monitor")
        write(proc, STRANGER, ME, 10 * clock.now, "-m", "tests.hostile.strangers.stranger")
        (proc / "99").mkdir(exist_ok=True)  # it has just ended
        memory.look(but=STRANGER)

    look(550, 50)
    assert memory.growth_mb == {"worldsim": 350.0, "r1": 0.0}, "however soon after the stranger has come"
    clock.now += SAMPLE_S
    look(560, 61)
    clock.now += SAMPLE_S / 2
    look(900, 61)
    assert memory.growth_mb == {"worldsim": 360.0, "r1": 11.0}


@pytest.mark.parametrize("over", [False, True])
def test_processes_that_go_on_growing_are_not_waited_for_for_ever(over: bool, proc: Path) -> None:
    clock = Clock()

    def rest(duration_s: float) -> None:
        clock.now += duration_s
        write(proc, 11, ME, clock.now, "-m", "worldsim")

    Memory(clock, ME).settle(rest, lambda: over)
    assert clock.now == (0.0 if over else SETTLED_S)


def test_a_stranger_s_log_says_what_was_tried(tmp_path: Path) -> None:
    log = tmp_path / "stranger.log"
    assert read_log(log) == ({}, {}, "")
    lines = [
        '{"begins": "floods"}',
        '{"attack": "floods", "counts": {"messages": 3}}',
        '{"attack": "floods", "counts": {"messages": 4, "bytes": 1}}',
        "7",
        "KeyError: \x1b[2J",
        '{"begins": "noise"}',
    ]
    log.write_text("\n".join(lines), encoding="utf-8")
    assert read_log(log) == ({"floods": 1, "noise": 1}, {"attacks": 2, "messages": 7, "bytes": 1}, "KeyError: \\x1b[2J")


HELD = Seen(COMPLETED, "valid", trace="a", honest="a", counts=Counter(attacks=3, messages=300))
DRIVEN = {"nobody lost": "lost: r2 (I cannot go on)"}


def spell(holds: Holds) -> Spell:
    return replace(draw_spell(1), holds=holds, victim="r2")


@pytest.mark.parametrize("holds", Holds)
def test_a_fleet_that_is_as_without_the_stranger_has_held(holds: Holds) -> None:
    assert problems(spell(holds), HELD) == []


@pytest.mark.parametrize("holds", Holds)
@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"ended": INTERRUPTED}, "the run did not complete: interrupted"),
        ({"ended": "hung: no tick for 90 s after tick 7", "outcome": ""}, "hung: no tick for 90 s after tick 7"),
        ({"outcome": "invalid", "failed": {"fog": "tick 3: 7 points differ"}}, "verdict: fog: tick 3: 7 points differ"),
        ({"outcome": "invalid", "failed": {"nobody lost": "lost: r1, r2"}}, "verdict: nobody lost: lost: r1, r2"),
        ({"outcome": "unknown"}, "the verdict is unknown"),
        ({"outcome": "invalid"}, "the verdict is invalid"),
        ({"restarts": ["the router was killed by SIGSEGV"]}, "a process died: the router was killed by SIGSEGV"),
        ({"crashes": ["world.log"]}, "a traceback in the log world.log"),
        ({"growth_mb": {"r1": 299.0, "worldsim": 301.0}}, "worldsim took 301 MB more than before the stranger came"),
        ({"counts": Counter({LET_IN: 1})}, "let in: 1 times"),
        ({"counts": Counter({OVERHEARD: 2})}, "overheard: 2 times"),
        ({"counts": Counter({ASKED: 3})}, "asked in the world's place: 3 times"),
        ({"counts": Counter()}, "the stranger has not attacked"),
        ({"stranger": "it ended with exit code 2"}, "the stranger could not attack: it ended with exit code 2"),
    ],
)
def test_whatever_else_is_a_problem(holds: Holds, changes: dict[str, object], says: str) -> None:
    found = problems(spell(holds), replace(HELD, **changes))  # type: ignore[arg-type]
    assert any(says in problem for problem in found), found


@pytest.mark.parametrize("holds", Holds)
def test_only_a_stranger_with_a_robot_s_credentials_may_change_what_happens(holds: Holds) -> None:
    changed = ["the verdict is valid, but the trace is not that of the run without the stranger"]
    assert problems(spell(holds), replace(HELD, trace="b")) == ([] if holds is Holds.ROBOT else changed)


def test_a_stranger_with_a_robot_s_credentials_may_make_the_verdict_name_that_robot() -> None:
    driven = replace(HELD, outcome="invalid", failed=DRIVEN, trace="b")
    assert problems(spell(Holds.ROBOT), driven) == []
    for holds in (Holds.NOTHING, Holds.VIEWER):
        assert problems(spell(holds), driven)
    assert problems(replace(spell(Holds.ROBOT), victim="r1"), driven)
    assert problems(spell(Holds.ROBOT), replace(driven, failed={**DRIVEN, "fog": "tick 3"})) == ["verdict: fog: tick 3"]


def test_a_run_at_a_pace_has_no_trace_to_compare() -> None:
    assert problems(spell(Holds.VIEWER), replace(HELD, trace="b", honest="")) == []


def attack(out: Path, minutes: float | None = None, runs: int | None = None, seed: int = 7) -> int:
    with HostileSession(out, Console(), lambda: False) as session:
        return session.run(seed, minutes, runs)


def seen_of(spell: Spell, outcome: str) -> tuple[Seen, Counter[str]]:
    failed = {} if outcome == "valid" else {"fog": "tick 3: 7 points differ"}
    seen = Seen(
        COMPLETED, outcome, failed, "a", "a" if spell.lockstep else "", counts=Counter(attacks=1, messages=7), ticks=500
    )
    return seen, Counter(floods=2)


def test_bad_input_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="--out /dev/null: is no empty folder"):
        attack(Path("/dev/null"))
    with pytest.raises(BadInput, match="the last seed would be above"):
        attack(tmp_path / "out", runs=1, seed=2**63)


def test_fleets_that_hold_leave_nothing_behind(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def held(spell: Spell, folder: Path, over: Callable[[], bool]) -> tuple[Seen, Counter[str]]:
        assert not over()
        (folder / "run").mkdir(parents=True)
        return seen_of(spell, "valid")

    monkeypatch.setattr("tests.hostile.strangers.session.run_spell", held)
    assert attack(tmp_path / "out", runs=3) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(":")[0] for line in lines if line.startswith("seed")] == ["seed 7", "seed 8", "seed 9"]
    assert "  tried: 2 floods" in lines
    assert "  counts: 7 messages" in lines
    assert lines[-1].startswith("3 spells, 6 attacks: all held, in ")
    assert not (tmp_path / "out").exists()


def test_without_time_one_fleet_is_attacked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tests.hostile.strangers.session.run_spell", lambda spell, *_: seen_of(spell, "valid"))
    assert attack(tmp_path / "out", minutes=0.0) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("1 spell, 2 attacks: all held, in ")


def test_a_fleet_that_breaks_is_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def broke(spell: Spell, folder: Path, _over: object) -> tuple[Seen, Counter[str]]:
        (folder / "run").mkdir(parents=True)
        return seen_of(spell, "invalid" if spell.seed == 8 else "valid")

    monkeypatch.setattr("tests.hostile.strangers.session.run_spell", broke)
    out = tmp_path / "out"
    assert attack(out, runs=3) == 1
    lines = capsys.readouterr().out.splitlines()
    assert "  verdict: fog: tick 3: 7 points differ" in lines
    assert f"  kept in {out / 'seed-8'}; again: python -m tests.hostile.strangers --runs 1 --seed 8" in lines
    assert lines[-1].startswith("3 spells, 6 attacks: 1 broke (seeds 8), in ")
    assert [path.name for path in out.iterdir()] == ["seed-8"]
    assert (out / "seed-8" / "run").is_dir()
    assert json.loads((out / "seed-8" / "seen.json").read_text(encoding="utf-8"))["outcome"] == "invalid"
