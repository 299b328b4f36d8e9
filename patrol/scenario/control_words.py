"""An operator's controls in words, for live pages, replays, reports and recordings alike."""

from __future__ import annotations

from dataclasses import replace

from patrol.errors import BadInput, in_flow
from patrol.journal.records import Event
from patrol.scenario.controls import OPERATOR, AddFault, AddIntruder, Heal, Pace, Step, SwitchZone, control_in


def worded(event: Event) -> Event:
    """Word an event's detail for people."""
    return replace(event, detail=described(event)) if event.kind == OPERATOR else event


def described(event: Event) -> str:
    """Describe an event's detail in one line, such as "loss: rate 0.5, who r1" or "ends op1"."""
    if event.kind != OPERATOR:
        return event.detail
    try:
        control = control_in(event)
    except BadInput:
        return event.detail
    match control:
        case AddFault():
            fault = dict(control.fault)
            values = [f"{name} {in_flow(value)}" for name, value in fault.items() if name != "kind"]
            values += [f"instead of {control.instead}"] if control.instead else []
            text = f"{fault.get('kind')}{': ' if values else ''}{', '.join(values)}"
        case Heal():
            text = f"ends {control.id}"
        case AddIntruder():
            text = f"places an intruder at ({control.place[0]:g}, {control.place[1]:g})"
            text += "" if control.stay is None else f" for {control.stay:g} s"
        case SwitchZone():
            how = f"switches {control.name} {'on' if control.on else 'off'}"
            text = how if control.weight is None else f"lets {control.name} count {control.weight:g} times"
        case Pace():
            text = "as fast as it goes" if control.factor is None else f"pace {control.factor:g}"
        case Step():
            text = f"step {control.ticks}"
        case _:
            text = control.do
    return text
