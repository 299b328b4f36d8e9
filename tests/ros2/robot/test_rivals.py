"""Others that drive a robot, by the graph."""

import threading
from types import SimpleNamespace
from typing import Any

import pytest

from ros2.robot import hardware
from ros2.robot.hardware import Rivals, rivals
from ros2.wire.messages import Twist
from ros2.wire.names import Entity, EntityKind, NodeName
from tests.ros2.robot.passing import Passing
from tests.ros2_hub import Hub

TOPIC = "/robot1/cmd_vel"
OURS = "0123"


def entity(kind: EntityKind, name: str, session: str = "4567", topic: str = "", namespace: str = "robot1") -> Entity:
    return Entity(0, session, 0, 1, kind, NodeName(name, namespace), topic)


def found(*entities: Entity, topic: str | None = TOPIC) -> list[str]:
    return rivals(entities, topic, lambda one: one.session == OURS, "/robot1/fogwatch")


def test_whoever_publishes_commands_is_a_rival_but_we_ourselves() -> None:
    joystick = entity(EntityKind.PUBLISHER, "teleop", topic=TOPIC)
    ours = entity(EntityKind.PUBLISHER, "fogwatch", OURS, TOPIC)
    assert found(joystick, ours) == ["/robot1/teleop on /robot1/cmd_vel"]
    assert found(entity(EntityKind.PUBLISHER, "", topic=TOPIC)) == ["somebody on /robot1/cmd_vel"]
    assert found(joystick, topic=None) == []
    assert found(entity(EntityKind.SUBSCRIPTION, "base", topic=TOPIC)) == []
    assert found(entity(EntityKind.PUBLISHER, "x", topic="/cmd_vel")) == []


def test_another_agent_of_the_robot_is_a_rival_whatever_it_sends() -> None:
    nodes = [entity(EntityKind.NODE, "fogwatch", namespace=namespace) for namespace in ("robot1", "/robot1")]
    assert found(*nodes, topic=None) == ["another agent, /robot1/fogwatch"]
    assert found(entity(EntityKind.NODE, "fogwatch", OURS)) == []
    assert found(entity(EntityKind.NODE, "fogwatch", namespace="robot2")) == []


def test_what_others_call_themselves_cannot_fill_a_line() -> None:
    lines = found(*(entity(EntityKind.PUBLISHER, f"{number}\n" + 1000 * "x", topic=TOPIC) for number in range(100)))
    assert len(lines) == 4
    assert all(len(line) < 200 and "\n" not in line for line in lines)


def test_one_that_goes_soon_is_waited_for() -> None:
    hub = Hub()
    hub.link("teleop", "robot1").publisher("cmd_vel", Twist)
    ours = Rivals(hub.link("fogwatch", "robot1"), TOPIC)
    assert ours.are_there(0.0) == ["/robot1/teleop on /robot1/cmd_vel"]
    assert ours.why == "also driven by /robot1/teleop on /robot1/cmd_vel (end all but one)"
    ours.release()
    assert ours.why
    going = threading.Thread(target=hub.entities.clear)
    going.start()
    assert ours.are_there(60.0) == []
    assert ours.why == ""
    going.join()
    ours.close()


class Graph:
    """A link whose graph always shows another driver, and how long a look may take."""

    def __init__(self, passing: Passing) -> None:
        self._passing = passing
        self.node = SimpleNamespace(name="fogwatch")
        self.looks: list[tuple[float, float]] = []

    def resolve(self, name: str) -> str:
        return f"/robot1/{name}"

    def is_ours(self, one: Entity) -> bool:
        return one.session == OURS

    def graph(self, limit_s: float) -> list[Entity]:
        self.looks.append((self._passing.now_s - 100.0, limit_s))
        return [entity(EntityKind.PUBLISHER, "teleop", topic=TOPIC)]


def test_another_driver_is_waited_for_four_seconds_and_looked_for_each_second_after_that(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    passing = Passing()
    passing.put_into(monkeypatch, hardware, "Event")
    link: Any = Graph(passing)
    ours = Rivals(link, TOPIC)
    assert ours.are_there() == ["/robot1/teleop on /robot1/cmd_vel"]
    assert [limit_s for _, limit_s in link.looks] == [2.0] * len(link.looks)
    assert [at_s for at_s, _ in link.looks] == pytest.approx([0.2 * look for look in range(21)])
    passing.waits.clear()
    looks = link.looks = []

    def graph(limit_s: float) -> list[Entity]:
        if len(looks) == 2:
            ours.close()
        return Graph.graph(link, limit_s)

    link.graph = graph
    ours._watch_graph()  # in this thread
    assert passing.waits == [1.0] * 3
