"""The faults that are planted into fogwatch: patches of this process, the verdict's code included.

Code that world and verdict share is wrong for both, so only a check that does not use it can tell. For example, losses
that drop half as many frames as asked for are dropped in the same way by the ether with which the check `radio`
recomputes their fates; `losses` counts them.
"""

import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import count
from types import MappingProxyType, ModuleType
from typing import Any

import numpy as np
import pytest

from agent import sender
from agent.mind import Mind
from agent.ports import PolicyFailed
from fogwatch.inprocess import InProcessFleet
from patrol.changing.ground import WAITING
from patrol.energy.batteries import Batteries
from patrol.faults.kinds import Clock
from patrol.ground.fog import Fog
from patrol.ground.terrain import Terrain
from patrol.journal import Event, Status
from patrol.journal.records import IN_FORCE, OUT_OF_FORCE
from patrol.pose import Command, Drive, Twist, Velocity
from patrol.radio import inbox
from patrol.radio.allowance import Allowance
from patrol.summary.totals import RunTotals
from tests.chaos.examine import TRACES_DIFFER
from worldsim import faults as timeline
from worldsim import world
from worldsim.faults import SKIPPED
from worldsim.fleet.acts import Acts
from worldsim.output import record
from worldsim.radio import ether, forging, path_loss, rules
from worldsim.robots import bodies as motion
from worldsim.robots import noise
from worldsim.robots.bodies import Body, standstill
from worldsim.robots.closures import Closures
from worldsim.robots.senses import Senses
from worldsim.truth import Truth
from worldsim.world import World

Plant = Callable[[pytest.MonkeyPatch], None]


@dataclass(frozen=True)
class Bug:
    """A planted fault."""

    check: str  # of the verdict, which has to find it
    plant: Plant  # patches this process
    kind: str  # of fault that it is planted into; empty for none
    needs: str  # kind of fault or feature without which it cannot show; empty for none
    settings: Mapping[str, Any]  # of the scenarios


BUGS: dict[str, Bug] = {}
"""By what is wrong."""

LOSSY = {"duration": 600.0, "faults": [{"kind": "loss", "rate": 0.5}]}
LONG_BURSTS = {"duration": 600.0, "faults": [{"kind": "loss", "rate": 0.5, "mean_burst": 10}]}
LATE = {"duration": 600.0, "faults": [{"kind": "delay", "delay": {"exponential": 2.0}}]}
COPIED = {"duration": 600.0, "faults": [{"kind": "duplicate", "rate": 0.3, "delay": {"uniform": [0.5, 9.5]}}]}
NARROW: dict[str, Any] = {"duration": 100.0, "faults": [{"kind": "bandwidth", "who": "all", "bytes_per_s": 10.0}]}
NARROW["faults"] += [{"kind": "pause", "who": "one", "at": 10.0, "for": 60.0}]
TALKATIVE: dict[str, Any] = {"radio.adaptive": None, "radio.budget": None, "nemesis": None}
DRIFTING = {"duration": 600.0, "faults": [{"kind": "drift", "who": "all", "growth": [0.05, 0.02]}]}
SHAKEN = {"kind": "motion", "who": "all", "jitter": {"size": 0.5}, "slip": {"rate": 0.4}}
UNEVEN = {"duration": 600.0, "faults": [SHAKEN]}
CALM: dict[str, Any] = {
    "terrain": {"builtin": "open"},
    "point": 2.0,
    "step": 1.0,
    "duration": 400.0,
    "sensor.range": 25.0,
}
CALM |= {"nemesis": None, "faults": [], "patrol.policy": "committed", "robots.speed": 5.0, "robots.battery": None}
HOLONOMIC = {**CALM, "duration": 100.0, "robots.model": "holonomic"}
SHORT_PAUSE = {**CALM, "faults": [{"kind": "pause", "who": "one", "at": 5.0, "for": 5.0}]}
"""What some checks need in order to judge: runs that are long enough for shares, or for a patrol to come round."""


def _bug(
    what: str, check: str, *, kind: str = "", needs: str = "", settings: Mapping[str, Any] = MappingProxyType({})
) -> Callable[..., None]:
    """Take in a bug, once it is given its plants."""

    def planted_by(*plants: Plant) -> None:
        def plant(patch: pytest.MonkeyPatch) -> None:
            for each in plants:
                each(patch)

        BUGS[what] = Bug(check, plant, kind, needs or kind, settings)

    return planted_by


def put(owner: Any, name: str, make: Callable[[Any], Any]) -> Plant:
    """Put something in the place of an attribute, and of a module's own function wherever that was imported."""

    def plant(patch: pytest.MonkeyPatch) -> None:
        real = getattr(owner, name)
        is_function = isinstance(owner, ModuleType) and getattr(real, "__module__", "") == owner.__name__
        importers = [module for module in list(sys.modules.values()) if vars(module).get(name) is real]
        for each in importers if is_function else [owner]:
            patch.setattr(each, name, make(real))

    return plant


def altered(**changed: Any) -> Callable[[Any], Any]:
    """Make a change of a frozen model or dataclass."""
    return lambda value: value.model_copy(update=changed) if hasattr(value, "model_copy") else replace(value, **changed)


# --- what faults do --------------------------------------------------------------------------------------------------


def alter_stood_down(expected: Status, **changed: Any) -> Plant:
    """Change a body when its robot is stood down with a status."""

    def make(real: Any) -> Any:
        def stand_down(of: World, number: int, status: Status, reason: str, *, away: bool = False) -> Event:
            event: Event = real(of, number, status, reason, away=away)
            for name, value in changed.items() if status is expected else ():
                setattr(of.bodies[number], name, value)
            return event

        return stand_down

    return put(World, "stand_down", make)


def _resumes(real: Any) -> Any:
    def wake(of: World, number: int, reason: str) -> Any:
        return Event(of.tick, "alive", number, reason) if "resume" in reason else real(of, number, reason)

    return wake


def _joins(real: Any) -> Any:
    def wake(of: World, number: int, reason: str) -> Any:
        event, body = real(of, number, reason), of.bodies[number]
        if "join" in reason:
            body.pose = replace(body.pose, x=body.pose.x + 0.1)
        return event

    return wake


def _hears(real: Any) -> Any:
    def hit(of: Any, entry: Any, *args: Any) -> Any:
        mask = real(of, entry, *args)
        return np.zeros_like(mask) if getattr(entry.fault, "direction", "") == "in" else mask

    return hit


def _clock(real: Any) -> Any:
    def clock(of: Senses, number: int, k: int) -> float:
        begins = [e.begin for e in of.timeline.at(k) if isinstance(e.fault, Clock) and number in e.who]
        return float(real(of, number, min(begins)) + (k - min(begins)) * of._step if begins else real(of, number, k))

    return clock


def alter_draws(purpose: int, change: Callable[[float], float]) -> Plant:
    """Change the draws of motion noise for a purpose."""
    return put(noise, "draw", lambda real: lambda *of: change(real(*of)) if of[-1] == purpose else real(*of))


def _held(ignored: bool) -> Plant:
    """Ignore the faults that close closures, or those that open them."""
    return put(
        Closures,
        "_held",
        lambda real: lambda of, k: {name: is_ for name, is_ in real(of, k).items() if is_ is not ignored},
    )


def _untold(owner: Any, method: str, *kinds: str) -> Plant:
    """Leave out the events of some kinds that a method yields."""
    return put(owner, method, lambda real: lambda *of: (event for event in real(*of) if event.kind not in kinds))


_dropped = put(InProcessFleet, "kill", lambda _: lambda *_: None)
_bug("a killed robot goes on", "statuses", kind="kill")(alter_stood_down(Status.DEAD, status=Status.ALIVE), _dropped)
_bug("the event of a kill names no fault", "events", kind="kill")(
    put(World, "stand_down", lambda real: lambda of, number, status, _, **how: real(of, number, status, "", **how))
)
_bug("an act that makes no sense is skipped unseen", "events")(_untold(Acts, "due", SKIPPED))
_bug("a wreck that is to stay is removed", "moves", kind="kill")(alter_stood_down(Status.DEAD, away=True))
_bug("a restarted robot never comes", "statuses", kind="restart")(
    put(InProcessFleet, "arrived", lambda _: lambda *_: False)
)
_bug("a restarted robot keeps what it has heard", "refused frames", kind="restart")(
    put(InProcessFleet, "kill", lambda _: lambda *_: None),
    put(
        InProcessFleet, "start", lambda real: lambda of, number, n: None if number in of.minds else real(of, number, n)
    ),
)
_bug("a paused robot drives on", "statuses", kind="pause")(alter_stood_down(Status.PAUSED, status=Status.ALIVE))
_bug("a resumed robot stays paused", "statuses", kind="resume")(put(World, "wake", _resumes))
_bug("a robot joins beside its start", "moves", kind="join")(put(World, "wake", _joins))
_bug("a robot that has left is still in the way", "moves", kind="leave")(
    put(Body, "present", lambda _: property(lambda _: True))
)
_bug("a loss drops half as much", "losses", kind="loss", settings=LOSSY)(
    put(rules, "below", lambda real: lambda *of: real(*of[:3], 0.5 * of[3]))
)
_bug("a loss is drawn once for each sender", "losses", kind="loss", settings=LOSSY)(
    put(rules, "below", lambda real: lambda of, to, *more: real(of, 0 * to, *more))
)
_bug("a loss is drawn once for each link", "losses", kind="loss", settings=LOSSY)(
    put(rules, "below", lambda real: lambda of, to, k, *more: real(of, to, 0 * k, *more))
)
_bug("a burst is drawn once for each sender", "losses", kind="loss", settings=LONG_BURSTS | TALKATIVE)(
    put(rules.Burst, "__init__", lambda real: lambda *of: real(*of[:-1], (of[-1][0], 0)))
)
_bug("a delay is drawn once for each sender", "delays and copies", kind="delay", settings=LATE)(
    put(rules, "waited", lambda real: lambda *of: real(*of[:5], 0, *of[6:]))
)
_bug("a copy's delay is drawn with the number that made it", "delays and copies", kind="duplicate", settings=COPIED)(
    put(rules, "waited", lambda real: lambda *of: real(*of[:7]))
)
_bug("a burst lasts half as long", "losses", kind="loss", settings=LONG_BURSTS)(
    put(rules, "chain_of", lambda real: lambda rate, mean: real(rate, max(0.5 * mean, 1.0)))
)
_bug("a delay is half as long", "on time", kind="delay")(put(rules, "waited", lambda real: lambda *of: 0.5 * real(*of)))
_copies = rules.RadioRules, "copies"
_bug("a duplicate makes no copy", "delays and copies", kind="duplicate")(put(*_copies, lambda _: lambda *_: []))
_bug("a duplicate makes two copies", "on time", kind="duplicate")(put(*_copies, lambda real: lambda *of: 2 * real(*of)))
_bug("a frame that is held back is held for two steps more", "on time", kind="reorder")(
    put(
        rules.RadioRules, "delays", lambda real: lambda of, *link: [(n, s + 2.0 * of._step) for n, s in real(of, *link)]
    )
)
_bug("a one-way partition cuts both ways", "nothing crossed", kind="partition")(
    put(rules, "_mark_cuts", lambda real: lambda entry, fault, *of: real(entry, altered(direction="both")(fault), *of))
)
_bug("a silence does not stop what robots hear", "nothing crossed", kind="silence")(
    put(rules.RadioRules, "_mark_hits", _hears)
)
_bug("a reach is a tenth longer", "reach", kind="range")(
    put(
        rules.RadioRules,
        "_is_out_of_reach",
        lambda real: lambda of, fault, *link: real(of, altered(reach=1.1 * fault.reach)(fault), *link),
    )
)
_bug("a radio reaches through walls", "reach", kind="range")(put(rules, "walls_on_line", lambda _: lambda *_: 0))
_bug("a bandwidth is twice as wide", "bandwidth", kind="bandwidth")(
    put(rules.Bucket, "__init__", lambda real: lambda of, rate, *more: real(of, 2.0 * rate, *more))
)
_bug("a forged place is a metre off", "forgeries", kind="spoof")(
    put(forging, "Pose", lambda real: lambda x, *of: real(x - 1.0, *of))
)
_bug("a drift does not grow", "senses", kind="drift", settings=DRIFTING)(
    put(
        Senses,
        "_pose_error",
        lambda real: lambda of, e, fault, *at: real(of, e, altered(growth=(0.0, 0.0))(fault), *at),
    )
)
_bug("a clock does not gain", "senses", kind="clock")(put(Senses, "clock", _clock))
_bug("jitter is half as large", "motion", kind="motion", settings=UNEVEN)(
    alter_draws(noise._JITTER, lambda share: 0.25 + 0.5 * share)
)
_bug("a body slips half as often", "motion", kind="motion", settings=UNEVEN)(alter_draws(noise._SLIP, math.sqrt))
_bug("a closure that is to be closed stays as it is", "closures", kind="close")(_held(True))
_bug("a closure that is to be open stays as it is", "closures", kind="open")(_held(False))


# --- what else checks look at ----------------------------------------------------------------------------------------


def alter_recorded(change: Callable[[Any], Any]) -> Plant:
    """Change what the world records of a tick."""
    return put(World, "end_tick", lambda real: lambda *of: change(real(*of)))


def alter_rows(where: Callable[[Any, int], bool], **changed: Any) -> Plant:
    """Change the rows of some robots in each tick's record."""
    change = altered(**changed)
    return alter_recorded(lambda of: replace(of, robots=tuple(change(r) if where(r, of.k) else r for r in of.robots)))


def alter_new(owner: Any, change: Callable[[Any], None]) -> Plant:
    """Change objects of a class once they are made."""

    def make(real: Any) -> Any:
        def init(of: Any, *args: Any, **more: Any) -> None:
            real(of, *args, **more)
            change(of)

        return init

    return put(owner, "__init__", make)


def _ends_early(of: World) -> None:
    of.ticks -= 1


def _stays_silent(of: Any) -> None:
    of._sending = replace(of._sending, silence=of._sending.silence + 2)


def alter_decisions(change: Callable[[Any, Any, Any], Any]) -> Plant:
    """Change minds' decisions, by the mind, what it senses and its decision."""
    return put(Mind, "decide", lambda real: lambda of, sensed, *more: change(of, sensed, real(of, sensed, *more)))


def _fails(_mind: Any, sensed: Any, decision: Any) -> Any:
    if sensed.k == 20:
        raise PolicyFailed("it was planted")
    return decision


def _stops(since: int) -> Plant:
    def change(mind: Any, sensed: Any, decision: Any) -> Any:
        return replace(decision, command=standstill(mind.spec)) if sensed.k >= since else decision

    return alter_decisions(change)


def _trace(real: Any) -> Any:
    class Forgetful(real):  # type: ignore[misc]
        def tick(self, of: Any) -> None:
            if of.k != 10:
                super().tick(of)

    return Forgetful


def _driven(_: Any) -> Any:
    def driven(of: Any, k: int, commands: Any) -> Any:
        speed = 0.9 if k % 7 == 0 else 1.0
        return {
            number: noise._change_command(command, speed, 1.0, 0.0, of._step) for number, command in commands.items()
        }

    return driven


def _accepts_again(real: Any) -> Any:
    def hear(cells: Any, *args: Any) -> Any:
        is_past = real(cells, *args)
        cells["sequence"] = np.where(cells["sequence"] > 0, cells["sequence"] - 1, cells["sequence"])
        return is_past

    return hear


def _sent(**moved: int) -> Plant:
    """Add to fields of the frames that robots send."""

    def make(real: Any) -> Any:
        def encode(position: Any, key: Any) -> Any:
            return real(replace(position, **{name: getattr(position, name) + by for name, by in moved.items()}), key)

        return encode

    return put(sender, "encode", make)


def _drives_blindly(mind: Any, sensed: Any, decision: Any) -> Any:
    """Drive to and fro at top speed, whatever is in the way."""
    spec, turn = mind.spec, sensed.k // 12
    speed = spec.speed if turn % 2 else -spec.speed
    commands: dict[str, Command] = {
        "car": Drive(speed, 0.4 / spec.turning_radius),
        "differential": Twist(speed, 0.1),
        "holonomic": Velocity(speed * math.cos(turn), speed * math.sin(turn)),
    }
    return replace(decision, command=commands[spec.model])


_calls = count()


def _hesitates(mind: Any, _sensed: Any, decision: Any) -> Any:
    """Stand still at every hundredth decision of this process, in whatever run."""
    return replace(decision, command=standstill(mind.spec)) if next(_calls) % 100 == 0 else decision


def _drives_east(mind: Any, _sensed: Any, decision: Any) -> Any:
    return replace(decision, command=Velocity(mind.spec.speed, 0.0))


def _free(real: Any, ground_of: Callable[[Any], Any]) -> Any:
    return lambda terrain, *of: real(ground_of(terrain), *of)


def _late_by_first_half(real: Any) -> Any:
    def figures(of: Any, events: Any) -> Any:
        first = np.mean(of._mfow[: len(of._mfow) // 2]) * of._step
        return altered(mfow_late_mean_s=float(first))(real(of, events))

    return figures


_path_is_free = motion, "path_is_free"
drive_blindly = alter_decisions(_drives_blindly)
_bug("the run ends a tick early", "complete")(alter_new(World, _ends_early))
_bug("the trace leaves out a tick", "trace")(put(record, "TraceHash", _trace))
_bug("a mind fails", "nobody lost")(alter_decisions(_fails))
_bug("a robot that is down decides", "the down are silent")(
    alter_rows(lambda row, _: row.status is not Status.ALIVE, state="patrolling")
)
_bug("a robot leaves the terrain", "robots there")(alter_rows(lambda row, k: row.number == 1 and k == 5, x=-1000.0))
_bug("a delivery is not recorded", "links add up")(
    alter_recorded(lambda of: replace(of, deliveries=list(of.deliveries)[1:]))
)
_bug("faults last a tick longer", "fault times")(put(timeline, "ticks_of", lambda real: lambda *of: real(*of) + 1))
_bug("bodies pass through each other", "bodies apart")(put(motion, "_cancel_meeting", lambda _: lambda *_: None))
_bug("bodies pass through walls", "bodies apart")(put(*_path_is_free, lambda _: lambda *_: True))
_bug("bodies get a little farther", "moves")(
    put(motion, "advance", lambda real: lambda at, of, step: real(at, of, 1.001 * step))
)
_bug("a robot exceeds its top speed", "moves")(
    put(world, "within_limits", lambda _: lambda _, command: noise._change_command(command, 1.5, 1.0, 0.0, 1.0))
)
_bug("moves are uneven without a fault", "moves")(put(noise.MotionNoise, "driven", _driven))
_bug("the fog counts a tick less", "fog")(put(Fog, "mfow", lambda real: lambda *of: real(*of) - 1))
_bug("the late mean is that of the first half", "figures")(put(RunTotals, "figures", _late_by_first_half))
_bug("robots drive with an empty battery", "batteries", needs="feature batteries")(
    put(Batteries, "is_empty", lambda _: lambda *_: False)
)
_bug("bodies pass through keep-outs", "keep-outs", needs="feature zone: keep-out")(
    drive_blindly,
    put(*_path_is_free, lambda real: _free(real, lambda t: Terrain(t.name, t.passable, t.point, t.origin))),
)
_bug("slow zones slow nothing", "slow zones", needs="feature zone: slow")(
    drive_blindly, put(world, "slowed", lambda _: lambda command, _: command)
)
_bug("zones begin and end unseen", "zone times", needs="feature zone: times")(
    _untold(World, "close_and_open", IN_FORCE, OUT_OF_FORCE)
)
_bug("bodies pass through what is closed", "closures", needs="feature closures by times")(
    drive_blindly, put(*_path_is_free, lambda real: _free(real, lambda t: getattr(t, "base", t)))
)
_bug("closures wait for robots unseen", "closures", needs="feature closures by times")(
    _untold(World, "close_and_open", WAITING)
)
_bug("closures close on robots", "bodies apart", needs="feature closures by rates")(
    put(Closures, "_overlaps_body", lambda _: lambda *_: False)
)
_bug("robots send places a centimetre off", "frames")(_sent(x_cm=1))
_bug("robots send their clock a millisecond late", "frames")(_sent(time_ms=1))
_bug("robots report no intruder", "frames", needs="feature intruders")(
    put(sender.Sender, "frames", lambda real: lambda *of: real(*of)[:1])
)
_bug("adaptive robots stay silent for too long", "frames", needs="feature adaptive sending")(
    alter_new(sender.Sender, _stays_silent)
)
_bug("the world's draws are not repeated", "radio", needs="loss")(
    put(world, "ether_of", lambda real: lambda of, *more, **named: real(altered(seed=of.seed + 1)(of), *more, **named))
)
_bug("a drop names a fault that was not there", "drops", needs="loss")(
    put(rules, "cause", lambda _: lambda entry: f"loss:{entry.id}x")
)
_bug("strangers know the key", "forged frames", needs="spoof")(
    put(inbox, "decode", lambda real: lambda frame, _: real(frame, None))
)
_bug("a forged frame comes twice", "forgeries", needs="spoof")(
    put(forging.Forger, "forge", lambda real: lambda *of: 2 * real(*of))
)
_bug("walls do not weaken the radio", "path loss", needs="feature path loss")(
    put(path_loss, "walls_between", lambda _: lambda *of: np.zeros((len(of[4]),) * 2))
)
_bug("a frame meets twice the noise", "path loss", needs="feature path loss")(
    put(path_loss.PathLoss, "_noise_levels", lambda real: lambda *of: real(*of) + 3.0)
)
_bug("robots send more than their share", "budget", needs="feature radio budget")(
    put(Allowance, "suffices", lambda _: lambda *_: True), put(Allowance, "take", lambda _: lambda *_: True)
)
_bug("a bandwidth saves up without end", "bandwidth", kind="bandwidth", settings=NARROW)(
    alter_new(rules.Bucket, lambda of: vars(of).update(_capacity=math.inf))
)
_bug("late frames come a tick early", "on time", needs="delay")(
    put(ether, "arrival", lambda real: lambda k, *of: max(real(k, *of) - 1, k))
)
_bug("one robot sees nothing", "fog")(
    put(Truth, "observe", lambda real: lambda of, k, poses: real(of, k, [pose for pose in poses if pose[0] != 1]))
)
_bug("a robot counts a refused frame too many", "refused frames", needs="feature key")(
    alter_rows(lambda row, k: row.rejected is not None and k > 10, rejected=1000)
)
_bug("inboxes accept a frame again and again", "refused frames", needs="duplicate")(put(inbox, "hear", _accepts_again))
_bug("minds count what others decide", TRACES_DIFFER)(alter_decisions(_hesitates))
_bug("minds drive east, whatever is there", "bumps", settings=HOLONOMIC)(alter_decisions(_drives_east))
_bug("minds stop deciding", "progress", settings=CALM)(_stops(0))
_bug("minds stop deciding after a fault", "recovery", settings=SHORT_PAUSE)(_stops(20))
