"""What a request may be: anything at all, from anybody, is either a control or refused in one line."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.errors import BadInput
from patrol.scenario import dump_scenario, load_scenario
from patrol.scenario.controls import CONTROLS, Answer, Pause, amended, answer_bytes, read_answer, read_request
from patrol.scenario.faults.kinds import KINDS

TOKEN = "a token that is long enough"
SCENARIO = load_scenario({"terrain": {"builtin": "open"}, "robots": {"count": 2}})

texts = st.text(st.characters(), max_size=6) | st.sampled_from(["r1", "all", "half", "halves", "op1", "\ud800"])
values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | texts,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts, inner, max_size=3),
    max_leaves=5,
)
FIELDS = ("who", "at", "for", "rate", "id", "from", "to", "groups", "delay", "reach", "by", "as", "payload", "offset")
faults = st.fixed_dictionaries({"kind": st.sampled_from(sorted(KINDS))}, optional=dict.fromkeys(FIELDS, values))
controls = st.fixed_dictionaries(
    {"do": st.sampled_from(CONTROLS)},
    optional={"fault": faults, **dict.fromkeys(("instead", "id", "place", "stay", "factor", "ticks"), values)},
)


def asked(token: object, control: object) -> bytes:
    return json.dumps({"token": token, "control": control}).encode()


def test_a_request_with_the_token_is_the_control() -> None:
    assert isinstance(read_request(asked(TOKEN, {"do": "pause"}), TOKEN), Pause)


@pytest.mark.parametrize("token", ["", "another", "\ud800", "ä", None, 1, ["a"]])
def test_a_request_without_the_token_is_refused_whatever_it_holds(token: object) -> None:
    with pytest.raises(BadInput, match="needs the token"):
        read_request(asked(token, {"do": "pause"}), TOKEN)


@given(st.binary(max_size=60))
def test_bytes_are_refused(payload: bytes) -> None:
    with pytest.raises(BadInput):
        read_request(payload, TOKEN)


@given(controls | values)
def test_what_has_the_token_is_a_control_or_refused(control: Any) -> None:
    """And what is refused can be said, and what is done can be written down."""
    try:
        scenario, _ = amended(SCENARIO, 5, read_request(asked(TOKEN, control), TOKEN))
        answer = Answer(done=True)
    except BadInput as bad:
        scenario, answer = SCENARIO, Answer(done=False, text=str(bad)[:2000])
    assert read_answer(answer_bytes(answer)) == answer
    assert dump_scenario(scenario).encode("utf-8")
