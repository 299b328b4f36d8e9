"""Intents: those that a body can use pass, and all others stop their own robot with a line that says why."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from agent.answers import checked, policy_failure
from agent.ports import Bearing, Intent, Place, PolicyFailed, State, Stay, Steer
from patrol.pose import Drive, Pose, Twist, Velocity
from patrol.radio.peers import Peer
from runtime.messages.phases import MAX_STATE

# Not the product's own, so that a wrong one there is noticed.
MAX_FAILURE = 300

VALID: list[Intent] = [
    Bearing(()),
    Bearing((0.5, -3.0, 1)),
    Bearing((0.5,), near=(1.0, 2.0), bend=(3.0, 4.0), wander=0.1, state="sniffing", figures={"x": 1.0}),
    Bearing((), wander=7.0),
    Place(1.0, -2.0),
    Place(1, 2, bend=(3, 4), lean=(5.0, 6.0), state=State.SURROUNDING),
    Place(1.0, -2.0, step=Twist(0.5, 0.1), others={2: Peer(4, Pose(1.0, 2.0, 0.0), 5)}),
    Stay(),
    Stay("waiting for others"),
    Stay("x" * MAX_STATE),
    Steer(Velocity(1.0, 2.0)),
    Steer(Drive(-1.0, 0.2), state="reversing"),
]

BAD: list[Any] = [math.nan, math.inf, -math.inf, "1", None, True, 1j, (1.0,), 2e9, 1e300, 10**400]


@pytest.mark.parametrize("intent", VALID, ids=repr)
def test_an_intent_that_can_be_used_is_passed_on_as_it_is(intent: Intent) -> None:
    assert checked(intent, {1, 2}) is intent


@pytest.mark.parametrize("other", [None, 3, "patrolling", (1.0, 2.0), {}, Velocity(1.0, 0.0), Stay])
def test_what_is_no_intent_is_refused_by_its_type(other: object) -> None:
    with pytest.raises(PolicyFailed, match=rf"returned {type(other).__name__}; return Bearing, Place, Stay or Steer"):
        checked(other)


WITH: dict[str, list[Callable[[Any], Intent]]] = {
    "Bearing bearings": [lambda value: Bearing((0.5, value))],
    "Bearing near": [lambda value: Bearing((), near=(1.0, value))],
    "Bearing bend": [lambda value: Bearing((), bend=(1.0, value))],
    "Place x": [lambda value: Place(value, 1.0)],
    "Place y": [lambda value: Place(1.0, value)],
    "Place bend": [lambda value: Place(1.0, 2.0, bend=(1.0, value))],
    "Place lean": [lambda value: Place(1.0, 2.0, lean=(value, 2.0)), lambda value: Place(1.0, 2.0, lean=(1.0, value))],
    "Place step": [lambda value: Place(1.0, 2.0, step=Twist(1.0, value))],
    "Steer command": [
        *(lambda value: Steer(Velocity(1.0, value)), lambda value: Steer(Velocity(value, 0.0))),
        *(lambda value: Steer(Drive(value, 0.0)), lambda value: Steer(Drive(0.0, value))),
    ],
}
"""Intents with one number replaced, by the words that name it."""


@pytest.mark.parametrize("value", BAD, ids=repr)
@pytest.mark.parametrize("field", WITH)
def test_a_number_that_is_none_or_not_finite_is_named(field: str, value: Any) -> None:
    kind, name = field.split()
    for intent in WITH[field]:
        with pytest.raises(PolicyFailed) as failed:
            checked(intent(value))
        assert str(failed.value) == f"returned {kind} with {name} = {value!r}; give a number from -1e9 to 1e9"


@pytest.mark.parametrize("value", [bad for bad in BAD if bad is not None], ids=repr)
def test_a_heading_is_none_or_a_number(value: Any) -> None:
    for intent in (Place(1.0, 2.0), Place(1.0, 2.0, heading=0.5), Steer(Velocity(1.0, 0.0, 0.5))):
        assert checked(intent) == intent
    with pytest.raises(PolicyFailed, match="returned Place with heading = "):
        checked(Place(1.0, 2.0, heading=value))
    with pytest.raises(PolicyFailed, match="returned Steer with command = "):
        checked(Steer(Velocity(1.0, 0.0, value)))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_numbers_reach_to_a_milliard(sign: float) -> None:
    for largest in (1e9, 10**9, np.float64(1e9)):
        assert checked(Place(sign * largest, 1.0)) == Place(sign * 1e9, 1.0)
    beyond = math.nextafter(1e9, math.inf)
    for more in (beyond, np.float64(beyond), 10**9 + 1):
        with pytest.raises(PolicyFailed, match="give a number from -1e9 to 1e9"):
            checked(Place(1.0, sign * more))


def test_numbers_of_numpy_become_pythons() -> None:
    bearing = checked(Bearing(np.array([0.5, 1.0]), near=(np.float32(1.0), 2.0), wander=np.float64(0.25)))  # type: ignore[arg-type]
    assert bearing == Bearing((0.5, 1.0), near=(1.0, 2.0), wander=0.25)
    place = checked(Place(np.int64(3), np.float32(0.5)))  # type: ignore[arg-type]
    assert isinstance(place, Place)
    assert (type(place.x), type(place.y)) == (int, float)
    steer = checked(Steer(Drive(np.float64(1.0), 0.0)))
    assert isinstance(steer, Steer)
    assert [type(number) for number in steer.command.numbers] == [float, float]
    with pytest.raises(PolicyFailed, match="returned Place with x = nan"):
        checked(Place(np.float64("nan"), 0.0))


@pytest.mark.parametrize("value", [one for one in BAD if one is not None], ids=repr)
def test_a_random_direction_is_a_number_too(value: Any) -> None:
    with pytest.raises(PolicyFailed, match="returned Bearing with wander = "):
        checked(Bearing((), wander=value))


@pytest.mark.parametrize("value", [1.0, "ahead", (1.0, 2.0)], ids=repr)
def test_a_step_is_a_command_and_others_are_peers(value: Any) -> None:
    with pytest.raises(PolicyFailed, match=r"returned Place with step = .*, which is no Velocity, Drive or Twist"):
        checked(Place(1.0, 2.0, step=value))
    for others in (value, {2: value}):
        with pytest.raises(PolicyFailed, match=r"returned Place with others = .*; give a mapping from numbers of"):
            checked(Place(1.0, 2.0, others=others), {1, 2})


@pytest.mark.parametrize(
    "others",
    [
        {3: Peer(4, Pose(1.0, 2.0, 0.0), 5)},
        {10**7: Peer(4, Pose(1.0, 2.0, 0.0), 5)},
        {"2": Peer(4, Pose(1.0, 2.0, 0.0), 5)},
        {2: Peer(4, Pose(math.nan, 2.0, 0.0), 5)},
        {2: Peer(2**70, Pose(1.0, 2.0, 0.0), 5)},
        {2: Peer(4, None, 5)},  # type: ignore[arg-type]
    ],
    ids=["no robot", "large", "text", "no place", "no tick", "no pose"],
)
def test_others_are_robots_of_the_fleet_at_a_place(others: Any) -> None:
    with pytest.raises(PolicyFailed, match=r"returned Place with others = .*; give a mapping from numbers of"):
        checked(Place(1.0, 2.0, others=others), {1, 2})


@pytest.mark.parametrize("value", [None, 1.0, "ahead", {1.0}, (1.0, 2.0)], ids=repr)
def test_a_command_is_a_command_and_bearings_are_a_tuple(value: Any) -> None:
    with pytest.raises(PolicyFailed, match="returned Steer with command = "):
        checked(Steer(value))
    if type(value) is not tuple:
        says = r"returned an intent with bearings = .*, which is no tuple of numbers"
        with pytest.raises(PolicyFailed, match=says):
            checked(Bearing(value))


class Fickle(Sequence[float]):
    """Holds other numbers each time that it is read, and in the end none."""

    def __init__(self, *numbers: Any) -> None:
        self.numbers = list(numbers)

    def __len__(self) -> int:
        return 1

    def __getitem__(self, at: Any) -> Any:
        if at:
            raise IndexError(at)
        return self.numbers.pop(0)


def test_a_sequence_of_ones_own_is_read_once() -> None:
    intent = checked(Bearing(Fickle(0.5, math.nan)))
    assert intent == Bearing((0.5,))
    for bad in (math.nan, "north", None):
        with pytest.raises(PolicyFailed, match="returned Bearing with bearings = "):
            checked(Bearing(Fickle(bad, 0.5)))


@pytest.mark.parametrize("spot", [3.0, (), (1.0,), (1.0, 2.0, 3.0), "ab"], ids=repr)
def test_a_spot_is_a_pair(spot: Any) -> None:
    for intent in (Bearing((), near=spot), Bearing((), bend=spot)):
        with pytest.raises(PolicyFailed, match=r"an intent with (near|bend) = .*, which is no pair of numbers"):
            checked(intent)
    for place in (Place(1.0, 2.0, bend=spot), Place(1.0, 2.0, lean=spot)):
        with pytest.raises(PolicyFailed, match=r"an intent with (bend|lean) = .*, which is no pair of numbers"):
            checked(place)


@pytest.mark.parametrize("state", ["", "x" * (MAX_STATE + 1), "two\nlines", "\x1b[2J", None, 7, b"patrolling"])
@pytest.mark.parametrize(
    ("kind", "needed"), [(Bearing, ((),)), (Place, (1.0, 2.0)), (Stay, ()), (Steer, (Velocity(0.0, 0.0),))]
)
def test_a_state_is_one_short_printable_word(kind: type[Any], needed: tuple[Any, ...], state: Any) -> None:
    with pytest.raises(PolicyFailed, match=f"returned a state that is no printable word of at most {MAX_STATE}"):
        checked(kind(*needed, state=state))


def test_the_account_of_a_failure_is_one_short_printable_line() -> None:
    said = policy_failure(7, PolicyFailed("raised ValueError: two\n  lines"))
    assert said == "its policy failed at tick 7: raised ValueError: two lines"
    assert len(policy_failure(7, PolicyFailed("x" * 5000))) == MAX_FAILURE
    assert policy_failure(7, PolicyFailed("clear \x1b[2J \ud800 the screen")).isprintable()
