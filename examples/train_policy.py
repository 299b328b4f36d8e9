"""Train a policy of five numbers with an evolution strategy, and run it as a fleet of processes.

    python examples/train_policy.py --out trained.npz
    fogwatch run yards --robots 5 --model holonomic --set point=1 --set patrol.policy=learned \
        --set patrol.options.weights=trained.npz --set 'patrol.options.inputs=[sectors]'

In each of eight directions a robot sees five features (docs/environments.md). The policy goes in the direction with the
greatest weighted sum of them; the five weights, the same for all directions and robots, are what is trained. It begins
with the staleness nearby alone. The reward is minus the mean age of the ground.
"""

import argparse
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
START = (1.0, 0.0, 0.0, 0.0, 0.0)
"""Weights of the staleness nearby and farther away, the free way, the nearness of others, and going straight on."""

Numbers = NDArray[np.float64]


def network_of(numbers: Numbers) -> Layers:
    """Lay the weights out as one layer: each direction's features count for that direction. Nobody stays."""
    weights = np.zeros((SECTORS * len(numbers), SECTORS + 1))
    for sector in range(SECTORS):
        weights[sector * len(numbers) : (sector + 1) * len(numbers), sector] = numbers
    bias = np.zeros(SECTORS + 1)
    bias[SECTORS] = -1e6
    return Layers([weights], [bias])


def play(env: PatrolEnv, network: Layers, seed: int) -> float:
    """Return the mean reward of a step over an episode."""
    observations, _ = env.reset(seed=seed)
    total, steps = 0.0, 0
    while env.agents:
        actions = {
            agent: action_of(network(flattened(parts)), parts["action_mask"]) for agent, parts in observations.items()
        }
        observations, rewards, *_ = env.step(actions)
        total, steps = total + max(rewards.values()), steps + 1
    return total / steps


def make_env(duration: float) -> PatrolEnv:
    """Make the environment: five robots that move in any direction, on points of 1 m."""
    settings = {"robots.count": 5, "robots.model": "holonomic", "point": 1, "duration": duration}
    return parallel_env("yards", settings, inputs=INPUTS)


def score(numbers: Numbers, seeds: Sequence[int], duration: float) -> float:
    """Return the mean reward over some seeds."""
    env = make_env(duration)
    return sum(play(env, network_of(numbers), seed) for seed in seeds) / len(seeds)


def train(generations: int, children: int, duration: float, seed: int, workers: int) -> Numbers:
    """Evolve the weights: children are drawn around the mean of the best three so far, ever closer to it.

    All play on the same two seeds, so that their scores can be compared.
    """
    rng = np.random.default_rng(seed)
    spread = 0.5
    judge = partial(score, seeds=(1000, 1001), duration=duration)
    # Each worker is a process with a world of its own; the result does not depend on how many there are.
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        best = [(judge(np.array(START)), np.array(START))]
        for generation in range(1, generations + 1):
            mean = np.mean([numbers for _, numbers in best], axis=0)
            drawn = list(mean + spread * rng.standard_normal((children, len(START))))
            best += zip(pool.map(judge, drawn), drawn, strict=True)
            best = sorted(best, key=lambda scored: -scored[0])[:3]
            spread *= 0.8
            print(
                f"generation {generation}: mean age {-best[0][0]:.1f} s, weights {np.round(best[0][1], 2)}", flush=True
            )
    return best[0][1]


def main() -> None:
    """Train, and compare the result with the start on seeds that training has not seen."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("trained.npz"), help="where to write the network")
    parser.add_argument("--generations", type=int, default=8)
    parser.add_argument("--children", type=int, default=8, help="in each generation")
    parser.add_argument("--duration", type=float, default=200.0, help="of an episode, simulated s")
    parser.add_argument("--seed", type=int, default=1, help="of the evolution")
    parser.add_argument("--workers", type=int, default=1, help="processes")
    options = parser.parse_args()
    trained = train(options.generations, options.children, options.duration, options.seed, options.workers)
    before, after = (score(np.array(each), (1, 2, 3), options.duration) for each in (START, trained))
    network_of(trained).save(options.out)
    print(f"mean age of the ground on other seeds: {-before:.1f} s before, {-after:.1f} s after; wrote {options.out}")


if __name__ == "__main__":
    main()
