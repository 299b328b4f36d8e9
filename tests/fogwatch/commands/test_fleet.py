"""``fogwatch fleet``: members made, added, revoked and checked, and what is refused."""

import json
import os
import shutil
import stat
import subprocess
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from fogwatch.fleets import certificates
from fogwatch.fleets.certificates import facts, issue, make_authority
from fogwatch.fleets.folder import checked_hosts, fleet_to_change, make_fleet, open_fleet_folder
from patrol.errors import BadInput
from runtime.security.credentials import read_credentials, read_router
from runtime.security.roles import Role, robot_role
from tests.fogwatch.conftest import Refused, Shell
from tests.routers import needs_openssl

pytestmark = needs_openssl


@pytest.fixture(scope="module")
def template(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fleets") / "yards-1"
    make_fleet(folder, "yards-1", ["r1", "r2"], ["192.0.2.10", "hub.example"], 7447, 30)
    return folder


@pytest.fixture
def made(template: Path, shell: Shell) -> Path:  # noqa: ARG001 - the command's folder is the current one
    return Path(shutil.copytree(template, "yards-1")).absolute()


def checked(fleet: str | Path, shell: Shell, code: int = 0) -> Mapping[str, str]:
    """The words of ``fleet check``, by member."""
    said = shell("fleet", "check", fleet)
    assert said.code == code, said
    return dict(line.split(": ", 1) for line in said.out.splitlines())


def paths_in(folder: Path) -> list[str]:
    return sorted(map(str, folder.rglob("*")))


def test_a_fleet_has_a_folder_for_each_member_that_its_owner_alone_can_read(shell: Shell) -> None:
    said = shell("fleet", "init", "yards-1", "--robots", "r1, r2", "--host", "192.0.2.10")
    assert said.code == 0
    assert "router at tls/192.0.2.10:7447" in said.out
    assert "operator, r1, r2, router, viewer, world" in said.out
    folder = Path("yards-1")
    for path in (folder, *(path for path in folder.rglob("*") if path.name != "authority.pem")):
        assert not stat.S_IMODE(path.stat().st_mode) & 0o077, path
    assert (folder / ".gitignore").read_text(encoding="utf-8") == "*\n"
    token = json.loads((folder / "fleet.json").read_text(encoding="utf-8"))["token"]
    members = {"r1", "r2", "world", "viewer", "operator"}
    for name in members:
        credentials = read_credentials(folder / name, "test")
        assert (credentials.fleet, credentials.router) == ("yards-1", "tls/192.0.2.10:7447")
        assert credentials.role.name == name
        assert credentials.token == (token if name in ("world", "operator") else None)
        assert facts(folder / name / "certificate.pem").common_name == f"{credentials.role.user}.1"
    assert read_router(folder, "test") == read_router(folder / "router", "test")
    assert read_router(folder, "test").listen == "tls/0.0.0.0:7447"
    assert {role.name for role in read_router(folder, "test").members.values()} == members
    checked("yards-1", shell)


def test_without_a_host_the_router_is_for_this_machine_alone(shell: Shell) -> None:
    assert shell("fleet", "init", "here", "--robots", "r1", "--name", "other", "--port", "7000").code == 0
    assert read_router(Path("here"), "test").listen == "tls/127.0.0.1:7000"
    assert read_credentials(Path("here/r1"), "test").fleet == "other"


def test_members_come_and_go(made: Path, shell: Shell) -> None:
    def change(*words: str) -> dict[str, Role]:
        said = shell("fleet", words[0], made, *words[1:])
        assert (said.code, said.out.count("restart the router")) == (0, 1)
        return dict(read_router(made, "test").members)

    assert change("add", "r3")["robot-r3.1"] == robot_role("r3")
    assert "robot-r2.1" not in change("revoke", "r2")
    assert not (made / "r2").exists()
    known = change("add", "r2", "--days", "5")
    assert "robot-r2.1" not in known, "the certificate that was revoked stays so"
    assert known["robot-r2.2"] == robot_role("r2")
    assert facts(made / "r2" / "certificate.pem").common_name == "robot-r2.2"
    checked(made, shell)


def test_a_revoked_operator_s_token_is_worth_nothing(made: Path, shell: Shell) -> None:
    before = read_credentials(made / "operator", "test").token
    assert "copy" in shell("fleet", "revoke", made, "operator").out.partition("new token")[2]
    assert shell("fleet", "add", made, "operator").code == 0
    after = {read_credentials(made / name, "test").token for name in ("world", "operator")}
    assert len(after) == 1
    assert before not in after


def test_a_new_token_reaches_a_world_whose_folder_was_moved_away(made: Path, shell: Shell) -> None:
    moved = (made / "world").rename(made.parent / "its machine")
    said = shell("fleet", "revoke", made, "operator").out
    assert f"copy {made / 'world'} to its machine again, and restart the world" in said
    new = read_credentials(made / "world", "test")
    assert new.token == json.loads((made / "fleet.json").read_text(encoding="utf-8"))["token"]
    assert new.token != read_credentials(moved, "test").token
    checked(made, shell)
    said = shell("fleet", "revoke", made, "world").out
    assert "copy" not in said.partition("world: revoked")[2].partition("restart the router")[2]


def test_a_stolen_router_is_no_member_that_can_be_revoked(made: Path, refused: Refused) -> None:
    said = refused("fleet", "revoke", made, "router")
    assert "router: cannot be revoked" in said
    assert "make a new fleet" in said


def test_the_router_moves_and_is_still_believed_at_its_earlier_addresses(made: Path, shell: Shell) -> None:
    certificate = (made / "router" / "certificate.pem").read_bytes()
    shutil.rmtree(made / "r2")
    said = shell("fleet", "add", made, "router", "--host", "198.51.100.7").out
    assert "the fleet meets at tls/198.51.100.7:7447 from now on: copy all folders" in said
    assert "r2: its folder is not here; revoke and add it" in said
    assert read_credentials(made / "r1", "test").router == "tls/198.51.100.7:7447"
    assert (made / "router" / "certificate.pem").read_bytes() != certificate
    assert open_fleet_folder(made).hosts == ["198.51.100.7", "192.0.2.10", "hub.example"]
    again = shell("fleet", "add", made, "router")
    assert again.code == 0
    assert "from now on" not in again.out
    checked(made, shell)


@pytest.mark.parametrize("end", [KeyboardInterrupt(), BadInput("openssl x509 failed")])
def test_a_member_that_could_not_be_added_leaves_nothing(
    end: BaseException, made: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def halfway(_authority: Path, folder: Path, *_: object, **__: object) -> None:
        (folder / "key.pem").touch()
        raise end

    before = paths_in(made)
    with monkeypatch.context() as broken:
        broken.setattr("fogwatch.fleets.folder.issue", halfway)
        with pytest.raises(type(end)):
            open_fleet_folder(made).add(robot_role("r3"), 1)
    assert paths_in(made) == before
    open_fleet_folder(made).add(robot_role("r3"), 1)


def test_a_certificate_that_could_not_be_signed_leaves_the_old_key(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = subprocess.run

    def unsigned(command: list[str], **how: Any) -> subprocess.CompletedProcess[str]:
        return run(["openssl", "x509", "-no-such-option"] if "-req" in command else command, **how)

    before = {path: path.read_bytes() for path in (made / "router").iterdir()}
    monkeypatch.setattr(subprocess, "run", unsigned)
    with pytest.raises(BadInput, match="openssl x509 failed"):
        open_fleet_folder(made).renew_router(1)
    assert {path: path.read_bytes() for path in (made / "router").iterdir()} == before


def test_members_that_are_added_at_once_are_all_members(made: Path) -> None:
    names = [f"n{number}" for number in range(6)]

    def add(name: str) -> None:
        with fleet_to_change(made) as fleet:
            fleet.add(robot_role(name), 1)

    with ThreadPoolExecutor(len(names)) as pool:
        list(pool.map(add, names))
    assert {f"robot-{name}" for name in names} <= set(open_fleet_folder(made).members)


def test_a_command_that_goes_on_for_ever_is_reported(
    made: Path, refused: Refused, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fogwatch.fleets.folder.LOCK_S", 0.0)
    with fleet_to_change(made):
        assert "another command is changing it" in refused("fleet", "revoke", made, "r1")
    assert (made / "r1").is_dir()


def test_no_certificate_outlives_the_authority(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(certificates, "AUTHORITY_DAYS", 3)
    assert shell("fleet", "init", "short", "--robots", "r1", "--days", "3650").code == 0
    authority = facts(Path("short/authority/certificate.pem")).ends_s
    for name in ("r1", "router", "world"):
        assert facts(Path("short", name, "certificate.pem")).ends_s <= authority
    assert checked("short", shell)["authority"].startswith("valid until ")
    make_authority(Path("ended"), "f")
    words = ("x509", "-in", "ended/certificate.pem", "-signkey", "ended/key.pem", "-days", "0")
    subprocess.run(["openssl", *words, "-out", "ended/again.pem"], check=True, capture_output=True)
    Path("ended/again.pem").replace("ended/certificate.pem")
    with pytest.raises(BadInput, match="the authority has expired, or does so within a day; make a new fleet"):
        issue(Path("ended"), Path("short/r1"), "r1.1", 1)


@pytest.mark.parametrize(
    ("host", "router"),
    [
        ("[2001:db8::1]", "tls/[2001:db8::1]:7447"),
        ("2001:DB8:0::1", "tls/[2001:db8::1]:7447"),
        ("hub-2.example", "tls/hub-2.example:7447"),
        ("192.168.1.10", "tls/192.168.1.10:7447"),
    ],
)
def test_hosts_that_can_work_become_locators(host: str, router: str, template: Path) -> None:
    fleet = open_fleet_folder(template)
    fleet.hosts = checked_hosts([host])
    assert fleet.router == router
    assert fleet.listen == ("tls/[::]:7447" if "::" in router else "tls/0.0.0.0:7447")


def test_a_check_finds_what_is_wrong(made: Path, shell: Shell) -> None:
    fleet = open_fleet_folder(made)
    fleet.add(robot_role("late"), days=-1)
    (made / "r1" / "key.pem").chmod(0o644)
    shutil.copyfile(made / "world" / "key.pem", made / "r2" / "key.pem")
    make_authority(made.parent / "other", "other")
    issue(made.parent / "other", made / "world", "world.1", 1)
    issue(made / "authority", made / "viewer", "viewer.7", 1)
    shutil.rmtree(made / "operator")
    said = checked(made, shell, code=1)
    assert said["router"].startswith("valid until")
    assert "others can read it (mode 644)" in said["r1"]
    assert said["r2"] == "its certificate does not belong to the key beside it"
    assert said["world"] == "its certificate is not signed by the fleet's authority"
    assert said["viewer"] == "its certificate is for viewer.7, and the fleet's member is viewer.1"
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
        (["init", "new", "--robots", "r1", "--host", "192.168.1.10:7447"], "write 192.168.1.10 here, and --port 7447"),
        (["init", "new", "--robots", "r1", "--host", "[::1]:7447"], "write [::1] here, and --port 7447"),
        (["init", "new", "--robots", "r1=10.0.0.1:7447"], "--robots r1= '10.0.0.1:7447': holds a port; write 10.0.0.1"),
        (["init", "new", "--robots", "r1="], "--robots r1= '': not the name or address of a machine"),
        (["init", "new", "--robots", "r1", "--host", "a:b"], "--host 'a:b': not the name or address of a machine"),
        (["init", "new", "--robots", "r1", "--host", "300.1.1.1"], "not the name or address of a machine"),
        (["init", "new", "--robots", "r1", "--host", "0.0.0.0"], "--host 0.0.0.0: is no machine's own address"),
        (["init", "new", "--robots", "r1", "--host", "::"], "--host ::: is no machine's own address"),
        (["init", "new", "--robots", "r1", "--host", "224.0.0.1"], "is no machine's own address"),
        (["init", "new", "--robots", "r1", "--host", "255.255.255.255"], "is no machine's own address"),
        (["init", "new", "--robots", "r1=255.255.255.255"], "is no machine's own address"),
        (["init", "new", "--robots", "r1", "--host", "ff02::1"], "is no machine's own address"),
        (["init", "new", "--robots", "r1", "--host", "0xe0000001"], "not the name or address of a machine"),
        (["init", "new", "--robots", "r1", "--host", "fe80::1%eth0"], "leave %eth0 out"),
        (["init", "new", "--robots", "r1", "--port", "99999"], "--port 99999: ports go from 1 to 65535"),
        (["init", "new", "--robots", "r1", "--port", "0"], "--port 0: ports go from 1 to 65535"),
        (["init", ".", "--robots", "r1"], ".: exists already"),
        (["init", "my fleet", "--robots", "r1"], "--name 'my fleet': not a name for a fleet"),
        (["init", "new", "--robots", "r1", "--days", "0"], "--days 0: expected 1 to 3650"),
        (["init", "none/such/new", "--robots", "r1", "--days", "9999"], "--days 9999"),
        (["add", "yards-1", "r1"], "r1: is a member already"),
        (["add", "yards-1", "../x"], "not a robot's name"),
        (["add", "yards-1", "r3", "--host", "x"], "--host x: is for the router"),
        (["add", "yards-1", "authority"], "authority: is a folder of every fleet"),
        (["revoke", "yards-1", "r9"], "r9: is no member of yards-1; members are operator, r1, r2, viewer, world"),
        (["check", "none"], "no fleet's folder, because it holds no fleet.json; make one with: fogwatch fleet init"),
        (["add", "none", "r3"], "none: no fleet's folder"),
        (["robot-router", "yards-1", "r9"], "r9: is no robot of yards-1"),
        (["robot-router", "yards-1", "world"], "world: is no robot of yards-1"),
        (["robot-router", "yards-1", "r1", "--namespace", "a b"], "--namespace 'a b': not a name in ROS"),
        (["robot-router", "yards-1", "r1", "--domain", "300"], "--domain 300: not a domain of ROS 2"),
        (
            ["robot-router", "yards-1", "r1", "--format", "dds"],
            "no such format; known are rmw_zenoh, rmw_zenoh-humble, b",
        ),
        (["robot-router", "yards-1", "r1", "--command", "*"], "--command '*': not a name in ROS"),
        (["robot-router", "yards-1", "r1", "--host", "a/b"], "--host 'a/b': not the name or address of a machine"),
        (["robot-router", "yards-1", "r1", "--port", "99999"], "not a router's address"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(arguments: list[str], says: str, made: Path, refused: Refused) -> None:
    before = paths_in(made.parent)
    assert says in refused("fleet", *arguments)
    assert paths_in(made.parent) == before, "nothing is left behind"


@pytest.mark.parametrize("text", ["{}", "[]", '{"fleet": "f", "token": "t", "port": 1, "hosts": [], "members": {}}'])
def test_a_damaged_file_is_refused(text: str, made: Path, refused: Refused) -> None:
    (made / "fleet.json").write_text(text, encoding="utf-8")
    refused("fleet", "check", made)


def test_a_file_without_an_end_is_not_given_to_openssl(made: Path, shell: Shell, refused: Refused) -> None:
    (made / "r1" / "certificate.pem").unlink()
    os.mkfifo(made / "r1" / "certificate.pem")
    (made / "r2" / "certificate.pem").unlink()
    (made / "r2" / "certificate.pem").symlink_to("/dev/zero")
    said = checked(made, shell, code=1)
    assert "is a named pipe; give a regular file" in said["r1"]
    assert "is a device; give a regular file" in said["r2"]
    for name in ("certificate.pem", "key.pem"):
        (made / "authority" / name).unlink()
        os.mkfifo(made / "authority" / name)
        assert f"{name} cannot be read: is a named pipe" in refused("fleet", "add", made, "r3")
    assert not (made / "r3").exists()


def test_a_link_in_place_of_a_member_s_folder_is_not_followed(made: Path, shell: Shell, refused: Refused) -> None:
    (made / "r3").symlink_to("nowhere")
    assert "r3: is there already" in refused("fleet", "add", made, "r3")
    (made / "r1").rename(made.parent / "moved")
    (made / "r1").symlink_to(made.parent / "moved")
    assert shell("fleet", "revoke", made, "r1").code == 0
    assert not (made / "r1").is_symlink()
    assert (made.parent / "moved" / "key.pem").exists()


@pytest.mark.parametrize("words", [("add", "router"), ("robot-router", "r1")])
def test_a_folder_that_cannot_be_changed_is_named(words: tuple[str, str], made: Path, refused: Refused) -> None:
    shutil.rmtree(made / "router")
    for name in ("router", "r1-router"):
        (made / name).symlink_to("nowhere")
    assert "router: cannot be written (File exists); make " in refused("fleet", words[0], made, words[1])


def test_without_openssl_people_are_told(refused: Refused, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path / "nothing"))
    assert "the command openssl is missing; install it" in refused("fleet", "init", "new", "--robots", "r1")
    assert not list(Path.cwd().iterdir())


def test_a_ros_robot_s_router_lets_in_its_agent_and_viewers(made: Path, shell: Shell) -> None:
    options = ["--namespace", "robot1", "--domain", "5", "--host", "192.0.2.20", "--place", "/etc/fogwatch/r1-router"]
    said = shell("fleet", "robot-router", made, "r1", *options).out
    assert "ZENOH_ROUTER_CONFIG_URI=/etc/fogwatch/r1-router/zenoh.json5" in said
    assert f"--connect tls/192.0.2.20:7448 --credentials {made / 'r1'}" in said
    config = json.loads((made / "r1-router" / "zenoh.json5").read_text(encoding="utf-8"))
    assert config["listen"]["endpoints"] == ["tcp/127.0.0.1:7447", "tls/0.0.0.0:7448"]
    subjects = config["access_control"]["subjects"]
    assert [one["id"] for one in subjects] == ["this machine", "robot-r1.1", "viewer.1"]
    assert any("5/robot1/cmd_vel/*/*" in rule["key_exprs"] for rule in config["access_control"]["rules"])
    assert facts(made / "r1-router" / "certificate.pem").common_name == "r1-router.yards-1"
    checked(made, shell)
