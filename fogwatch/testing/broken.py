"""What the checks of `fogwatch.testing` share."""

from __future__ import annotations

import inspect
import random  # noqa: TID251 - its state is what a class must not depend on
import sys
from types import ModuleType
from typing import Any

import numpy as np

from patrol.classes.named_class import ClassSort, NamedClass, find
from patrol.errors import BadInput

_MODULE = "fogwatch_checked"
"""A module that holds the classes under check, so that a scenario can name them wherever they were made."""


class RuleBroken(AssertionError):
    """A class breaks a rule of its port; the message says which, when, and with what value.

    Where the class has raised, that is the cause (``__cause__``), with its own traceback.
    """


def class_of(given: type[Any] | str, sort: ClassSort) -> type[Any]:
    """The class to be checked.

    Args:
        given: The class, or its name as in a scenario.
        sort: What it should be.

    Raises:
        RuleBroken: There is no such class, or it lacks its method.
    """
    if not isinstance(given, str):
        if not inspect.isclass(given) or not callable(getattr(given, sort.method, None)):
            raise RuleBroken(f"{given!r}: is not a class with a method {sort.call}; give one, or its name")
        return given
    try:
        return find(NamedClass(sort, given, None, {}))
    except BadInput as error:
        raise RuleBroken(str(error)) from error.__cause__


def put_up(made: type[Any]) -> str:
    """Put a class where a scenario finds it, wherever it was made.

    Args:
        made: The class.

    Returns:
        Its name for a scenario.
    """
    module = sys.modules.setdefault(_MODULE, ModuleType(_MODULE))
    setattr(module, made.__name__, made)
    return f"{_MODULE}:{made.__name__}"


def disturb_chance(number: int) -> None:
    """Put the generators that nothing in a fleet may use into another state.

    Args:
        number: Of the state.
    """
    random.seed(number)
    np.random.seed(number % 2**32)  # noqa: NPY002 - what is disturbed
