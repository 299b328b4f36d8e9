"""The name by which a scenario knows a policy class that a program hands over.

A class of a module is ``package.module:Class``, which every process can import. A module beside the script is named by
its file, since other processes do not look into the script's folder. A notebook's or a script's own class is
``__main__:Class``, which only the process that defined it can find.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from patrol.errors import BadInput

MAIN = "__main__"


def policy_name(policy: type[Any], *, in_process: bool) -> str:
    """Return the name of a policy class for ``patrol.policy``.

    Unless it is only used `in_process`, other processes must be able to import it.
    """
    if not isinstance(policy, type):
        raise BadInput(f"policy = {policy!r}: expected a class; give a name as overrides={{'patrol.policy': NAME}}")
    module, name = policy.__module__, policy.__qualname__
    if not callable(getattr(policy, "decide", None)):
        raise BadInput(f"policy = {name}: has no method decide(view); see docs/policies.md")
    if getattr(sys.modules.get(module), name, None) is not policy:
        raise BadInput(f"policy = {name}: is not at the top level of its module {module}; define it there")
    if module == MAIN and not in_process:
        raise BadInput(
            f"policy = {name}: was defined here, where other processes cannot import it; run with in_process=True, or "
            f"put it into a file and give overrides={{'patrol.policy': './file.py:{name}'}}"
        )
    file = getattr(sys.modules[module], "__file__", None)
    if not in_process and file is not None and Path(file).parent in (Path(sys.path[0]).absolute(), Path.cwd()):
        return f"{file}:{name}"
    return f"{module}:{name}"


def with_names(settings: Mapping[str, object]) -> dict[str, object]:
    """Replace policy classes among settings for other processes by their names.

    Settings are values by dotted field; a value may be a list of values, each alone or with a label.
    """

    def named(value: object) -> object:
        if isinstance(value, list | tuple | range):
            return [named(entry) for entry in value]
        if isinstance(value, dict) and "label" in value:
            return {key: named(part) for key, part in value.items()}
        return policy_name(value, in_process=False) if isinstance(value, type) else value

    return {field: named(value) for field, value in settings.items()}
