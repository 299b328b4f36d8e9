"""The container file and the fleet of containers: they name what exists, and start what our programs can read."""

import json
import re
from argparse import Namespace
from pathlib import Path
from typing import Any

import pytest
import yaml

from fogwatch.fleets.folder import member_role
from patrol.scenario import load_scenario
from tests.deploy.command_lines import DEPLOY, options_in

ROOT = DEPLOY.parent
CONTAINERFILE = (DEPLOY / "Containerfile").read_text(encoding="utf-8").replace("\\\n", " ")
COMPOSE: dict[str, Any] = yaml.safe_load((DEPLOY / "compose.yaml").read_text(encoding="utf-8"))
SERVICES: dict[str, dict[str, Any]] = COMPOSE["services"]
ROBOTS = ("r1", "r2", "r3")
ROLES = {"router": "fogwatch.router", "world": "worldsim", "agent": "agent", "page": "monitor"}


def stage(role: str) -> dict[str, list[str]]:
    """The words that a role's image starts with, by instruction."""
    (text,) = re.findall(rf"^FROM base AS {role}\n((?:[A-Z].*\n)*)", CONTAINERFILE, re.MULTILINE)
    return {word: json.loads(rest) for word, rest in (line.split(" ", 1) for line in text.splitlines())}


def started(role: str, command: list[str] | None = None) -> tuple[str, Namespace]:
    """The module that a role's image starts and its options, by default or with a service's command."""
    python, *words = stage(role)["ENTRYPOINT"]
    assert (python, words[0]) == ("/opt/fogwatch/venv/bin/python", "-P")
    return options_in([*words[1:], *(command or stage(role)["CMD"])])


def options_of(service: str) -> Namespace:
    module, options = started(SERVICES[service]["build"]["target"], SERVICES[service].get("command"))
    assert module == ROLES[SERVICES[service]["build"]["target"]]
    return options


def mounts(service: str) -> dict[str, str]:
    return {where.split(":")[1]: where.split(":")[0] for where in SERVICES[service]["volumes"]}


@pytest.mark.parametrize("role", ROLES)
def test_the_image_of_a_role_starts_its_process_with_the_credentials_that_are_mounted(role: str) -> None:
    module, options = started(role)
    assert module == ROLES[role]
    assert (options.fleet if role == "router" else options.credentials) == Path("/fleet")


def test_a_router_starts_only_where_it_is_asked_for_and_nothing_depends_on_it() -> None:
    assert [name for name, service in SERVICES.items() if service.get("profiles") == ["router"]] == ["router"]
    assert not [name for name, service in SERVICES.items() if "depends_on" in service]


def test_one_image_has_all_commands_and_there_is_a_service_for_each_process_of_a_fleet() -> None:
    assert [*stage("fogwatch")["ENTRYPOINT"], *stage("fogwatch")["CMD"]][-3:] == ["-m", "fogwatch", "--help"]
    roles = {name: service["build"]["target"] for name, service in SERVICES.items()}
    assert roles == {"router": "router", "world": "world", "page": "page", **dict.fromkeys(ROBOTS, "agent")}


@pytest.mark.parametrize("name", SERVICES)
def test_a_service_has_its_own_credentials_alone_and_can_do_no_more_than_it_must(name: str) -> None:
    options = options_of(name)
    folder = options.fleet if name == "router" else options.credentials
    assert [where for where in mounts(name) if where.startswith("/fleet")] == [str(folder)]
    member = Path(mounts(name)[str(folder)])
    assert member.parent == Path("fleet")
    assert member.name == {"page": "viewer"}.get(name, name)
    if name != "router":
        assert member_role(member.name).name == member.name
    service = SERVICES[name]
    assert service["read_only"] is True
    assert service["cap_drop"] == ["ALL"]
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert all(port.startswith("127.0.0.1:") for port in service.get("ports", ()))
    named = {source for source in mounts(name).values() if not source.startswith(".")}
    assert named <= set(COMPOSE["volumes"])


def test_all_run_the_same_scenario_which_names_the_robots() -> None:
    for name in ("world", *ROBOTS):
        assert mounts(name)[str(options_of(name).scenario)] == "./scenario.yaml"
    scenario = load_scenario(DEPLOY / "scenario.yaml")
    assert tuple(spec.name for spec in scenario.roster) == ROBOTS
    assert scenario.factor is not None, "a container may be cut off, and lockstep would wait for it"


def test_the_container_file_copies_what_exists_and_runs_as_nobody_in_particular() -> None:
    lines = CONTAINERFILE.splitlines()
    copies = [line.split()[1:-1] for line in lines if line.startswith("COPY ") and "--from" not in line]
    copied = {word for words in copies for word in words}
    assert {
        "requirements-run.lock",
        "pyproject.toml",
        "patrol",
        "runtime",
        "agent",
        "worldsim",
        "monitor",
        "fogwatch",
    } <= copied
    assert not [name for name in copied if not (ROOT / name).exists()]
    assert len({line.split()[1] for line in lines if line.startswith("FROM ")} - {"base"}) == 1
    assert [line.split()[1] for line in lines if line.startswith("USER ")] == ["10001"]
    (locked,) = [line for line in lines if "--requirement requirements-run.lock" in line]
    assert "--require-hashes" in locked
    installed = [line for line in lines if "pip install" in line]
    assert len(installed) == 2
    assert all("--no-deps" in line for line in installed), "nothing comes that the lock does not name"
