"""Situations drawn for tests of a policy: the view is that of a mind, with the ages and robots of the drawing."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agent.ports import Intent, Place, Stay
from examples.my_policy import GreedyTarget
from fogwatch.testing import Situation, draw_situation
from patrol.errors import BadInput

ROOMS = """
    ###########
    #1...#...a#
    #....#....#
    #b.......2#
    ###########
"""
CLOSURES = [{"name": "d", "polygon": [[0, 0], [1, 0], [1, 1]]}]
ROOT = Path(__file__).parents[3]


def test_the_view_has_the_ages_places_and_robots_of_the_drawing() -> None:
    situation = draw_situation(ROOMS, ages={"a": 300, ".": 10}, heard={"2": 4}, side=0.5, heading=1.0)
    view = situation.view
    assert view.ground.terrain.bounds == (0.0, 0.0, 5.5, 2.5)
    assert not view.ground.terrain.passable[[0, 4, -5, -1]].any()
    assert situation.places == {"1": (0.75, 1.75), "2": (4.75, 0.75), "a": (4.75, 1.75), "b": (0.75, 0.75)}
    age_s = view.age * situation.setup.fleet.step
    assert age_s[view.point_of(situation.places["a"])] == 300.0
    assert age_s[view.point_of(situation.places["b"])] == 0.0
    assert age_s[view.point_of((1.25, 1.25))] == 10.0
    assert view.mfow * situation.setup.fleet.step == view.time_s == 300.0
    assert (view.pose.x, view.pose.y, view.pose.heading) == (0.75, 1.75, 1.0)
    (peer,) = view.peers.values()
    assert (peer.pose.x, peer.pose.y, view.tick - peer.tick) == (4.75, 0.75, 8)
    around = view.lengths()
    assert around[view.point_of(situation.places["a"])] > math.dist(situation.places["1"], situation.places["a"]) + 0.5


def test_stale_ages_spread_as_in_a_run() -> None:
    situation = draw_situation(
        ROOMS, "potential-field", options={"dilatation": 1.0}, settings={"sensor.range": 3}, ages={"a": 300}
    )
    seen, spread = situation.view.fog.last_seen, situation.view.fog.dilated
    row, col = situation.view.point_of(situation.places["a"])
    assert seen[row, col - 4] == situation.view.tick
    assert spread[row, col - 4] == seen[row, col] == 0


def test_a_policy_decides_on_what_is_drawn() -> None:
    for options, ages, there in (({}, {"a": 300, "b": 290}, "b"), ({"near": 100}, {"a": 300, "b": 10}, "a")):
        situation = draw_situation(ROOMS, GreedyTarget, options=options, ages=ages)
        intent = situation.decide()
        assert isinstance(intent, Place)
        assert situation.character_at(intent.x, intent.y) == there
    assert draw_situation(ROOMS, GreedyTarget).decide() == Stay(), "all is fresh"
    situation = draw_situation(ROOMS)
    with pytest.raises(ValueError, match=r"\(11.5, 1\) is not on the drawing"):
        situation.character_at(11.5, 1.0)
    with pytest.raises(ValueError, match="was given no policy"):
        situation.decide()


@pytest.mark.parametrize("policy", ["stochastic", "committed", "potential-field", "cr", "even-tour"])
def test_built_in_policies_decide_too(policy: str) -> None:
    assert isinstance(draw_situation(ROOMS, policy, ages={"a": 60}).decide(), Intent)


@pytest.mark.parametrize(
    ("drawing", "given", "problem"),
    [
        ("", {}, "drawing: is empty"),
        ("#1.#\n#..", {}, "drawing: line 2 has 3 characters, line 1 4; make them equal"),
        ("1!", {}, "drawing: line 1: !: expected #, ., 1 to 9 or a letter"),
        ("..", {}, r"drawing: has the robots \[\]; draw 1"),
        ("1.3", {}, r"drawing: has the robots \[1, 3\]; draw 1"),
        ("1.1", {}, r"drawing: has the robots \[1, 1\]; draw 1"),
        ("1..", {"ages": {"a": 3}}, "ages: a: is on no floor of the drawing"),
        ("1a.", {"ages": {"a": -1}}, "ages: a = -1: expected s from 0 to"),
        ("1a.", {"ages": {"a": math.nan}}, "ages: a = NaN: expected s"),
        ("1.2", {"heard": {"1": 3}}, "heard: 1: is no other robot of the drawing"),
        ("1..", {"side": 0.0}, "side = 0.0: expected the side of a character"),
        ("1..", {"settings": {"robots.sped": 1}}, "robots.sped: unknown key"),
        ("1..", {"settings": {"closures": CLOSURES}}, "settings: closures: .*; draw what is closed as walls"),
        ("1..", {"settings": {"patrol.policy": "random"}}, "settings: patrol.policy: .*; give policy"),
        ("1..", {"settings": {"robots": {"count": 5}}}, "settings: robots: .*; draw the robots"),
        ("1..", {"settings": {"terrain.map": "a.yaml"}}, "settings: terrain.map: .*; draw it"),
        ("1..", {"settings": {"point": 0.1}}, "settings: point: .*; give side"),
        ("1a.", {"ages": {"a": True}}, "ages: a = .rue: expected s"),
        (5, {}, "drawing: 5: expected a text"),
    ],
)
def test_bad_input_names_the_mistake(drawing: Any, given: dict[str, Any], problem: str) -> None:
    with pytest.raises(BadInput, match=problem):
        draw_situation(drawing, **given)


def test_the_example_of_the_documentation_holds() -> None:
    text = (ROOT / "docs/policies.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```python\n(from examples.*?draw_situation.*?)```", text, flags=re.DOTALL)
    names: dict[str, Any] = {}
    exec(block, names)
    tests = [value for name, value in names.items() if name.startswith("test_")]
    assert tests
    for test in tests:
        test()
    assert isinstance(names["draw_situation"]("1.a", ages={"a": 5}), Situation)
    assert np.all(names["draw_situation"]("1.a").view.age == 0)


def test_a_drawing_holds_forty_thousand_characters_and_ages_a_million_seconds() -> None:
    line = "1" + "." * 199
    others = "\n".join(["." * 200] * 199)
    with pytest.raises(BadInput, match="has more than 40000 characters"):
        draw_situation(f"{line}\n{others}\n{'.' * 200}")
    assert draw_situation("1a", ages={"a": 1e6}).view.time_s == 1e6
    with pytest.raises(BadInput, match="ages: a = 1000001: expected s from 0 to 1e"):
        draw_situation("1a", ages={"a": 1_000_001})


def test_each_character_is_five_by_five_points_and_bodies_are_three_tenths_of_it() -> None:
    situation = draw_situation("#1#\n..a\n###", side=2.0)
    terrain = situation.view.ground.terrain
    assert (terrain.shape, terrain.point) == ((15, 15), 0.4)
    assert situation.view.spec.radius == pytest.approx(0.6)
    free = np.zeros((15, 15), dtype=np.bool_)
    free[5:10], free[10:15, 5:10] = True, True
    assert np.array_equal(terrain.passable, free)
    for x, y, character in ((0.0, 0.0, "#"), (5.99, 5.99, "#"), (2.0, 4.0, "1"), (4.0, 3.99, "a"), (3.99, 2.0, ".")):
        assert situation.character_at(x, y) == character
    for x, y in ((-0.01, 0.0), (0.0, -0.01), (6.0, 0.0), (0.0, 6.0)):
        with pytest.raises(ValueError, match="is not on the drawing"):
            situation.character_at(x, y)


def test_of_several_squares_of_a_name_the_uppermost_and_leftmost_gives_its_place() -> None:
    assert draw_situation("1.a\naa.").places == {"1": (0.5, 1.5), "a": (2.5, 1.5)}
    assert draw_situation("1a.a").places["a"] == (1.5, 0.5)


def test_each_robot_was_heard_as_long_ago_as_asked_for() -> None:
    situation = draw_situation("1.2.3.4", heard={"2": 3, "4": 10}, ages={".": 5})
    step = situation.setup.fleet.step
    ago_s = {number: (situation.view.tick - peer.tick) * step for number, peer in situation.view.peers.items()}
    assert ago_s == {2: 3.0, 3: 0.0, 4: 10.0}
    assert [peer.pose.x for _, peer in sorted(situation.view.peers.items())] == [2.5, 4.5, 6.5]
    age_s = situation.view.age * step
    assert age_s[situation.view.point_of((1.5, 0.5))] == 5.0
    assert age_s[situation.view.point_of((2.5, 0.5))] == 0.0
