from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.errors import BadInput
from patrol.faults.kinds import KINDS
from patrol.scenario import dump_scenario, load_scenario
from patrol.scenario.controls import CONTROLS, MOST_FAULTS, amended, read_control

LITTLE: dict[str, Any] = {"terrain": {"builtin": "open"}, "robots": {"count": 2}}
SCENARIO = load_scenario(LITTLE)

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


@given(controls | values)
def test_whatever_is_asked_for_is_a_control_or_refused(control: Any) -> None:
    """And what is refused can be said, and what is done can be written down."""
    refusal = ""
    try:
        scenario, _ = amended(SCENARIO, 5, read_control(control))
    except BadInput as bad:
        scenario, refusal = SCENARIO, str(bad)
    assert json.dumps({"done": not refusal, "text": refusal}).encode("utf-8")
    assert dump_scenario(scenario).encode("utf-8")


def test_operators_change_no_scenario_with_more_faults_than_can_be_checked_again_and_again() -> None:
    loss = {"kind": "loss", "rate": 0.1}
    full = load_scenario({**LITTLE, "faults": [{**loss, "id": f"own{n}"} for n in range(MOST_FAULTS)]})
    with pytest.raises(BadInput, match=f"has {MOST_FAULTS} faults already and takes no more"):
        amended(full, 5, read_control({"do": "fault", "fault": loss}))
    healed, _ = amended(full, 5, read_control({"do": "heal", "id": "own0"}))
    assert healed.faults[0] != full.faults[0]
    fuller = load_scenario({**LITTLE, "faults": [{**loss, "id": f"own{n}"} for n in range(MOST_FAULTS + 1)]})
    with pytest.raises(BadInput, match=f"more than {MOST_FAULTS} faults, and none can be ended"):
        amended(fuller, 5, read_control({"do": "heal", "id": "own0"}))
