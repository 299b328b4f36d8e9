"""The check of robots: the shipped ones pass, and one broken robot for each rule."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from agent.own_robot import Site
from agent.robots.fake import FakeRobot
from examples.my_robot import MyRobot
from fogwatch.testing import RuleBroken, check_robot
from patrol.exchange import Sensed
from patrol.pose import Command, Pose

MODELS = ("holonomic", "differential", "car")


class Fake(FakeRobot):
    def __init__(self, site: Site) -> None:
        super().__init__(site.clock, site.spec, site.terrain, site.start, site.step)
        self.clock = site.clock

    def sense(self) -> Any:
        sensed = super().sense()
        return sensed if sensed is None else self.changed(sensed)

    def changed(self, sensed: Sensed) -> Any:
        return sensed


class OnAir(Fake):
    """A robot that is its own radio, as a simulated one is."""

    heard: Any = None

    def send(self, frames: tuple[bytes, ...]) -> None:
        assert frames == ()

    def hear(self) -> Any:
        return None if self.pose is None else self.heard


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("made", [Fake, MyRobot, OnAir])
def test_the_shipped_robots_pass(made: Callable[[Site], Any], model: str) -> None:
    check_robot(made, model=model)


def changing(change: Callable[[Sensed], Any]) -> type[Fake]:
    return type("Changed", (Fake,), {"changed": lambda _, sensed: change(sensed)})


class Twice(Fake):
    def sense(self) -> Any:
        self.clock.tick()
        return super().sense()


class Coasting(Fake):
    """Goes on with its last command."""

    def act(self, command: Command) -> None:
        super().act(command)
        self.kept = command

    def sense(self) -> Any:
        sensed = super().sense()
        if hasattr(self, "kept"):
            super().act(self.kept)
        return sensed


class Slow(Fake):
    def act(self, command: Command) -> None:
        super().act(type(command)(*(0.5 * number for number in command.numbers)))


class Unstopped(Fake):
    def stop(self, reason: str) -> None:
        self.stopped = reason


class StopsOnce(Fake):
    def stop(self, reason: str) -> None:
        if self.stopped:
            raise RuntimeError("stopped already")
        super().stop(reason)


class Endless(Fake):
    def sense(self) -> Any:
        return super().sense() or Sensed(99, self.pose)


class EndsOnce(Fake):
    ended = False

    def sense(self) -> Any:
        sensed = super().sense()
        if sensed is None and self.ended:
            raise EOFError("no more ticks")
        self.ended = sensed is None
        return sensed


class Deaf(OnAir):
    heard = "frames"


class HearsOn(OnAir):
    heard = [b"frame"]  # noqa: RUF012 - a fake


class Needy(Fake):
    def __init__(self, site: Site) -> None:
        super().__init__(site)
        site.orders()


WRONG: tuple[Any, ...] = ((1.0, 2.0), 0, None)
BROKEN: dict[str, Callable[[Site], Any]] = {
    "returned 3 at tick 0; return patrol.exchange.Sensed": changing(lambda _: 3),
    "at tick 0 it called site.clock.tick() 2 times": Twice,
    "returned k = 4 at tick 3; return the tick that the clock gave": changing(
        lambda sensed: replace(sensed, k=4) if sensed.k == 3 else sensed
    ),
    "returned pose = Pose(x=nan": changing(lambda sensed: replace(sensed, pose=Pose(float("nan"), 0.0, 0.0))),
    "returned pose = (1.0, 2.0)": changing(lambda sensed: replace(sensed, pose=WRONG[0])),
    "clock_s = inf at tick 0": changing(lambda sensed: replace(sensed, clock_s=float("inf"))),
    "returned bumped = 0 at tick 0": changing(lambda sensed: replace(sensed, bumped=WRONG[1])),
    "returned contacts = None at tick 0": changing(lambda sensed: replace(sensed, contacts=WRONG[2])),
    "without a command it must stand: at tick 3 it has moved 0.500 m": Coasting,
    "a command holds for one step: told to drive 0.5 m, at tick 1 it has moved 0.250 m": Slow,
    "stop ends the last command too: at tick 9 the robot has moved 0.500 m": Unstopped,
    "stop('again') raised RuntimeError: stopped already": StopsOnce,
    "when the clock had ended; return None": Endless,
    "sense() at the end raised EOFError: no more ticks": EndsOnce,
    "hear() returned 'frames' at tick 0; return a list of bytes, or None": Deaf,
    "hear() returned 1 frames at the end; return None": HearsOn,
    "make the robot without site.orders": Needy,
    "make_robot(site) raised TypeError": lambda _: int("x", base="y"),  # type: ignore[call-overload]
}


@pytest.mark.parametrize("says", BROKEN)
def test_a_robot_that_breaks_a_rule_is_named_with_tick_and_value(says: str) -> None:
    with pytest.raises(RuleBroken) as found:
        check_robot(BROKEN[says])
    assert says in str(found.value)


def test_what_a_robot_raises_is_the_cause() -> None:
    with pytest.raises(RuleBroken) as found:
        check_robot(StopsOnce)
    assert isinstance(found.value.__cause__, RuntimeError)


class Off(Fake):
    """Is found so many metres further along x from some tick on."""

    further = 0.0
    since = 0

    def changed(self, sensed: Sensed) -> Any:
        pose = sensed.pose
        moved = self.further if sensed.k >= self.since else 0.0
        return replace(sensed, pose=Pose(pose.x + moved, pose.y, pose.heading))


@pytest.mark.parametrize(
    "since", [1, 2, 3, 8, 9], ids=["driving", "driving again", "standing", "after a gap", "stopped"]
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_place_may_be_off_by_five_centimetres(since: int, sign: float) -> None:
    check_robot(type("Near", (Off,), {"further": sign * 0.049, "since": since}))
    with pytest.raises(RuleBroken, match=rf"at tick {since} (it|the robot) has moved"):
        check_robot(type("Far", (Off,), {"further": sign * 0.051, "since": since}))


def test_a_robot_is_told_to_drive_in_four_ticks_and_asked_in_all_and_twice_at_the_end() -> None:
    calls: list[str] = []

    class Noted(OnAir):
        def sense(self) -> Any:
            sensed = super().sense()
            calls.append("none" if sensed is None else str(sensed.k))
            return sensed

        def act(self, command: Command) -> None:
            calls.append(f"act {command.numbers[0]:g}")
            super().act(command)

        def send(self, frames: tuple[bytes, ...]) -> None:
            super().send(frames)
            calls.append("send")

        def hear(self) -> Any:
            calls.append("hear")
            return None

        def stop(self, reason: str) -> None:
            calls.append("stop")
            super().stop(reason)

    check_robot(Noted)
    drive = [f"{k} send hear act 1" for k in (0, 1)] + ["2 send hear", "3 send hear"]
    drive += [f"{k} send hear act 1" for k in (7, 8)]
    assert " ".join(calls) == " ".join(["stop stop", *drive, "stop 9 10 none none send hear stop"])
