"""An operator's controls of a running fleet, and the changes that they make to its scenario.

    {"do": "pause"}  {"do": "go"}  {"do": "step", "ticks": 1}       hold the ticks, let them go on, do a few of them
    {"do": "pace", "factor": 2.0}                                   of real time; null: as fast as it goes
    {"do": "fault", "fault": {...}, "instead": "op1"}               an entry as in a scenario's faults
    {"do": "fault", "fault": {"kind": "close", "closure": "gate"}}  a closure is closed until this is healed
    {"do": "heal", "id": "op1"}                                     a fault that lasts ends now
    {"do": "intruder", "place": [x, y], "for": 30.0}                an intruder stands there from now on
    {"do": "heal", "id": "intruder1"}                               the scenario's first intruder leaves now
    {"do": "zone", "name": "vault", "on": false}                    a zone is in force from now on, or no longer
    {"do": "zone", "name": "vault", "weight": 5}                    a zone has another weight from now on

Times in a fault count from now: without `at` it begins with the next tick. `instead` names a fault that ends at the
same moment, so that a value is changed without a gap. A `close` or `open` also ends those in force on its closure, so
the last one holds until it is healed. Intruders are called `intruder1`, `intruder2`, ... by their place in the
scenario's list, to which each new one is appended; a fault of the same name is healed first.

A control that changes what happens is written to the journal as an event of kind `OPERATOR`, and `operated` makes of a
scenario and these events the scenario that has happened: run from its beginning, it gives the same trace.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, Self

from pydantic import ConfigDict, Discriminator, Field, TypeAdapter, ValidationError, model_validator

from patrol.areas import Span, holds_tick
from patrol.errors import BadInput, did_you_mean, in_flow, quoted
from patrol.faults.kinds import Clock, Lasting, OnGround, nothing
from patrol.faults.roster import tick_of, ticks_of
from patrol.files.untrusted import refuse_half_characters
from patrol.journal.records import Event
from patrol.scenario import Scenario, as_mapping, load_scenario
from patrol.values import LARGEST, Corner, Flag, Name, Positive, Section, expecting, wrong
from patrol.zones.spec import Weight, ZoneSpec


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


OPERATOR = "operator"
"""The kind of the journal's events that tell of controls; their detail is JSON, as `as_detail` makes it."""

MOST_FAULTS = MOST_INTRUDERS = 400
"""Faults, and intruders, of a scenario beyond which operators change no more: each change checks all of them again, and
so does every later reader of the run."""

_INTRUDER = "intruder"

MOST_STEPS = 100_000
FACTORS = (1e-3, 1e6)
"""The least and the greatest pace that may be asked for, of real time."""


class Pause(Section):
    """Hold the ticks until another control."""

    do: Literal["pause"]


class Go(Section):
    """Let the ticks go on by themselves."""

    do: Literal["go"]


class Step(Section):
    """Do a few ticks, then hold."""

    do: Literal["step"]
    ticks: Annotated[
        int, Field(ge=1, le=MOST_STEPS, strict=True), expecting(f"a whole number from 1 to {MOST_STEPS}")
    ] = 1


class Pace(Section):
    """Go on at a factor of real time, or as fast as possible."""

    do: Literal["pace"]
    factor: Annotated[
        Annotated[float, Field(ge=FACTORS[0], le=FACTORS[1], strict=True)] | None,
        expecting(f"a number from {FACTORS[0]:g} to {FACTORS[1]:g} (times real time), or max"),
    ]


class AddFault(Section):
    """Add a fault, its times from now on."""

    do: Literal["fault"]
    fault: Annotated[dict[str, Any], expecting("a fault such as {kind: loss, rate: 0.5}")]
    instead: Name | None = None


class Heal(Section):
    """End a lasting fault, or let an intruder leave."""

    do: Literal["heal"]
    id: Name


class AddIntruder(Section):
    """Place an intruder (m) from now on, for a time (s) or to the end."""

    model_config = ConfigDict(serialize_by_alias=True)

    do: Literal["intruder"]
    place: Corner
    stay: Positive | None = Field(None, alias="for")


class SwitchZone(Section):
    """Put a zone in force from now on to the end, or no longer; or give it another weight from now on."""

    do: Literal["zone"]
    name: Name
    on: Flag | None = None
    weight: Weight | None = None

    @model_validator(mode="after")
    def _does_one_thing(self) -> Self:
        if (self.on is None) == (self.weight is None):
            raise wrong("", "exactly one is needed: on, or a weight")
        return self


Control = Pause | Go | Step | Pace | AddFault | Heal | AddIntruder | SwitchZone
CONTROLS = ("pause", "go", "step", "pace", "fault", "heal", "intruder", "zone")
"""Values of `do` in a control."""

EXAMPLES = {
    "step": {"ticks": "10"},
    "pace": {"factor": "2, or max"},
    "fault": {"fault": "{kind: loss, rate: 0.5}"},
    "heal": {"id": "op1, the id in the answer to a fault or an intruder"},
    "intruder": {"place": "[12, 30]", "for": "60"},
    "zone": {"name": "vault, as in {name: vault, on: false}", "on": "true or false", "weight": "5"},
}
"""Fields of each control that has values, the needed one first, with an example each."""

_CONTROL: TypeAdapter[Control] = TypeAdapter(Annotated[Control, Discriminator("do")])


@dataclass(frozen=True, slots=True)
class Answer:
    """The outcome of a control."""

    done: bool
    text: str = ""  # one line for the operator; the reason where it was refused


def read_control(says: object) -> Control:
    """Read the control in a mapping."""
    do = says.get("do") if isinstance(says, Mapping) else None
    if not isinstance(do, str) or do not in CONTROLS:
        hint = did_you_mean(do, CONTROLS) if isinstance(do, str) else f"known are {', '.join(CONTROLS)}"
        raise BadInput(f"control: do = {quoted(do)}: {hint}")
    refuse_half_characters(says, "control")
    try:
        return _CONTROL.validate_python(says)
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
        field = ".".join(str(part) for part in problem["loc"][1:] if not str(part).startswith("=")) or do
        fields: Mapping[str, str] = EXAMPLES.get(do, {})
        match problem["type"]:
            case "missing":
                raise BadInput(f"control: {field}: missing; give {fields.get(field, do)}") from None
            case "extra_forbidden":
                remedy = did_you_mean(field, tuple(fields)) if fields else f"{do} takes no value; leave it out"
                raise BadInput(f"control: {field}: unknown key; {remedy}") from None
        expected = problem.get("ctx", {}).get("what")
        problem_text = f"expected {expected}" if expected else problem["msg"][:1].lower() + problem["msg"][1:]
        raise BadInput(f"control: {field} = {quoted(problem['input'])}: {problem_text}") from None


# --- what has happened -----------------------------------------------------------------------------------------------


def amended(scenario: Scenario, k: int, control: Control) -> tuple[Scenario, str]:
    """Return the scenario once a control has been obeyed before tick `k`, and one line on what it does.

    The scenario is the same object where the control changes nothing that happens. A control that cannot be obeyed
    raises BadInput.
    """
    match control:
        case AddFault():
            return _with_fault(scenario, k, control)
        case Heal():
            return _heal_fault(scenario, k, control.id), f"{control.id} ends with tick {k}"
        case AddIntruder():
            if (index := len(scenario.intruders)) >= MOST_INTRUDERS:
                raise BadInput(f"control: intruder: this run has {MOST_INTRUDERS} intruders already and takes no more")
            entry = {"place": control.place, "at": _time_of(k, scenario.step), "for": control.stay}
            x, y = control.place
            changed = _with_entry(scenario, "intruders", index, entry)
            return changed, f"{intruder_name(index)} at ({x:g}, {y:g}) from tick {k} on"
        case SwitchZone():
            index, zone = _find_zone(scenario, control.name)
            change: dict[str, Any]
            if control.weight is not None:
                change = {"weights": _reweight_zone(scenario, k, zone, control.weight)}
                does = f"counts {control.weight:g} times"
            else:
                change = {"times": _switch_zone(scenario, k, zone, bool(control.on))}
                does = "is in force" if control.on else "is out of force"
            changed = _with_entry(scenario, "zones", index, _plain(zone) | change)
            return changed, f"{control.name} {does} from tick {k} on"
    return scenario, ""


def operated(scenario: Scenario, events: Iterable[Event]) -> Scenario:
    """Return the scenario that has happened: with what operators have added to it."""
    for event in events:
        if event.kind == OPERATOR:
            scenario, _ = amended(scenario, event.k, control_in(event))
    return scenario


def control_in(event: Event) -> Control:
    """Read the control in an event of kind `OPERATOR`."""
    try:
        says = json.loads(event.detail)
    except (ValueError, RecursionError):
        raise BadInput(f"control: {quoted(event.detail)} before tick {event.k}: is not JSON") from None
    return read_control(says)


def in_force(scenario: Scenario, k: int, first: int = 0) -> tuple[Mapping[str, Any], ...]:
    """List the lasting faults, except those of processes, that are active in a tick and change something.

    They are entries of a scenario's `faults`. Faults before index `first` are left out; operators' faults follow the
    scenario's own.
    """
    return tuple(
        _plain(fault)
        for fault in scenario.faults[first:]
        if isinstance(fault, Lasting)
        and fault.acts_on != "processes"
        and not (isinstance(fault, Clock) and fault.offset == fault.rate == 0.0)
        and _is_active(fault, scenario.step, k)
    )


def as_detail(control: Control) -> str:
    """Write a control as the detail of an event."""
    return json.dumps(control.model_dump(mode="json", exclude_defaults=True), separators=(",", ":"))


def intruder_name(place: int) -> str:
    """Return the name by which an intruder is healed, such as "intruder1" for place 0 in the list."""
    return f"{_INTRUDER}{place + 1}"


def intruders_there(scenario: Scenario, k: int) -> tuple[tuple[float, float, str], ...]:
    """List the intruders on the terrain in a tick, as x and y in m and name."""
    return tuple(
        (*intruder.place, intruder_name(index))
        for index, intruder in enumerate(scenario.intruders)
        if intruder.is_there(k * scenario.step)
    )


def intruders_came(scenario: Scenario, end_s: float) -> list[tuple[int, float, float]]:
    """List the intruders that came before a run's end by their places in the list, with their times there in s.

    `scenario` includes what operators have added.
    """
    there = []
    for index, intruder in enumerate(scenario.intruders):
        gone_s = end_s if intruder.stay is None else min(intruder.at + intruder.stay, end_s)
        first_s = math.ceil(intruder.at / scenario.step - 1e-9) * scenario.step
        if first_s < gone_s:  # else it was taken away before its first tick, or never came
            there.append((index, intruder.at, gone_s))
    return there


def _with_fault(scenario: Scenario, k: int, control: AddFault) -> tuple[Scenario, str]:
    if len(scenario.faults) >= MOST_FAULTS:
        raise BadInput(f"control: fault: this run has {MOST_FAULTS} faults already and takes no more")
    if control.instead is not None and _intruder_of(scenario, control.instead) is not None:
        raise BadInput(f"control: instead = {control.instead}: an intruder is no fault to replace; heal it")
    if control.instead is not None:
        _, replaced = _find_fault(scenario, control.instead)
        if not (isinstance(replaced, Lasting) and _has_ended(replaced, scenario.step, k)):
            scenario = _heal_fault(scenario, k, control.instead)
    entry = dict(control.fault)
    delay_s = entry.get("at", 0.0)
    if isinstance(delay_s, bool) or not isinstance(delay_s, int | float) or not 0.0 <= delay_s <= LARGEST:
        raise BadInput(f"control: fault.at = {quoted(delay_s)}: expected seconds from now, from 0 to {LARGEST:g}")
    begin = k + tick_of(delay_s, scenario.step)
    entry["at"] = _time_of(begin, scenario.step)
    for before in [fault for fault in scenario.faults if isinstance(fault, OnGround)]:
        if before.part == entry.get("closure") and _is_active(before, scenario.step, begin):
            scenario = _heal_fault(scenario, begin, str(before.id))
    known_ids = {fault.id for fault in scenario.faults}
    entry.setdefault("id", next(name for n in range(1, MOST_FAULTS + 2) if (name := f"op{n}") not in known_ids))
    extended = _with_entry(scenario, "faults", len(scenario.faults), entry)
    fault = extended.faults[-1]
    if isinstance(fault, OnGround):
        return extended, f"{fault.id} {fault.kind} {fault.part} from tick {begin} on; heal {fault.id} takes it back"
    return extended, f"{fault.id} {fault.kind} from tick {begin} on"


def _heal_fault(scenario: Scenario, k: int, name: str) -> Scenario:
    """End a lasting fault before tick k; of one that begins then only its place remains."""
    if len(scenario.faults) > MOST_FAULTS:
        raise BadInput(f"control: id = {name}: this run has more than {MOST_FAULTS} faults, and none can be ended")
    if (number := _intruder_of(scenario, name)) is not None:
        return _without_intruder(scenario, k, number)
    index, fault = _find_fault(scenario, name)
    if not isinstance(fault, Lasting):
        raise BadInput(f"control: id = {name}: a {fault.kind} happens at once and does not end")
    begin = tick_of(fault.at, scenario.step)
    if begin > k:
        raise BadInput(f"control: id = {name}: it has not begun yet; it begins at {fault.at:g} s")
    if _has_ended(fault, scenario.step, k):
        raise BadInput(f"control: id = {name}: it has ended already")
    entry = _plain(fault) | {"for": (k - begin) * scenario.step}
    if begin == k:
        entry = nothing(name, fault.at, scenario.step, scenario.roster[0].name)
    return _with_entry(scenario, "faults", index, entry)


def _intruder_of(scenario: Scenario, name: str) -> int | None:
    """Find the place of the intruder of a name in the scenario's list; None for the name of a fault, or of nothing."""
    number = name.removeprefix(_INTRUDER)
    if number == name or not number.isdecimal() or any(fault.id == name for fault in scenario.faults):
        return None
    index = int(number) - 1
    return index if 0 <= index < len(scenario.intruders) and name == intruder_name(index) else None


def _without_intruder(scenario: Scenario, k: int, place: int) -> Scenario:
    """Let an intruder leave before tick k."""
    intruder, step = scenario.intruders[place], scenario.step
    where = f"control: id = {intruder_name(place)}"
    if not intruder.is_there(k * step):
        if intruder.at > k * step:
            raise BadInput(f"{where}: it has not come yet; it comes at {intruder.at:g} s")
        raise BadInput(f"{where}: it has left already")
    times = {"for": k * step - intruder.at}
    if times["for"] <= 0.0:  # it keeps its place in the list, between two ticks, so that others keep their names
        times = {"at": (k + 0.25) * step, "for": 0.25 * step}
    return _with_entry(scenario, "intruders", place, _plain(intruder) | times)


def _find_zone(scenario: Scenario, name: str) -> tuple[int, ZoneSpec]:
    """Find a zone, and its place in the scenario's list."""
    names = [zone.name for zone in scenario.zones]
    if name not in names:
        raise BadInput(f"control: name = {name}: {did_you_mean(name, names) if names else 'this run has no zones'}")
    return names.index(name), scenario.zones[names.index(name)]


def _switch_zone(scenario: Scenario, k: int, zone: ZoneSpec, on: bool) -> tuple[Span, ...]:
    """Return the times of a zone that is switched on or off before tick k: as before up to then."""
    step, begin = scenario.step, _time_of(k, scenario.step)
    if zone.keep_out:
        raise BadInput(f"control: name = {zone.name}: a keep-out always holds; only other zones can be switched")
    times = ((0.0, scenario.duration),) if zone.times is None else zone.times
    cut = [(first, min(end, begin)) for first, end in times]
    switched = [span for span in cut if holds_tick(span, step)]
    if on:
        if switched and switched[-1][1] == begin:
            begin = switched.pop()[0]
        switched.append((begin, scenario.duration))
    if tuple(switched) == times:
        state = "is in force to the end already" if on else "is not in force, and will not be"
        raise BadInput(f"control: name = {zone.name}: {state}")
    return tuple(switched)


def _reweight_zone(scenario: Scenario, k: int, zone: ZoneSpec, weight: float) -> list[tuple[float, float]]:
    """Return the later weights of a zone that is given another one before tick k: as before up to then."""
    if zone.weight is None:
        raise BadInput(f"control: name = {zone.name}: is no zone with a weight, so it has none to change")
    begin = _time_of(k, scenario.step)
    weights = zone.weights or ()
    if zone.weight_at(begin) == weight and all(start <= begin for start, _ in weights):
        raise BadInput(f"control: weight = {weight:g}: {zone.name} counts so many times already")
    return [*(entry for entry in weights if tick_of(entry[0], scenario.step) < k), (begin, weight)]


def _is_active(fault: Lasting, step: float, k: int) -> bool:
    return tick_of(fault.at, step) <= k and not _has_ended(fault, step, k)


def _has_ended(fault: Lasting, step: float, k: int) -> bool:
    return fault.lasts is not None and tick_of(fault.at, step) + ticks_of(fault.lasts, step) <= k


def _find_fault(scenario: Scenario, name: str) -> tuple[int, Any]:
    for index, fault in enumerate(scenario.faults):
        if fault.id == name:
            return index, fault
    names = [str(fault.id) for fault in scenario.faults]
    names += [intruder_name(index) for index in range(len(scenario.intruders))]
    raise BadInput(f"control: id = {name}: no such fault or intruder; the latest are {', '.join(names[-8:]) or 'none'}")


def _time_of(k: int, step: float) -> float:
    """Return the time of a tick in s, rounded for people where that is the same tick."""
    exact = k * step
    for time_s in (round(exact, 9), exact):
        if time_s <= exact and tick_of(time_s, step) == k:
            return time_s
    while tick_of(exact, step) > k:
        exact = math.nextafter(exact, 0.0)
    return exact


def _plain(section: Section) -> dict[str, Any]:
    return section.model_dump(mode="json", exclude_none=True)


def _with_entry(scenario: Scenario, section: str, place: int, entry: Mapping[str, Any]) -> Scenario:
    """Return the scenario with another entry at a place of a list, or after the last one."""
    mapping = as_mapping(scenario)
    mapping[section][place : place + 1] = [entry]
    aliases = {f"faults.{place}": "fault"} if section == "faults" else {}
    return load_scenario(mapping, called="control", aliases=aliases)
