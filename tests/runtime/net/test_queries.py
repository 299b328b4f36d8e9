"""Queries while processes and routers come and go: Zenoh may end one at once though somebody could answer."""

import os
import threading
import time
from collections.abc import Callable, Iterator

import pytest

from patrol.scenario.controls import Answer
from runtime.messages.stop_orders import Order, Outcome, StopOrders, ask_robots
from runtime.net.link import Link, open_link, open_router
from runtime.net.mailbox import Mailbox, Question
from runtime.security.control_auth import ASK, CHALLENGE, ControlClient, ControlGate
from runtime.security.keys import FleetKeys, fleet_keys
from tests.routers import PATIENCE_S, free_endpoint

KEYS: FleetKeys = fleet_keys("f")
STOPPED = Outcome(True, "stands")
TOKEN = "a token that is long enough"
RETURNS = 5

Join = Callable[[str], Link]


@pytest.fixture
def join() -> Iterator[Join]:
    links: list[Link] = []

    def opened(router: str) -> Link:
        links.append(open_link(router, PATIENCE_S))
        return links[-1]

    yield opened
    for link in links:
        assert link.close(PATIENCE_S)


def robot(link: Link) -> None:
    StopOrders(link, KEYS, "r1").obey(lambda _order: STOPPED)


def stopped(operator: Link, meanwhile: Callable[[], None] = lambda: None) -> list[tuple[str, Outcome]]:
    """Return the answers of robot r1 when the query is over, long before its time is up."""
    answers: list[tuple[str, Outcome]] = []
    asking = threading.Thread(
        target=lambda: answers.extend(ask_robots(operator, KEYS, ["r1"], Order.STOP, 10 * PATIENCE_S)), daemon=True
    )
    asking.start()
    meanwhile()
    asking.join(PATIENCE_S)
    assert not asking.is_alive(), "the query goes on"
    return answers


def test_an_order_reaches_a_robot_that_has_just_come_back(endpoint: str, join: Join) -> None:
    """Zenoh's issue 2767: a query ends at once, without an answer, though it was to wait for a long time."""
    operator = join(endpoint)
    for _ in range(RETURNS):
        link = open_link(endpoint, PATIENCE_S)
        robot(link)
        assert stopped(operator) == [("r1", STOPPED)]
        assert link.close(PATIENCE_S)


def test_an_order_that_is_given_while_the_router_is_down_is_carried_out_when_it_is_back(join: Join) -> None:
    """Also of Zenoh's issue 2767."""
    where = free_endpoint()
    router = open_router(where)
    operator = join(where)
    robot(join(where))
    assert stopped(operator) == [("r1", STOPPED)]
    assert router.close(PATIENCE_S)
    routers: list[Link] = []
    assert stopped(operator, lambda: routers.append(open_router(where))) == [("r1", STOPPED)]
    assert routers[0].close(PATIENCE_S)


def test_an_operator_controls_a_world_that_has_just_come_back(endpoint: str, join: Join) -> None:
    """As above: the world is asked twice, for a ticket and with the request."""
    operator = join(endpoint)
    client = ControlClient(operator, KEYS, TOKEN, time.monotonic, os.urandom)
    outcome: list[Answer] = []
    asking = threading.Thread(target=lambda: outcome.append(client.ask({"do": "pause"}, PATIENCE_S).answer))
    asking.start()
    world = join(endpoint)
    gate = ControlGate(KEYS.fleet, TOKEN, 9, b"s" * 16, time.monotonic)
    asked: Mailbox[Question] = Mailbox([KEYS.control(CHALLENGE), KEYS.control(ASK)], _none, 1 << 16)
    for key in (CHALLENGE, ASK):
        world.attend(KEYS.control(key), 1 << 16, asked)
    challenge = asked.get(PATIENCE_S)
    assert challenge is not None
    challenge[1].answer(gate.challenge(challenge[1].payload))
    request = asked.get(PATIENCE_S)
    assert request is not None
    request[1].answer(gate.open(request[1].payload).seal(Answer(True, "paused")))
    asking.join(PATIENCE_S)
    assert outcome == [Answer(True, "paused")]


def _none(payload: bytes) -> Question:
    raise ValueError(f"{len(payload)} bytes are no question")


@pytest.mark.parametrize("lost", [0, 1])
def test_an_order_is_carried_out_though_one_of_two_routers_is_lost(lost: int, join: Join) -> None:
    """Zenoh's issue 2454: a query that was answered waits until its time is up for the router that is lost."""
    where = [free_endpoint(), free_endpoint()]
    routers = [open_router(where[0]), open_router(where[1], others=[where[0]])]
    operator = join(f"{where[0]},{where[1]}")
    robot(join(f"{where[1]},{where[0]}"))
    assert stopped(operator) == [("r1", STOPPED)]
    assert routers.pop(lost).close(PATIENCE_S)
    for _ in range(RETURNS):
        assert stopped(operator) == [("r1", STOPPED)]
    assert routers[0].close(PATIENCE_S)
