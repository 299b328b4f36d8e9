import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from PIL import Image
from typer.main import get_command

from fogwatch.cli.app import app
from fogwatch.cli.command_help import PANEL_OF, reflowed
from fogwatch.launch.launcher import PROCESS_GB
from tests.fleets import python
from tests.fogwatch.conftest import Refused, Shell

SHORT = ["--point", "0.5", "--duration", "5", "--set", "patrol.goal_distance=6"]
PATIENCE_S = 300.0
TOO_MANY = int(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 1e9 / PROCESS_GB) + 1
"""Robots that no longer fit into this machine's memory as processes."""
COARSE = [*SHORT, "--no-picture", "--no-recording", "--no-report"]
FILES = {"scenario.yaml", "journal", "ticks.csv", "summary.json"}
"""Of each run."""


def names_in(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_a_command_without_its_docstring_says_why_it_has_no_help() -> None:
    assert reflowed(lambda: None) == "No help: Python runs with PYTHONOPTIMIZE=2."


def test_a_run_in_one_process_from_a_built_in_terrain(shell: Shell, tmp_path: Path) -> None:
    shown = shell("run", "open", "--robots", "2", "--in-process", *SHORT)
    assert shown.code == 0
    (folder,) = (tmp_path / "runs").iterdir()
    assert folder.name.startswith("open-")
    assert names_in(folder) == FILES | {"fog.png", "recording.mcap", "report.html"}
    for words in ("MFoW        mean", "coverage", "messages", "r2", "verdict     valid", str(folder)):
        assert words in shown.out
    assert "tick 10/10" in shown.err
    assert json.loads((folder / "summary.json").read_text(encoding="utf-8"))["ticks"] == 10
    assert (folder / "ticks.csv").read_text(encoding="ascii").count("\n") == 11


def test_the_options_override_the_scenario_and_quiet_prints_the_folder_alone(shell: Shell, tmp_path: Path) -> None:
    options = ["--robots", "2", "--model", "holonomic", "--radius", "0.5", "--speed", "2", "--seed", "9"]
    options += ["--set", "robots.turning_radius=1.5", "--sensor-range", "7", "--start", "10,20", "--start", "30,40,1.5"]
    out, quiet = tmp_path / "out", ("--in-process", "--quiet", "--out")
    assert shell("run", "open", *options, *quiet, out, *COARSE) == (0, f"{out}\n", "")
    header = (out / "scenario.yaml").read_text(encoding="utf-8")
    for words in ("model: holonomic", "radius: 0.5", "speed: 2.0", "seed: 9", "count: 2", "goal_distance: 6.0"):
        assert words in header
    for words in ("turning_radius: 1.5", "range: 7.0"):
        assert words in header
    assert shell("run", out / "scenario.yaml", "--workers", "2", *quiet, tmp_path / "two").code == 0
    hashes = {json.loads((tmp_path / name / "summary.json").read_text())["trace_hash"] for name in ("out", "two")}
    assert len(hashes) == 1


def interrupt(*arguments: object, **_: object) -> None:
    """Press Ctrl-C in the middle of something that takes long; a file that it was to write has been begun."""
    for file in arguments:
        if isinstance(file, Path) and file.suffix == ".part":
            file.write_bytes(b"begun")
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(PATIENCE_S)


@pytest.mark.parametrize(
    ("step", "without", "left"),
    [
        ("monitor.report.document.write_report", [], {"recording.mcap"}),
        ("matplotlib.figure.Figure.savefig", ["--no-recording", "--no-report"], set()),
    ],
)
def test_ctrl_c_while_files_are_written_ends_that_at_once(
    shell: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str, without: list[str], left: set[str]
) -> None:
    monkeypatch.setattr(step, interrupt)
    shown = shell("run", "open", "--robots", "2", "--in-process", "--out", "out", *SHORT, *without)
    assert shown.code == 130
    (told,) = [line for line in shown.err.splitlines() if line.startswith("interrupted")]
    assert f"`fogwatch report {tmp_path / 'out'}`" in told
    assert "verdict     valid" in shown.out
    assert names_in(tmp_path / "out") == FILES | left


@pytest.mark.processes
def test_ctrl_c_while_the_run_is_judged_says_how_to_judge_it(shell: Shell, tmp_path: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("worldsim.verdict.judge.Judge.verdict", interrupt)
        shown = shell("run", "open", "--robots", "1", "--no-page", "--out", "out", *COARSE)
    assert shown.code == 130
    assert f"`fogwatch judge {tmp_path / 'out'}` judges it" in shown.err
    assert not (tmp_path / "out" / "summary.json").exists()
    assert shell("judge", tmp_path / "out").code == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere"], "no such scenario"),
        (["."], "is a folder"),
        (["noise"], "is not UTF-8 text"),
        (["words"], "expected keys and values"),
        (["open", "--robots", "0"], "fogwatch: --robots 0: expected"),
        (["open", "--robots", "100000"], "fogwatch: --robots 100000: expected"),
        (["open", "--spare", "-1"], "fogwatch: --spare -1: expected"),
        (["listed.yaml", "--robots", "3"], "--robots: the scenario lists its 2 robots; add or remove entries there"),
        (["listed.yaml", "--speed", "-2"], "fogwatch: --speed -2: expected a number above 0"),
        (["listed.yaml", "--seed", "3"], "fogwatch: listed.yaml: line 2: robots.0.radius = -5: expected"),
        (["open", "--robots", str(TOO_MANY)], "GB of memory"),
        (["open", "--robots", "40", "--radius", "12"], "do not fit"),
        (["open", "--model", "boat"], 'fogwatch: --model "boat": expected'),
        (["open", "--speed", "nan"], "fogwatch: --speed NaN: expected a number above 0"),
        (["open", "--radius", "-1"], "fogwatch: --radius -1: expected a number above 0"),
        (["open", "--duration", "-1"], "fogwatch: --duration -1: expected"),
        (["open", "--pace", "warp"], 'fogwatch: --pace "warp": expected'),
        (["open", "--set", "robots.radius=-1"], "fogwatch: --set robots.radius = -1: expected"),
        (["open", "--start", "here"], "--start here"),
        (["open", "--start", "1,2,3,4"], "--start"),
        pytest.param(["open", "--start", "-50,3"], "50", marks=pytest.mark.processes),
        (["open", "--port", "0"], "--port 0"),
        (["open", "--set", "patrol"], "--set patrol"),
        (["open", "--set", "patrol.dilation=1"], "did you mean patrol.options.dilatation"),
        (["open", "--out", "full"], "--out full: is not empty"),
        (["open", "--out", "noise"], "--out noise: cannot be written"),
        (["open", "--bogus"], "--bogus: no such option; leave it out"),
        (["open", "--robot", "5"], "--robot: no such option; did you mean --robots?"),
        (["open", "--robots", "five"], "--robots five: expected a whole number, such as --robots 5"),
        (["open", "--robots", "2.5"], "--robots 2.5: expected a whole number, such as --robots 5"),
        (["open", "--radius", "30cm"], "--radius 30cm: expected a number in m, such as --radius 0.3"),
        (["open", "--radius", "0,3"], "--radius 0,3: expected a number in m, such as --radius 0.3"),
        (["open", "--speed", "3.6km/h"], "--speed 3.6km/h: expected a number in m/s, such as --speed 1"),
        (["open", "--duration", "10min"], "--duration 10min: expected a number in s, such as --duration 600"),
        (["open", "--seed", "k"], "--seed k: expected a whole number, such as --seed 7"),
        (["open", "--speed", "300"], "fogwatch: --speed 300: a stride of 150 m leaps over ground"),
        (["open", "--radius", "300"], "fogwatch: --radius 300: a body this wide fits nowhere on open, on points of"),
        (["open", "--set", "robots.radius=300"], "fogwatch: robots.radius = 300: a body this wide fits nowhere on"),
        ([], "SCENARIO is missing; for example: fogwatch run yards"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(
    arguments: list[str], words: str, refused: Refused, tmp_path: Path
) -> None:
    (tmp_path / "noise").write_bytes(bytes(range(256)))
    (tmp_path / "words").write_text("hello", encoding="utf-8")
    (tmp_path / "full" / "kept").mkdir(parents=True)
    listed = "terrain: {builtin: open}\nrobots: [{radius: -5}, {}]\n"
    (tmp_path / "listed.yaml").write_text(listed, encoding="utf-8")
    said = refused("run", *arguments, "--point", "0.5")
    assert said.startswith("fogwatch: ")
    assert words in said
    assert not (tmp_path / "runs").exists() or not list((tmp_path / "runs").iterdir())


@pytest.mark.parametrize("way", ["--in-process", pytest.param("--no-page", marks=pytest.mark.processes)])
def test_an_error_in_a_map_names_the_map_and_not_its_copy(way: str, shell: Shell, tmp_path: Path) -> None:
    picture = Image.new("L", (400, 400), 254)
    picture.paste(0, (0, 0, 400, 2))
    picture.save(tmp_path / "plan.png")
    says = {"image": "plan.png", "resolution": 0.1, "origin": [0, 0, 0], "negate": 1}
    plan = tmp_path / "plan.yaml"
    plan.write_text(json.dumps({**says, "occupied_thresh": 0.65, "free_thresh": 0.196}), encoding="utf-8")
    shown = shell("run", plan, "--radius", "0.3", way, "--out", tmp_path / "run")
    last = shown.err.splitlines()[-1]
    assert shown.code == 2
    assert last.startswith(f"fogwatch: {plan}: leaves no room for a body with a radius of 0.3 m: negate = true, ")
    assert "make 0.5 % of its cells free, 99.5 % occupied and 0.0 % unknown" in last
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    "command",
    [
        ["scenario", "check"],
        ["run", "--in-process"],
        pytest.param(["run", "--no-page"], marks=pytest.mark.processes),
        ["plan", "--age", "60", "--quick"],
    ],
)
def test_a_scenario_that_does_not_fit_its_ground_is_named(command: list[str], shell: Shell, tmp_path: Path) -> None:
    file = tmp_path / "site.yaml"
    zone = "{name: a, weight: 2, polygon: [[900, 4], [901, 4], [901, 6]]}"
    file.write_text(f"terrain: {{builtin: open}}\npoint: 1.0\nzones: [{zone}]\n", encoding="utf-8")
    shown = shell(*command, file)
    assert shown.code == 2
    assert shown.err.splitlines()[-1].startswith(f"fogwatch: {file}: zones.0: a")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["repot"], "repot: no such command; did you mean report?"),
        (["map", "check", "yards", "--range", "far"], "--range far: expected a number in m, such as --range 10"),
        (["control", "RUN", "go", "--wait", "1m"], "--wait 1m: expected a number in s, such as --wait 15"),
        (["run", "open", "--workers", "0"], "--workers 0: expected 1 to 64"),
        (["run", "open", "--workers", "2"], "--workers 2: each robot is a process of its own; leave it out, or give"),
        (["reproduce", "table", "two"], "N... two: expected a whole number, such as 5"),
        (["sweep"], "FILE is missing; for example: fogwatch sweep"),
        (["map", "check", "nowhere.yaml"], "nowhere.yaml: no such map file"),
        (["scenario", "show", "nowhere.yaml"], "nowhere.yaml: no such scenario"),
        (["fleet", "init", "a", "b"], "--robots NAME[=HOST],... is missing; for example: fogwatch fleet init yards-1"),
        (["fleet", "init", "a", "b", "--robots", "r1"], "b: not expected here; for example: fogwatch fleet init"),
        (["control", "RUN", "intruder"], "control intruder: give its place too, such as '[12, 30]'"),
        (["control", "RUN", "fault", "loss"], 'control: fault = "loss": expected a fault such as {kind: loss, rate'),
        (["control", "RUN", "intruder", "{at: 3}"], "control: place: missing; give [12, 30]"),
    ],
)
def test_every_command_names_the_argument_its_value_and_the_remedy(
    arguments: list[str], words: str, refused: Refused
) -> None:
    assert words in refused(*arguments)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("key new", "fleet key"),
        ("key", "fleet key"),
        ("paper table", "reproduce table"),
        ("paper all", "reproduce table"),
        ("paper", "reproduce"),
    ],
)
def test_words_of_1_0_work_and_the_new_ones_are_told(old: str, new: str, shell: Shell) -> None:
    shown = shell(*old.split(), "--help")
    assert shown.code == 0
    assert re.search(rf"^fogwatch: `fogwatch {' '.join(old.split()[:1])}\b.*` is now `fogwatch .*`", shown.err)
    assert shown.err.count("\n") == 1
    assert shell(*new.split(), "--help") == (0, shown.out, "")


@pytest.mark.parametrize(
    ("words", "error"),
    [
        ("chaos", "is now `make chaos` in a clone"),
        ("recording a.mcap", "`fogwatch recording` is gone; the tool mcap does that: mcap doctor FILE"),
        ("record --check a.mcap --repair b.mcap", "`fogwatch record --check` is gone; the tool mcap"),
        ("record a.mcap --repair=b.mcap", "mcap recover FILE -o NEW saves a damaged one"),
        ("map random a.yaml --seed 1", "`fogwatch map random` is gone; a clone of fogwatch has such buildings in"),
        ("intruder runs/a --trials 5", "`fogwatch intruder --trials` is gone, and so is the learned intruder"),
        ("run open --in-process --threads 2", "`fogwatch run --threads` is gone; give --workers"),
        ("intruder --horizon=9 runs/a", "`fogwatch intruder --horizon` is gone"),
        ("paper", "say which one"),
        ("paper table", "say which one"),
        ("experiment faults --seeds 1", "`fogwatch experiment` is gone; what faults cost is a sweep: fogwatch sweep"),
        ("paper calibrate --seeds 1", "`fogwatch reproduce calibrate` is gone; fogwatch reproduce table 2 3 --set"),
        ("reproduce table 2 --point=1", "has no option for point now; give --set point=NUMBER"),
        ("benchmark --preset magec --map a.yaml", "`fogwatch benchmark --map` is gone; give --terrains FILE.graph+"),
        ("reproduce faults", "`fogwatch reproduce faults` is gone; what faults cost is a sweep"),
        ("reproduce figure paper", "`fogwatch reproduce figure` is gone; a clone has the command of each figure in"),
        ("reproduce check", "`fogwatch reproduce check` is now `python docs/samples.py` in a clone"),
    ],
)
def test_words_of_1_0_that_cannot_go_on_say_so(words: str, error: str, shell: Shell) -> None:
    shown = shell(*words.split())
    assert shown.code == 2
    assert error in shown.err


def test_version_names_what_it_stands_on_and_is_an_option_too(shell: Shell) -> None:
    shown = shell("version")
    assert shown.code == 0
    for name in ("fogwatch 1", "Python 3", "eclipse-zenoh 1", "numba 0", "numpy 2"):
        assert name in shown.out
    shown = shell("--version")
    assert (shown.code, shown.out[:10]) == (0, "fogwatch 1")


LEFT_ALONE = """
import os, sys
from itertools import product
from pathlib import Path
import fogwatch.inprocess, fogwatch.api, fogwatch.pictures.run_end, matplotlib.figure
from fogwatch.cli.app import main
from worldsim.checks.check import CheckResult
from worldsim.checks.statuses import NobodyLost

def run(number, ok, options, output, errors):
    os.dup2(output, 1)
    os.dup2(errors, 2)
    NobodyLost.result = lambda self: CheckResult("nobody lost", ok, "made up")
    sys.argv = ["fogwatch", "run", "open", "--in-process", "--out", f"run-{number}", *options]
    sys.exit(main())

for number, (ok, quiet, together) in enumerate(product((True, False), ((), ("--quiet",)), (True, False))):
    reading, writing = os.pipe()
    os.close(reading)
    with open(f"errors-{number}", "xb") as errors:
        if (child := os.fork()) == 0:
            run(number, ok, [*sys.argv[1:], *quiet], writing, writing if together else errors.fileno())
    os.close(writing)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    print(code, 0 if ok else 1, Path(f"errors-{number}").read_text(), flush=True)
"""
"""Runs whose reader has left, forked by a process that has loaded what each needs."""


@pytest.mark.processes
def test_a_reader_that_leaves_changes_no_exit_code(tmp_path: Path) -> None:
    """A verdict is not made valid, nor invalid, by ``| head``."""
    done = python("-c", LEFT_ALONE, *COARSE, cwd=tmp_path, check=True)
    codes = [line.split()[:2] for line in done.stdout.splitlines() if line[:1].isdigit()]
    assert len(codes) == 8
    assert all(code == expected for code, expected in codes), done.stdout
    assert "Traceback" not in done.stdout + done.stderr
    assert "Exception ignored" not in done.stdout + done.stderr


def commands(group: Any, *path: str) -> Iterator[list[str]]:
    """The words of every command, those in groups included."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, *path, name)
        else:
            yield [*path, name]


ALL_COMMANDS = list(commands(get_command(app)))


@pytest.mark.parametrize(("words", "code"), [(["--help"], 0), ([], 2)], ids=["asked for", "no command"])
def test_the_help_lists_commands_in_the_order_in_which_one_meets_them(
    words: list[str], code: int, shell: Shell
) -> None:
    shown = shell(*words)
    assert shown.code == code
    listed = re.findall(r"^│ ([a-z][a-z-]*)  ", shown.out + shown.err, flags=re.MULTILINE)
    assert listed == list(PANEL_OF)
    assert {words[0] for words in ALL_COMMANDS} == set(PANEL_OF)


@pytest.mark.parametrize("words", ALL_COMMANDS, ids=" ".join)
def test_every_command_has_an_example_and_its_exit_codes(
    words: list[str], shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    code, shown, _ = shell(*words, "--help")
    assert code == 0
    assert max(len(line) for line in shown.splitlines()) <= 80
    assert re.search(rf"^ Examples?: *\n   fogwatch {' '.join(words)}\b", shown, flags=re.MULTILINE), shown
    assert re.search(r"^ Exit codes: .*\b2 ", shown, flags=re.MULTILINE | re.DOTALL), shown


@pytest.mark.processes
@pytest.mark.parametrize("module", ["agent", "worldsim", "fogwatch.router"])
def test_every_process_has_help_with_an_example(module: str) -> None:
    done = python("-m", module, "--help", check=True)
    assert "fogwatch agent" in done.stdout
    assert "fogwatch fleet init yards-1 --robots r1" in done.stdout
    assert "--credentials yards-1/r1 --scenario yards.yaml" in done.stdout


@pytest.mark.processes
def test_a_busy_port_is_bad_input(tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        done = python("-m", "fogwatch", "run", "open", "--port", str(port), *COARSE, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.endswith(f"--port {port}: the port is busy; choose another, or leave the choice to fogwatch\n")
    assert not list((tmp_path / "runs").iterdir())


@pytest.mark.processes
def test_an_interrupted_run_in_one_process_can_be_read(tmp_path: Path) -> None:
    out = tmp_path / "run"
    command = [sys.executable, "-P", "-m", "fogwatch", "run", "open", "--in-process", "--out", str(out), *COARSE]
    process = subprocess.Popen([*command, "--duration", "100000"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    end = time.monotonic() + PATIENCE_S
    while not (out / "ticks.csv").exists() or (out / "ticks.csv").read_text(encoding="ascii").count("\n") < 5:
        assert time.monotonic() < end
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert summary["ended"] == "interrupted"
    assert summary["ticks"] >= 4
