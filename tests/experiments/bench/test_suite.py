"""Which measures there are, and how they are chosen."""

from __future__ import annotations

import pytest

from experiments.bench.measures.kernels import tasks
from experiments.bench.suite import chosen, every_task
from experiments.bench.tools.groups import ALL, GROUPS
from experiments.bench.tools.measure import Effort
from patrol.errors import BadInput

LEAST = Effort(repeats=2, seconds=0.1, quick=True)


def test_every_group_has_tasks_and_every_task_a_name_of_its_own() -> None:
    every = every_task()
    assert list(dict.fromkeys(task.group for task in every)) == list(GROUPS)
    assert len({(task.group, task.name) for task in every}) == len(every)
    names = [(task.group, task.name) for task in every]
    for groups in ([], [ALL], list(GROUPS)):
        assert [(task.group, task.name) for task in chosen(groups)] == names


def test_groups_and_names_choose() -> None:
    assert {task.group for task in chosen(["memory", "kernels"])} == {"memory", "kernels"}
    assert [task.name for task in chosen(["kernels"], "WAVE, site")] == ["wave, site of 1600 x 2400 points"]
    with pytest.raises(BadInput, match="kernel: no such group of measures; did you mean kernels"):
        chosen(["kernel"])
    with pytest.raises(BadInput, match="--only wavy: is in no name; the names are: wave, open field"):
        chosen(["kernels"], "wavy")


@pytest.mark.parametrize("name", ["dilatation", "look", "record"])
def test_kernels_are_measured(name: str) -> None:
    pytest.importorskip("scipy")
    for task in tasks():
        if name in task.name:
            for one in task.run(LEAST):
                assert len(one.values) == 2
                assert all(value > 0.0 for value in one.values)
                assert len(one.ratio) == (0 if one.name.startswith("ours") else 2)
