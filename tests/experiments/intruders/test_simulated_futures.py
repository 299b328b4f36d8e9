"""The futures of a fleet with a key: the key gives the true one, and another secret another one."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from experiments.intruders.game import Game
from experiments.intruders.infiltrator import Infiltrator
from experiments.intruders.predictors import code_predictor
from experiments.intruders.simulated_futures import add_code, simulated_futures
from experiments.sweeps.run_metrics import GameLog
from fogwatch.inprocess import run_in_process
from patrol.errors import BadInput
from patrol.prepare import Prepared, prepare
from patrol.scenario import load_scenario

INTRUDER = Infiltrator(speed=4.0, within_s=20.0, stay_s=5.0, attempts=4)


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Prepared:
    key = tmp_path_factory.mktemp("fleet") / "fleet.key"
    key.write_text("a key that is the same in each test run", encoding="ascii")
    facts = {"terrain": {"builtin": "open"}, "point": 2.0, "duration": 410, "radio": {"key": str(key)}}
    return prepare(load_scenario({**facts, "robots": {"count": 3, "model": "holonomic"}}))


@pytest.fixture(scope="module")
def game(prepared: Prepared) -> Game:
    log = GameLog(INTRUDER)
    run_in_process(prepared, keep=False, watch=log.watch)
    return log.game()


def test_the_key_gives_the_true_future_and_another_secret_does_not(game: Game, prepared: Prepared) -> None:
    futures = simulated_futures(game, prepared, [None, b"another secret", b"a third secret"])
    differ = 0
    for now, (with_key, other, third) in futures.items():
        true = game.watch.words[now + 1 : now + 1 + game.within]
        assert np.array_equal(with_key, true)
        differ += len({words.tobytes() for words in (true, other, third)})
    assert differ > 2 * len(futures)
    limit = code_predictor(game.past, {now: words[:1] for now, words in futures.items()})
    for now, target in game.trials:
        seen = game.predictors["future"](now, game.within) > 0.0
        assert np.array_equal(limit(now, game.within) >= 0.5, seen)
        assert game.once(limit, now, target).succeeded == game.once(game.predictors["future"], now, target).succeeded


def test_a_run_that_its_scenario_does_not_repeat_is_refused(game: Game, prepared: Prepared) -> None:
    other = replace(prepared, scenario=prepared.scenario.model_copy(update={"seed": 2}))
    with pytest.raises(BadInput, match=r"its scenario now gives another run from [\d.]+ s on"):
        add_code(game, other)


def test_without_its_key_the_fleet_is_not_simulated(game: Game, prepared: Prepared, tmp_path: Path) -> None:
    radio = prepared.scenario.radio.model_copy(update={"key": str(tmp_path / "lost.key")})
    other = replace(prepared, scenario=prepared.scenario.model_copy(update={"radio": radio}))
    with pytest.raises(BadInput, match=r"radio\.key: cannot read"):
        add_code(game, other)
