"""Arguments of the functions for notebooks: errors of one line, and NumPy's values."""

import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest

import fogwatch
from fogwatch.learn import one_env, parallel_env
from fogwatch.notebook.arguments import checked_arguments, plain, policy_name, with_names
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


class Own:
    def decide(self, view: object) -> object:
        return view


def test_a_class_is_named_so_that_the_processes_that_need_it_find_it(monkeypatch: pytest.MonkeyPatch) -> None:
    module, file = Own.__module__, Path(__file__)
    monkeypatch.setattr(sys, "path", ["/nowhere", *sys.path])
    monkeypatch.chdir("/")
    assert policy_name(Own, in_process=True) == policy_name(Own, in_process=False) == f"{module}:Own"
    monkeypatch.chdir(file.parent)
    assert policy_name(Own, in_process=False) == f"{file}:Own"
    assert policy_name(Own, in_process=True) == f"{module}:Own"
    monkeypatch.chdir("/")
    monkeypatch.setattr(sys, "path", [str(file.parent), *sys.path])
    assert policy_name(Own, in_process=False) == f"{file}:Own"


def test_a_class_of_the_main_program_is_for_its_own_process(monkeypatch: pytest.MonkeyPatch) -> None:
    main = ModuleType("__main__")
    mine = type("Mine", (Own,), {"__module__": "__main__", "__qualname__": "Mine"})
    main.Mine = mine  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "__main__", main)
    assert policy_name(mine, in_process=True) == "__main__:Mine"
    with pytest.raises(BadInput, match=r"policy = Mine: was defined here, where other processes cannot import it"):
        policy_name(mine, in_process=False)


def test_classes_among_settings_get_their_names_wherever_they_stand(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", ["/nowhere", *sys.path])
    monkeypatch.chdir("/")
    name = f"{Own.__module__}:Own"
    labelled = {"label": "mine", "patrol.policy": Own}
    given = {"a": Own, "b": ["cr", Own], "c": [labelled], "d": {"x": 1}, "e": range(2), "f": None}
    assert with_names(given) == {
        "a": name,
        "b": ["cr", name],
        "c": [{"label": "mine", "patrol.policy": name}],
        "d": {"x": 1},
        "e": [0, 1],
        "f": None,
    }


def test_a_checked_function_is_called_with_plain_arguments_in_their_places() -> None:
    @checked_arguments
    def noted(scenario: object, *rest: object, out: object = None, progress: object = None, **more: object) -> object:
        return scenario, rest, out, progress, more

    folder = Path("runs")
    found = noted(np.int64(1), np.arange(2), out=folder, progress=print, other=np.float64(0.5))
    assert found == (1, ([0, 1],), folder, print, {"other": 0.5})
    assert noted.__name__ == "noted"
    with pytest.raises(BadInput, match=r'progress = "print": expected a function'):
        noted(1, progress="print")
    with pytest.raises(BadInput, match=r"out = 3: expected a folder"):
        noted(1, out=3)
