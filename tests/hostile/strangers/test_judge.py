"""What counts as having held out, and what does not."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import pytest

from tests.hostile.strangers.door import LET_IN
from tests.hostile.strangers.judge import Seen, problems
from tests.hostile.strangers.member import ASKED, OVERHEARD
from tests.hostile.strangers.spell import Holds, Spell, draw_spell
from worldsim.run_record import COMPLETED, INTERRUPTED

HELD = Seen(COMPLETED, "valid", trace="a", honest="a", counts=Counter(attacks=3, messages=300))
DRIVEN = {"nobody lost": "lost: r2 (I cannot go on)"}


def spell(holds: Holds) -> Spell:
    return replace(draw_spell(1), holds=holds, victim="r2")


@pytest.mark.parametrize("holds", Holds)
def test_a_fleet_that_is_as_without_the_stranger_has_held(holds: Holds) -> None:
    assert problems(spell(holds), HELD) == []


@pytest.mark.parametrize("holds", Holds)
@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"ended": INTERRUPTED}, "the run did not complete: interrupted"),
        ({"ended": "hung: no tick for 90 s after tick 7", "outcome": ""}, "hung: no tick for 90 s after tick 7"),
        ({"outcome": "invalid", "failed": {"fog": "tick 3: 7 points differ"}}, "verdict: fog: tick 3: 7 points differ"),
        ({"outcome": "invalid", "failed": {"nobody lost": "lost: r1, r2"}}, "verdict: nobody lost: lost: r1, r2"),
        ({"outcome": "unknown"}, "the verdict is unknown"),
        ({"outcome": "invalid"}, "the verdict is invalid"),
        ({"restarts": ["the router was killed by SIGSEGV"]}, "a process died: the router was killed by SIGSEGV"),
        ({"crashes": ["world.log"]}, "a traceback in the log world.log"),
        ({"growth_mb": {"r1": 299.0, "worldsim": 301.0}}, "worldsim took 301 MB more than before the stranger came"),
        ({"counts": Counter({LET_IN: 1})}, "let in: 1 times"),
        ({"counts": Counter({OVERHEARD: 2})}, "overheard: 2 times"),
        ({"counts": Counter({ASKED: 3})}, "asked in the world's place: 3 times"),
        ({"counts": Counter()}, "the stranger has not attacked"),
        ({"stranger": "it ended with exit code 2"}, "the stranger could not attack: it ended with exit code 2"),
    ],
)
def test_whatever_else_is_a_problem(holds: Holds, changes: dict[str, object], says: str) -> None:
    found = problems(spell(holds), replace(HELD, **changes))  # type: ignore[arg-type]
    assert any(says in problem for problem in found), found


@pytest.mark.parametrize("holds", Holds)
def test_only_a_stranger_with_a_robot_s_credentials_may_change_what_happens(holds: Holds) -> None:
    changed = ["the verdict is valid, but the trace is not that of the run without the stranger"]
    assert problems(spell(holds), replace(HELD, trace="b")) == ([] if holds is Holds.ROBOT else changed)


def test_a_stranger_with_a_robot_s_credentials_may_make_the_verdict_name_that_robot() -> None:
    driven = replace(HELD, outcome="invalid", failed=DRIVEN, trace="b")
    assert problems(spell(Holds.ROBOT), driven) == []
    for holds in (Holds.NOTHING, Holds.VIEWER):
        assert problems(spell(holds), driven)
    assert problems(replace(spell(Holds.ROBOT), victim="r1"), driven)
    assert problems(spell(Holds.ROBOT), replace(driven, failed={**DRIVEN, "fog": "tick 3"})) == ["verdict: fog: tick 3"]


def test_a_run_at_a_pace_has_no_trace_to_compare() -> None:
    assert problems(spell(Holds.VIEWER), replace(HELD, trace="b", honest="")) == []
