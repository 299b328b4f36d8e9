from pathlib import Path

import pytest

from patrol.errors import BadInput
from runtime.process.options import meeting, robot_named
from runtime.security.credentials import Credentials, RouterSecurity, as_json
from runtime.security.keys import fleet_keys
from runtime.security.private_files import write_private
from runtime.security.roles import VIEWER, WORLD_ROLE, Kind, Role, robot_role

ROUTER = "tcp/127.0.0.1:7447"


def file_of(role: Role, folder: Path) -> Path:
    file = folder / f"{role.user}.json"
    write_private(file, as_json(Credentials("f", ROUTER, role, "secret")))
    return file


def test_credentials_say_it_all_and_another_way_to_the_router_may_be_given(tmp_path: Path) -> None:
    met = meeting(file_of(robot_role("r1"), tmp_path), None, None, Kind.ROBOT)
    assert (met.router, met.keys) == (ROUTER, fleet_keys("f"))
    assert met.credentials is not None
    assert robot_named(None, met.credentials) == robot_named("r1", met.credentials) == "r1"
    met = meeting(file_of(VIEWER, tmp_path), "tcp/127.0.0.1:7000", "f", Kind.VIEWER, Kind.OPERATOR)
    assert met.router == "tcp/127.0.0.1:7000"


def test_without_credentials_both_are_needed() -> None:
    met = meeting(None, ROUTER, "f", Kind.ROBOT)
    assert (met.router, met.keys.fleet, met.credentials) == (ROUTER, "f", None)
    for router, fleet in ((None, None), (ROUTER, None), (None, "f")):
        with pytest.raises(BadInput, match="give --credentials FOLDER, or both --router LOCATOR and --fleet NAME"):
            meeting(None, router, fleet, Kind.ROBOT)
    with pytest.raises(BadInput, match="--robot: name the robot"):
        robot_named(None, None)


@pytest.mark.parametrize(
    ("role", "kind"), [(VIEWER, Kind.ROBOT), (robot_role("r1"), Kind.WORLD), (WORLD_ROLE, Kind.VIEWER)]
)
def test_credentials_of_another_kind_are_refused(role: Role, kind: Kind, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=f"of {role.user}; give those of a {kind}"):
        meeting(file_of(role, tmp_path), None, None, kind)


def test_what_contradicts_the_credentials_is_refused(tmp_path: Path) -> None:
    file = file_of(robot_role("r1"), tmp_path)
    with pytest.raises(BadInput, match="--fleet g: the credentials are for fleet f"):
        meeting(file, None, "g", Kind.ROBOT)
    with pytest.raises(BadInput, match="--robot r2: the credentials are r1's"):
        robot_named("r2", meeting(file, None, None, Kind.ROBOT).credentials)


@pytest.mark.parametrize(
    ("passwords", "listen", "says"),
    [
        (True, "tcp/0.0.0.0:7447", "passwords are for one machine"),
        (True, "tls/192.0.2.1:7447", "passwords are for one machine"),
        (False, "tcp/127.0.0.1:7447", "which need tls; write tls/127.0.0.1:7447"),
        (False, "ws/0.0.0.0:7447", "which need tls"),
    ],
)
def test_a_router_listens_only_where_members_are_safe(passwords: bool, listen: str, says: str, tmp_path: Path) -> None:
    security = RouterSecurity(fleet_keys("f"), listen, {"viewer": VIEWER}, tmp_path, passwords)
    with pytest.raises(BadInput, match=says):
        security.check_listen(listen)
    fine = "tcp/127.0.0.1:1" if passwords else "tls/0.0.0.0:1"
    assert security.check_listen(fine) == fine
