"""``fogwatch control``: pause a running fleet, resume it, close and open doors and inject faults, from a shell.

Commands raise BadInput; the caller prints it.
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fogwatch.cli.command_help import command
from fogwatch.cli.ending import complain, say
from fogwatch.cli.options import argument, option
from patrol.errors import BadInput, did_you_mean, quoted

if TYPE_CHECKING:
    from runtime.net.link import Link
    from runtime.security.credentials import Credentials

ROBOTS_S = 5.0
"""How long robots may take to answer an order, s, unless --wait says less. A robot answers when it stands, or when it
has not come to rest for 3 s."""
SIMULATED_S = 1.0
"""The same where a world simulates the fleet, whose robots take no orders."""
WAIT_S = 15.0
"""How long a world may take to answer: it ends its tick first, and starts the robots that the request needs."""

OF_ROBOTS = ("stop", "release")
"""What robots do that no world simulates."""

FOR_A_ZONE = "control zone: give its name, and whether it is on or its weight, such as '{name: vault, on: false}'"

REFUSED, UNANSWERED = 1, 3

_RUN = "Folder of a running fleet, an operator's credentials, or to stop robots a router's address."
_WHAT = "pause, go, step, pace, fault, heal, close, open, intruder or zone; stop or release robots."
_VALUE = (
    "step: ticks; pace: factor of real time, or max; fault: the fault as YAML; heal: the id of a fault or an intruder, "
    "as the answer to it says; close, open: the name of a closure; intruder: its place as [X, Y] in m, or {place: "
    "[X, Y], for: S}; zone: {name: NAME, on: true or false}, or {name: NAME, weight: W}; stop, release: the robot "
    "(default: all robots)."
)


@command(
    examples=[
        "fogwatch control RUN pause",
        "fogwatch control RUN step 10",
        "fogwatch control RUN go",
        "fogwatch control RUN pace 2",
        "fogwatch control RUN pace max",
        "fogwatch control RUN fault '{kind: loss, rate: 0.5}'",
        "fogwatch control RUN heal op1",
        "fogwatch control RUN close door",
        "fogwatch control RUN open door",
        "fogwatch control RUN intruder '[12, 30]'",
        "fogwatch control RUN heal intruder1",
        "fogwatch control RUN zone '{name: vault, on: false}'",
        "fogwatch control RUN zone '{name: vault, weight: 5}'",
        "fogwatch control yards-1/operator pause",
        "fogwatch control yards-1/operator stop robot1",
        "fogwatch control tcp/192.168.1.20:7447 stop --fleet patrol",
    ],
    exit_codes="0 done, 1 refused, or a robot may still drive, 2 bad input, 3 no answer, or not from every robot",
)
def control(
    run: Annotated[Path, argument("RUN", _RUN)],
    do: Annotated[str, argument("WHAT", _WHAT)],
    value: Annotated[str | None, argument("[VALUE]", _VALUE)] = None,
    wait: Annotated[float, option("S", "How long to wait for an answer, in s.")] = WAIT_S,
    fleet: Annotated[str | None, option("NAME", "The fleet's name, where RUN is a router's address.")] = None,
) -> int:
    """Control a running fleet: pause, step or pace it, inject and heal faults, close and open doors, add an intruder.

    The request is carried out between two ticks and recorded in the journal and in timeline.yaml. RUN stands for the
    run's folder, such as runs/yards-20260101-120000.

    close and open hold a closure of the scenario closed or open, whatever its own times and rates say, until the other
    word replaces them or heal ends them, with the id in the answer. A closure closes once all robots are clear of it.

    Robots that no world simulates, such as ROS 2 robots, can be told to stop, and to be released. They answer
    themselves, when they stand; one that is stopped stands until the same operator
    releases it, also when its agent is started again meanwhile.
    """
    if do in OF_ROBOTS:
        return _stop_robots(run, do, value, fleet, wait)
    if fleet is not None:
        raise BadInput(f"--fleet {fleet}: is for stop and release; leave the option out")
    request = control_of(do, value)
    from patrol.scenario.controls import read_control
    from runtime.messages.stop_orders import robots_there
    from runtime.security.access import read_access
    from runtime.security.control_auth import ControlClient, Unanswered
    from runtime.security.keys import WORLD, fleet_keys

    read_control(request)
    access = read_access(run, "control")
    keys = fleet_keys(access.fleet)
    link = _open_link(run, access.router, wait, access.credentials)
    try:
        if not link.sees(keys.alive(WORLD)) and robots_there(link, keys):
            why = f"{do}: fleet {keys.fleet} has no world, and its robots obey stop and release alone"
            complain(f"{why}, as in: fogwatch control {run} stop")
            return UNANSWERED
        client = ControlClient(link, keys, access.token, time.monotonic, os.urandom)
        operated = client.ask(request, wait)
    except Unanswered as unanswered:
        revocable = access.credentials is not None and access.credentials.folder is not None
        complain(f"{unanswered}{', or this operator was revoked' if revocable else ''}")
        return UNANSWERED
    finally:
        link.close()
    if operated.warning:
        complain(operated.warning)
    typer.echo(operated.answer.text, err=not operated.answer.done)
    return 0 if operated.answer.done else REFUSED


def _open_link(run: Path, router: str, wait_s: float, credentials: Credentials | None) -> Link:
    from runtime.net.link import LinkDown, open_link

    try:
        return open_link(router, wait_s, credentials=credentials)
    except LinkDown as down:
        raise BadInput(f"{run}: {down}; is the fleet still running?") from None


def _stop_robots(run: Path, do: str, robot: str | None, fleet: str | None, wait: float) -> int:
    """Ask robots to stop, or release them; the exit code."""
    from runtime.messages.stop_orders import Order, ask_robots, robots_to_ask
    from runtime.security.access import read_access
    from runtime.security.keys import WORLD, check_locator, fleet_keys
    from runtime.security.roles import robot_role

    credentials = None
    if fleet is not None:
        router, keys = check_locator(str(run), "RUN"), fleet_keys(fleet)
    else:
        access = read_access(run, str(run))
        router, keys, credentials = access.router, fleet_keys(access.fleet), access.credentials
    whom = None if robot is None else robot_role(robot).robot
    link = _open_link(run, router, wait, credentials)
    unsure = False
    try:
        robots = robots_to_ask(link, keys) if whom is None else [whom]
        simulated = link.sees(keys.alive(WORLD))
        silent = set(robots)
        limit_s = min(wait, SIMULATED_S if simulated else ROBOTS_S)
        for name, outcome in ask_robots(link, keys, robots, Order(do), limit_s):
            say(f"{name}: {outcome.text}", err=not outcome.done)
            silent.discard(name)
            unsure = unsure or not outcome.done
    finally:
        link.close()
    if silent or not robots:
        who = f"no answer from {', '.join(sorted(silent))}" if silent else "no robot is there"
        remedy = "; use another way to stop what is left" if do == "stop" else ""
        if silent and simulated:
            hold, kind = ("pause", "pause") if do == "stop" else ("go", "resume")
            target = run if fleet is None else "RUN"  # a router's address gives no right to control a world
            remedy = (
                f"; a world simulates this fleet, and its robots take no orders: control the world with "
                f"fogwatch control {target} {hold}, or the robots' processes with "
                f"fogwatch control {target} fault '{{kind: {kind}, who: {robot or 'all'}}}'"
            )
        complain(f"fleet {keys.fleet}: {who}{remedy}")
        return UNANSWERED
    return REFUSED if unsure else 0


def control_of(do: str, value: str | None) -> dict[str, Any]:
    """Return the control that the words of a command line stand for; its value is not checked yet.

    It is as `patrol.scenario.controls.read_control` takes it. `do` is a word such as ``step``.
    """
    from patrol.faults.kinds import kinds_acting_on
    from patrol.files.yaml_text import parse_yaml
    from patrol.scenario.controls import CONTROLS, EXAMPLES

    of_ground = kinds_acting_on("ground")  # words of their own on the command line
    if do not in (choices := (*CONTROLS, *of_ground)):
        raise BadInput(f"control: {quoted(do)}: {did_you_mean(do, (*choices, *OF_ROBOTS))}")
    if do in of_ground:
        if value is None:
            raise BadInput(f"control {do}: give the name of a closure too, such as door")
        return {"do": "fault", "fault": {"kind": do, "closure": value}}
    field, example = next(iter(EXAMPLES.get(do, {}).items()), (None, ""))
    if value is None:
        if do == "zone":
            raise BadInput(FOR_A_ZONE)
        if field is not None and do != "step":
            example = f"'{example}'" if example[0] in "[{" else example
            raise BadInput(f"control {do}: give its {field} too, such as {example}")
        return {"do": do}
    if field is None:
        raise BadInput(f"control {do}: takes no value; leave {value!r} out")
    if do == "heal":
        return {"do": do, field: value}
    if do == "pace" and value == "max":
        return {"do": do, field: None}
    parsed = parse_yaml(value, f"control {do}")
    if do in {"intruder", "zone"} and isinstance(parsed, dict):
        return {"do": do, **parsed}
    if do == "zone":
        raise BadInput(FOR_A_ZONE)
    return {"do": do, field: parsed}
