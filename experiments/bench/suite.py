"""All measures that there are."""

from __future__ import annotations

from collections.abc import Sequence

from experiments.bench.measures import decisions, fleets, horizon, kernels, processes, scale
from experiments.bench.tools.groups import ALL, GROUPS
from experiments.bench.tools.measure import Task
from patrol.errors import BadInput, did_you_mean


def every_task() -> list[Task]:
    """All tasks, in the order in which they are taken."""
    modules = (kernels, decisions, fleets, processes, horizon, scale)
    every = [task for module in modules for task in module.tasks()]
    return [task for group in GROUPS for task in every if task.group == group]


def chosen(groups: Sequence[str], only: str = "") -> list[Task]:
    """Some of the tasks.

    Args:
        groups: Names of groups, or `ALL`; all where there are none.
        only: What the names of the tasks contain; empty for any.

    Raises:
        BadInput: A group is unknown, or no task is left.
    """
    known = [*GROUPS, ALL]
    for group in groups:
        if group not in known:
            raise BadInput(f"{group}: no such group of measures; {did_you_mean(group, known)}")
    wanted = set(GROUPS) if not groups or ALL in groups else set(groups)
    every = [task for task in every_task() if task.group in wanted]
    left = [task for task in every if only.lower() in task.name.lower()]
    if not left:
        names = "; ".join(task.name for task in every)
        raise BadInput(f"--only {only}: is in no name; the names are: {names}")
    return left
