"""Parts that the checks of `fogwatch.testing` share."""

from __future__ import annotations

import inspect
import random  # noqa: TID251 - a class must not depend on its state
import sys
from types import ModuleType
from typing import Any

import numpy as np

from patrol.classes.named_class import ClassSort, NamedClass, find
from patrol.errors import BadInput

_MODULE = "fogwatch_checked"
"""A module that holds the classes under check, so that a scenario can name them."""


class RuleBroken(AssertionError):
    """A class breaks a rule of its port; the message says which, when, and with what value.

    Where the class has raised, that is the cause (``__cause__``), with its own traceback.
    """


def class_of(checked: type[Any] | str, sort: ClassSort) -> type[Any]:
    """Find the class to be checked, by itself or its name; RuleBroken where there is none, or it lacks its method."""
    if not isinstance(checked, str):
        if not inspect.isclass(checked) or not callable(getattr(checked, sort.method, None)):
            raise RuleBroken(f"{checked!r}: is not a class with a method {sort.call}; give one, or its name")
        return checked
    try:
        return find(NamedClass(sort, checked, None, {}))
    except BadInput as error:
        raise RuleBroken(str(error)) from error.__cause__


def put_up(checked: type[Any]) -> str:
    """Put a class where a scenario finds it, and return its name for a scenario."""
    module = sys.modules.setdefault(_MODULE, ModuleType(_MODULE))
    setattr(module, checked.__name__, checked)
    return f"{_MODULE}:{checked.__name__}"


def disturb_chance(number: int) -> None:
    """Change the state of the generators that nothing in a fleet may use."""
    random.seed(number)
    np.random.seed(number % 2**32)  # noqa: NPY002 - what is disturbed
