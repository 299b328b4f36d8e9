"""``fogwatch control``: pause a running fleet, let it go on, and break it, from a shell.

Commands raise BadInput; the caller prints it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from patrol.errors import BadInput

EPILOG = (
    "Try: fogwatch control runs/yards-20260101-120000 fault '{kind: loss, rate: 0.5}'; then: heal op1. Others: pause; "
    "go; step 10; pace 2; pace max; intruder '[12, 30]'. Exit codes: 0 done, 1 refused, 2 bad input, 3 no answer."
)
WAIT_S = 15.0
"""How long a world may take to answer: until its tick is over, and what robots need to be started is done."""

REFUSED, UNANSWERED = 1, 3

VALUES = {
    "step": ("ticks", "10"),
    "pace": ("factor", "2, or max"),
    "fault": ("fault", "'{kind: loss, rate: 0.5}'"),
    "heal": ("id", "op1, as the answer to a fault names it"),
    "intruder": ("place", "'[12, 30]'"),
}
"""The field of the value of each control that has one, and an example."""


def control(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A running fleet's folder, or its control file.")],
    do: Annotated[str, typer.Argument(metavar="WHAT", help="pause, go, step, pace, fault, heal or intruder.")],
    value: Annotated[
        str | None, typer.Argument(metavar="[VALUE]", help="Ticks, factor, fault as YAML, its id, or [X, Y].")
    ] = None,
    wait: Annotated[float, typer.Option(metavar="S", help="How long to wait for an answer.")] = WAIT_S,
) -> int:
    """Ask something of a running fleet. It is done between two ticks and written to the journal and timeline.yaml."""
    asked = control_of(do, value)
    from patrol.net.access import read_access
    from patrol.net.keys import fleet_keys
    from patrol.net.link import LinkDown, open_link
    from patrol.scenario.controls import ASK, read_answer, read_control, request

    read_control(asked)
    access = read_access(run, str(run))
    try:
        link = open_link(access.router, wait)
    except LinkDown as down:
        raise BadInput(f"{run}: {down}; is the fleet still running?") from None
    try:
        payload = link.ask(fleet_keys(access.fleet).control(ASK), request(access.token, asked), wait)
    finally:
        link.close()
    if payload is None:
        typer.echo(f"fogwatch: no world of fleet {access.fleet} has answered within {wait:g} s", err=True)
        return UNANSWERED
    answer = read_answer(payload)
    typer.echo(answer.text, err=not answer.done)
    return 0 if answer.done else REFUSED


def control_of(do: str, value: str | None) -> dict[str, Any]:
    """The control that a command line's words mean; its values are not looked at yet."""
    from patrol.yaml_text import parse_yaml

    field, example = VALUES.get(do, (None, ""))
    if value is None:
        if field is not None and do != "step":
            raise BadInput(f"control {do}: give its {field} too, such as {example}")
        return {"do": do}
    if field is None:
        raise BadInput(f"control {do}: takes no value; leave {value!r} out")
    if do == "heal":
        return {"do": do, field: value}
    if do == "pace" and value == "max":
        return {"do": do, field: None}
    given = parse_yaml(value, f"control {do}")
    if do == "intruder" and isinstance(given, dict):
        return {"do": do, **given}
    return {"do": do, field: given}
