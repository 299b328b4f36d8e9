"""A fleet's future as an intruder computes it that has the scenario and the code, but not the secret of the draws.

Such an intruder runs the whole fleet in its own computer. At the moment of an attempt it knows the state of every
robot's mind and of the world, as if it had been told all draws so far; from then on it draws with a secret of its own.
So it knows more than any outsider can. The world's own chance, such as that of lost frames, stays that of the run.
With the fleet's secret the simulated future is the true one.

The scenario is run once. Before an attempt's first tick this process is forked for each future: the copy draws with
another secret (`agent.chance`), goes on for as long as an attempt lasts, sends what is seen meanwhile, and ends.
"""

from __future__ import annotations

import os
import traceback
from collections import deque
from collections.abc import Callable, Sequence
from multiprocessing import Pipe
from multiprocessing.connection import Connection

import numpy as np
from numpy.typing import NDArray

from experiments.intruders.game import CODE, Game
from experiments.intruders.predictors import code_predictor
from experiments.intruders.sightings import Sightings
from experiments.sweeps.run_metrics import GameLog
from fogwatch.inprocess import check_in_process, fleet_of
from patrol.classes.exits import end_now
from patrol.errors import BadInput
from patrol.prepare import Prepared, sensor_footprint
from runtime.starting.forking import fork_process
from worldsim.fleet.loop import run_ticks
from worldsim.world import World

FUTURES = 5
"""Futures of each attempt, each of which takes as long as the attempt does in a run."""

Futures = dict[int, NDArray[np.uint64]]
"""By the tick that was seen last: uint64 (futures, ticks, words), as of `experiments.intruders.watch.Watch`."""

Advance = Callable[[float], None]


def add_code(game: Game, prepared: Prepared, advance: Advance = lambda _share: None) -> None:
    """Add the predictor `code` to a game; raise BadInput where the scenario does not give the same run again."""
    secrets = [f"{game.infiltrator.seed} {number} draws of an intruder's own".encode() for number in range(FUTURES)]
    game.predictors[CODE] = code_predictor(game.past, simulated_futures(game, prepared, secrets, advance))


def simulated_futures(
    game: Game, prepared: Prepared, secrets: Sequence[bytes | None], advance: Advance = lambda _share: None
) -> Futures:
    """Simulate a future of each attempt for each secret from which the fleet draws then.

    None stands for the fleet's own secret, which gives the true future. Raises BadInput as `add_code` does.
    """
    check_in_process(prepared.scenario)
    world = World(prepared, footprint=sensor_footprint(prepared.scenario, prepared.terrain))
    fleet = fleet_of(world, world.truth.footprint)
    log = GameLog(game.infiltrator)
    look = log.watch(world)
    sightings = log.sightings
    assert sightings is not None, "the game has been played on such a run"
    chance = fleet.chance
    assert chance is not None
    moments = {now for now, _ in game.trials}
    shape = game.within, game.watch.words.shape[1]
    futures: Futures = {now: np.zeros((len(secrets), *shape), dtype=np.uint64) for now in moments}
    copies: deque[tuple[NDArray[np.uint64], int, Connection]] = deque()
    processors = len(os.sched_getaffinity(0))
    ends = max(moments) + 1
    output: Connection | None = None  # of a copy

    def fork_or_end() -> bool:
        """Fork before an attempt's first tick; return True at the end, in a copy that of its future."""
        nonlocal ends, output
        now = world.tick - 1
        if output is None and now in moments:
            _check_repeated(game, sightings, now)
            for number, secret in enumerate(secrets):
                if len(copies) == processors:
                    _take_in(*copies.popleft())
                source, sink = Pipe(duplex=False)
                if (process := fork_process()) == 0:
                    source.close()
                    ends, output = now + 1 + game.within, sink
                    chance.key = secret or chance.key
                    return False
                sink.close()
                copies.append((futures[now][number], process, source))
            advance(now / max(moments))
        return world.tick >= ends

    try:
        run_ticks(world, fleet, look, lambda _event: None, fork_or_end, fleet)
        if output is not None:
            output.send_bytes(sightings.watched().words[ends - game.within :].tobytes())
            end_now(0)
    except BaseException as error:
        if output is None:
            raise
        if isinstance(error, Exception):
            traceback.print_exc()
        end_now(1)
    while copies:
        _take_in(*copies.popleft())
    return futures


def _check_repeated(game: Game, sightings: Sightings, now: int) -> None:
    """Refuse a run in which robots have been elsewhere than they are when its scenario is run again."""
    differs = (sightings.watched().places[: now + 1] != game.watch.places[: now + 1]).any(axis=(1, 2))
    if differs.any():
        since_s = differs.argmax() * game.watch.step
        raise BadInput(
            f"the run cannot be simulated: its scenario now gives another run from {since_s:g} s on; take a run in "
            "lockstep that this version has made, with the key file that radio.key names as it was"
        )


def _take_in(future: NDArray[np.uint64], process: int, source: Connection) -> None:
    """Write down the future that a copy of this process sends."""
    try:
        words = np.frombuffer(source.recv_bytes(), dtype=np.uint64).reshape(-1, future.shape[1])
    except EOFError:
        raise RuntimeError("a copy of this process has failed to simulate a future") from None
    finally:
        os.waitpid(process, 0)
        source.close()
    future[: len(words)] = words
