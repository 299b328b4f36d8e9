"""The secrets of a run in a folder of its own, and folders of launchers that are gone."""

import json
import os
import stat
import time
from pathlib import Path

import pytest

from fogwatch.launch import private
from fogwatch.launch.private import Secrets
from patrol.errors import BadInput
from runtime.security.credentials import USERS
from runtime.security.roles import OPERATOR, VIEWER, WORLD_ROLE, robot_role


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    root = tmp_path / "private"
    monkeypatch.setattr(private, "private_roots", lambda: [root])
    return root


def test_each_role_has_a_password_of_its_own_and_only_world_and_operators_the_token(root: Path) -> None:
    secrets = Secrets("fleet-1", ["r1", "r2"])
    secrets.for_members("tcp/127.0.0.1:7447")
    roles = [WORLD_ROLE, OPERATOR, VIEWER, robot_role("r1"), robot_role("r2")]
    told = [json.loads(secrets.of_role(role).read_text()) for role in roles]
    assert len({says["password"] for says in told}) == len(roles)
    assert [says.get("token") for says in told] == [secrets.token, secrets.token, None, None, None]
    router = secrets.for_router("tcp/127.0.0.1:7447")
    users = {user: word for user, _, word in (line.partition(":") for line in (router / USERS).read_text().split())}
    assert [users[role.user] for role in roles] == [says["password"] for says in told]
    for secret in (*users.values(), secrets.token, secrets.name):
        assert len(bytes.fromhex(secret)) == 16
    assert stat.S_IMODE(secrets.path.stat().st_mode) == stat.S_IMODE(router.stat().st_mode) == 0o700
    assert all(stat.S_IMODE(file.stat().st_mode) == 0o600 for file in secrets.path.rglob("*") if file.is_file())
    assert secrets.path == root / secrets.name
    secrets.remove()
    assert list(root.iterdir()) == []


def test_a_folder_that_was_cleared_comes_again_with_the_same_secrets(root: Path) -> None:
    secrets = Secrets("fleet-1", ["r1"])
    secrets.for_members("tcp/127.0.0.1:7447")
    before = secrets.of_role(VIEWER).read_bytes()
    for file in secrets.path.iterdir():
        file.unlink()
    assert secrets.of_role(VIEWER).read_bytes() == before
    secrets.of_role(VIEWER).unlink()
    assert secrets.of_role(VIEWER).read_bytes() == before
    assert secrets.path.parent == root
    secrets.remove()


@pytest.mark.parametrize(("age_s", "stays"), [(3000.0, True), (4000.0, False)])
def test_only_what_nobody_uses_any_more_is_swept_away(root: Path, age_s: float, stays: bool) -> None:
    alive = Secrets("fleet-1", ["r1"])
    gone = root / "gone"
    part = root / "part-other"
    for folder in (gone, part):
        folder.mkdir()
    (gone / "lock").touch()
    (gone / "viewer.json").touch()
    os.utime(part, (time.time() - age_s,) * 2)
    other = Secrets("fleet-2", ["r1"])
    expected = {alive.path, other.path} | ({part} if stays else set())
    assert set(root.iterdir()) == expected
    assert alive.name != other.name
    assert alive.token != other.token
    for secrets in (alive, other):
        secrets.remove()


def test_a_root_that_others_may_enter_is_not_used(root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    root.mkdir(mode=0o755)
    root.chmod(0o755)
    second = tmp_path / "second"
    monkeypatch.setattr(private, "private_roots", lambda: [root, second])
    secrets = Secrets("fleet-1", ["r1"])
    assert secrets.path.parent == second
    secrets.remove()
    second.chmod(0o755)
    with pytest.raises(BadInput, match=rf"neither {root} nor {second} is; remove one of them"):
        Secrets("fleet-1", ["r1"])


@pytest.mark.usefixtures("root")
def test_removing_twice_closes_no_file_of_anybody_else() -> None:
    secrets = Secrets("fleet-1", ["r1"])
    kept = [os.dup(number) for number in range(3)]
    secrets.remove()
    secrets.remove()
    still = [Path(f"/proc/self/fd/{number}").exists() for number in range(3)]
    for number, copy in enumerate(kept):
        os.dup2(copy, number)
        os.close(copy)
    assert still == [True] * 3
    assert not secrets.path.exists()
