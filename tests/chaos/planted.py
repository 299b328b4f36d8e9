"""Faults planted into fogwatch on purpose: the verdict or the hunt must find each of them.

Each is a function that patches code of this process, the verdict's included: code that world and verdict share is wrong
for both, so only a check that does not use it can tell. For example, losses that drop half as many frames as asked for
are dropped in the same way by the ether with which the check `radio` recomputes their fates; `losses` counts them.

    python -m tests.chaos.planted >build/chaos/planted.jsonl         # all
    python -m tests.chaos.planted "a loss drops half as much"        # one
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import agent.mind
import agent.routes.ground
import agent.sender
import patrol.radio.inbox
import patrol.scenario.faults.kinds as faults
import worldsim.faults.timeline
import worldsim.output.record
import worldsim.radio.forging
import worldsim.radio.models.path_loss
import worldsim.radio.rules
import worldsim.robots.closures
import worldsim.robots.motion
import worldsim.robots.noise
import worldsim.robots.senses
import worldsim.world
from agent.ports import PolicyFailed
from experiments.inprocess import InProcessFleet, fault_free_mfow, run_in_process
from fogwatch.testing.swarm import random_fleet
from patrol.journal import Status
from patrol.pose import Pose
from patrol.prepare import Prepared
from patrol.radio.message import Rejected, RejectReason
from tests.chaos.coverage import of_scenario
from tests.chaos.examine import TRACES_DIFFER
from worldsim.robots.bodies import Body
from worldsim.truth import Truth
from worldsim.world import World

MOST_SEEDS = 60
"""Seeds after which a fault that was not found has survived."""

Patch = pytest.MonkeyPatch


@dataclass(frozen=True)
class Bug:
    """A planted fault.

    Attributes:
        what: What is wrong.
        kind: The kind of fault that it is planted into; empty for none.
        check: The check of the verdict that has to find it.
        needs: Kind of fault or feature without which it cannot show; empty for none.
        settings: Of the scenarios.
        plant: Patches this process.
    """

    what: str
    kind: str
    check: str
    needs: str
    settings: Mapping[str, Any]
    plant: Callable[[Patch], None]


BUGS: dict[str, Bug] = {}

LONG_BURSTS = {"kind": "loss", "rate": 0.5, "mean_burst": 10}
UNEVEN = {"kind": "motion", "who": "all", "jitter": {"size": 0.5}, "slip": {"rate": 0.4}}
CALM = {"terrain": {"builtin": "open"}, "point": 2.0, "step": 1.0, "duration": 1000.0, "nemesis": None, "faults": []}
SHORT_PAUSE = {"kind": "pause", "who": "one", "at": 5.0, "for": 5.0}
"""What some checks need in order to judge: runs that are long enough for shares, or for a patrol to come round."""


def bug(
    what: str, check: str, *, kind: str = "", needs: str = "", settings: Mapping[str, Any] | None = None
) -> Callable[[Callable[[Patch], None]], None]:
    """Register a function that plants a fault; the arguments are those of `Bug`."""

    def register(plant: Callable[[Patch], None]) -> None:
        BUGS[what] = Bug(what, kind, check, needs or kind, settings or {}, plant)

    return register


# --- what faults do --------------------------------------------------------------------------------------------------


def _stand_down(patch: Patch, expected: Status, **changed: Any) -> None:
    """Do something else when a robot is stood down with a status."""
    original = World.stand_down

    def stand_down(world: World, number: int, now: Status, reason: str, *, away: bool = False) -> Any:
        event = original(world, number, now, reason, away=away)
        if now is expected:
            for name, value in changed.items():
                setattr(world.bodies[number], name, value)
        return event

    patch.setattr(World, "stand_down", stand_down)


@bug("a killed robot goes on", "statuses", kind="kill")
def _planted(patch: Patch) -> None:
    _stand_down(patch, Status.DEAD, status=Status.ALIVE)
    patch.setattr(InProcessFleet, "kill", lambda *_: None)


@bug("a wreck that is to stay is removed", "moves", kind="kill")
def _planted(patch: Patch) -> None:
    _stand_down(patch, Status.DEAD, away=True)


@bug("a restarted robot never comes", "statuses", kind="restart")
def _planted(patch: Patch) -> None:
    patch.setattr(InProcessFleet, "arrived", lambda *_: False)


@bug("a restarted robot keeps what it has heard", "statuses", kind="restart")
def _planted(patch: Patch) -> None:
    patch.setattr(InProcessFleet, "_drop", lambda *_: None)
    patch.setattr(InProcessFleet, "start", lambda *_: None)


@bug("a paused robot drives on", "statuses", kind="pause")
def _planted(patch: Patch) -> None:
    _stand_down(patch, Status.PAUSED, status=Status.ALIVE)


@bug("a resumed robot stays paused", "statuses", kind="resume")
def _planted(patch: Patch) -> None:
    original = World.wake

    def wake(world: World, number: int, reason: str) -> Any:
        if "resume" in reason:
            return worldsim.world.Event(world.tick, "alive", number, reason)
        return original(world, number, reason)

    patch.setattr(World, "wake", wake)


@bug("a robot joins beside its start", "moves", kind="join")
def _planted(patch: Patch) -> None:
    original = World.wake

    def wake(world: World, number: int, reason: str) -> Any:
        event = original(world, number, reason)
        if "join" in reason:
            body = world.bodies[number]
            body.pose = Pose(body.pose.x + 0.1, body.pose.y, body.pose.heading)
        return event

    patch.setattr(World, "wake", wake)


@bug("a robot that has left is still in the way", "moves", kind="leave")
def _planted(patch: Patch) -> None:
    patch.setattr(Body, "present", property(lambda _: True))


@bug("a loss drops half as much", "losses", kind="loss")
def _planted(patch: Patch) -> None:
    original = worldsim.radio.rules.below
    patch.setattr(worldsim.radio.rules, "below", lambda *args: original(*args[:3], 0.5 * args[3]))


@bug("a burst lasts half as long", "losses", needs="loss", settings={"duration": 600.0, "faults": [LONG_BURSTS]})
def _planted(patch: Patch) -> None:
    original = worldsim.radio.rules.chain_of
    patch.setattr(worldsim.radio.rules, "chain_of", lambda rate, mean: original(rate, max(0.5 * mean, 1.0)))


@bug("a delay is half as long", "on time", kind="delay")
def _planted(patch: Patch) -> None:
    original = worldsim.radio.rules.waited
    patch.setattr(worldsim.radio.rules, "waited", lambda *args: 0.5 * original(*args))


def _copies(patch: Patch, kept: Callable[[list[Any]], list[Any]]) -> None:
    original = worldsim.radio.rules.RadioRules.copies
    patch.setattr(worldsim.radio.rules.RadioRules, "copies", lambda *args: kept(original(*args)))


@bug("a duplicate makes no copy", "delays and copies", kind="duplicate")
def _planted(patch: Patch) -> None:
    _copies(patch, lambda _: [])


@bug("a duplicate makes two copies", "on time", kind="duplicate")
def _planted(patch: Patch) -> None:
    _copies(patch, lambda copies: 2 * copies)


@bug("a frame that is held back is held for two steps more", "on time", kind="reorder")
def _planted(patch: Patch) -> None:
    original = worldsim.radio.rules.RadioRules.delays

    def delays(rules: Any, *link: int) -> list[tuple[str, float]]:
        return [(name, delay_s + 2.0 * rules._step) for name, delay_s in original(rules, *link)]

    patch.setattr(worldsim.radio.rules.RadioRules, "delays", delays)


@bug("a one-way partition cuts both ways", "nothing crossed", kind="partition")
def _planted(patch: Patch) -> None:
    original = worldsim.radio.rules._cut

    def cut(entry: Any, fault: Any, *args: Any) -> Any:
        return original(entry, fault.model_copy(update={"direction": "both"}), *args)

    patch.setattr(worldsim.radio.rules, "_cut", cut)


@bug("a silence does not stop what robots hear", "nothing crossed", kind="silence")
def _planted(patch: Patch) -> None:
    original = worldsim.radio.rules.RadioRules._hit

    def hit(rules: Any, entry: Any, sent: Any, receivers: Any, on_the_way: Any) -> Any:
        mask = original(rules, entry, sent, receivers, on_the_way)
        if isinstance(entry.fault, faults.Silence) and entry.fault.direction == "in":
            return np.zeros_like(mask)
        return mask

    patch.setattr(worldsim.radio.rules.RadioRules, "_hit", hit)


@bug("a reach is a tenth longer", "reach", kind="range")
def _planted(patch: Patch) -> None:
    original = worldsim.radio.rules.RadioRules._is_out_of_reach

    def is_out_of_reach(rules: Any, fault: Any, *link: int) -> bool:
        return original(rules, fault.model_copy(update={"reach": 1.1 * fault.reach}), *link)

    patch.setattr(worldsim.radio.rules.RadioRules, "_is_out_of_reach", is_out_of_reach)


@bug("a radio reaches through walls", "reach", kind="range")
def _planted(patch: Patch) -> None:
    patch.setattr(worldsim.radio.rules, "walls_on_line", lambda *_: 0)


@bug("a bandwidth is twice as wide", "bandwidth", kind="bandwidth")
def _planted(patch: Patch) -> None:
    original = worldsim.radio.rules.Bucket.__init__
    patch.setattr(
        worldsim.radio.rules.Bucket, "__init__", lambda self, rate, k, step: original(self, 2.0 * rate, k, step)
    )


@bug("a forged offset points the other way", "forgeries", kind="spoof")
def _planted(patch: Patch) -> None:
    original = worldsim.radio.forging.Pose
    patch.setattr(worldsim.radio.forging, "Pose", lambda x, y, heading: original(x - 1.0, y, heading))


@bug("a drift does not grow", "senses", kind="drift")
def _planted(patch: Patch) -> None:
    original = worldsim.robots.senses.Senses._error

    def error(senses: Any, entry: Any, fault: Any, *args: int) -> Any:
        return original(senses, entry, fault.model_copy(update={"growth": (0.0, 0.0)}), *args)

    patch.setattr(worldsim.robots.senses.Senses, "_error", error)


@bug("a clock does not gain", "senses", kind="clock")
def _planted(patch: Patch) -> None:
    original = worldsim.robots.senses.Senses.clock

    def clock(senses: Any, number: int, k: int) -> float:
        begins = [e.begin for e in senses.timeline.at(k) if isinstance(e.fault, faults.Clock) and number in e.who]
        time_s = original(senses, number, min(begins)) if begins else 0.0
        return time_s + (k - min(begins)) * senses._step if begins else original(senses, number, k)

    patch.setattr(worldsim.robots.senses.Senses, "clock", clock)


@bug("jitter is half as large", "motion", kind="motion", settings={"duration": 600.0, "faults": [UNEVEN]})
def _planted(patch: Patch) -> None:
    original = worldsim.robots.noise.draw

    def draw(*values: int) -> float:
        drawn = original(*values)
        return 0.5 + 0.5 * (drawn - 0.5) if values[-1] == worldsim.robots.noise._JITTER else drawn

    patch.setattr(worldsim.robots.noise, "draw", draw)


@bug("a body slips half as often", "motion", kind="motion", settings={"duration": 600.0, "faults": [UNEVEN]})
def _planted(patch: Patch) -> None:
    original = worldsim.robots.noise.draw

    def draw(*values: int) -> float:
        return math.sqrt(original(*values)) if values[-1] == worldsim.robots.noise._SLIP else original(*values)

    patch.setattr(worldsim.robots.noise, "draw", draw)


def _held(patch: Patch, kind: type[Any]) -> None:
    """Ignore a kind of faults of closures."""
    original = worldsim.robots.closures.Closures._held

    def held(closures: Any, k: int) -> dict[str, bool]:
        return {name: closed for name, closed in original(closures, k).items() if closed is not (kind is faults.Close)}

    patch.setattr(worldsim.robots.closures.Closures, "_held", held)


@bug("a closure that is to be closed stays as it is", "closures", kind="close")
def _planted(patch: Patch) -> None:
    _held(patch, faults.Close)


@bug("a closure that is to be open stays as it is", "closures", kind="open")
def _planted(patch: Patch) -> None:
    _held(patch, faults.Open)


# --- what checks look at ---------------------------------------------------------------------------------------------


@bug("the run ends a tick early", "complete")
def _planted(patch: Patch) -> None:
    original = World.__init__

    def init(world: World, *args: Any, **more: Any) -> None:
        original(world, *args, **more)
        world.ticks -= 1

    patch.setattr(World, "__init__", init)


@bug("the trace leaves out a tick", "trace")
def _planted(patch: Patch) -> None:
    original = worldsim.output.record.TraceHash

    class Forgetful(original):  # type: ignore[misc, valid-type]
        def tick(self, record: Any) -> None:
            if record.k != 10:
                super().tick(record)

    patch.setattr(worldsim.output.record, "TraceHash", Forgetful)


@bug("a mind fails", "nobody lost")
def _planted(patch: Patch) -> None:
    original = agent.mind.Mind.decide

    def decide(mind: Any, sensed: Any, *more: Any) -> Any:
        if sensed.k == 20:
            raise PolicyFailed("it was planted")
        return original(mind, sensed, *more)

    patch.setattr(agent.mind.Mind, "decide", decide)


def _records(patch: Patch, change: Callable[[Any], Any]) -> None:
    """Change what the world records of a tick."""
    original = World.end_tick
    patch.setattr(World, "end_tick", lambda *args: change(original(*args)))


def _rows(patch: Patch, of: Callable[[Any, int], bool], **changed: Any) -> None:
    """Change the rows of robots in each tick's record."""

    def change(record: Any) -> Any:
        rows = tuple(replace(row, **changed) if of(row, record.k) else row for row in record.robots)
        return replace(record, robots=rows)

    _records(patch, change)


@bug("a robot that is down decides", "the down are silent")
def _planted(patch: Patch) -> None:
    _rows(patch, lambda row, _: row.status is not Status.ALIVE, state="patrolling")


@bug("a robot leaves the terrain", "robots there")
def _planted(patch: Patch) -> None:
    _rows(patch, lambda row, k: row.number == 1 and k == 5, x=-1000.0)


@bug("a delivery is not recorded", "links add up")
def _planted(patch: Patch) -> None:
    _records(patch, lambda record: replace(record, deliveries=list(record.deliveries)[1:]))


@bug("faults last a tick longer", "fault times")
def _planted(patch: Patch) -> None:
    original = worldsim.faults.timeline.ticks_of
    patch.setattr(worldsim.faults.timeline, "ticks_of", lambda *args: original(*args) + 1)


@bug("bodies pass through each other", "bodies apart")
def _planted(patch: Patch) -> None:
    patch.setattr(worldsim.robots.motion, "_cancel_meeting", lambda *_: None)


@bug("bodies pass through walls", "bodies apart")
def _planted(patch: Patch) -> None:
    patch.setattr(worldsim.robots.motion, "path_is_free", lambda *_: True)


@bug("bodies get a little farther", "moves")
def _planted(patch: Patch) -> None:
    original = worldsim.robots.motion.advance
    patch.setattr(worldsim.robots.motion, "advance", lambda pose, command, step: original(pose, command, 1.001 * step))


@bug("a robot exceeds its top speed", "moves")
def _planted(patch: Patch) -> None:
    changed = worldsim.robots.noise._changed
    patch.setattr(worldsim.world, "within_limits", lambda _, command: changed(command, 1.5, 1.0, 0.0, 1.0))


@bug("moves are uneven without a fault", "moves")
def _planted(patch: Patch) -> None:
    def driven(noise: Any, k: int, commands: Any) -> Any:
        return {
            n: worldsim.robots.noise._changed(c, 0.9 if k % 7 == 0 else 1.0, 1.0, 0.0, noise._step)
            for n, c in commands.items()
        }

    patch.setattr(worldsim.robots.noise.MotionNoise, "driven", driven)


@bug("robots drive with an empty battery", "batteries", needs="feature batteries")
def _planted(patch: Patch) -> None:
    patch.setattr(worldsim.world.Batteries, "is_empty", lambda *_: False)


@bug("bodies pass through keep-outs", "keep-outs", needs="feature zone: keep-out")
def _planted(patch: Patch) -> None:
    original = worldsim.robots.motion.path_is_free

    def path_is_free(terrain: Any, *args: Any) -> Any:
        return original(type(terrain)(terrain.name, terrain.passable, terrain.point, terrain.origin), *args)

    patch.setattr(worldsim.robots.motion, "path_is_free", path_is_free)


@bug("slow zones slow nothing", "slow zones", needs="feature zone: slow")
def _planted(patch: Patch) -> None:
    patch.setattr(worldsim.world, "slowed", lambda command, _: command)


@bug("minds know no direction of zones", "one-way zones", needs="feature zone: one-way")
def _planted(patch: Patch) -> None:
    original = agent.routes.ground.Ground.__init__

    def init(ground: Any, *args: Any, **more: Any) -> None:
        original(ground, *args, **more)
        ground.against = agent.routes.ground.ALL_WAYS

    patch.setattr(agent.routes.ground.Ground, "__init__", init)


@bug("zones begin and end unseen", "zone times", needs="feature zone: times")
def _planted(patch: Patch) -> None:
    original = World.close_and_open

    def close_and_open(world: World) -> Any:
        return (event for event in original(world) if "force" not in event.kind)

    patch.setattr(World, "close_and_open", close_and_open)


@bug("bodies pass through what is closed", "closures", needs="feature closures by times")
def _planted(patch: Patch) -> None:
    original = worldsim.robots.motion.path_is_free
    patch.setattr(
        worldsim.robots.motion,
        "path_is_free",
        lambda terrain, *args: original(getattr(terrain, "base", terrain), *args),
    )


@bug("closures close on robots", "closures", needs="feature closures by rates")
def _planted(patch: Patch) -> None:
    patch.setattr(worldsim.robots.closures.Closures, "_overlaps", lambda *_: False)


def _positions(patch: Patch, **moved: int) -> None:
    original = agent.sender.encode

    def encode(position: Any, key: Any) -> bytes:
        changed = {name: getattr(position, name) + by for name, by in moved.items()}
        return original(replace(position, **changed), key)

    patch.setattr(agent.sender, "encode", encode)


@bug("robots send places a centimetre off", "frames")
def _planted(patch: Patch) -> None:
    _positions(patch, x_cm=1)


@bug("robots send their clock a millisecond late", "frames")
def _planted(patch: Patch) -> None:
    _positions(patch, time_ms=1)


@bug("robots report no intruder", "frames", needs="feature intruders")
def _planted(patch: Patch) -> None:
    original = agent.sender.Sender.frames
    patch.setattr(agent.sender.Sender, "frames", lambda *args: original(*args)[:1])


@bug("adaptive robots stay silent for too long", "frames", needs="feature adaptive sending")
def _planted(patch: Patch) -> None:
    original = agent.sender.Sender.__init__

    def init(sender: Any, number: int, sending: Any, key: Any) -> None:
        original(sender, number, replace(sending, silence=sending.silence + 2), key)

    patch.setattr(agent.sender.Sender, "__init__", init)


@bug("the world's draws are not repeated", "radio", needs="loss")
def _planted(patch: Patch) -> None:
    original = worldsim.world.ether_of

    def ether_of(scenario: Any, *args: Any, **more: Any) -> Any:
        return original(scenario.model_copy(update={"seed": scenario.seed + 1}), *args, **more)

    patch.setattr(worldsim.world, "ether_of", ether_of)


@bug("a drop names a fault that was not there", "drops", needs="loss")
def _planted(patch: Patch) -> None:
    patch.setattr(worldsim.radio.rules, "cause", lambda entry: f"loss:{entry.id}x")


@bug("strangers know the key", "forged frames", needs="spoof")
def _planted(patch: Patch) -> None:
    original = patrol.radio.inbox.decode

    def decode(frame: bytes, key: Any) -> Any:
        try:
            return original(frame, key)
        except Rejected as rejected:
            if rejected.reason is not RejectReason.TAG:
                raise
            return replace(original(frame[:-8], None))

    patch.setattr(patrol.radio.inbox, "decode", decode)


@bug("a forged frame comes in a tick without a spoof", "forgeries", needs="spoof")
def _planted(patch: Patch) -> None:
    original = worldsim.radio.forging.Forger.forge

    def forge(forger: Any, k: int, *args: Any) -> Any:
        forged = original(forger, k, *args)
        return forged + forged[:1]

    patch.setattr(worldsim.radio.forging.Forger, "forge", forge)


@bug("walls do not weaken the radio", "path loss", needs="feature path loss")
def _planted(patch: Patch) -> None:
    patch.setattr(
        worldsim.radio.models.path_loss,
        "walls_between",
        lambda _walls, _p, _x, _y, places, _b: np.zeros((len(places),) * 2),
    )


@bug("a frame is heard at twice the noise", "path loss", needs="feature path loss")
def _planted(patch: Patch) -> None:
    original = worldsim.radio.models.path_loss.PathLoss._noise
    patch.setattr(worldsim.radio.models.path_loss.PathLoss, "_noise", lambda *args: original(*args) + 3.0)


@bug("robots send more than their share", "budget", needs="feature radio budget")
def _planted(patch: Patch) -> None:
    patch.setattr(agent.sender.Allowance, "suffices", lambda *_: True)
    patch.setattr(agent.sender.Allowance, "take", lambda *_: True)


@bug("late frames come a tick early", "on time", needs="delay")
def _planted(patch: Patch) -> None:
    original = worldsim.radio.ether.arrival
    patch.setattr(worldsim.radio.ether, "arrival", lambda k, *args: max(original(k, *args) - 1, k))


@bug("one robot sees nothing", "fog")
def _planted(patch: Patch) -> None:
    original = Truth.observe

    def observe(truth: Truth, tick: int, poses: Any) -> None:
        original(truth, tick, [(number, pose) for number, pose in poses if number != 1])

    patch.setattr(worldsim.world.Truth, "observe", observe)


@bug("a robot counts a refused frame too many", "refused frames", needs="feature key")
def _planted(patch: Patch) -> None:
    _rows(patch, lambda row, k: row.rejected is not None and k > 10, rejected=1000)


@bug("inboxes accept a frame again and again", "refused frames", needs="duplicate")
def _planted(patch: Patch) -> None:
    original = patrol.radio.inbox.hear

    def hear(cells: Any, *args: Any) -> Any:
        now = original(cells, *args)
        cells["sequence"] = np.where(cells["sequence"] > 0, cells["sequence"] - 1, cells["sequence"])
        return now

    patch.setattr(patrol.radio.inbox, "hear", hear)


@bug("minds draw by the wall clock", TRACES_DIFFER)
def _planted(patch: Patch) -> None:
    original = agent.mind.Mind.frames
    count = [0]

    def frames(mind: Any, sensed: Any) -> Any:
        count[0] += 1
        return original(mind, sensed)[: count[0] % 100 and None]

    patch.setattr(agent.mind.Mind, "frames", frames)


class Seeds:
    """Scenarios by seed, drawn once for all planted faults."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._drawn: dict[tuple[int, str], tuple[Prepared, set[str]]] = {}

    def draw(self, seed: int, settings: Mapping[str, Any]) -> tuple[Prepared, set[str]]:
        """Return a scenario, and its features and kinds of faults."""
        key = seed, repr(settings)
        if key not in self._drawn:
            prepared = random_fleet(seed, self._folder, settings)
            met = of_scenario(prepared.scenario) | {fault.kind for fault in prepared.scenario.faults}
            self._drawn[key] = prepared, met
        return self._drawn[key]


@bug("minds stop deciding", "progress", settings=CALM)
def _planted(patch: Patch) -> None:
    _stops(patch, 0)


@bug("minds stop deciding after a fault", "recovery", settings={**CALM, "faults": [SHORT_PAUSE]})
def _planted(patch: Patch) -> None:
    _stops(patch, 20)


def _stops(patch: Patch, since: int) -> None:
    """Let all minds stand still from a tick on."""
    original = agent.mind.Mind.decide

    def decide(mind: Any, sensed: Any, *more: Any) -> Any:
        decision = original(mind, sensed, *more)
        standing = worldsim.world.standstill(mind.spec)
        return replace(decision, command=standing) if sensed.k >= since else decision

    patch.setattr(agent.mind.Mind, "decide", decide)


def find(bug: Bug, seeds: Seeds, most: int = MOST_SEEDS) -> tuple[int, int, tuple[str, ...]] | None:
    """Look for a planted fault, seed by seed.

    Args:
        bug: The fault.
        seeds: The scenarios.
        most: Seeds that are looked at.

    Returns:
        The seed that found it, the number of seeds that were run, and the checks that failed there; None where it has
        survived.
    """
    ran = 0
    for seed in range(1, most + 1):
        prepared, met = seeds.draw(seed, bug.settings)
        if bug.needs and bug.needs not in met:
            continue
        ran += 1
        baseline_s = fault_free_mfow(prepared) if bug.check == "recovery" else None
        with Patch.context() as patch:
            bug.plant(patch)
            found = _found_by(bug, prepared, baseline_s)
        if found:
            return seed, ran, found
    return None


def _found_by(bug: Bug, prepared: Prepared, baseline_s: float | None) -> tuple[str, ...]:
    """Return the checks that a planted fault fails; a check that only warns counts where it is meant."""
    try:
        first = run_in_process(prepared, baseline_s=baseline_s)
        checks = first.verdict.checks
        found = tuple(c.name for c in checks if not c.ok or (c.warnings and c.name == bug.check))
        if found or bug.check != TRACES_DIFFER:
            return found
        again = run_in_process(prepared, keep=False, verify_fog=False)
    except Exception as error:  # noqa: BLE001 - finds it too
        return (type(error).__name__,)
    return () if again.summary.trace_hash == first.summary.trace_hash else (TRACES_DIFFER,)


def main() -> int:
    """Look for the planted faults, and print a line for each as JSON."""
    parser = argparse.ArgumentParser(prog="python -m tests.chaos.planted")
    parser.add_argument("names", nargs="*", help="of planted faults (default: all)")
    survivors = 0
    with tempfile.TemporaryDirectory() as folder:
        seeds = Seeds(Path(folder))
        for what in parser.parse_args().names or BUGS:
            bug = BUGS[what]
            seed, ran, checks = find(bug, seeds) or (None, None, ())
            survivors += bug.check not in checks
            line = {"what": what, "kind": bug.kind, "check": bug.check, "seed": seed, "ran": ran, "checks": checks}
            print(json.dumps(line), flush=True)
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
