"""The controls that words of a command line stand for."""

from typing import Any

import pytest

from fogwatch.commands.control import control_of
from patrol.errors import BadInput

ZONE = "control zone: give its name, and whether it is on or its weight, such as '{name: vault, on: false}'"


@pytest.mark.parametrize(
    ("words", "control"),
    [
        (("close", "door"), {"do": "fault", "fault": {"kind": "close", "closure": "door"}}),
        (("open", "12"), {"do": "fault", "fault": {"kind": "open", "closure": "12"}}),
        (("zone", "{name: door, on: true}"), {"do": "zone", "name": "door", "on": True}),
        (("heal", "12"), {"do": "heal", "id": "12"}),
        (("step", "12"), {"do": "step", "ticks": 12}),
        (("pace", "max"), {"do": "pace", "factor": None}),
        (("pause", None), {"do": "pause"}),
    ],
)
def test_words_stand_for_a_control(words: tuple[str, str | None], control: dict[str, Any]) -> None:
    assert control_of(*words) == control


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("close", None), "control close: give the name of a closure too, such as door"),
        (("clos", "door"), 'control: "clos": did you mean close?'),
        (("relese", "robot1"), 'control: "relese": did you mean release?'),
        (("zone", "vault"), ZONE),
        (("zone", None), ZONE),
        (("fault", None), "control fault: give its fault too, such as '{kind: loss, rate: 0.5}'"),
        (("pause", "3"), "control pause: takes no value; leave '3' out"),
    ],
)
def test_other_words_are_refused_with_a_remedy(words: tuple[str, str | None], why: str) -> None:
    with pytest.raises(BadInput) as caught:
        control_of(*words)
    assert str(caught.value) == why
