import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.errors import BadInput
from patrol.faults.kinds import KINDS
from patrol.scenario import dump_scenario, load_scenario
from patrol.scenario.controls import (
    CONTROLS,
    MOST_FAULTS,
    amended,
    in_force,
    intruders_came,
    intruders_there,
    read_control,
)

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
    optional={"fault": faults, **dict.fromkeys(("instead", "id", "place", "for", "factor", "ticks"), values)},
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


# --- what each control makes of a scenario; a step takes 0.5 s ---

ZONE: dict[str, Any] = {"polygon": [[10, 10], [30, 10], [30, 30], [10, 30]]}
RICH = load_scenario(
    {
        **LITTLE,
        "duration": 100,
        "faults": [{"kind": "loss", "rate": 0.1, "at": 2, "for": 3, "id": "own"}],
        "intruders": [{"place": [40, 41], "at": 3, "for": 4}, {"place": [50, 52], "at": 6}],
        "zones": [
            {"name": "slow", "speed": 1.0, "times": [[1, 4], [8, 10]], **ZONE},
            {"name": "heavy", "weight": 2, "weights": [[3, 4], [9, 5]], **ZONE},
        ],
        "closures": [{"name": "gate", "polygon": [[60, 60], [62, 60], [62, 61], [60, 61]]}],
    }
)


def after(k: int, *controls: dict[str, Any], scenario: Any = RICH) -> tuple[Any, str]:
    text = ""
    for control in controls:
        scenario, text = amended(scenario, k, read_control(control))
    return scenario, text


def refused(k: int, *controls: dict[str, Any]) -> str:
    with pytest.raises(BadInput) as bad:
        after(k, *controls)
    return str(bad.value)


def test_faults_of_operators_are_numbered_from_one_and_begin_in_their_tick_or_later() -> None:
    loss, later = {"kind": "loss", "rate": 0.25}, {"kind": "delay", "delay": {"constant": 2}, "at": 1.2, "for": 4}
    found, text = after(7, {"do": "fault", "fault": loss}, {"do": "fault", "fault": later})
    assert [(fault.id, fault.at, fault.lasts) for fault in found.faults] == [
        ("own", 2.0, 3.0),
        ("op1", 3.5, None),
        ("op2", 5.0, 4.0),
    ]
    assert text == "op2 delay from tick 10 on"


@pytest.mark.parametrize(
    ("k", "lasts"), [(5, 0.5), (9, 2.5), (3, "not begun yet; it begins at 2 s"), (10, "has ended already")]
)
def test_a_fault_is_healed_from_its_second_tick_to_its_last(k: int, lasts: float | str) -> None:
    """It is in force in the ticks 4 to 9."""
    heal = {"do": "heal", "id": "own"}
    if isinstance(lasts, str):
        assert lasts in refused(k, heal)
        return
    found, text = after(k, heal)
    assert (found.faults[0].kind, found.faults[0].at, found.faults[0].lasts) == ("loss", 2.0, lasts)
    assert text == f"own ends with tick {k}"


def test_a_fault_that_is_healed_as_it_begins_keeps_its_place_and_does_nothing() -> None:
    found, _ = after(4, {"do": "heal", "id": "own"})
    assert (found.faults[0].id, found.faults[0].kind == "loss", len(in_force(found, 4))) == ("own", False, 0)


def test_the_faults_in_force_are_those_that_have_begun_and_not_ended() -> None:
    assert [len(in_force(RICH, k)) for k in (3, 4, 9, 10)] == [0, 1, 1, 0]
    assert in_force(RICH, 4, first=1) == ()


def test_an_order_at_a_closure_ends_the_one_before_it() -> None:
    orders = [{"do": "fault", "fault": {"kind": kind, "closure": "gate"}} for kind in ("close", "open")]
    found, _ = after(12, orders[0])
    found, text = after(20, orders[1], scenario=found)
    assert [(fault.kind, fault.at, fault.lasts) for fault in found.faults[1:]] == [
        ("close", 6.0, 4.0),
        ("open", 10.0, None),
    ]
    assert text == "op2 open gate from tick 20 on; heal op2 takes it back"


def test_intruders_come_in_the_tick_and_are_named_by_their_place_in_the_list() -> None:
    found, text = after(7, {"do": "intruder", "place": [20, 21], "for": 5})
    assert [(i.place, i.at, i.stay) for i in found.intruders[2:]] == [((20.0, 21.0), 3.5, 5.0)]
    assert text == "intruder3 at (20, 21) from tick 7 on"
    there = {k: [name for _, _, name in intruders_there(found, k)] for k in (5, 6, 7, 12, 13, 14, 16, 17)}
    both, first, third, last = ["intruder1", "intruder3"], ["intruder1"], ["intruder2", "intruder3"], ["intruder2"]
    assert there == {
        5: [],
        6: first,
        7: both,
        12: [*first, *third],
        13: [*first, *third],
        14: third,
        16: third,
        17: last,
    }
    assert intruders_came(found, 6.0) == [(0, 3.0, 6.0), (2, 3.5, 6.0)]
    assert intruders_came(found, 6.5) == [(0, 3.0, 6.5), (1, 6.0, 6.5), (2, 3.5, 6.5)]
    assert intruders_came(found, 50.0) == [(0, 3.0, 7.0), (1, 6.0, 50.0), (2, 3.5, 8.5)]


def test_an_intruder_is_taken_away_while_it_is_there() -> None:
    heal = {"do": "heal", "id": "intruder1"}
    assert after(8, heal)[0].intruders[0].stay == 1.0
    assert "it has not come yet; it comes at 3 s" in refused(5, heal)
    assert "it has left already" in refused(14, heal)
    gone, _ = after(6, heal)
    assert [intruders_there(gone, k) for k in range(5, 9)] == [()] * 4
    assert [intruders_came(gone, 20.0)[0][0], len(gone.intruders)] == [1, 2]


@pytest.mark.parametrize(
    ("k", "on", "times"),
    [
        (5, False, ((1.0, 2.5),)),
        (8, True, ((1.0, 100.0),)),  # it ends with tick 8, so nothing lies between
        (9, True, ((1.0, 4.0), (4.5, 100.0))),
        (17, False, ((1.0, 4.0), (8.0, 8.5))),
        (2, True, ((1.0, 100.0),)),
    ],
)
def test_a_zone_is_switched_from_a_tick_on(k: int, on: bool, times: Any) -> None:
    found, text = after(k, {"do": "zone", "name": "slow", "on": on})
    assert found.zones[0].times == times
    assert text == f"slow is {'in' if on else 'out of'} force from tick {k} on"


@pytest.mark.parametrize(
    ("k", "weight", "weights"),
    [
        (5, 3.0, ((2.5, 3.0),)),
        (6, 3.0, ((3.0, 3.0),)),
        (7, 3.0, ((3.0, 4.0), (3.5, 3.0))),
        (20, 4.0, ((3.0, 4.0), (9.0, 5.0), (10.0, 4.0))),
        (20, 5.0, "counts so many times already"),
    ],
)
def test_a_zone_is_given_another_weight_from_a_tick_on(k: int, weight: float, weights: Any) -> None:
    control = {"do": "zone", "name": "heavy", "weight": weight}
    if isinstance(weights, str):
        assert weights in refused(k, control)
        return
    found, text = after(k, control)
    assert (found.zones[1].weight, tuple(map(tuple, found.zones[1].weights))) == (2.0, weights)
    assert text == f"heavy counts {weight:g} times from tick {k} on"
