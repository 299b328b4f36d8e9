"""Small worlds for the world's tests, and a fleet that drives at random."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from patrol.exchange import Reply, Sensed
from patrol.ground.fields import StaticFields
from patrol.ground.own_place import OwnPlace
from patrol.ground.terrain import Terrain
from patrol.journal import Status
from patrol.pose import Command, Drive, Pose, Twist, Velocity
from patrol.prepare import Prepared, closable_ground, inboxes_of
from patrol.radio.inbox import Inboxes
from patrol.radio.message import Position, encode
from patrol.random import draw
from patrol.scenario import load_scenario
from worldsim.fleet.loop import run_ticks
from worldsim.fleet.process_control import NotStarted
from worldsim.output.record import Recorder, header_of
from worldsim.run_record import COMPLETED, MemoryJournal
from worldsim.world import World

NEVER = -1


def command_of(model: str, seed: int, number: int, k: int) -> Command:
    """A random command, often beyond the robot's limits."""
    first, second = (draw(seed, number, k, i) - 0.5 for i in (0, 1))
    match model:
        case "car":
            return Drive(12.0 * first, second)
        case "differential":
            return Twist(12.0 * first, 12.0 * second)
        case _:
            return Velocity(12.0 * first, 12.0 * second)


@dataclass
class RandomFleet:
    """Minds that send their positions and drive at random.

    silent: (number, k, phase) at which a robot does not answer any more. killed: (number, status) by the tick after
    which it is gone. heard: what arrived, by tick. done: what its hands were asked for. late: the tick before which a
    robot that is started arrives, where that is not at once; NEVER for one that never does. key: of the frames' tags.
    inboxes: what they hear with, by robot. seen: what its hands see of who is paused.
    places: where they take themselves to be.
    """

    world: World
    seed: int = 1
    silent: set[tuple[int, int, str]] = field(default_factory=set)
    killed: dict[int, tuple[int, Status]] = field(default_factory=dict)
    heard: list[Mapping[int, list[bytes]]] = field(default_factory=list)
    done: list[tuple[str, int]] = field(default_factory=list)
    late: dict[int, int] = field(default_factory=dict)
    finished: int | None = None
    key: bytes | None = None
    inboxes: dict[int, Inboxes] = field(default_factory=dict)
    seen: str = ""
    places: dict[int, OwnPlace] = field(default_factory=dict)

    def phase_a(self, k: int, sensed: Mapping[int, Sensed]) -> Mapping[int, Sequence[bytes]]:
        poses = {number: self._believed(number, k, one) for number, one in sensed.items()}
        return {
            number: (encode(Position.of(number, k, one.clock_s, poses[number]), self.key), *self._contacts(k, one))
            for number, one in sensed.items()
            if (number, k, "A") not in self.silent
        }

    def _believed(self, number: int, k: int, sensed: Sensed) -> Pose:
        own = self.places.setdefault(number, OwnPlace(self.world.step))
        return own.take(k, sensed.pose, self.world.bodies[number].command, sensed.bumped)

    def _contacts(self, k: int, sensed: Sensed) -> list[bytes]:
        return [encode(Position.of_contact(k, sensed.clock_s, x, y), self.key) for x, y in sensed.contacts]

    def phase_b(self, k: int, heard: Mapping[int, list[bytes]]) -> Mapping[int, Reply]:
        self.heard.append(heard)
        for number, frames in heard.items():
            self._inbox(number).hear(k, {number: frames})
        return {
            number: Reply(
                command_of(self.world.bodies[number].spec.model, self.seed, number, k),
                "dead-end" if (number + k) % 4 == 0 else "patrolling",
                None,
                float(number),
                self._inbox(number).rejected(number),
            )
            for number in heard
            if (number, k, "A") not in self.silent and (number, k, "B") not in self.silent
        }

    def _inbox(self, number: int) -> Inboxes:
        if number not in self.inboxes:
            bounds = self.world.terrain.bounds
            self.inboxes[number] = inboxes_of(self.world.scenario, [number], bounds, self.key)
        return self.inboxes[number]

    def lost(self) -> list[tuple[int, Status, str]]:
        gone = self.killed.pop(self.world.tick - 1, None)
        return [] if gone is None else [(*gone, "asked for")]

    def finish(self, k: int) -> None:
        self.finished = k

    def kill(self, number: int) -> None:
        self.done.append(("kill", number))

    def pause(self, number: int) -> str:
        self.done.append(("pause", number))
        return self.seen

    def resume(self, number: int) -> str:
        self.done.append(("resume", number))
        return self.seen

    def leave(self, number: int) -> None:
        self.done.append(("leave", number))

    def start(self, number: int, incarnation: int) -> None:
        self.done.append((f"start {incarnation}", number))
        self.inboxes.pop(number, None)
        self.places.pop(number, None)

    def arrived(self, number: int) -> bool:
        if self.late.get(number) == NEVER:
            raise NotStarted("it did not come")
        return self.world.tick >= self.late.get(number, 0)

    def release(self, paused: Iterable[int]) -> None:
        self.done += [("release", number) for number in paused]


@dataclass(frozen=True)
class Lab:
    """A room, and worlds in it for tests."""

    room: Terrain

    def world(
        self,
        robots: Sequence[dict[str, Any]],
        starts: Sequence[tuple[float, float, float]],
        terrain: Terrain | None = None,
        **more: Any,
    ) -> World:
        """A world on the room of 20 x 15 m, unless a terrain is given, all of whose free points count."""
        mapping = {"terrain": {"builtin": "open"}, "point": 0.5, "robots": list(robots), "sensor": {"range": 3.0}}
        scenario = load_scenario({**mapping, **more})
        ground = terrain or self.room
        proxy = np.full(ground.shape, -1, dtype=np.int32)
        fields = StaticFields(cspace=ground.free, reach=ground.free, patrolled=ground.free, proxy=proxy)
        poses = tuple(Pose(*start) for start in starts)
        return World(
            Prepared(
                scenario,
                ground,
                poses,
                {spec.number: fields for spec in scenario.roster},
                closable_ground(scenario, ground),
            )
        )

    def patrol(self, ticks: int = 40, seed: int = 1, **more: Any) -> World:
        """A world with two cars, a differential drive and a holonomic robot, not yet begun."""
        car = {"model": "car", "radius": 0.5, "turning_radius": 2.0}
        disc = {"model": "holonomic", "radius": 0.4}
        base = {"model": "differential", "radius": 0.4}
        starts = [(3.0, 3.0, 0.0), (9.0, 9.0, 1.0), (14.0, 4.0, 0.0), (5.0, 11.0, 0.0)]
        return self.world([car, car, base, disc], starts, duration=0.5 * ticks, seed=seed, **more)

    def run(
        self, world: World, fleet: RandomFleet | None = None, stop: Callable[[], bool] = lambda: False
    ) -> MemoryJournal:
        """The journal of a run to its end."""
        journal = MemoryJournal(header_of(world))
        recorder = Recorder(journal)
        driven = fleet or RandomFleet(world, world.scenario.seed)
        run_ticks(world, driven, recorder.tick, recorder.event, stop, driven)
        recorder.end(COMPLETED)
        return journal

    def driven(self, *args: Any, **more: Any) -> tuple[World, MemoryJournal]:
        """A patrol, run to its end."""
        world = self.patrol(*args, **more)
        return world, self.run(world)

    def fleet(self, world: World, **more: Any) -> RandomFleet:
        """A fleet that drives at random."""
        return RandomFleet(world, **more)


@pytest.fixture
def lab() -> Lab:
    """The room has a wall over x in [10, 10.5) below y = 7.5."""
    passable = np.ones((30, 40), dtype=np.bool_)
    passable[:15, 20] = False
    return Lab(Terrain("room", passable, 0.5))
