"""Train a policy of five numbers with an evolution strategy, and run it as a fleet of processes.

    python examples/train_policy.py --out trained.npz
    fogwatch run yards --robots 5 --model holonomic --set point=1 --set patrol.policy=learned \
        --set patrol.options.weights=trained.npz --set 'patrol.options.inputs=[sectors]' \
        --set patrol.options.actions=place --set patrol.options.decide=arrival

In each of eight directions a robot sees five features (docs/environments.md). Their weighted sum is how strongly the
direction pulls, and the robot goes to the place to which the eight pulls together point; there it chooses the next. The
five weights, the same for all directions and robots, are what is trained. They begin with the staleness alone, nearby
and farther away. What is to become small is the mean age of the ground plus its greatest age, the MFoW: by the mean age
alone, a corner that is never seen hardly counts.
"""

import argparse
import math
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fogwatch.learn import Layers, PatrolEnv, action_of, flattened, parallel_env

INPUTS = ("sectors",)
SECTORS = 8
START = (3.0, 3.0, 0.0, 0.0, 0.0)
"""Weights of the staleness nearby and farther away, the free way, the nearness of others, and going straight on."""

Numbers = NDArray[np.float64]


def network_of(numbers: Numbers) -> Layers:
    """Lay the weights out as one layer: each direction's features pull towards it."""
    angles = [2.0 * math.pi * sector / SECTORS for sector in range(SECTORS)]
    weights = np.concatenate([np.outer(numbers, (math.cos(angle), math.sin(angle))) for angle in angles])
    return Layers([weights], [np.zeros(2)])


def play(env: PatrolEnv, network: Layers, seed: int) -> tuple[float, float]:
    """Return the mean age of the ground and the mean MFoW over the second half of an episode, s."""
    observations, _ = env.reset(seed=seed)
    ages = []
    while env.agents:
        actions = {agent: action_of(network(flattened(parts)), None) for agent, parts in observations.items()}
        observations, _, _, _, infos = env.step(actions)
        true = next(iter(infos.values()))
        ages += [(true["mean_age_s"], true["mfow_s"])] * true["ticks"]
    mean_age_s, mfow_s = np.mean(ages[len(ages) // 2 :], axis=0)
    return float(mean_age_s), float(mfow_s)


def make_env(duration: float) -> PatrolEnv:
    """Make the environment: five robots that move in any direction, on points of 1 m."""
    settings = {"robots.count": 5, "robots.model": "holonomic", "point": 1, "duration": duration}
    return parallel_env("yards", settings, inputs=INPUTS, actions="place", decide="arrival")


def ages_of(numbers: Numbers, seeds: Sequence[int], duration: float) -> tuple[float, float]:
    """Return mean age and MFoW as means over some seeds, s."""
    env = make_env(duration)
    mean_age_s, mfow_s = np.mean([play(env, network_of(numbers), seed) for seed in seeds], axis=0)
    return float(mean_age_s), float(mfow_s)


def train(generations: int, children: int, duration: float, seed: int, workers: int) -> Numbers:
    """Evolve the weights: children are drawn around the mean of the best three so far, ever closer to it.

    All play on the same two seeds, so that their scores can be compared.
    """
    rng = np.random.default_rng(seed)
    spread = 1.5
    judge = partial(ages_of, seeds=(1000, 1001), duration=duration)
    # Each worker is a process with a world of its own; the result does not depend on how many there are.
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        best = [(judge(np.array(START)), np.array(START))]
        for generation in range(1, generations + 1):
            mean = np.mean([numbers for _, numbers in best], axis=0)
            drawn = list(mean + spread * rng.standard_normal((children, len(START))))
            best += zip(pool.map(judge, drawn), drawn, strict=True)
            best = sorted(best, key=lambda judged: sum(judged[0]))[:3]
            spread *= 0.8
            (mean_age_s, mfow_s), weights = best[0]
            shown = f"mean age {mean_age_s:.1f} s, MFoW {mfow_s:.1f} s, weights {np.round(weights, 2)}"
            print(f"generation {generation}: {shown}", flush=True)
    return best[0][1]


def main() -> None:
    """Train, and compare the result with the start on seeds that training has not seen."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("trained.npz"), help="where to write the network")
    parser.add_argument("--generations", type=int, default=5)
    parser.add_argument("--children", type=int, default=6, help="in each generation")
    parser.add_argument("--duration", type=float, default=400.0, help="of an episode, simulated s")
    parser.add_argument("--seed", type=int, default=1, help="of the evolution")
    parser.add_argument("--workers", type=int, default=1, help="processes")
    options = parser.parse_args()
    trained = train(options.generations, options.children, options.duration, options.seed, options.workers)
    network_of(trained).save(options.out)
    for title, numbers in (("before", np.array(START)), ("after", trained)):
        mean_age_s, mfow_s = ages_of(numbers, (1, 2, 3), options.duration)
        print(f"on other seeds, {title}: mean age {mean_age_s:.1f} s, MFoW {mfow_s:.1f} s")
    print(f"wrote {options.out}")


if __name__ == "__main__":
    main()
