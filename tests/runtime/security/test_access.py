import json
import os
import re
import shutil
import stat
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from fogwatch.launch import private
from fogwatch.launch.private import Secrets
from patrol.errors import BadInput
from runtime.net.open_links import open_links
from runtime.process.options import meeting
from runtime.security.access import FILE, Access, credentials_at, is_private, read_access, write_pointer
from runtime.security.credentials import Credentials, as_json, read_credentials, read_router
from runtime.security.private_files import write_private
from runtime.security.roles import OPERATOR, VIEWER, WORLD_ROLE, Kind, robot_role
from tests.routers import write_access

ROUTER, AWAY = "tcp/127.0.0.1:7447", "tcp/192.0.2.1:7447"


@pytest.fixture(autouse=True)
def roots(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The place for private folders, apart from those of other runs."""
    runtime = tmp_path / "runtime"
    runtime.mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(runtime))
    return runtime / "fogwatch"


@pytest.fixture
def secrets() -> Iterator[Secrets]:
    secrets = Secrets("f", ["r1", "world"])
    secrets.for_router(ROUTER)
    secrets.for_members(ROUTER)
    yield secrets
    secrets.remove()


@pytest.fixture
def run(secrets: Secrets, tmp_path: Path) -> Path:
    folder = tmp_path / "run"
    folder.mkdir()
    write_pointer(folder / FILE, "f", ROUTER, secrets.name)
    return folder


def test_nobody_else_can_read_the_secrets_of_a_run(secrets: Secrets, roots: Path) -> None:
    assert secrets.path.parent == roots
    for path in (roots, secrets.path, *secrets.path.rglob("*")):
        assert not stat.S_IMODE(path.stat().st_mode) & 0o077, path
    assert len({path.read_bytes() for path in secrets.path.glob("*.json")}) == 5, "each role has its own"
    tokens = {path.stem: read_credentials(path, "test").token for path in secrets.path.glob("*.json")}
    assert {user for user, token in tokens.items() if token} == {"world", "operator"}
    path = secrets.path
    secrets.remove()
    assert not path.exists()


def test_a_robot_called_world_is_no_world(secrets: Secrets) -> None:
    robot, world = (
        read_credentials(path, "test") for path in (secrets.of_role(robot_role("world")), secrets.of_role(WORLD_ROLE))
    )
    assert (robot.role, world.role) == (robot_role("world"), WORLD_ROLE)
    assert robot.password != world.password
    assert robot.token is None


def test_a_run_s_folder_leads_to_the_secrets_and_holds_none(secrets: Secrets, run: Path) -> None:
    access = read_access(run / FILE, "test")
    assert access == read_access(run, "test")
    assert (access.fleet, access.router) == ("f", ROUTER)
    assert access.credentials is not None
    assert access.credentials.role == OPERATOR
    assert credentials_at(run, "test", VIEWER).role == VIEWER
    held = (run / FILE).read_text(encoding="utf-8")
    for file in secrets.path.glob("*.json"):
        one = read_credentials(file, "test")
        assert str(one.password) not in held
        assert str(one.password) not in repr(one)
        assert str(one.token) not in f"{held}{one!r}{access!r}"


def test_what_the_system_clears_while_a_run_goes_on_comes_back(secrets: Secrets, run: Path, roots: Path) -> None:
    before = read_credentials(secrets.of_role(robot_role("r1")), "test")
    secrets.of_role(WORLD_ROLE).unlink()
    assert read_credentials(secrets.of_role(WORLD_ROLE), "test").role == WORLD_ROLE
    shutil.rmtree(roots)
    assert read_credentials(secrets.of_role(robot_role("r1")), "test") == before
    assert (secrets.for_router(ROUTER) / "users.txt").is_file()
    shutil.rmtree(roots.parent)  # as when its user logs out
    try:
        assert read_credentials(secrets.of_role(robot_role("r1")), "test") == before
        assert not secrets.path.is_relative_to(roots)
        assert read_access(run, "test").token == secrets.token
        assert not (secrets.path.parent / f"part-{secrets.name}").exists()
    finally:
        secrets.remove()


def test_what_a_launcher_left_behind_goes_with_the_next_and_what_lives_stays(secrets: Secrets) -> None:
    program = "import os; from fogwatch.launch.private import Secrets\n"
    program += "print(Secrets('g', ['r1']).path, flush=True); os._exit(0)"
    dead = subprocess.run([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True, check=True)
    left = Path(dead.stdout.strip())
    assert left.is_dir()
    later = Secrets("h", ["r1"])
    assert not left.exists()
    assert secrets.path.exists()
    later.remove()


@pytest.mark.parametrize("name", ["..", ".", "/", "../../etc", "/etc", "x" * 32, "", 7, None, "a" * 15, "a" * 65])
def test_a_file_of_a_stranger_names_no_path(run: Path, name: object) -> None:
    (run / FILE).write_text(json.dumps({"fleet": "f", "router": ROUTER, "private": name}), encoding="utf-8")
    with pytest.raises(BadInput, match=r"expected 16 to 64 hex digits"):
        read_access(run, "test")


@pytest.mark.parametrize("change", [{"fleet": "g"}, {"router": "tcp/192.0.2.1:7447"}, {"fleet": None}, {"router": 3}])
def test_a_file_of_a_stranger_does_not_pass_off_one_run_as_another(run: Path, change: dict[str, object]) -> None:
    says = json.loads((run / FILE).read_text(encoding="utf-8"))
    (run / FILE).write_text(json.dumps({**says, **change}), encoding="utf-8")
    with pytest.raises(BadInput, match="names the secrets of another run, of fleet f"):
        read_access(run, "test")


def test_secrets_that_others_can_see_are_refused(secrets: Secrets, run: Path) -> None:
    secrets.path.chmod(0o755)
    with pytest.raises(BadInput, match="the secrets of its run are not here"):
        read_access(run, "test")
    secrets.path.chmod(0o700)
    (secrets.path / "operator.json").chmod(0o644)
    with pytest.raises(BadInput, match=r"others can read it \(mode 644\); run chmod 600"):
        read_access(run, "test")
    (secrets.path / "router" / "users.txt").chmod(0o640)
    with pytest.raises(BadInput, match="others can read it"):
        read_router(secrets.path / "router", "test")


def test_secrets_behind_a_link_or_of_a_run_that_is_over_are_not_there(secrets: Secrets, run: Path, roots: Path) -> None:
    moved = secrets.path.rename(roots / "elsewhere")
    secrets.path.symlink_to(moved)
    assert not is_private(secrets.path)
    with pytest.raises(BadInput, match="not here"):
        read_access(run, "test")
    secrets.path.unlink()
    moved.rename(secrets.path)
    secrets.remove()
    with pytest.raises(BadInput, match="the secrets of its run are not here; the run is over"):
        read_access(run, "test")


def test_what_a_launcher_left_that_was_killed_at_once_goes_when_it_is_old(roots: Path) -> None:
    Secrets("f", ["r1"]).remove()
    for name in ("part-old", "part-new"):
        (roots / name).mkdir(mode=0o700)
    long_ago = time.time() - 7200.0
    os.utime(roots / "part-old", (long_ago, long_ago))
    secrets = Secrets("f", ["r1"])
    assert {path.name for path in roots.iterdir()} == {"part-new", secrets.name}
    secrets.remove()


def test_who_waits_for_a_run_s_file_finds_all_of_it(secrets: Secrets, tmp_path: Path) -> None:
    found: list[bool] = []

    def look(*_: object) -> Callable[..., Any]:
        if (tmp_path / FILE).exists():
            read_access(tmp_path, "test")
        found.append((tmp_path / FILE).exists())
        return look

    before = sys.gettrace()
    sys.settrace(look)  # at every line that the writer executes
    try:
        write_pointer(tmp_path / FILE, "f", ROUTER, secrets.name)
    finally:
        sys.settrace(before)
    assert not found[0]
    assert found[-1]
    assert [path.name for path in tmp_path.iterdir() if path.is_file()] == [FILE]


def test_without_a_folder_of_one_s_own_there_is_no_run(roots: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    roots.mkdir(mode=0o755)
    roots.chmod(0o755)
    monkeypatch.setattr(private, "private_roots", lambda: [roots])
    with pytest.raises(BadInput, match="need a folder that is yours alone"):
        Secrets("f", ["r1"])


def test_a_file_made_by_hand_is_read_as_before(tmp_path: Path) -> None:
    write_access(tmp_path, ROUTER, "f", "0123456789abcdef")
    assert stat.S_IMODE((tmp_path / FILE).stat().st_mode) == 0o600
    for path in (tmp_path, tmp_path / FILE):
        assert read_access(path, "test") == Access("f", ROUTER, "0123456789abcdef")
    with pytest.raises(BadInput, match="holds no credentials"):
        credentials_at(tmp_path, "test", VIEWER)


def test_a_service_manager_s_folder_may_hold_secrets_that_an_access_list_lets_one_user_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "viewer.json"
    write_private(file, as_json(Credentials("f", ROUTER, VIEWER, "secret")))
    monkeypatch.setenv("CREDENTIALS_DIRECTORY", str(tmp_path))
    file.chmod(0o440)
    assert read_credentials(file, "test").role == VIEWER
    for mode in (0o444, 0o460):
        file.chmod(mode)
        with pytest.raises(BadInput, match="others can read it"):
            read_credentials(file, "test")
    file.chmod(0o440)
    monkeypatch.setenv("CREDENTIALS_DIRECTORY", str(tmp_path.parent))
    with pytest.raises(BadInput, match="others can read it"):
        read_credentials(file, "test")


MEMBER = "operator.json"


@pytest.mark.parametrize(
    ("file", "text", "says"),
    [
        (FILE, "{}", 'expected a JSON object with "fleet", "router" and "token", all strings'),
        (FILE, "[]", "expected a JSON object"),
        (FILE, "no", "expected a JSON object"),
        (FILE, "[" * 60_000, "expected a JSON object"),
        (FILE, " " * 2_000_000, "is larger than an access file may be, 64 KiB"),
        (FILE, json.dumps({"fleet": "f", "router": ROUTER, "token": "short"}), "the token has 5 characters"),
        (FILE, json.dumps({"fleet": "*", "router": ROUTER, "token": "x" * 16}), "not a name for a fleet"),
        (FILE, json.dumps({"fleet": "f", "router": AWAY, "token": "x" * 16}), "leads to a router on this machine only"),
        (FILE, as_json(Credentials("f", ROUTER, OPERATOR, "secret", "x" * 16)), "holds a member's credentials"),
        (MEMBER, json.dumps({"role": "root"}), "expected one of robot, world, viewer, operator"),
        (MEMBER, json.dumps({"role": "robot", "robot": "*"}), "not a robot's name"),
        (MEMBER, json.dumps({"role": "viewer", "password": 3}), "password: expected a text"),
        (MEMBER, json.dumps({"role": "viewer", "password": "x"}), 'expected "fleet"'),
        (MEMBER, as_json(Credentials("f", AWAY, OPERATOR, "secret", "x" * 16)), "passwords are for one machine"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_in_one_line(file: str, text: str, says: str, tmp_path: Path) -> None:
    write_private(tmp_path / file, text)
    with pytest.raises(BadInput, match=re.escape(says)) as caught:
        read_access(tmp_path if file == FILE else tmp_path / file, "test")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["journal", "scenario.yaml"])
def test_credentials_in_a_run_s_folder_are_not_looked_for(name: str, tmp_path: Path) -> None:
    write_private(tmp_path / "member.json", as_json(Credentials("f", ROUTER, OPERATOR, "secret", "x" * 16)))
    assert read_access(tmp_path, "test").token == "x" * 16
    (tmp_path / name).touch()
    with pytest.raises(BadInput, match=f"holds a member's credentials beside a run's {name}; if .* name their file"):
        read_access(tmp_path, "test")
    assert read_access(tmp_path / "member.json", "test").token == "x" * 16


def test_credentials_are_used_only_at_a_router_that_can_ask_for_them(tmp_path: Path) -> None:
    own = Credentials("f", "tls/192.0.2.1:7447", OPERATOR, token="x" * 16, folder=tmp_path)
    assert own.check_router("quic/192.0.2.1:7447", "--router") == "quic/192.0.2.1:7447"
    with pytest.raises(BadInput, match=f"--router {AWAY}: the members have certificates.* write tls/192.0.2.1:7447"):
        own.check_router(AWAY, "--router")
    with pytest.raises(BadInput, match=f"--radio {AWAY}: the members have certificates"):
        open_links(own.router, AWAY, 0.1, lambda _line: None, lambda: False, own)
    for name in ("key.pem", "authority.pem", "certificate.pem"):
        write_private(tmp_path / name, "")
    write_private(tmp_path / "member.json", as_json(own))
    with pytest.raises(BadInput, match=f"--router {AWAY}: the members have certificates"):
        meeting(tmp_path, AWAY, None, Kind.OPERATOR)


@pytest.mark.timeout(60)
def test_a_file_that_never_ends_is_no_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / FILE)
    (tmp_path / "zero").symlink_to("/dev/zero")
    for path in (tmp_path, tmp_path / "zero"):
        with pytest.raises(BadInput, match=r"is a (named pipe|device); give a regular file"):
            read_access(path, "test")
    with pytest.raises(BadInput, match=r"cannot be read: No such file or directory$"):
        read_access(tmp_path / "none", "test")


def test_a_viewer_s_credentials_give_no_right_to_control(tmp_path: Path) -> None:
    write_private(tmp_path / "viewer.json", as_json(Credentials("f", ROUTER, VIEWER, "secret")))
    with pytest.raises(BadInput, match="a viewer's credentials give no right to control the fleet"):
        read_access(tmp_path / "viewer.json", "test")
    assert credentials_at(tmp_path / "viewer.json", "test", OPERATOR).role == VIEWER
