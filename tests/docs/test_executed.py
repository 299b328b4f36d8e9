"""The commands in the documents, executed: each page's in their order, in an empty folder, with shorter runs.

`SHORTER` says what is added to a command to keep it short, `NOT_EXECUTED` which commands a test on one machine cannot
execute; `tests.docs.test_commands` has those parsed. A command that stands in several pages is executed once.
"""

from __future__ import annotations

import re
import shlex
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path
from socket import SOCK_DGRAM

import numpy as np
import pytest
from typer.testing import CliRunner

from agent.learned.network import Layers
from fogwatch.cli.app import app
from tests.docs.test_commands import DOCUMENTS, ROOT, command_lines
from tests.fleets import Processes
from tests.fogwatch.conftest import PATIENCE_S
from tests.routers import free_port

WAITS = "goes on until Ctrl-C; tests/fogwatch/processes starts it"
MEMBERS = "needs the machines of a fleet; tests/fogwatch/processes/test_admission.py starts them on one"
LONG = "needs a run of six minutes or more; tests/experiments/commands/test_intruder.py makes one"
ROBOT = "needs a ROS 2 robot, or processes in several shells; tests/ros2 starts simulated ones"
NOT_EXECUTED = {
    "python": "starts a process of a fleet by hand; " + MEMBERS,
    "fogwatch agent": ROBOT,
    "fogwatch router": WAITS,
    "fogwatch robot-sim": ROBOT,
    "fogwatch doctor --connect": ROBOT,
    "fogwatch monitor": WAITS,
    "fogwatch intruder runs/NAME --again": LONG,
    "fogwatch intruder runs/NAME --code": LONG,
    "fogwatch control operator": MEMBERS,
    "fogwatch control hall-1/operator": "needs the fleet of docs/ros2/closed-fleet.md, which a test of its own starts",
    "fogwatch record --credentials": MEMBERS,
    "fogwatch status --credentials": MEMBERS,
    "fogwatch status --router": MEMBERS,
    "fogwatch benchmark --preset conditions": "runs all of its conditions; tests/experiments/benchmark has a short one",
    "fogwatch benchmark --preset m": "needs the map of cumberland, which is not ours",
    "fogwatch reproduce table --seeds": "runs all cells of seven tables",
}
"""Beginnings of commands, and why they are not executed."""

ON_A_FLEET = ("fogwatch control runs/NAME", "fogwatch status runs/")
"""Beginnings of commands that need a fleet that is running on this machine."""

QUIET = "--in-process --quiet --no-picture --no-recording --no-report"
SHORT_TABLE = "--seeds 1 --duration 20 --point 2 --cluster HERE"
PAPER_TABLE = "--seeds 1 --set duration=20 --set point=2 --cluster HERE"
SHORTER = {
    "fogwatch run examples/faults-": f"{QUIET} --point 2 --set step=4 --set watchdog=4",
    "fogwatch run site.yaml": f"{QUIET} --duration 30 --point 1",
    "fogwatch run rooms.yaml": f"{QUIET} --duration 130 --point 0.5",
    "fogwatch run plan.yaml": f"{QUIET} --duration 20 --point 0.25",
    "fogwatch run yards .* --set point=": f"{QUIET} --duration 20",
    "fogwatch run": f"{QUIET} --duration 20 --point 1",
    "fogwatch plan .* --quick": "--robots 1-2 --point 0.25",
    "fogwatch plan .* --robots": "--robots 1-2 --point 0.25 --duration 60",
    "fogwatch plan": "--point 0.25 --duration 60",
    r"fogwatch replay \S+$": "--static page",
    r"fogwatch replay \S+ runs/OTHER$": "--static pair",
    "fogwatch benchmark .* plan.yaml": f"{SHORT_TABLE} --policies committed",
    "fogwatch benchmark --quick": f"{SHORT_TABLE} --policies committed,even-tour --terrains open",
    "fogwatch benchmark": f"{SHORT_TABLE} --terrains open --conditions loss-90 --teams 3",
    "fogwatch reproduce claim [a-z]": PAPER_TABLE,
    "fogwatch reproduce table 4": f"{PAPER_TABLE} --columns 1",
    "fogwatch reproduce table": f"{PAPER_TABLE} --rows f3 --columns g4",
    "fogwatch sweep": "--seeds 1 --cluster HERE",
}
"""How a command begins (the first that fits), and what is added to make it short: the last of two options counts.

HERE is a Dask cluster in this process, which has loaded the kernels already.
"""

SHORTER_FILES = {
    "patrol: {avoidance: none}": "patrol: {avoidance: none}\n  duration: 20",
    "point: 0.5": "point: 2",
    "point: [0.5]": "point: [2]",
    "robots.count: [1, 3, 5]": "robots.count: [1]",
    "[[600, 900], [1800, 2400]]": "[[6, 9], [18, 24]]",
    "[[600, 1200], [1800, 2400]]": "[[6, 12], [18, 24]]",
}
"""What is replaced in examples of sweeps and in files that a page has its reader save, beside ticks."""

PREPARED = "runs/NAME"
"""The run that documents do not make."""

GRAPH = "3  30 16  1  0 0  0  4 12  1  1 S 10  1  14 7  2  0 N 10  2 S 8  2  7 3  1  1 N 8\n"
"""Three places in the rooms of the tutorial's map, in the format of patrolling_sim."""


def executed(line: str) -> bool:
    return not line.startswith((*NOT_EXECUTED, *ON_A_FLEET))


def shortened(line: str) -> list[str]:
    """Return a command's arguments, and those that make it short."""
    added = next((more for beginning, more in SHORTER.items() if re.match(beginning, line)), "")
    words = shlex.split(line.partition(" > ")[0])[1:]
    return [*words, *(shlex.split(added) if "--help" not in words else [])]


def saved_files(document: str) -> dict[str, str]:
    """Return the YAML files that a page has its reader save, by their names."""
    blocks = re.findall(
        r"^    # (\w+\.yaml)\n((?:    .*\n)+)", (ROOT / document).read_text(encoding="utf-8"), re.MULTILINE
    )
    return {name: re.sub(r"^    ", "", content, flags=re.MULTILINE) for name, content in blocks}


def documents() -> dict[str, list[str]]:
    """Return the commands of each document but the measurements, without those of earlier ones on the same files."""
    found: dict[str, list[str]] = {}
    for path in (path for pattern in DOCUMENTS for path in sorted(ROOT.glob(pattern))):
        if ROOT / "docs" / "results" not in path.parents:
            document = str(path.relative_to(ROOT))
            earlier = set() if saved_files(document) else {line for lines in found.values() for line in lines}
            found[document] = [line for line in command_lines(path) if line not in earlier]
    return found


COMMANDS = documents()
EXECUTED = {name: lines for name in COMMANDS if (lines := [line for line in COMMANDS[name] if executed(line)])}


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    """Return the address of a Dask cluster with one worker, a thread of this process."""
    from distributed import LocalCluster

    one = {"n_workers": 1, "threads_per_worker": 1, "processes": False}
    with LocalCluster(**one, protocol="tcp", host="127.0.0.1", dashboard_address=":0") as made:  # type: ignore[no-untyped-call]
        yield made.scheduler_address


def run_in_here(words: list[str]) -> str:
    result = CliRunner().invoke(app, words, catch_exceptions=False)
    assert result.exit_code == 0, f"{shlex.join(words)}: {result.output}"
    return result.output


def hall(closed: tuple[range, range]) -> str:
    """Return a hall of 42 m x 30 m, with a block in it, for pages whose map is the reader's."""
    rows = (
        ["0" if x in {0, 43} or y in {0, 31} or (x in closed[0] and y in closed[1]) else "1" for x in range(44)]
        for y in range(32)
    )
    return "P2\n44 32\n1\n" + "\n".join(" ".join(row) for row in rows)


def write_files(document: str) -> None:
    """Write the reader's own maps and network, the repository's examples, and what the page has its reader save."""
    tutorial = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
    image, description = re.findall(r"^```(?:text|yaml)\n(.*?)^```$", tutorial, flags=re.MULTILINE | re.DOTALL)[:2]
    Path("rooms.pbm").write_text(image, encoding="utf-8")
    for name in ("rooms", "plan", "site"):
        Path(f"{name}.yaml").write_text(description, encoding="utf-8")
    Path("robot.yaml").write_text(description.replace("[0, 0, 0]", "[-5, -3, 0]"), encoding="utf-8")
    for name, picture in (("site-map", hall((range(0), range(0)))), ("keepout", hall((range(38, 41), range(14, 17))))):
        Path(f"{name}.pgm").write_text(picture, encoding="utf-8")
        Path(f"{name}.yaml").write_text(description.replace("rooms.pbm", f"{name}.pgm"), encoding="utf-8")
    Path("plan.graph").write_text(GRAPH, encoding="utf-8")
    Path("patrol.yaml").write_text("terrain: {map: plan.yaml}\nrobots: {model: holonomic, radius: 0.3}\n")
    Layers([np.zeros((40, 2))], [np.zeros(2)]).save("trained.npz")
    shutil.copytree(ROOT / "examples", "examples", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy("examples/my_policy.py", "mine.py")
    Path("mine.py").write_text(Path("mine.py").read_text(encoding="utf-8").replace("GreedyTarget", "Mine"))
    for name, content in saved_files(document).items():
        Path(name).write_text(content, encoding="utf-8")
    for path in (Path("site.yaml"), Path("examples/yards-five.yaml"), *Path("examples/sweeps").iterdir()):
        text = path.read_text(encoding="utf-8")
        for old, new in SHORTER_FILES.items():
            text = text.replace(old, new)
        text = re.sub(r"duration: \d{4}\b", "duration: 20", text)
        text = re.sub(r"\b(at|for): (\d{3,4})\b", lambda tick: f"{tick[1]}: {int(tick[2]) // 125}", text)
        path.write_text(text, encoding="utf-8")


def make_what_pages_share(lines: list[str]) -> None:
    """Make the runs that pages call NAME, ONE and OTHER, and the fleet that some take from another page."""
    if any(PREPARED in line or "runs/ONE" in line for line in lines):
        patrol = "run plan.yaml --robots 2 --model holonomic --radius 0.3 --speed 1 --set terrain.graph=plan.graph"
        run_in_here([*shlex.split(f"{patrol} {QUIET} --point 0.25 --duration 160 --out"), PREPARED])
        for name in ("ONE", "OTHER"):
            shutil.copytree(PREPARED, f"runs/{name}")
    fleet = next((line for line in lines if "yards-1" in line), "fleet init")
    if "fleet init" not in fleet:
        run_in_here(shlex.split("fleet init yards-1 --robots r1"))


@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning")  # of Dask
@pytest.mark.parametrize("document", EXECUTED)
def test_the_commands_of_a_document_can_be_executed(
    document: str, cluster: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_files(document)
    make_what_pages_share(EXECUTED[document])
    for line in EXECUTED[document]:
        if "fleet init yards-1" in line:
            shutil.rmtree("yards-1", ignore_errors=True)  # another section's example
        run_in_here([cluster if word == "HERE" else word for word in shortened(line)])


LIVE = """
terrain: {map: site-map.yaml}
point: 1
duration: 100000
pace: 5
robots: {count: 2, model: holonomic, radius: 0.3, speed: 1.0}
closures:
- {name: door, polygon: [[22, 8], [24, 8], [24, 9], [22, 9]]}
- {name: crate, polygon: [[30, 8], [31, 8], [31, 9], [30, 9]]}
zones:
- {name: vault, polygon: [[2, 2], [14, 2], [14, 12], [2, 12]], weight: 10}
- {name: cellar, polygon: [[30, 20], [40, 20], [40, 28], [30, 28]], weight: 3, times: [[600, 1200]]}
"""
"""A fleet with what the documents' controls name."""


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[Processes]:
    fleet = Processes(tmp_path, PATIENCE_S)
    yield fleet
    fleet.end()


@pytest.mark.processes
def test_the_commands_for_a_running_fleet_can_be_executed(
    fleet: Processes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("os.nice", lambda _: 0)  # it would hold for all tests after this one
    write_files("README.md")
    Path("live.yaml").write_text(LIVE, encoding="utf-8")
    fleet.start("fleet", "fogwatch", "run", "live.yaml", "--no-page", "--out", PREPARED)
    ticks = Path(PREPARED, "ticks.csv")
    fleet.until(lambda: ticks.exists() and ticks.read_text(encoding="ascii").count("\n") > 2)
    lines = [line for lines in COMMANDS.values() for line in lines if line.startswith(ON_A_FLEET)]
    assert len(lines) > 6
    for line in lines:
        run_in_here(shlex.split(re.sub(r"runs/\S+", PREPARED, line))[1:])
    fleet.processes["fleet"].send_signal(signal.SIGINT)
    assert fleet.code("fleet") == 130, fleet.said("fleet")


WAITING = {"router": "router ready at", "robot-sim": "simulates robot1", "agent": "patrols with", "monitor": "page: "}
"""What the processes of a page say once they can be used, by their commands."""


@pytest.mark.processes
def test_the_closed_fleet_of_simulated_robots_can_be_driven_as_its_page_says(
    fleet: Processes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("os.nice", lambda _: 0)  # it would hold for all tests after this one
    for file in (ROOT / "examples" / "maps").glob("office.*"):
        shutil.copy(file, file.name)
    ports = {"7450": str(free_port()), "init hall-1": f"init hall-1 --port {free_port(SOCK_DGRAM)}"}
    for number, line in enumerate(COMMANDS["docs/ros2/closed-fleet.md"]):
        words = shlex.split(re.sub("|".join(ports), lambda match: ports[match[0]], line))[1:]
        if words[0] not in WAITING:
            run_in_here(words)
            continue
        name = f"{number}-{words[0]}"
        fleet.start(name, "fogwatch", *words)
        fleet.until(lambda name=name, ready=WAITING[words[0]]: ready in fleet.said(name))  # type: ignore[misc]
    paused = CliRunner().invoke(app, ["control", "hall-1/operator", "pause"], catch_exceptions=False)
    assert "fleet hall-1 has no world, and its robots obey stop and release alone" in paused.output


def test_every_command_of_the_tutorial_is_executed() -> None:
    assert EXECUTED["docs/tutorial.md"] == command_lines(ROOT / "docs" / "tutorial.md")


def test_every_rule_is_needed() -> None:
    lines = [line for lines in COMMANDS.values() for line in lines]
    assert [beginning for beginning in NOT_EXECUTED if not any(line.startswith(beginning) for line in lines)] == []
    assert [rule for rule in SHORTER if not any(re.match(rule, line) for line in lines)] == []
