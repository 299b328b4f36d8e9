"""``fogwatch fleet``: members made, added, revoked and checked, and what is refused."""

from __future__ import annotations

import json
import shutil
import stat
from collections.abc import Callable
from pathlib import Path

import pytest

from fogwatch.certificates import facts, issue, make_authority
from fogwatch.fleet_folder import open_fleet_folder
from patrol.net.credentials import read_credentials, read_router
from patrol.net.roles import Role, robot_role
from tests.routers import needs_openssl

pytestmark = needs_openssl

Command = Callable[..., int]


@pytest.fixture(scope="module")
def template(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fleet, made once."""
    from fogwatch.fleet_folder import make_fleet

    folder = tmp_path_factory.mktemp("fleets") / "yards-1"
    make_fleet(folder, "yards-1", ["r1", "r2"], ["192.0.2.10", "hub.example"], 7447, 30)
    return folder


@pytest.fixture
def made(template: Path, fogwatch: Command) -> Path:  # noqa: ARG001 - the command's folder is the current one
    return Path(shutil.copytree(template, "yards-1")).absolute()


def test_a_fleet_has_a_folder_for_each_member_that_its_owner_alone_can_read(
    fogwatch: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    assert fogwatch("fleet", "init", "yards-1", "--robots", "r1, r2", "--host", "192.0.2.10") == 0
    said = capsys.readouterr().out
    assert "router at tls/192.0.2.10:7447" in said
    assert "operator, r1, r2, router, viewer, world" in said
    folder = Path("yards-1")
    for path in (folder, *(path for path in folder.rglob("*") if path.name != "authority.pem")):
        assert not stat.S_IMODE(path.stat().st_mode) & 0o077, path
    assert (folder / ".gitignore").read_text(encoding="utf-8") == "*\n"
    token = json.loads((folder / "fleet.json").read_text(encoding="utf-8"))["token"]
    for name in ("r1", "r2", "world", "viewer", "operator"):
        credentials = read_credentials(folder / name, "test")
        assert (credentials.fleet, credentials.router) == ("yards-1", "tls/192.0.2.10:7447")
        assert credentials.role.name == name
        assert credentials.token == (token if name in ("world", "operator") else None)
        assert facts(folder / name / "certificate.pem").common_name == f"{credentials.role.user}.1"
    assert read_router(folder, "test") == read_router(folder / "router", "test")
    assert read_router(folder, "test").listen == "tls/0.0.0.0:7447"
    assert {role.name for role in read_router(folder, "test").members.values()} == {
        "r1",
        "r2",
        "world",
        "viewer",
        "operator",
    }
    assert fogwatch("fleet", "check", "yards-1") == 0


def test_without_a_host_the_router_is_for_this_machine_alone(fogwatch: Command) -> None:
    assert fogwatch("fleet", "init", "here", "--robots", "r1", "--name", "other", "--port", "7000") == 0
    assert read_router(Path("here"), "test").listen == "tls/127.0.0.1:7000"
    assert read_credentials(Path("here/r1"), "test").fleet == "other"


def test_members_come_and_go(made: Path, fogwatch: Command, capsys: pytest.CaptureFixture[str]) -> None:
    def known() -> dict[str, Role]:
        return dict(read_router(made, "test").members)

    assert fogwatch("fleet", "add", str(made), "r3") == 0
    assert known()["robot-r3.1"] == robot_role("r3")
    assert fogwatch("fleet", "revoke", str(made), "r2") == 0
    assert "robot-r2.1" not in known()
    assert not (made / "r2").exists()
    assert fogwatch("fleet", "add", str(made), "r2", "--days", "5") == 0
    assert "robot-r2.1" not in known(), "the certificate that was revoked stays so"
    assert known()["robot-r2.2"] == robot_role("r2")
    assert facts(made / "r2" / "certificate.pem").common_name == "robot-r2.2"
    assert capsys.readouterr().out.count("restart the router") == 3
    assert fogwatch("fleet", "check", str(made)) == 0


def test_a_revoked_operator_s_token_is_worth_nothing(
    made: Path, fogwatch: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    before = read_credentials(made / "operator", "test").token
    assert fogwatch("fleet", "revoke", str(made), "operator") == 0
    assert "copy" in capsys.readouterr().out.partition("new token")[2]
    assert fogwatch("fleet", "add", str(made), "operator") == 0
    after = {read_credentials(made / name, "test").token for name in ("world", "operator")}
    assert len(after) == 1
    assert before not in after


def test_the_router_moves(made: Path, fogwatch: Command) -> None:
    certificate = (made / "router" / "certificate.pem").read_bytes()
    assert fogwatch("fleet", "add", str(made), "router", "--host", "198.51.100.7") == 0
    assert read_credentials(made / "r1", "test").router == "tls/198.51.100.7:7447"
    assert (made / "router" / "certificate.pem").read_bytes() != certificate
    assert fogwatch("fleet", "check", str(made)) == 0


def test_a_check_finds_what_is_wrong(made: Path, fogwatch: Command, capsys: pytest.CaptureFixture[str]) -> None:
    fleet = open_fleet_folder(made)
    fleet.add(robot_role("late"), days=-1)
    (made / "r1" / "key.pem").chmod(0o644)
    shutil.copyfile(made / "world" / "key.pem", made / "r2" / "key.pem")
    make_authority(made.parent / "other", "other")
    issue(made.parent / "other", made / "world", "world.1", 1)
    issue(made / "authority", made / "viewer", "viewer.7", 1)
    shutil.rmtree(made / "operator")
    assert fogwatch("fleet", "check", str(made)) == 1
    said = dict(line.split(": ", 1) for line in capsys.readouterr().out.splitlines())
    assert said["router"].startswith("valid until")
    assert "others can read it (mode 644)" in said["r1"]
    assert said["r2"] == "its certificate does not belong to the key beside it"
    assert said["world"] == "its certificate is not signed by the fleet's authority"
    assert said["viewer"] == "its certificate is for viewer.7, and the router lets in viewer.1"
    assert said["operator"] == "its folder is not here (it may have been moved to its machine)"
    assert said["late"].startswith("its certificate expired on")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["init", "yards-1", "--robots", "r1"], "exists already; to add a member, use: fogwatch fleet add"),
        (["init", "new", "--robots", "r1,r1"], "robot 'r1': named twice"),
        (["init", "new", "--robots", "r1,*"], "robot '*': not a robot's name"),
        (["init", "new", "--robots", ""], "robot '': not a robot's name"),
        (["init", "new", "--robots", "world"], "world: is a folder of every fleet"),
        (["init", "new", "--robots", "router"], "router: is a folder of every fleet"),
        (["init", "new", "--robots", "authority"], "authority: is a folder of every fleet"),
        (["init", "a*b", "--robots", "r1"], "not a name for a fleet"),
        (["init", "new", "--robots", "r1", "--host", "a b"], "--host 'a b': not the name or address of a machine"),
        (["init", "new", "--robots", "r1", "--host", "a,DNS:evil"], "not the name or address of a machine"),
        (["init", "new", "--robots", "r1", "--port", "99999"], "not a router's address"),
        (["init", "new", "--robots", "r1", "--days", "0"], "--days 0: expected 1 to 3650"),
        (["init", "none/such/new", "--robots", "r1", "--days", "9999"], "--days 9999"),
        (["add", "yards-1", "r1"], "r1: is a member already"),
        (["add", "yards-1", "../x"], "not a robot's name"),
        (["add", "yards-1", "r3", "--host", "x"], "--host x: is for the router"),
        (["add", "yards-1", "authority"], "authority: is a folder of every fleet"),
        (["revoke", "yards-1", "r9"], "r9: is no member of yards-1; members are operator, r1, r2, viewer, world"),
        (["check", "none"], "fleet: none/fleet.json cannot be read"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(
    arguments: list[str], says: str, made: Path, fogwatch: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(str(path) for path in made.parent.rglob("*"))
    assert fogwatch("fleet", *arguments) == 2
    said = capsys.readouterr().err
    assert says in said
    assert said.count("\n") == 1
    assert sorted(str(path) for path in made.parent.rglob("*")) == before, "nothing is left behind"


@pytest.mark.parametrize("text", ["{}", "[]", '{"fleet": "f", "token": "t", "port": 1, "hosts": [], "members": {}}'])
def test_a_damaged_file_is_refused(
    text: str, made: Path, fogwatch: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    (made / "fleet.json").write_text(text, encoding="utf-8")
    assert fogwatch("fleet", "check", str(made)) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_without_openssl_people_are_told(
    fogwatch: Command, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path / "nothing"))
    assert fogwatch("fleet", "init", "new", "--robots", "r1") == 2
    assert "the command openssl is missing; install it" in capsys.readouterr().err
    assert not Path("new").exists()
    assert not list(Path.cwd().iterdir())


def test_a_ros_robot_s_router_lets_in_its_agent_and_viewers(
    made: Path, fogwatch: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--namespace", "robot1", "--domain", "5", "--host", "192.0.2.20", "--place", "/etc/fogwatch/r1-router"]
    assert fogwatch("fleet", "robot-router", str(made), "r1", *options) == 0
    said = capsys.readouterr().out
    assert "ZENOH_ROUTER_CONFIG_URI=/etc/fogwatch/r1-router/zenoh.json5" in said
    assert f"--connect tls/192.0.2.20:7448 --credentials {made / 'r1'}" in said
    config = json.loads((made / "r1-router" / "zenoh.json5").read_text(encoding="utf-8"))
    assert config["listen"]["endpoints"] == ["tcp/127.0.0.1:7447", "tls/0.0.0.0:7448"]
    subjects = config["access_control"]["subjects"]
    assert [one["id"] for one in subjects] == ["this machine", "robot-r1.1", "viewer.1"]
    assert any("5/robot1/cmd_vel/*/*" in rule["key_exprs"] for rule in config["access_control"]["rules"])
    assert facts(made / "r1-router" / "certificate.pem").common_name == "r1-router.yards-1"
    assert fogwatch("fleet", "check", str(made)) == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["r9"], "r9: is no robot of yards-1"),
        (["world"], "world: is no robot of yards-1"),
        (["r1", "--namespace", "a b"], "--namespace 'a b': not a name in ROS"),
        (["r1", "--domain", "300"], "--domain 300: not a domain of ROS 2"),
        (["r1", "--format", "dds"], "--format 'dds': no such format; known are rmw_zenoh, rmw_zenoh-humble, bridge"),
        (["r1", "--command", "*"], "--command '*': not a name in ROS"),
        (["r1", "--host", "a/b"], "--host 'a/b': not the name or address of a machine"),
        (["r1", "--port", "99999"], "not a router's address"),
    ],
)
def test_a_ros_robot_s_router_needs_what_can_be(
    arguments: list[str], words: str, made: Path, fogwatch: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    assert fogwatch("fleet", "robot-router", str(made), *arguments) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line
