"""A running fleet: who gets in, what can be read of its secrets, and fleets of several machines from start to end."""

import json
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from monitor.live.attach import open_fleet
from runtime.net.link import NotAdmitted, open_link
from runtime.process.lifeline import Ending
from runtime.security.access import FILE, credentials_at, private_roots, read_access
from runtime.security.credentials import read_credentials
from runtime.security.keys import WORLD, fleet_keys
from runtime.security.roles import VIEWER
from tests.fleets import COARSE, Processes, python
from tests.fogwatch.conftest import Run
from tests.routers import PATIENCE_S, free_endpoint, needs_openssl

pytestmark = pytest.mark.processes

SMALL: dict[str, Any] = {
    **COARSE,
    "name": "guarded",
    "duration": 20,
    "robots": [{"name": "anna", "model": "holonomic"}, {"name": "bert", "model": "car"}],
}


def private_folder(run: Path) -> Path:
    name: str = json.loads((run / FILE).read_text(encoding="utf-8"))["private"]
    return next(root / name for root in private_roots() if (root / name).is_dir())


def secrets_in(folder: Path) -> set[str]:
    found = set()
    for file in folder.glob("*.json"):
        one = read_credentials(file, "test")
        found |= {one.password, one.token}
    return {secret for secret in found if secret}


def text_in(folder: Path) -> str:
    """All that the files of a folder hold."""
    return "".join(path.read_bytes().decode(errors="replace") for path in folder.rglob("*") if path.is_file())


def what_others_see(pids: list[int]) -> str:
    """Command lines and environments, as ``ps`` shows them."""
    files = [Path("/proc", str(pid), name) for pid in pids for name in ("cmdline", "environ")]
    return "\n".join(file.read_bytes().decode(errors="replace") for file in files)


def test_a_running_fleet_shows_no_secret_and_lets_no_stranger_in(start: Callable[..., Run]) -> None:
    run = start({**COARSE, "duration": 100_000, "pace": 10, "robots": 3 * [{}]})
    run.until(lambda: run.ticks() > 5)
    folder = private_folder(run.folder)
    secrets = secrets_in(folder)
    assert len(secrets) == 3 + 3 + 1, "robots, world, viewer, operator, and the token"
    children = run.children()
    assert len(children) == 5
    shown = what_others_see([run.process.pid, *children.values()])
    held = text_in(run.folder)
    assert str(folder) in shown, "what is searched is what the processes were started with"
    assert FILE in {path.name for path in run.folder.iterdir()}
    for secret in secrets:
        assert secret not in shown
        assert secret not in held
    access = read_access(run.folder, "test")
    with pytest.raises(NotAdmitted):
        open_link(access.router, 2.0)
    viewer = open_link(access.router, PATIENCE_S, credentials=credentials_at(run.folder, "test", VIEWER))
    assert any(viewer.sees(fleet_keys(access.fleet).alive(WORLD)) for _ in range(1000))
    viewer.close()
    paused = python("-m", "fogwatch", "control", run.folder, "pause")
    assert paused.returncode == 0, paused.stderr
    assert "paused before tick" in paused.stdout
    run.interrupt()
    assert run.summary()["verdict"]["outcome"] == "valid"
    assert not folder.exists()
    left = text_in(run.folder)
    for secret in secrets:
        assert secret not in f"{left}{run.output}{run.errors}"


class Site(Processes):
    """Processes of a fleet that was made with ``fogwatch fleet init``, each with its folder alone."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, PATIENCE_S)
        self.fleet = folder / "guarded-1"
        self.scenario = folder / "scenario.yaml"
        self.scenario.write_text(json.dumps(SMALL), encoding="utf-8")
        self.port = free_endpoint().rpartition(":")[2]

    def command(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return python("-m", "fogwatch", *arguments)

    def start_world(self, credentials: Path, out: Path) -> None:
        where = ("--scenario", str(self.scenario), "--out", str(out))
        self.start("world", "worldsim", "--credentials", str(credentials), *where)

    def start_agent(self, name: str, credentials: Path) -> None:
        self.start(name, "agent", "--credentials", str(credentials), "--scenario", str(self.scenario), "--wait", "60")


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    site = Site(tmp_path)
    yield site
    site.end()


@needs_openssl
@pytest.mark.kind("closed fleet")
def test_the_recipe_for_several_machines(site: Site, tmp_path: Path) -> None:
    site.scenario.write_text(json.dumps({**SMALL, "duration": 100_000, "pace": 10}), encoding="utf-8")
    made = site.command("fleet", "init", str(site.fleet), "--robots", "anna,bert", "--port", site.port)
    assert made.returncode == 0, made.stderr
    names = ("router", "world", "anna", "bert", "viewer", "operator")
    machines = {name: tmp_path / f"machine-{name}" for name in names}
    for name, machine in machines.items():
        (site.fleet / name).rename(machine)
    site.start("router", "fogwatch.router", "--fleet", str(machines["router"]))
    out = tmp_path / "run"
    site.start_world(machines["world"], out)
    for robot in ("anna", "bert"):
        site.start_agent(robot, machines[robot])
    site.until(lambda: (out / "ticks.csv").exists() and (out / "ticks.csv").read_text(encoding="ascii").count("\n") > 5)
    paused = site.command("control", str(machines["operator"]), "pause")
    assert (paused.returncode, paused.stdout[:18]) == (0, "paused before tick"), paused.stderr
    refused = site.command("control", str(machines["viewer"]), "go")
    assert refused.returncode == 2
    why = "a viewer's credentials give no right to control the fleet; name an operator's"
    assert refused.stderr == f"fogwatch: control: {machines['viewer']}: {why}\n"
    page = open_fleet(Ending(), access=machines["operator"])
    onlooker = open_fleet(Ending(), credentials=machines["viewer"])
    assert page is not None
    assert onlooker is not None
    assert page.control({"do": "step", "ticks": 3}).done
    assert not onlooker.control({"do": "go"}).done
    page.close()
    onlooker.close()
    film = tmp_path / "film.mcap"
    site.start("record", "fogwatch", "record", "--credentials", str(machines["viewer"]), "--out", str(film))
    site.until(lambda: "recording fleet guarded-1" in site.said("record"))
    site.processes["record"].send_signal(signal.SIGINT)
    assert site.code("record") == 0, site.said("record")
    assert film.stat().st_size > 0
    site.processes["world"].terminate()
    assert [site.code(name) for name in ("world", "anna", "bert")] == [130, 0, 0], site.said("world")
    assert json.loads((out / "summary.json").read_text(encoding="utf-8"))["verdict"]["outcome"] == "valid"
    token = json.loads((machines["operator"] / "member.json").read_text(encoding="utf-8"))["token"]
    assert token == json.loads((machines["world"] / "member.json").read_text(encoding="utf-8"))["token"]
    assert token not in "".join([text_in(out), *(site.said(name) for name in site.processes)])


@needs_openssl
def test_a_robot_that_was_revoked_does_not_take_part(site: Site, tmp_path: Path) -> None:
    assert site.command("fleet", "init", str(site.fleet), "--robots", "anna,bert", "--port", site.port).returncode == 0
    stolen = Path(shutil.copytree(site.fleet / "bert", tmp_path / "stolen"))
    revoked = site.command("fleet", "revoke", str(site.fleet), "bert")
    assert revoked.returncode == 0, revoked.stderr
    assert "restart the router" in revoked.stdout
    assert site.command("fleet", "add", str(site.fleet), "bert").returncode == 0
    site.start("router", "fogwatch.router", "--fleet", str(site.fleet))
    site.start_world(site.fleet / "world", tmp_path / "run")
    site.start_agent("anna", site.fleet / "anna")
    site.start_agent("thief", stolen)
    site.until(lambda: "waiting for bert" in site.said("world"))
    site.until(lambda: "it is not there, or bert was revoked" in site.said("thief"))
    assert not (tmp_path / "run" / "journal").exists(), "the run has not begun"
    site.start_agent("bert", site.fleet / "bert")
    assert [site.code(name) for name in ("world", "anna", "bert")] == [0, 0, 0], site.said("world")
    site.processes["thief"].terminate()
    assert site.code("thief") == 130


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--listen", "tcp/0.0.0.0:1"], "other machines could connect, and nobody would be asked who they are"),
        (["--listen", "tcp/[::]:1"], "(or --open, to let everybody do everything)"),
        (["--listen", "tcp/localhost.example:1"], "give --fleet FOLDER"),
        (["--fleet", "none"], "--fleet: none/router/router.json cannot be read"),
        (["--fleet", "none", "--open"], "--open: means that there is no --fleet"),
    ],
)
def test_a_router_that_would_be_open_to_others_does_not_start(arguments: list[str], says: str) -> None:
    done = python("-m", "fogwatch.router", *arguments)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert says in done.stderr


@pytest.mark.parametrize("arguments", [[], ["--open"]])
def test_an_open_router_says_what_that_means(arguments: list[str]) -> None:
    host = "0.0.0.0" if arguments else "127.0.0.1"
    listen = f"tcp/{host}:{free_endpoint().rpartition(':')[2]}"
    command = [sys.executable, "-P", "-m", "fogwatch.router", "--listen", listen, *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as router:
        assert router.stdout is not None
        said = router.stdout.readline()
        router.terminate()
    assert said == (
        f"router ready at {listen}; it is open: anybody who can reach {listen} can read, send and forge everything, "
        "positions and controls included\n"
    )
