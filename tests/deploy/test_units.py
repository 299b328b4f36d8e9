"""The service units: their command lines can be read, they keep what they hold, and a hung process is restarted."""

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from fogwatch.fleets.folder import make_fleet
from runtime.security.credentials import AUTHORITY, CERTIFICATE, KEY, MEMBER, ROUTER, read_credentials
from runtime.security.mesh import MESH
from tests.deploy.command_lines import DEPLOY, options_in
from tests.routers import needs_openssl

UNITS = {path.stem: path for path in sorted((DEPLOY / "systemd").glob("*.service"))}
SPECIFIERS = {"%i": "r1", "%d": "/run/credentials/unit", "%%": "%"}
ROBOT = ("${FOGWATCH_ROBOT}", "tcp/127.0.0.1:7447")
"""The variable that names a ROS 2 robot's router, and what the unit sets it to."""
HARDENED = {
    "NoNewPrivileges": "yes",
    "CapabilityBoundingSet": "",
    "ProtectSystem": "strict",
    "PrivateTmp": "yes",
    "RestrictAddressFamilies": "AF_INET AF_INET6 AF_NETLINK AF_UNIX",
    "UMask": "0077",
    "User": "fogwatch",
}


def service(name: str) -> list[tuple[str, str]]:
    """The assignments in a unit's section [Service], in their order; a name may stand there several times."""
    section = UNITS[name].read_text(encoding="utf-8").partition("[Service]\n")[2].partition("\n[")[0]
    lines = (line for line in section.splitlines() if line and not line.startswith("#"))
    return [(key, value) for key, _, value in (line.partition("=") for line in lines)]


def command(name: str) -> list[str]:
    """The words of a unit's command line, from `-m` on, with the specifiers of the service manager replaced."""
    line = dict(service(name))["ExecStart"]
    line = re.sub("%[id%]", lambda found: SPECIFIERS[found[0]], line)
    assert "%" not in line.replace("date +%Y%m%d-%H%M%S", "")
    words = shlex.split(line)
    if words[0] == "/bin/sh":
        words = shlex.split(words[2].replace("$(date +%Y%m%d-%H%M%S)", "now"))[1:]
    assert words[:2] == ["/opt/fogwatch/venv/bin/python", "-P"]
    words = [ROBOT[1] if word == ROBOT[0] else word for word in words]
    return [word for word in words[2:] if not re.fullmatch(r"\$FOGWATCH(_ROUTER)?_OPTIONS", word)]


def test_there_is_a_unit_for_each_process() -> None:
    started = {name: options_in(command(name))[0] for name in UNITS}
    assert started == {
        "fogwatch-agent@": "agent",
        "fogwatch-monitor": "monitor",
        "fogwatch-ros2-agent@": "ros2.robot",
        "fogwatch-router": "fogwatch.router",
        "fogwatch-world": "worldsim",
    }


@pytest.mark.parametrize("name", UNITS)
def test_a_unit_gives_its_process_the_credentials_that_the_manager_keeps(name: str) -> None:
    module, options = options_in(command(name))
    folder = options.fleet if module == "fogwatch.router" else options.credentials
    assert folder == Path(SPECIFIERS["%d"])
    given = dict(value.split(":") for key, value in service(name) if key == "LoadCredential")
    own = {ROUTER} if module == "fogwatch.router" else {MEMBER, MESH}
    assert set(given) == {*own, AUTHORITY, CERTIFICATE, KEY}
    for file, source in given.items():
        assert Path(source).name == file
        assert Path(source).parents[1] == Path("/etc/fogwatch")


@needs_openssl
@pytest.mark.parametrize("name", [name for name in UNITS if name != "fogwatch-router"])
def test_a_member_of_a_fleet_with_a_router_needs_no_mesh(name: str, tmp_path: Path) -> None:
    """The service manager puts a default in the place of a file that is missing, instead of failing the unit."""
    (file, _, default) = dict(service(name))["SetCredential"].partition(":")
    fleet = make_fleet(tmp_path / "fleet", "yards", ["r1"], [], 7447, 1)
    folder = fleet.path / "r1"
    assert file == MESH
    assert not (folder / file).exists()
    (folder / file).write_text(default, encoding="utf-8")
    assert read_credentials(folder, "--credentials").mesh is None


@pytest.mark.parametrize("name", UNITS)
def test_a_unit_is_restarted_watched_and_hardened_and_requires_no_other(name: str) -> None:
    assert "fogwatch-" not in UNITS[name].read_text(encoding="utf-8")
    says = dict(service(name))
    assert says["Type"] == "notify"
    assert says["Restart"] == ("on-abnormal" if name == "fogwatch-world" else "always")
    assert 0 < int(says["WatchdogSec"]) <= 60
    for key, value in HARDENED.items():
        assert says[key] == value, key
    first, *_ = UNITS.values()
    hardening = first.read_text(encoding="utf-8").partition("# What it cannot do")[2].partition("\n\n")[0]
    assert hardening in UNITS[name].read_text(encoding="utf-8"), "all units are hardened alike"


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="the command systemd-analyze is not installed")
@pytest.mark.parametrize("name", UNITS)
def test_systemd_understands_a_unit(name: str, tmp_path: Path) -> None:
    text = UNITS[name].read_text(encoding="utf-8").replace("/opt/fogwatch/venv/bin/python", "/bin/true")
    unit = tmp_path / UNITS[name].name
    unit.write_text(text, encoding="utf-8")
    command = ["systemd-analyze", "verify", "--man=no", str(unit)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    said = [line for line in done.stderr.splitlines() if "fogwatch" in line]
    assert (done.returncode, said) == (0, [])
