"""Arguments of the functions for notebooks: errors of one line, and NumPy's values."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest

import fogwatch
from fogwatch.learn import one_env, parallel_env
from fogwatch.notebook.arguments import plain
from patrol.errors import BadInput

BASE = {"terrain": {"builtin": "open"}, "point": 2.0, "duration": 5, "robots": {"model": "holonomic"}}
run, sweep, plan, load = cast(tuple[Any, ...], (fogwatch.run, fogwatch.sweep, fogwatch.plan, fogwatch.load))


def test_numpys_values_are_plain_wherever_they_stand() -> None:
    given = {"a": np.int64(3), "b": [np.float32(0.5), np.bool_(True)], "c": np.eye(2), "d": (range(2), pd.Series([1]))}
    assert plain(given) == {"a": 3, "b": [0.5, True], "c": [[1.0, 0.0], [0.0, 1.0]], "d": [[0, 1], [1]]}
    env = parallel_env({**BASE, "duration": np.int64(5)}, {"robots.count": np.int64(2), "seed": np.uint8(9)})
    assert (len(env.possible_agents), env.scenario.seed, env.scenario.duration) == (2, 9, 5.0)
    settings = {"point": np.float64(2.0), "robots.model": "holonomic"}
    planned = fogwatch.plan("open", age=np.float64(60.0), robots=np.arange(1, 3), overrides=settings, quick=True)  # type: ignore[arg-type]
    assert planned.table.num_rows == 2


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda: run("yards", duration=10),
            "duration = 10: run() has no such argument; a field of the scenario is given as overrides={'duration': 10}",
        ),
        (lambda: run("yards", robots=np.int64(3)), "is given as overrides={'robots.count': np.int64(3)}"),
        (lambda: parallel_env(BASE, duration=5), "is given as overrides={'duration': 5}"),  # type: ignore[call-arg]
        (lambda: sweep(BASE, robots=3), "is given as grid={'robots.count': [3]}"),
        (lambda: one_env(BASE, windo=3), "windo = 3: one_env() has no such argument; did you mean window?"),  # type: ignore[call-arg]
        (lambda: run(BASE, overides={}), "did you mean overrides?"),
        (lambda: run(BASE, overrides=["duration=10"]), 'overrides = ["duration=10"]: expected values by dotted field'),
        (lambda: run(BASE, overrides={3: 4}), 'overrides = {"3": 4}: expected values by dotted field'),
        (lambda: run(BASE, out=3), "out = 3: expected a folder"),
        (run, "run(): missing a required argument: 'scenario'"),
        (lambda: plan("open", 60), "plan(): too many positional arguments"),
        (lambda: sweep(BASE, grid=["seed"]), 'grid = ["seed"]: expected lists of values by dotted field'),
        (lambda: sweep(BASE, cases={"a": 3}), "cases: a = 3: expected settings by the name of a case"),
        (lambda: run(BASE, progress=3), "progress = 3: expected a function, such as print"),
        (lambda: load(3), "folder = 3: expected a folder"),
    ],
)
def test_a_wrong_argument_is_one_line_with_its_remedy(call: Callable[[], object], words: str) -> None:
    with pytest.raises(BadInput) as error:
        call()
    assert words in str(error.value)
