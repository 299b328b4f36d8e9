"""Code of one's own in fleets of processes: the trace is that of one process, and failures are one line."""

import json
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

import fogwatch
from agent.learned.network import read_network
from fogwatch.learn import action_of, flattened, parallel_env
from monitor.replay.replay import play
from monitor.replay.run import open_run
from patrol.errors import BadInput
from patrol.journal import Status, read_journal
from patrol.kernel_cache import cache_home
from tests.agent.learned.test_network import as_onnx, layers
from tests.fleets import COARSE, one_and_many
from tests.fogwatch.conftest import WITHOUT, Shell
from tests.patrol.classes.test_named_class import plant
from tests.patrol.sensors import records

HERE = Path(__file__).parent
EXAMPLES = HERE.parents[2] / "examples"
EXAMPLE, RADIO, ELLIPSE = (EXAMPLES / f"{name}.py" for name in ("my_policy", "my_radio", "elliptic_sensor"))
__all__ = ["records"]

FAILS_AT = 20
WORDS = {
    "Raising": "raised ZeroDivisionError: no idea",
    "Leaving": "raised SystemExit: 3",
    "Nonsense": "returned Bearing with bearings = nan",
    "Sleeping": "took longer than 30 s to decide",
}


def scenario(policy: str, **patrol: Any) -> dict[str, Any]:
    robots = {"count": 3, "model": "holonomic"}
    return {**COARSE, "duration": 40, "robots": robots, "patrol": {"policy": policy, **patrol}}


@pytest.mark.processes
def test_a_policy_of_ones_own_gives_the_same_trace_in_one_process_and_in_many(tmp_path: Path) -> None:
    mapping = scenario(f"{EXAMPLE}:GreedyTarget", options={"near": 8})
    _, many = one_and_many(mapping, tmp_path)
    kept = tmp_path / "many" / "policy" / EXAMPLE.name
    assert kept.read_bytes() == EXAMPLE.read_bytes()
    again = fogwatch.run(tmp_path / "many" / "scenario.yaml", out=tmp_path / "again", picture=False)
    assert again.trace_hash == many.trace_hash


def await_ends(pids: list[int]) -> None:
    """Wait until none of these processes runs any more; one that nobody has waited for is a zombie."""
    for pid in pids:
        stat = Path(f"/proc/{pid}/stat")
        while stat.exists() and stat.read_text(encoding="ascii").rpartition(")")[2].split()[0] != "Z":
            time.sleep(0.01)


@pytest.mark.processes
@pytest.mark.parametrize(
    "name", ["Raising", "Sleeping", *(pytest.param(name, marks=pytest.mark.accept) for name in ("Nonsense", "Leaving"))]
)
def test_a_policy_that_fails_stops_its_robot_alone(
    name: str, shell: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, pids = tmp_path / "scenario.yaml", tmp_path / "pids"
    pids.mkdir()
    monkeypatch.setenv("POLICY_PIDS", str(pids))
    path.write_text(json.dumps(scenario(f"{HERE / 'policies_that_fail.py'}:{name}")), encoding="utf-8")
    traces = []
    for way in ("--in-process", "--no-page"):
        out = tmp_path / way.strip("-")
        shown = shell("run", path, way, *WITHOUT[1:], "--out", out)
        assert shown.code == 1, shown.err
        ticks = list(read_journal(out / "journal").ticks)
        assert len(ticks) == 80
        assert [robot.status for robot in ticks[FAILS_AT].robots] == [Status.ALIVE] * 3
        assert [robot.status for robot in ticks[-1].robots] == [Status.ALIVE, Status.LOST, Status.ALIVE]
        summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
        assert not summary["verdict"]["valid"]
        failed = [check["detail"] for check in summary["verdict"]["checks"] if not check["ok"]]
        assert any(f"its policy failed at tick {FAILS_AT}: {WORDS[name]}" in detail for detail in failed), failed
        assert any("r2" in detail for detail in failed)
        log = (out / "logs" / "robot-r2.log").read_text(encoding="utf-8")
        assert f"its policy failed at tick {FAILS_AT}: {WORDS[name]}" in log
        assert ("Traceback" in log) == (name in ("Raising", "Leaving"))
        assert not [line for line in (out / "logs").glob("robot-r[13].log") if "Traceback" in line.read_text()]
        traces.append(summary["trace_hash"])
        await_ends([int(file.read_text(encoding="ascii")) for file in pids.iterdir()])
        assert len(list(pids.iterdir())) == (3 if name == "Raising" else 0)
    assert traces[0] == traces[1]


@pytest.mark.parametrize(
    ("setting", "more", "says"),
    [
        ("patrol.policy=./nowhere.py:Policy", (), "cannot be read"),
        (f"patrol.policy={EXAMPLE}:Missing", (), "has no Missing"),
        ("patrol.policy=no-such-policy", (), "no such policy"),
        ("patrol.policy=no_such_package.module:Policy", (), "No module named"),
        (f"patrol.policy={EXAMPLE}:GreedyTarget", ("--set", "patrol.options.near=-3"), "patrol.options.near = -3"),
        ("radio.model=./nowhere.py:Model", (), "cannot be read"),
        (f"radio.model={RADIO}:Missing", (), "has no Missing"),
        ("radio.model=no-such", (), "no such model"),
    ],
)
def test_code_that_cannot_be_had_is_one_line_and_no_run(
    setting: str, more: tuple[str, ...], says: str, shell: Shell, tmp_path: Path
) -> None:
    for command in (("run", "yards", "--out", tmp_path / "out"), ("scenario", "check", "yards")):
        if not more or command[0] == "run":
            said = shell(*command, "--set", setting, *more)
            assert (said.code, said.out) == (2, "")
            *announced, last = said.err.splitlines()
            exists = Path(setting.partition("=")[2].rpartition(":")[0]).is_file()
            assert len(announced) == (exists and command[0] == "run")
            assert all(line.startswith("fogwatch: runs code: ") for line in announced)
            assert more or setting.partition("=")[0] in last
            assert says in last
    assert not (tmp_path / "out").exists()


@pytest.mark.processes
@pytest.mark.parametrize("way", ["--in-process", "--no-page"])
def test_a_policy_that_cannot_be_made_is_bad_input_in_one_process_and_in_many(
    way: str, shell: Shell, tmp_path: Path
) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text(json.dumps(scenario(f"{HERE / 'policies_that_fail.py'}:Unmade")), encoding="utf-8")
    shown = shell("run", path, way, "--out", tmp_path / "out")
    last = shown.err.splitlines()[-1]
    assert shown.code == 2
    where = r"policies_that_fail\.py:\d+"
    raised = rf"policy .*:Unmade: cannot be made for r[123]: ZeroDivisionError: no idea \({where}\)"
    said = re.fullmatch(rf"fogwatch: {raised}; the traceback is in (.*)", last)
    assert said is not None, last
    log = Path(said[1])
    assert log.parent == tmp_path / "out" / "logs"
    kept = log.read_text(encoding="utf-8").splitlines()
    assert kept[0] == "Traceback (most recent call last):"
    assert re.fullmatch(rf"r[123]: {raised}", kept[-1])


def test_whoever_looks_at_a_run_never_imports_its_policy(shell: Shell, tmp_path: Path) -> None:
    source = tmp_path / "mine.py"
    source.write_bytes(EXAMPLE.read_bytes())
    out = tmp_path / "run"
    chosen = ("--set", f"patrol.policy={source}:GreedyTarget", "--set", "point=1", "--set", "duration=20")
    assert shell("run", "open", *chosen, "--in-process", *WITHOUT[1:], "--out", out).code == 0
    (out / "policy" / "mine.py").write_text("raise RuntimeError('imported')", encoding="utf-8")
    source.unlink()
    other = tmp_path / "other"
    shutil.copytree(out, other)
    for command in (["report", out], ["record", out], ["compare", out, other]):
        shown = shell(*command)
        assert shown.code == 0, shown.err
    shown = shell("run", out / "scenario.yaml", "--in-process", "--out", tmp_path / "again")
    assert shown.code == 2
    assert "is not the file that this scenario was resolved with" in shown.err


LEARNED: dict[str, Any] = {
    **COARSE,
    "terrain": {"builtin": "yards"},
    "duration": 40,
    "seed": 3,
    "robots": {"count": 3, "model": "holonomic"},
    "faults": [{"kind": "loss", "rate": 0.4}, {"kind": "kill", "at": 6, "who": "r2"}],
}


@pytest.mark.processes
@pytest.mark.parametrize("suffix", [".npz", ".onnx"])
def test_a_trained_policy_decides_in_processes_as_in_its_environment(suffix: str, tmp_path: Path) -> None:
    env = parallel_env(LEARNED, inputs=["sectors"])
    network, path = layers(40, 8, 9), tmp_path / f"trained{suffix}"
    if suffix == ".npz":
        network.save(path)
    else:
        path.write_bytes(as_onnx(network))
    loaded = read_network(path.read_bytes(), path, 40, 9)
    observations, _ = env.reset()
    while env.agents:
        observations, *_ = env.step(
            {agent: action_of(loaded(flattened(parts)), parts["action_mask"]) for agent, parts in observations.items()}
        )
    assert env.episode is not None
    options = {"weights": str(path), "inputs": ["sectors"]}
    _, many = one_and_many({**LEARNED, "patrol": {"policy": "learned", "options": options}}, tmp_path)
    assert many.trace_hash == env.episode.trace_hash
    assert (tmp_path / "many" / "policy" / path.name).read_bytes() == path.read_bytes()


@pytest.mark.processes
def test_a_network_for_other_inputs_ends_the_run_before_it_begins(shell: Shell, tmp_path: Path) -> None:
    layers(3, 9).save(tmp_path / "trained.npz")
    settings = ["patrol.policy=learned", f"patrol.options.weights={tmp_path / 'trained.npz'}", "duration=5", "point=1"]
    sets = [word for setting in settings for word in ("--set", setting)]
    shown = shell("run", "open", "--robots", "1", "--no-page", "--out", tmp_path / "run", *sets)
    assert shown.code == 2
    assert "takes 3 values and gives 9, and this scenario has" in shown.err.splitlines()[-1]
    assert "Traceback" not in shown.err
    assert not (tmp_path / "run").exists()


def write_scenario(folder: Path, **radio: Any) -> Path:
    faults = [{"kind": "loss", "rate": 0.1, "at": 10, "for": 10}]
    given = {"terrain": {"builtin": "yards"}, "point": 1.0, "duration": 40, "radio": radio, "faults": faults}
    path = folder / "scenario.yaml"
    path.write_text(json.dumps({**given, "robots": {"count": 4, "model": "holonomic"}}), encoding="utf-8")
    return path


@pytest.mark.processes
@pytest.mark.parametrize(
    ("radio", "cause"),
    [
        ({"model": "path-loss", "options": {"redraw": 5, "airtime": 0.02}}, "path-loss"),
        ({"model": f"{RADIO}:Halving", "options": {"reach": 20}}, "model"),
    ],
    ids=["path-loss", "own"],
)
def test_a_model_gives_the_same_trace_in_one_process_and_in_many(
    radio: dict[str, Any], cause: str, shell: Shell, tmp_path: Path
) -> None:
    path = write_scenario(tmp_path, **radio)
    summaries = []
    for way in (("--in-process", "--no-report"), ("--no-page",)):
        out = tmp_path / way[0].strip("-")
        assert shell("run", path, *way, "--no-picture", "--no-recording", "--out", out).code == 0
        summaries.append(json.loads((out / "summary.json").read_text(encoding="utf-8")))
    report = (tmp_path / "no-page" / "report.html").read_text(encoding="utf-8")
    assert re.search(f"<td[^>]*>{cause}</td>", report)
    one, many = summaries
    assert one["trace_hash"] == many["trace_hash"]
    lost = many["messages"]["dropped_by_cause"][cause]
    assert lost > 100
    assert sum(link["dropped"].get(cause, 0) for to in many["links"].values() for link in to.values()) == lost
    assert many["messages"]["dropped_by_cause"] == one["messages"]["dropped_by_cause"]
    checks = {check["name"]: check["detail"] for check in many["verdict"]["checks"]}
    assert ("path loss" in checks) == (cause == "path-loss")
    # A stranger's folder: judging it again runs nothing that is in it.
    for file in (tmp_path / "no-page").glob("model/*.py"):
        file.write_text("raise SystemExit('ran')", encoding="utf-8")
    judged = shell("judge", tmp_path / "no-page")
    assert judged.code == 0
    assert "summary     agrees with the journal in every" in judged.out


@pytest.mark.processes
@pytest.mark.parametrize("way", ["--in-process", "--no-page"])
def test_a_model_that_fails_in_a_run_ends_it_with_what_it_raised(way: str, shell: Shell, tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(
        "import numpy as np\n\n\nclass Late:\n    def __init__(self, setup):\n        pass\n\n"
        "    def lost(self, air):\n        return air.on_the_way & False if air.k < 20 else 1 / 0\n",
        encoding="utf-8",
    )
    path = write_scenario(tmp_path, model="./mine.py:Late")
    shown = shell("run", path, way, *WITHOUT[1:], "--out", tmp_path / "out")
    log = tmp_path / "out" / "logs" / "world.log"
    told = shown.err + (log.read_text(encoding="utf-8") if log.exists() else "")
    assert shown.code != 0
    assert "mine.py:Late: raises ZeroDivisionError: division by zero; correct it" in told
    assert "Traceback" not in told


def test_a_check_names_a_model_that_it_does_not_run(shell: Shell) -> None:
    own = shell("scenario", "check", "yards", "--set", f"radio.model={RADIO}:Halving")
    assert own.code == 0
    assert "my_radio.py:Halving, not run: a run checks its options" in own.out
    ours = shell("scenario", "check", "yards", "--set", "radio.model=path-loss")
    assert ours.code == 0
    assert "radio model" not in ours.out


def with_sensor(kind: str, **sensor: Any) -> dict[str, Any]:
    robots = {"count": 3, "model": "holonomic"}
    given = {"terrain": {"builtin": "yards"}, "point": 1.0, "duration": 40, "robots": robots}
    return {**given, "sensor": {"kind": kind, **sensor}}


@pytest.mark.processes
def test_an_ellipse_gives_the_same_trace_in_one_process_and_in_many(
    records: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mapping = with_sensor(f"{ELLIPSE}:Ellipse", options={"across": 3})
    _, many = one_and_many(mapping, tmp_path)
    disc = fogwatch.run(with_sensor("disc"), out=tmp_path / "disc", picture=False)
    assert many.trace_hash != disc.trace_hash
    again = fogwatch.run(tmp_path / "many" / "scenario.yaml", out=tmp_path / "again", picture=False)
    assert again.trace_hash == many.trace_hash
    run = open_run(tmp_path / "many")
    assert play(run, ()) is None  # the fog as replayed has the MFoW of the journal in every tick

    monkeypatch.setattr("patrol.own_sensor._allowed", set())
    next(records.iterdir()).unlink()
    with pytest.raises(BadInput, match="this user has not run a scenario with it here"):
        play(open_run(tmp_path / "many"), ())


@pytest.mark.processes
def test_a_sensor_that_fails_ends_the_run_with_one_line(shell: Shell, tmp_path: Path) -> None:
    source = ELLIPSE.read_text(encoding="utf-8")
    looks = "        view = self._in_sight.visible(pose)\n"
    assert looks in source
    failing = tmp_path / "failing.py"
    failing.write_text(source.replace(looks, f"        1 / (pose.x > 40.0)\n{looks}"), encoding="utf-8")
    path = tmp_path / "scenario.yaml"
    robots = {"count": 1, "model": "holonomic", "starts": [[60, 40]]}
    mapping = {**with_sensor(f"{failing}:Ellipse"), "terrain": {"builtin": "open"}, "robots": robots, "duration": 200}
    says = "raised ZeroDivisionError: division by zero (failing.py:"

    path.write_text(json.dumps(mapping), encoding="utf-8")
    planned = shell("run", path, "--in-process", *WITHOUT, "--out", tmp_path / "planned")
    assert planned.code == 1  # the robot plans with looks from places ahead, and so it stops before the world fails
    assert says in planned.err.splitlines()[-1]

    mapping["patrol"] = {"policy": "potential-field"}
    path.write_text(json.dumps(mapping), encoding="utf-8")
    one = shell("run", path, "--in-process", *WITHOUT, "--out", tmp_path / "one")
    assert one.code == 2
    assert says in one.err.splitlines()[-1]
    assert "Traceback" not in one.err

    assert shell("run", path, *WITHOUT, "--out", tmp_path / "many").code == 1
    summary = json.loads((tmp_path / "many" / "summary.json").read_text(encoding="utf-8"))
    failed = [check["detail"] for check in summary["verdict"]["checks"] if not check["ok"]]
    assert any(says in detail for detail in failed), failed
    logs = {file.name: file.read_text(encoding="utf-8") for file in (tmp_path / "many" / "logs").glob("*.log")}
    assert says in logs["world.log"]
    assert says in logs["robot-r1.log"]
    assert not any("Traceback" in log for log in logs.values())


CODE = {
    "patrol.policy": (EXAMPLE, "GreedyTarget"),
    "sensor.kind": (ELLIPSE, "Ellipse"),
    "radio.model": (RADIO, "Halving"),
}


def with_first(file: Path, code: str) -> str:
    """A file's source with other code before its own."""
    begin, future, rest = file.read_text(encoding="utf-8").rpartition("from __future__ import annotations\n")
    return f"{begin}{future}{code}{rest}"


@pytest.fixture
def received(tmp_path: Path) -> Path:
    """A folder of somebody else: a scenario and a sweep whose classes say when they run."""
    folder = tmp_path / "received"
    folder.mkdir()
    for field, (file, _) in CODE.items():
        says = f"import sys\nsys.stderr.write({f'ran: {field} {tmp_path}'!r} + chr(10))\n"
        (folder / file.name).write_text(with_first(file, says), encoding="utf-8")
    kinds = {field: f"./{file.name}:{name}" for field, (file, name) in CODE.items()}
    scenario = {
        **with_sensor(kinds["sensor.kind"]),
        "duration": 10,
        "patrol": {"policy": kinds["patrol.policy"]},
        "radio": {"model": kinds["radio.model"]},
    }
    (folder / "scenario.yaml").write_text(json.dumps(scenario), encoding="utf-8")
    (folder / "sweep.yaml").write_text("base: scenario.yaml\nseeds: 1\n", encoding="utf-8")
    return folder


def check_announced(said: str, *fields: str) -> None:
    """Check that each class was named with its file before anything of one of them ran."""
    lines = said.splitlines()
    named = [line for line in lines if line.startswith("fogwatch: runs code: ")]
    assert len(named) == len(fields), said
    for line, field in zip(named, fields, strict=True):
        file, name = CODE[field]
        assert re.fullmatch(rf"fogwatch: runs code: {field} = /\S+/{file.name}:{name}, SHA-256 [0-9a-f]{{12}}", line)
    ran = [index for index, line in enumerate(lines) if line.startswith("ran: ")]
    assert {lines[index].split()[1] for index in ran} == set(fields), said
    assert min(ran) > max(lines.index(line) for line in named)


@pytest.mark.processes
@pytest.mark.parametrize(
    ("words", "is_recorded"),
    [
        (("run", "scenario.yaml", "--in-process", *WITHOUT[1:]), True),
        (("sweep", "sweep.yaml", "--workers", "1"), False),
        (("plan", "scenario.yaml", "--robots", "3", "--duration", "10", "--seeds", "1"), False),
        (
            (
                *("benchmark", "--terrains", "yards", "--teams", "2", "--seeds", "1", "--duration", "10"),
                *("--point", "1", "--policies", "./my_policy.py:GreedyTarget", "--workers", "1"),
                *("--set", "sensor.kind=./elliptic_sensor.py:Ellipse", "--set", "radio.model=./my_radio.py:Halving"),
            ),
            False,
        ),
    ],
    ids=lambda words: words[0] if isinstance(words, tuple) else None,
)
def test_a_command_that_runs_code_names_it_first(
    words: tuple[str, ...],
    is_recorded: bool,
    received: Path,
    records: Path,
    shell: Shell,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(received)
    said = shell(*words, "--out", tmp_path / "out")
    assert said.code == 0, said.err
    check_announced(said.err, *CODE)
    assert records.exists() == is_recorded, "only a run puts a sensor on the user's list"


@pytest.mark.processes
def test_an_intruder_with_the_code_names_it_first(
    received: Path, shell: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    assert shell("run", received / "scenario.yaml", "--in-process", *WITHOUT[1:], "--out", out).code == 0
    for name in [name for name in sys.modules if name.startswith("fogwatch_")]:
        monkeypatch.delitem(sys.modules, name)
    said = shell("intruder", out, "--code")
    assert (said.code, "needs 600 s" in said.err) == (2, True), said.err
    check_announced(said.err, *CODE)


@pytest.mark.processes
@pytest.mark.parametrize(
    ("module", "fields"), [("agent", ("patrol.policy", "sensor.kind")), ("worldsim", ("sensor.kind", "radio.model"))]
)
def test_a_process_started_by_hand_names_code_first(
    module: str, fields: tuple[str, ...], received: Path, tmp_path: Path
) -> None:
    own = ["--robot", "r1"] if module == "agent" else ["--out", str(tmp_path / "out")]
    command = [sys.executable, "-m", module, "--scenario", str(received / "scenario.yaml"), "--fleet", "x", *own]
    command += ["--router", "tcp/127.0.0.1:9", "--wait", "0.1"]
    done = subprocess.run(command, cwd=EXAMPLES.parent, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 2, done.stderr
    assert len([line for line in done.stderr.splitlines() if line.startswith("fogwatch: runs code: ")]) == len(fields)
    for field in fields:
        assert f"fogwatch: runs code: {field} = " in done.stderr.partition("ran: ")[0]


@pytest.fixture(scope="module")
def poisoned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run with a sensor of one's own, in which byte code of another one lies beside it."""
    folder = tmp_path_factory.mktemp("poisoned")
    with pytest.MonkeyPatch.context() as patch:
        (folder / "fogwatch").symlink_to(cache_home())
        patch.setenv("NUMBA_CACHE_DIR", str(folder))
        patch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
        fogwatch.run(with_sensor(f"{ELLIPSE}:Ellipse", options={"across": 3}), out=folder / "run", picture=False)
    file = folder / "run" / "sensor" / ELLIPSE.name
    source = with_first(file, f"open({str(folder / 'ran')!r}, 'w')\n")
    plant(file, source, checked=False)
    return folder


@pytest.mark.processes
@pytest.mark.parametrize(
    "words",
    [
        ("judge", "run"),
        ("report", "run", "--out", "run.html"),
        ("compare", "run", "other", "--out", "compare.html"),
        ("record", "run", "--out", "run.mcap"),
        ("export", "run", "--out", "tables"),
        ("animate", "run", "--out", "run.gif"),
        ("intruder", "run"),
        ("replay", "run", "--static", "page"),
    ],
    ids=lambda words: words[0],
)
def test_a_received_folder_runs_nothing_but_the_sensor_that_was_allowed(
    words: tuple[str, ...], poisoned: Path, shell: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(poisoned / "cache"))
    for name in [name for name in sys.modules if name.startswith("fogwatch_sensor_")]:
        monkeypatch.delitem(sys.modules, name)
    for name in ("run", "other"):
        shutil.copytree(poisoned / "run", tmp_path / name)
    said = shell(*words)
    assert said.code == 0, said.err
    assert any(name.startswith("fogwatch_sensor_") for name in sys.modules), "the command has not run the sensor"
    assert not (poisoned / "ran").exists()
