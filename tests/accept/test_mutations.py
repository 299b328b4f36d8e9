"""The mutation run: code that makes things go wrong, or that reports them, is broken, and the responsible check fires.

World and verdict run the same broken code where they share any, so each case shows that a check does not take its word
from the code that it judges.
"""

import math
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial
from typing import Any

import pytest

from fogwatch.inprocess import InProcessFleet, run_in_process
from patrol.energy.batteries import Batteries
from patrol.faults.kinds import KINDS
from patrol.ground.fog import Fog
from patrol.journal import Status
from patrol.pose import Velocity
from patrol.prepare import Prepared, prepare
from patrol.radio.allowance import Share
from patrol.radio.inbox import Inboxes
from patrol.scenario import load_scenario
from tests.chaos.bugs import (
    BUGS,
    Plant,
    alter_decisions,
    alter_new,
    alter_recorded,
    alter_rows,
    alter_stood_down,
    altered,
    drive_blindly,
    put,
)
from worldsim import faults, world
from worldsim.faults import Timeline
from worldsim.radio import ether, forging, path_loss, rules
from worldsim.radio.forging import Forger
from worldsim.radio.path_loss import PathLoss
from worldsim.radio.rules import Bucket, RadioRules
from worldsim.robots import bodies as motion
from worldsim.robots import closures, noise
from worldsim.robots.bodies import Body
from worldsim.robots.closures import Closures
from worldsim.robots.senses import Senses
from worldsim.world import World

pytestmark = pytest.mark.accept

ROBOTS = {"count": 4, "model": "holonomic", "radius": 0.5, "speed": 4.0}
FLEET: Mapping[str, Any] = {
    "terrain": {"builtin": "open"},
    "point": 2.0,
    "duration": 40.0,
    "robots": ROBOTS,
    "sensor": {"range": 15.0},
    "patrol": {"policy": "random"},
}
"""Four robots that drive at random for 80 ticks."""

SCENARIOS: dict[str, Mapping[str, Any]] = {}
"""Things that go wrong on purpose, as changes of `FLEET`, by name."""

MUTATIONS: dict[str, tuple[str, str, Plant]] = {}
"""The scenario, the check that has to fire, and what breaks the code, by what is wrong."""


def _break(name: str, scenario: Mapping[str, Any], *ways: str | tuple[Any, ...]) -> None:
    """Add ways in which code is wrong: (what, check, plants ...), or the name of one of `BUGS`."""
    SCENARIOS[name] = scenario
    for way in ways:
        if isinstance(way, str):
            MUTATIONS[f"{name}: {way}"] = name, BUGS[way].check, BUGS[way].plant
        else:
            what, check, *plants = way
            MUTATIONS[f"{name}: {what}"] = name, check, partial(_plant_all, plants)


def _plant_all(plants: list[Plant], patch: pytest.MonkeyPatch) -> None:
    for plant in plants:
        plant(patch)


def _faults(*entries: Mapping[str, Any], **more: Any) -> dict[str, Any]:
    """Return a scenario's faults, which begin after 5 s unless told otherwise."""
    return {"faults": [{"at": 5.0, **entry} for entry in entries], **more}


def _wrap(owner: Any, name: str, call: Callable[..., Any]) -> Plant:
    """Call something else in place of a function or method, with that as the first argument."""
    return put(owner, name, lambda real: lambda *args: call(real, *args))


def _elsewhere(entry: Any) -> Any:
    """Let a fault act on each robot's successor, of four."""
    moved = {field: tuple(map(_next, getattr(entry, field))) for field in ("who", "sources", "targets")}
    return replace(entry, **moved)


def _next(number: int) -> int:
    return number % 4 + 1


def _scaled(field: str, factor: float) -> Callable[[Any], Any]:
    """Multiply a field of a frozen value by a factor, or each of its numbers."""

    def scale(of: Any) -> Any:
        value = getattr(of, field)
        return altered(**{field: tuple(factor * x for x in value) if isinstance(value, tuple) else factor * value})(of)

    return scale


def _set(owner: Any, **change: Callable[[Any], Any]) -> Plant:
    """Change attributes of new objects of a class."""
    return alter_new(owner, lambda of: vars(of).update({name: make(vars(of)[name]) for name, make in change.items()}))


def _forged(name: str, by: int) -> Plant:
    """Add to a field of the positions that are forged."""
    return _wrap(forging, "encode", lambda real, of, *key: real(replace(of, **{name: getattr(of, name) + by}), *key))


def _wrong_by(change: Callable[[Any], Any]) -> Plant:
    """Change the drift by which senses are wrong."""
    return _wrap(Senses, "_pose_error", lambda real, of, entry, fault, *at: real(of, entry, change(fault), *at))


def _batteries(field: str, factor: float) -> Plant:
    """Multiply a field of all batteries as the world has them."""
    change = _scaled(field, factor)
    return _set(Batteries, _specs=lambda specs: {number: change(spec) for number, spec in specs.items()})


class _Forgetful(dict[Any, Any]):
    """A dict that forgets what was looked up."""

    def get(self, key: Any, default: Any = None) -> Any:
        return self.pop(key, default)


def _makes_late(real: Any) -> Any:
    """Let a process arrive when it is asked about a second time."""
    asked: set[tuple[int, int]] = set()

    def arrived(of: Any, number: int) -> bool:
        first = (id(of), number) not in asked
        asked.add((id(of), number))
        return not first and bool(real(of, number))

    return arrived


def _wakes_at_start(real: Any, of: World, number: int, reason: str) -> Any:
    of.bodies[number].away = True
    return real(of, number, reason)


def _drives(change: Callable[[int, float], float]) -> Plant:
    """Drive along x, by the tick and the top speed."""
    return alter_decisions(lambda mind, sensed, of: replace(of, command=Velocity(change(sensed.k, mind.spec.speed), 0)))


def _varies(change: Callable[[float, float, float], tuple[float, float, float]]) -> Plant:
    """Change the shares of speed and turning, and the veer, under motion faults."""
    return _wrap(noise, "_change_command", lambda real, command, *of: real(command, *change(*of[:3]), *of[3:]))


_hit_elsewhere = _wrap(RadioRules, "_mark_hits", lambda real, of, entry, *at: real(of, _elsewhere(entry), *at))
_links_elsewhere = _wrap(rules, "_on_link", lambda real, entry, *link: real(_elsewhere(entry), *link))
_rules_late = _wrap(RadioRules, "begin", lambda real, of, k, poses: real(of, k - 1, poses))
_rarely = put(rules, "draw", lambda real: lambda *of: math.sqrt(real(*of)))
_late = put(InProcessFleet, "arrived", _makes_late)
_stays = put(InProcessFleet, "leave", lambda _: lambda *_: None)
_living_hear = _wrap(
    World, "exchange", lambda real, of, sent: {n: heard for n, heard in real(of, sent).items() if n in of.living}
)
_paused_asked = put(Body, "alive", lambda _: property(lambda of: of.status in (Status.ALIVE, Status.PAUSED)))
_others_hit = _wrap(Timeline, "_resolve_target", lambda real, *of: tuple(map(_next, real(*of))))
_others_repeated = _wrap(Forger, "_repeat_frames", lambda real, of, ago, n: real(of, ago, _next(n)))
_frames_vanish = _wrap(ether, "_arrived_frames", lambda real, *of: real(*of[:4], of[4][1:]))
_half_the_jumps = _wrap(Senses, "_sum_jumps", lambda real, *of: real(*of[:-2], of[-2] // 2, of[-1]))
_half_as_large_when_they_meet = _wrap(motion, "cancel_meeting", lambda real, ways, r, *of: real(ways, 0.5 * r, *of))
_half_as_large_at_walls = _wrap(motion, "path_is_free", lambda real, *of: real(*of[:-1], 0.5 * of[-1]))
_five_times_as_far = _wrap(motion, "advance", lambda real, pose, of, step: real(pose, of, 5.0 * step))
_slowed_half_as_much = _wrap(world, "slowed", lambda real, command, most: real(command, most and 2.0 * most))
_zones_late = _wrap(world, "zones_in_force", lambda real, zones, s: real(zones, s - 0.5))

# --- robots ----------------------------------------------------------------------------------------------------------

_break("kill", _faults({"kind": "kill", "who": "r2"}), "a killed robot goes on", "the event of a kill names no fault")
_break(
    "restart",
    _faults({"kind": "kill", "who": "r2"}, {"kind": "restart", "who": "r2", "at": 10.0}),
    "a restarted robot never comes",
    ("it comes a tick late", "statuses", _late),
)
_break(
    "pause",
    _faults({"kind": "pause", "who": "r2", "for": 10.0}),
    "a paused robot drives on",
    ("the robot is asked all the same", "the down are silent", _paused_asked),
)
_break(
    "resume",
    _faults({"kind": "pause", "who": "r2"}, {"kind": "resume", "who": "r2", "at": 10.0}),
    "a resumed robot stays paused",
    ("it wakes at its start", "moves", _wrap(World, "wake", _wakes_at_start)),
)
_break(
    "join",
    _faults({"kind": "join", "who": "r2"}),
    "a robot joins beside its start",
    ("it comes a tick late", "statuses", _late),
    ("it is there from the beginning", "statuses", put(faults, "_absent_at_first", lambda _: lambda *_: frozenset())),
)
_break(
    "leave",
    _faults({"kind": "leave", "who": "r2"}),
    ("the robot goes on", "statuses", alter_stood_down(Status.LEFT, status=Status.ALIVE), _stays),
    ("it counts as dead", "statuses", alter_stood_down(Status.LEFT, status=Status.DEAD)),
)
_break(
    "timeline",
    _faults({"kind": "pause", "who": "r2", "for": 5.0}, {"kind": "silence", "who": "r3", "for": 10.0}),
    "faults last a tick longer",
    ("faults begin a tick late", "fault times", _wrap(faults, "tick_of", lambda real, *of: real(*of) + 1)),
    ("what is active is a tick late", "nothing crossed", _wrap(Timeline, "at", lambda real, of, k: real(of, k - 1))),
    ("acts are a tick late", "statuses", _wrap(Timeline, "acts", lambda real, of, k: real(of, k - 1))),
    ("acts are left out", "statuses", put(Timeline, "acts", lambda _: lambda *_: ())),
    ("others are hit", "fault times", _others_hit),
)

# --- the radio -------------------------------------------------------------------------------------------------------

_SOME = {"from": ["r1", "r2"], "for": 30.0}
_break(
    "loss",
    _faults({"kind": "loss", "rate": 0.5, **_SOME}),
    "a loss drops half as much",
    ("it acts on the wrong links", "drops", _hit_elsewhere),
    ("it is a tick late", "drops", _rules_late),
)
_break(
    "loss in bursts",
    _faults({"kind": "loss", "rate": 0.5, "mean_burst": 10}, duration=150.0),
    "a burst lasts half as long",
    ("a burst never ends", "losses", _wrap(rules, "chain_of", lambda real, *of: (0.0, real(*of)[1]))),
)
_break(
    "delay",
    _faults({"kind": "delay", "delay": {"constant": 2.0}, **_SOME}),
    "a delay is half as long",
    ("it acts on the wrong links", "on time", _links_elsewhere),
    ("it is a tick late", "on time", _rules_late),
)
_break(
    "random delay",
    _faults({"kind": "delay", "delay": {"exponential": 3.0}}),
    ("it is half as long", "delays and copies", _wrap(rules, "waited", lambda real, *of: 0.5 * real(*of))),
    ("it is never short", "delays and copies", _wrap(rules, "waited", lambda real, *of: 3.0 + real(*of))),
)
_break(
    "duplicate",
    _faults({"kind": "duplicate", "rate": 0.6, "delay": {"constant": 1.0}, **_SOME}),
    "a duplicate makes no copy",
    "a duplicate makes two copies",
    ("copies are too rare", "delays and copies", _rarely),
    ("it acts on the wrong links", "on time", _links_elsewhere),
)
_break(
    "reorder",
    _faults({"kind": "reorder", "rate": 0.6, "hold": 1.0, **_SOME}),
    "a frame that is held back is held for two steps more",
    ("frames are held back too rarely", "delays and copies", _rarely),
    ("it acts on the wrong links", "on time", _links_elsewhere),
)
_break(
    "partition",
    _faults({"kind": "partition", "groups": [["r1"], ["r2", "r3"]], "direction": "one-way", "for": 20.0}),
    "a one-way partition cuts both ways",
    ("it is a tick late", "nothing crossed", _rules_late),
    ("groups are others", "nothing crossed", _wrap(rules, "_group_of", lambda real, groups, n: real(groups, _next(n)))),
)
_break(
    "silence",
    _faults({"kind": "silence", "who": "r2", "direction": "in", "for": 20.0}),
    "a silence does not stop what robots hear",
    ("it acts on the wrong robot", "nothing crossed", _hit_elsewhere),
    ("it is a tick late", "nothing crossed", _rules_late),
)
_break(
    "range",
    _faults(
        {"kind": "range", "reach": 30.0, "through_walls": False, "who": ["r1", "r2"]}, terrain={"builtin": "yards"}
    ),
    "a reach is a tenth longer",
    "a radio reaches through walls",
    ("it acts on the wrong robots", "reach", _hit_elsewhere),
)
_break(
    "bandwidth",
    _faults({"kind": "bandwidth", "who": ["r1", "r2"], "bytes_per_s": 20.0}),
    "a bandwidth is twice as wide",
    ("it is half as wide", "bandwidth", _wrap(Bucket, "__init__", lambda real, of, rate, *at: real(of, rate / 2, *at))),
)
_break(
    "path loss",
    {"terrain": {"builtin": "yards"}, "radio": {"model": "path-loss"}},
    "walls do not weaken the radio",
    "a frame meets twice the noise",
    ("shadowing is half as strong", "path loss", _wrap(path_loss, "normals", lambda real, *of: 0.5 * real(*of))),
    ("chances are halved", "path loss", _wrap(PathLoss, "_reception_chance", lambda real, *of: 0.5 * real(*of))),
)
_SPOOF = {"kind": "spoof", "as": "r2", "for": 30.0}
_break(
    "spoof with an offset",
    _faults({**_SPOOF, "payload": {"offset": [10, 0]}}),
    "a forged place is a metre off",
    ("its time is a millisecond off", "forgeries", _forged("time_ms", 1)),
    ("it is in the wrong name", "forgeries", _forged("robot", 1)),
    ("it is a tick late", "forgeries", _wrap(Timeline, "at", lambda real, of, k: real(of, k - 1))),
)
_break(
    "spoof that is ahead",
    _faults({**_SPOOF, "payload": {"ahead": 3}}),
    ("it is less ahead", "forgeries", _forged("sequence", -1)),
    "a forged frame comes twice",
)
_break(
    "spoof that repeats",
    _faults({**_SPOOF, "payload": {"replay": 2.0}}),
    ("frames are too young", "forgeries", _wrap(Forger, "_frame_age", lambda real, *of: max(real(*of) - 1, 0))),
    ("they are another's", "forgeries", _others_repeated),
)
_break(
    "spoof that freezes",
    _faults({**_SPOOF, "payload": "freeze"}),
    ("the place thaws", "forgeries", _set(Forger, _frozen=lambda _: _Forgetful())),
    ("the place is a metre off", "forgeries", _forged("x_cm", 100)),
)
_break(
    "spoof that invents",
    _faults({**_SPOOF, "payload": {"invented": 3}}),
    ("there is one too few", "forgeries", _set(Forger, _robots=lambda robots: robots + 1)),
    ("they are off the terrain", "forgeries", _forged("x_cm", 10_000)),
)
_break(
    "ether",
    _faults({"kind": "delay", "delay": {"constant": 2.0}, "for": 20.0}, {"kind": "kill", "who": "r2", "at": 6.0}),
    "late frames come a tick early",
    ("the dead hear", "the down are silent", put(ether, "_DEAF", lambda _: {}), _living_hear),
    ("frames in flight vanish", "links add up", _frames_vanish),
)
_break(
    "draws of the ether",
    _faults({"kind": "loss", "rate": 0.5}),
    "the world's draws are not repeated",
    "a drop names a fault that was not there",
    "a delivery is not recorded",
)
_break(
    "inbox",
    _faults(
        {"kind": "duplicate", "rate": 0.5, "delay": {"constant": 0.5}},
        {**_SPOOF, "payload": {"ahead": 3}},
        {**_SPOOF, "payload": {"invented": 2}},
    ),
    "inboxes accept a frame again and again",
    ("it accepts what is to come", "forged frames", _set(Inboxes, rules=altered(ahead=10))),
    ("minds count too many", "refused frames", alter_rows(lambda _, k: k > 20, rejected=1000)),
)
_break(
    "budget",
    {"radio": {"budget": {"bits_per_s": 1000, "overhead": 8}}},
    "robots send more than their share",
    ("overhead is not counted", "budget", put(Share, "cost", lambda _: lambda _of, length: 8 * length)),
)
_break(
    "sending",
    {"intruders": [{"place": [50, 44], "at": 0.0, "for": 30.0}], "sensor": {"range": 60}},
    "robots send places a centimetre off",
    "robots send their clock a millisecond late",
    "robots report no intruder",
)

# --- senses and motion -----------------------------------------------------------------------------------------------

_break(
    "drift",
    _faults({"kind": "drift", "who": "all", "bias": [2.0, 1.0], "growth": [0.05, 0.02]}),
    "a drift does not grow",
    ("a bias is halved", "senses", _wrong_by(_scaled("bias", 0.5))),
)
_break(
    "noise of places",
    _faults({"kind": "drift", "who": "all", "noise": 0.2}, duration=80.0),
    ("it is half as large", "senses", _wrong_by(_scaled("noise", 0.5))),
    ("it is twice as large", "senses", _wrong_by(_scaled("noise", 2.0))),
)
_break(
    "jumps of places",
    _faults({"kind": "drift", "who": "all", "jump": {"every": 5.0, "size": 2.0}}),
    ("they are half as long", "senses", _wrap(Senses, "_sum_jumps", lambda real, *of: real(*of[:-1], 0.5 * of[-1]))),
    ("they are half as many", "senses", _half_the_jumps),
)
_break(
    "clock",
    _faults({"kind": "clock", "who": ["r1", "r2"], "offset": 2.0, "rate": 0.1}),
    "a clock does not gain",
    ("it is a tick late", "senses", _wrap(Senses, "clock", lambda real, of, n, k: real(of, n, k - 1) + of._step)),
)
_break(
    "motion",
    _faults({"kind": "motion", "who": "all", "jitter": {"size": 0.5}, "slip": {"rate": 0.4}}, duration=80.0),
    "jitter is half as large",
    "a body slips half as often",
    "moves are uneven without a fault",
)
_break(
    "noise of motion",
    _faults({"kind": "motion", "who": "all", "speed": 0.2, "veer": 0.05}, duration=80.0),
    ("speeds are too uneven", "motion", _varies(lambda speed, turning, veer: (2.0 * speed - 1.0, turning, veer))),
    ("bodies veer to one side", "motion", _varies(lambda speed, turning, veer: (speed, turning, abs(veer)))),
)
_break("moves", {}, "bodies get a little farther", "a robot exceeds its top speed")
_break(
    "meetings",
    {"robots": {**ROBOTS, "count": 20, "radius": 2.0}},
    "bodies pass through each other",
    ("bodies stop that are half as large", "bodies apart", _half_as_large_when_they_meet),
)
_break(
    "walls",
    {"terrain": {"builtin": "yards"}},
    ("bodies pass", "moves", drive_blindly, put(motion, "path_is_free", lambda _: lambda *_: True)),
    ("bodies stop that are half as large", "bodies apart", drive_blindly, _half_as_large_at_walls),
)

# --- the ground ------------------------------------------------------------------------------------------------------

_PLACE = {"name": "place", "polygon": [[40, 30], [60, 30], [60, 60], [40, 60]]}
_BATTERY = {"capacity": 0.3, "idle": 10.0, "drive": 10.0, "charge": 200.0, "start": 0.3}
_HALL = {"name": "hall", "polygon": [[10, 10], [90, 10], [90, 78], [10, 78]]}
_break(
    "close and open",
    _faults(
        {"kind": "close", "closure": "place", "for": 10.0},
        {"kind": "open", "closure": "place", "at": 25.0, "for": 5.0},
        closures=[{**_PLACE, "closed": [[20.0, 40.0]]}],
        duration=50.0,
    ),
    "a closure that is to be closed stays as it is",
    "a closure that is to be open stays as it is",
    ("both are a tick late", "closures", _wrap(Closures, "_held", lambda real, of, k: real(of, k - 1))),
    ("times are a tick late", "closures", _wrap(closures, "is_in_one_of", lambda real, spans, s: real(spans, s - 0.5))),
)
_break(
    "closures by rates",
    {"closures": [{**_PLACE, "closes": 0.1, "opens": 0.1}], "duration": 100.0},
    "closures close on robots",
    "closures wait for robots unseen",
    ("they are half as frequent", "closures", put(closures, "draw", lambda real: lambda *of: 2.0 * real(*of))),
)
_break(
    "batteries",
    {"robots": {**ROBOTS, "count": 1, "starts": [[11, 11]], "battery": _BATTERY}, "docks": [{"place": [11, 11]}]},
    ("empty ones last", "batteries", drive_blindly, put(Batteries, "is_empty", lambda _: lambda *_: False)),
    ("driving costs half as much", "batteries", drive_blindly, _batteries("drive", 0.5)),
    ("docks give twice as much", "batteries", _drives(lambda k, speed: speed * (k >= 2)), _batteries("charge", 2.0)),
)
_break(
    "keep-outs",
    {"zones": [{**_PLACE, "keep_out": True}]},
    "bodies pass through keep-outs",
    ("bodies get five times as far", "keep-outs", _five_times_as_far),
)
_break(
    "slow zones",
    {"zones": [{**_HALL, "speed": 1.0, "times": [[10, 30]]}]},
    "slow zones slow nothing",
    ("they are twice as fast", "slow zones", drive_blindly, _slowed_half_as_much),
    "zones begin and end unseen",
    ("they begin a tick late", "zone times", _zones_late),
)

# --- what the journal measures ---------------------------------------------------------------------------------------

_break(
    "measures",
    {},
    "the fog counts a tick less",
    "one robot sees nothing",
    ("the mean fog is too high", "fog", _wrap(Fog, "mean", lambda real, *of: 1.01 * real(*of))),
    ("a point too many was seen", "fog", alter_recorded(lambda of: replace(of, seen=of.seen + 1))),
    "the trace leaves out a tick",
    "the run ends a tick early",
    "a robot leaves the terrain",
    "a mind fails",
)


@cache
def _prepared(name: str) -> Prepared:
    return prepare(load_scenario({**FLEET, **SCENARIOS[name]}))


def _failures(name: str) -> dict[str, str]:
    """Run a scenario; return the details of the checks that fail, by name."""
    return {check.name: check.detail for check in run_in_process(_prepared(name)).verdict.failed}


def test_every_kind_of_fault_is_wrong_in_two_ways() -> None:
    ways = Counter(
        kind
        for name, _, _ in MUTATIONS.values()
        for kind in {fault["kind"] for fault in SCENARIOS[name].get("faults", ())}
    )
    assert {kind for kind in KINDS if ways[kind] < 2} == set()


@pytest.mark.parametrize("name", SCENARIOS)
def test_code_that_is_right_fails_no_check(name: str) -> None:
    assert _failures(name) == {}


@pytest.mark.parametrize("what", MUTATIONS)
def test_the_responsible_check_fires(what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    name, check, plant = MUTATIONS[what]
    _prepared(name)  # by code that is right
    plant(monkeypatch)
    assert check in _failures(name)
