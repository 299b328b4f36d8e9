"""The container file and the fleet of containers: they name what exists, and start what our programs can read."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from fogwatch.fleet_folder import member_role
from patrol.scenario import load_scenario
from tests.deploy.command_lines import DEPLOY, options_in

ROOT = DEPLOY.parent
COMPOSE: dict[str, Any] = yaml.safe_load((DEPLOY / "compose.yaml").read_text(encoding="utf-8"))
SERVICES: dict[str, dict[str, Any]] = COMPOSE["services"]
ROBOTS = ("r1", "r2", "r3")


def mounts(service: str) -> dict[str, str]:
    """What a service has mounted, by the place in its container."""
    return {where.split(":")[1]: where.split(":")[0] for where in SERVICES[service]["volumes"]}


def test_there_is_a_service_for_each_process_of_a_fleet() -> None:
    started = {name: options_in(["-m", *service["command"]])[0] for name, service in SERVICES.items()}
    assert started == {
        "router": "fogwatch.router",
        "world": "worldsim",
        "monitor": "monitor",
        **dict.fromkeys(ROBOTS, "agent"),
    }


@pytest.mark.parametrize("name", SERVICES)
def test_a_service_has_its_own_credentials_and_no_other_s(name: str) -> None:
    module, options = options_in(["-m", *SERVICES[name]["command"]])
    folder = Path(str(options.fleet if module == "fogwatch.router" else options.credentials))
    assert [where for where in mounts(name) if where.startswith("/fleet")] == [str(folder)]
    assert mounts(name)[str(folder)] == f"./fleet/{folder.name}"
    if name != "router":
        assert member_role(folder.name).name == {"monitor": "viewer"}.get(name, name)


@pytest.mark.parametrize("name", SERVICES)
def test_a_service_can_do_no_more_than_it_must(name: str) -> None:
    service = SERVICES[name]
    assert service["read_only"] is True
    assert service["cap_drop"] == ["ALL"]
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert all(port.startswith("127.0.0.1:") for port in service.get("ports", ()))
    named = {source for source in mounts(name).values() if not source.startswith(".")}
    assert named <= set(COMPOSE["volumes"])


def test_all_run_the_same_scenario_which_names_the_robots() -> None:
    for name in ("world", *ROBOTS):
        _, options = options_in(["-m", *SERVICES[name]["command"]])
        assert mounts(name)[str(options.scenario)] == "./scenario.yaml"
    scenario = load_scenario(DEPLOY / "scenario.yaml")
    assert tuple(spec.name for spec in scenario.roster) == ROBOTS
    assert scenario.factor is not None, "a container may be cut off, and lockstep would wait for it"


def test_the_container_file_copies_what_exists_and_runs_as_nobody_in_particular() -> None:
    lines = (DEPLOY / "Containerfile").read_text(encoding="utf-8").replace("\\\n", " ").splitlines()
    copied = [
        word for line in lines if line.startswith("COPY ") and "--from" not in line for word in line.split()[1:-1]
    ]
    assert {"requirements-run.lock", "pyproject.toml", "patrol", "agent", "worldsim", "monitor", "fogwatch"} <= set(
        copied
    )
    assert not [name for name in copied if not (ROOT / name).exists()]
    assert sum(line.startswith("FROM ") for line in lines) == 2
    users = [line.split()[1] for line in lines if line.startswith("USER ")]
    assert users == ["10001"]
    (locked,) = [line for line in lines if "--requirement requirements-run.lock" in line]
    assert "--require-hashes" in locked
    installed = [line for line in lines if "pip install" in line]
    assert len(installed) == 2
    assert all("--no-deps" in line for line in installed), "nothing comes that the lock does not name"
    started = re.findall(r"ENTRYPOINT \[(.*)\]", "\n".join(lines))
    assert started == ['"/opt/fogwatch/venv/bin/python", "-P", "-m"']
