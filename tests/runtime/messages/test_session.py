"""Both ends of the session: the effects of each message in each state, and the rules that no sequence breaks."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.exchange import Reply, Sensed
from patrol.pose import Pose, Velocity
from runtime.messages import phases, session
from runtime.net.mailbox import Presence

NOW = 100.0
RUN, OTHER, HASH = 5, 6, "a" * 64
POSE = Pose(1.0, 2.0, 0.5)


def short(effects: session.Effects) -> str:
    """Write effects in a word each."""
    words = []
    for effect in effects:
        match effect:
            case session.Send(message):
                words.append({phases.Hello: "hello", phases.HelloReply: "hello", phases.Stop: "stop"}[type(message)])
            case session.Refuse(reason):
                words.append(reason)
            case _:
                words.append(type(effect).__name__.lower())
    return "+".join(words) or "-"


def columns(table: str) -> list[tuple[str, str, str]]:
    """Split a table of cases: a state, a message, and the effects, with the state that follows where it is another."""
    head, *rows = [line for line in table.strip().splitlines() if line.strip()]
    cases = []
    for row in rows:
        message, _, cells = row.partition("|")
        cases += [(at, message.strip(), cell) for at, cell in zip(head.split(), cells.split(), strict=True)]
    return cases


ME = session.Identity("r1", 1, 77, HASH)


def hello(run: int = RUN) -> phases.Hello:
    return phases.Hello(0, phases.ANYONE, 3, run)


def a(k: int) -> phases.PhaseA:
    return phases.PhaseA(1, 77, k, RUN, Sensed(k, POSE))


def b(k: int) -> phases.PhaseB:
    return phases.PhaseB(1, 77, k, RUN, (b"frame",))


def robot_at(stage: str) -> session.RobotEnd:
    """A robot's end in a state; tick 3 is due, or was taken last."""
    robot = session.RobotEnd(ME, 10.0, 2.0, NOW)
    robot.arrived(Presence(True), NOW)
    steps: list[Callable[[], object]] = [
        lambda: robot.arrived(hello(), NOW),
        lambda: robot.arrived(a(3), NOW),
        robot.take,
        lambda: robot.arrived(b(3), NOW),
        lambda: robot.leave("told to"),
    ]
    for step in steps[: list(session.RobotStage).index(session.RobotStage[stage])]:
        step()
    assert robot.stage is session.RobotStage[stage]
    return robot


def greeted_while_alone(robot: session.RobotEnd) -> session.Effects:
    assert robot.arrived(Presence(False), NOW) == ()
    return robot.arrived(hello(OTHER), NOW + session.SILENCE_S)


def taken(robot: session.RobotEnd) -> session.Effects:
    assert (phase := robot.take()) is None or phase == a(3)
    return ()


TO_ROBOT: Mapping[str, Any] = {
    "Hello": hello(),
    "Hello of run 6": hello(OTHER),
    "the same, own world gone": greeted_while_alone,
    "PhaseA 4": a(4),
    "PhaseA 3": a(3),
    "PhaseA 4 to another": replace(a(4), instance=78),
    "PhaseA 4 of run 6": replace(a(4), run=OTHER),
    "PhaseB 3": b(3),
    "PhaseB 4": b(4),
    "PhaseB 3 to another": replace(b(3), incarnation=2),
    "PhaseB 3 of run 6": replace(b(3), run=OTHER),
    "Stop": phases.Stop(1, 77, 3, RUN, True, "over"),
    "Stop of run 6": phases.Stop(1, 77, 3, OTHER, True, "over"),
    "Stop to another": phases.Stop(1, 78, 3, RUN, True, "over"),
    "Stop to all": phases.Stop(1, phases.ANYONE, 3, RUN, True, "over"),
    "token": Presence(True),
    "its mind takes the tick": taken,
    "its process has to leave": lambda robot: robot.leave("told to"),
    "nothing, for long": lambda robot: (robot.arrived(Presence(False), NOW), robot.waited(1.0, NOW + 11.0))[1][1:],
}

ROBOT_CASES = """
                             UNGREETED     OFFERED    DUE         AWAITS_B       AWAITS_A   LEFT
    Hello                    |hello>OFFERED hello     hello       hello          hello      -
    Hello of run 6           |hello>OFFERED hello     stranger    stranger       stranger   -
    the same, own world gone |hello>OFFERED hello     part>LEFT   part>LEFT      part>LEFT  -
    PhaseA 4                 |stranger      ->DUE     -           ->DUE          ->DUE      -
    PhaseA 3                 |stranger      ->DUE     repeat      repeat         repeat     -
    PhaseA 4 to another      |stranger      stranger  stranger    stranger       stranger   -
    PhaseA 4 of run 6        |stranger      stranger  stranger    stranger       stranger   -
    PhaseB 3                 |stranger      stranger  deliver     deliver>AWAITS_A repeat   -
    PhaseB 4                 |stranger      stranger  deliver     deliver        deliver    -
    PhaseB 3 to another      |stranger      stranger  stranger    stranger       stranger   -
    PhaseB 3 of run 6        |stranger      stranger  stranger    stranger       stranger   -
    Stop                     |part>LEFT     part>LEFT part>LEFT   part>LEFT      part>LEFT  -
    Stop of run 6            |part>LEFT     stranger  stranger    stranger       stranger   -
    Stop to another          |stranger      stranger  stranger    stranger       stranger   -
    Stop to all              |stranger      stranger  stranger    stranger       stranger   -
    token                    |-             -         -           -              -          -
    its mind takes the tick  |-             -         ->AWAITS_B  -              -          -
    its process has to leave |part>LEFT     part>LEFT part>LEFT   part>LEFT      part>LEFT  -
    nothing, for long        |part>LEFT     part>LEFT part>LEFT   part>LEFT      part>LEFT  -
"""


@pytest.mark.parametrize(("at", "message", "cell"), columns(ROBOT_CASES))
def test_a_message_to_a_robot(at: str, message: str, cell: str) -> None:
    robot = robot_at(at)
    what = TO_ROBOT[message]
    effects = what(robot) if callable(what) else robot.arrived(what, NOW)
    expected, _, following = cell.partition(">")
    assert short(effects) == expected
    assert robot.stage is session.RobotStage[following or at]


def test_a_tick_whose_phase_b_has_come_is_taken_whole() -> None:
    robot = robot_at("DUE")
    assert robot.arrived(b(3), NOW) == (session.Deliver(b(3)),)
    assert robot.take() == a(3)
    assert robot.stage is session.RobotStage.AWAITS_A


def test_phase_b_of_an_older_tick_counts_and_ends_no_wait() -> None:
    robot = robot_at("AWAITS_B")
    robot.arrived(a(5), NOW)
    assert robot.arrived(b(3), NOW) == (session.Deliver(b(3)),)
    assert robot.take() == a(5)
    for k in (7, 4):
        assert robot.arrived(b(k), NOW) == (session.Deliver(b(k)),)
        assert robot.arrived(b(k), NOW) == (session.Repeat(b(k)),)
        assert robot.stage is session.RobotStage.AWAITS_B
    assert robot.arrived(b(5), NOW) == (session.Deliver(b(5)),)
    assert robot.take() is None
    robot.arrived(a(6), NOW)
    assert robot.take() == a(6)


def test_a_world_that_has_begun_no_tick_fills_no_memory() -> None:
    robot = robot_at("OFFERED")
    assert robot.arrived(hello(OTHER), NOW) == (session.Send(phases.HelloReply(1, 77, 0, OTHER, HASH)),)
    for k in range(3, 600):
        forged = phases.PhaseB(1, 77, k, OTHER, (b"forged",))
        assert robot.arrived(forged, NOW) == (session.Refuse("stranger"),)
    robot.arrived(a(3), NOW)
    robot.take()
    assert robot.stage is session.RobotStage.AWAITS_B  # nothing was heard of this tick


def test_a_silence_is_asked_about_and_a_pause_of_the_process_is_none() -> None:
    robot = robot_at("AWAITS_A")
    assert robot.waited(0.1, NOW + session.SILENCE_S) == (session.Halt(),)
    asked = session.Send(phases.HelloReply(1, 77, 3, RUN, HASH))
    assert robot.waited(0.1, NOW + session.SILENCE_S + 0.1) == (session.Halt(), asked)
    assert robot.waited(0.1, NOW + session.SILENCE_S + 0.2) == (session.Halt(),)
    robot.arrived(Presence(True), NOW + 10.0)
    assert robot.waited(60.0, NOW + 70.0) == (session.Halt(),)
    robot.arrived(a(4), NOW + 71.0)
    assert robot.waited(0.1, NOW + 71.0) == ()


def test_a_pause_of_the_process_makes_no_pose_old() -> None:
    """It is blind after 2 s, and looked last a second after the pose came."""
    robot = robot_at("AWAITS_A")
    assert robot.waited(0.1, NOW + 1.0) == ()
    assert robot.waited(60.0, NOW + 61.0) == ()
    assert robot.waited(0.5, NOW + 61.5) == ()
    assert robot.waited(0.6, NOW + 62.1) == (session.Halt(),)


def test_an_ungreeted_robot_asks_for_a_greeting_and_says_so() -> None:
    asked = session.Send(phases.HelloReply(1, 77, 0, phases.NO_RUN, HASH))
    robot = session.RobotEnd(ME, 10.0, 60.0, NOW)
    assert robot.waited(0.1, NOW + session.UNGREETED_S) == ()
    assert robot.waited(0.1, NOW + session.UNGREETED_S + 0.5) == (asked, session.Unanswered(session.UNGREETED_S + 0.5))


BEGUN = 300
REPLY = Reply(Velocity(1.0, 0.0), "patrolling", None, 1.0, 0)


def world_at(stage: str) -> session.WorldEnd:
    """The world's end in a state; where a process has the seat, it is instance 71."""
    run = session.WorldRun(RUN, HASH, k=BEGUN - 1, begun=BEGUN)
    world = session.WorldEnd(run, 1, "r1", expected=stage != "VACANT")
    if stage not in ("VACANT", "EXPECTED"):
        assert world.arrived(phases.HelloReply(1, 71, 0, RUN, HASH), NOW) == ()
    if stage == "FAILING":
        world.arrived(phases.Failed(1, 71, 3, RUN, "no idea"), NOW)
    if stage == "DISMISSED":
        world.dismiss("left out", orderly=False)
    assert world.stage is session.SeatStage[stage]
    return world


TO_WORLD: Mapping[str, Any] = {
    "token": Presence(True),
    "token gone": Presence(False),
    "HelloReply to no world": phases.HelloReply(1, 71, 0, phases.NO_RUN, HASH),
    "HelloReply": phases.HelloReply(1, 71, 0, RUN, HASH),
    "HelloReply of another": phases.HelloReply(1, 99, 0, RUN, HASH),
    "HelloReply of another, unlike": phases.HelloReply(1, 99, 0, RUN, "d" * 64),
    "HelloReply of another version": phases.HelloReply(1, 99, 0, phases.NO_RUN, HASH, phases.PROTOCOL + 1),
    "HelloReply to run 6": phases.HelloReply(1, 71, 0, OTHER, HASH),
    "ReplyA": phases.ReplyA(1, 71, BEGUN - 1, RUN, (b"frame",)),
    "ReplyB": phases.ReplyB(1, 71, BEGUN - session.OLDEST, RUN, REPLY),
    "ReplyB ahead": phases.ReplyB(1, 71, BEGUN, RUN, REPLY),
    "ReplyA late": phases.ReplyA(1, 71, BEGUN - session.OLDEST - 1, RUN, (b"frame",)),
    "ReplyA of another": phases.ReplyA(1, 99, 3, RUN, (b"frame",)),
    "ReplyA to run 6": phases.ReplyA(1, 71, 3, OTHER, (b"frame",)),
    "Failed": phases.Failed(1, 71, 3, RUN, "no idea"),
    "Failed of another": phases.Failed(2, 71, 3, RUN, "no idea"),
    "Farewell": phases.Farewell(1, 71, 3, RUN),
    "Farewell of another": phases.Farewell(1, 99, 3, RUN),
    "it is dismissed": lambda world: world.dismiss("go", orderly=True),
    "it has ended": lambda world: world.end() or (),
    "another is started": lambda world: world.expect(2) or (),
}

WORLD_CASES = """
                                 VACANT      EXPECTED    SEATED         FAILING        DISMISSED
    token                         |-         hello       -              -              -
    token gone                    |-         -           -              -              -
    HelloReply to no world        |-         hello       -              -              stop
    HelloReply                    |seat+stop ->SEATED    -              -              stop
    HelloReply of another         |seat+stop ->SEATED    seat+stop      seat+stop      seat+stop
    HelloReply of another, unlike |seat+stop stop+unlike seat+stop      seat+stop      seat+stop
    HelloReply of another version |seat+stop stop+unlike seat+stop      seat+stop      seat+stop
    HelloReply to run 6           |stranger  stranger    stranger       stranger       stranger
    ReplyA                        |stranger  stranger    deliver        deliver        stranger
    ReplyB                        |stranger  stranger    deliver        deliver        stranger
    ReplyB ahead                  |stranger  stranger    ahead          ahead          stranger
    ReplyA late                   |stranger  stranger    late           late           stranger
    ReplyA of another             |stranger  stranger    stranger       stranger       stranger
    ReplyA to run 6               |stranger  stranger    stranger       stranger       stranger
    Failed                        |stranger  stranger    ->FAILING      -              stranger
    Failed of another             |stranger  stranger    stranger       stranger       stranger
    Farewell                      |stranger  stranger    -              -              -
    Farewell of another           |stranger  stranger    stranger       stranger       stranger
    it is dismissed               |-         -           stop>DISMISSED stop>DISMISSED stop
    it has ended                  |-         ->VACANT    ->VACANT       ->VACANT       ->VACANT
    another is started            |->EXPECTED -          ->EXPECTED     ->EXPECTED     ->EXPECTED
"""


@pytest.mark.parametrize(("at", "message", "cell"), columns(WORLD_CASES))
def test_a_message_to_the_world(at: str, message: str, cell: str) -> None:
    world = world_at(at)
    what = TO_WORLD[message]
    effects = what(world) if callable(what) else world.arrived(what, NOW)
    expected, _, following = cell.partition(">")
    assert short(effects) == expected
    assert world.stage is session.SeatStage[following or at]


def test_a_process_that_is_turned_away_is_told_why() -> None:
    seated, vacant, dismissed = (world_at(stage) for stage in ("SEATED", "VACANT", "DISMISSED"))
    other = TO_WORLD["HelloReply of another"]
    stop = phases.Stop(1, 99, BEGUN - 1, RUN, False, "another process is r1 already")
    assert seated.arrived(other, NOW) == (session.Refuse("seat"), session.Send(stop))
    no_seat = replace(stop, reason="no process is expected for r1 now")
    assert vacant.arrived(other, NOW) == (session.Refuse("seat"), session.Send(no_seat))
    left_out = replace(stop, instance=71, reason="left out")
    assert dismissed.arrived(TO_WORLD["HelloReply"], NOW) == (session.Send(left_out),)


def test_only_the_process_that_was_started_takes_the_seat() -> None:
    world = session.WorldEnd(session.WorldRun(RUN, HASH), 1, "r1")
    world.expect(2)
    for incarnation in (1, 3):
        assert short(world.arrived(phases.HelloReply(incarnation, 102, 0, RUN, HASH), NOW)) == "seat+stop"
    assert world.arrived(phases.HelloReply(2, 102, 0, RUN, HASH), NOW) == ()
    assert world.process == (2, 102)


def test_a_process_that_is_gone_may_say_farewell_but_answers_no_more() -> None:
    world = world_at("SEATED")
    world.end()
    assert world.arrived(phases.Farewell(1, 71, 3, RUN), NOW) == ()
    assert world.process is None
    world.expect(2)
    assert world.arrived(phases.Farewell(1, 71, 3, RUN), NOW) == ()
    assert world.stage is session.SeatStage.EXPECTED
    assert world.arrived(phases.ReplyA(1, 71, 3, RUN, (b"frame",)), NOW) == (session.Refuse("stranger"),)
    world.arrived(phases.HelloReply(2, 72, 0, RUN, HASH), NOW)
    assert not world.said_farewell


def test_a_token_that_has_gone_is_no_farewell() -> None:
    world = world_at("SEATED")
    assert not world.is_missing(NOW + 1000.0)
    for seconds in (0.0, 5.0):
        world.arrived(Presence(False), NOW + seconds)
    assert not world.is_missing(NOW + 0.9 * session.GRACE_S)
    assert world.is_missing(NOW + 1.1 * session.GRACE_S)
    assert not world.is_gone(NOW + session.RETURN_S - 0.1)
    assert world.is_gone(NOW + session.RETURN_S)
    world.arrived(phases.Farewell(1, 71, 3, RUN), NOW)
    assert not world.is_gone(NOW + 0.9 * session.GRACE_S)
    assert world.is_gone(NOW + 1.1 * session.GRACE_S)
    world.arrived(Presence(True), NOW + 60.0)
    assert not world.is_missing(NOW + 1000.0)


TICK = st.integers(0, 12)
FROM = st.tuples(st.sampled_from([1, 1, 1, 2]), st.sampled_from([77, 77, 77, 78, phases.ANYONE]))


@st.composite
def to_robots(draw: st.DrawFn) -> Any:
    """Messages to a robot from its world and from another; and what its own process does."""
    k, head, run = draw(TICK), draw(FROM), draw(st.sampled_from([RUN, RUN, OTHER]))
    kinds: list[Any] = [
        phases.Hello(0, phases.ANYONE, k, run),
        phases.PhaseA(*head, k, run, Sensed(k, POSE)),
        phases.PhaseB(*head, k, run, (b"frame",)),
        Presence(draw(st.booleans())),
        "take",
        draw(st.sampled_from([0.1, 1.0, 6.0])),
    ]
    if draw(st.integers(0, 20)) == 0:
        kinds = [phases.Stop(*head, k, run, True, "over"), "leave"]
    return draw(st.sampled_from(kinds))


@given(st.lists(to_robots(), max_size=60))
def test_no_sequence_makes_a_robot_obey_a_stranger_or_come_back(sequence: list[Any]) -> None:
    robot, now, own, heard = session.RobotEnd(ME, 10.0, 2.0, NOW), NOW, None, set()
    for what in sequence:
        had_left, newest = robot.stage is session.RobotStage.LEFT, robot.k
        effects: session.Effects = ()
        if what == "take":
            phase = robot.take()
            assert phase is None or (phase.k > newest and phase.run == own)
        elif what == "leave":
            effects = robot.leave("told to")
        elif isinstance(what, float):
            now += what
            effects = robot.waited(what, now)
        else:
            effects = robot.arrived(what, now)
            if own is None and robot.stage is session.RobotStage.DUE:
                own = what.run
        assert robot.stage is session.RobotStage.LEFT or not had_left
        assert effects == () or not had_left
        assert (robot.stage is session.RobotStage.LEFT) == (
            had_left or any(isinstance(one, session.Part) for one in effects)
        )
        for effect in effects:
            if isinstance(effect, session.Deliver | session.Repeat):
                assert (what.incarnation, what.instance, what.run) == (1, 77, own)
            if isinstance(effect, session.Deliver):
                assert what.k not in heard
                heard.add(what.k)
            if isinstance(effect, session.Refuse):
                assert effect.reason == "stranger"


@st.composite
def to_worlds(draw: st.DrawFn) -> Any:
    """Messages to a world from processes of a robot; and what the world does with them."""
    head = draw(st.integers(1, 2)), draw(st.integers(71, 73))
    k = draw(st.sampled_from([0, 43, 44, 299, 300, 2**31 - 1]))
    run = draw(st.sampled_from([RUN, RUN, RUN, phases.NO_RUN, OTHER]))
    kinds: list[Any] = [
        phases.HelloReply(
            *head, k, run, draw(st.sampled_from([HASH, HASH, "d" * 64])), draw(st.sampled_from([phases.PROTOCOL, 4]))
        ),
        phases.ReplyA(*head, k, run, (b"frame",)),
        phases.ReplyB(*head, k, run, REPLY),
        phases.Failed(*head, k, run, "no idea"),
        phases.Farewell(*head, k, run),
        Presence(draw(st.booleans())),
        draw(st.sampled_from(["dismiss", "end", "expect"])),
    ]
    return draw(st.sampled_from(kinds))


@given(st.lists(to_worlds(), max_size=60))
def test_no_sequence_lets_a_process_without_the_seat_speak(sequence: list[Any]) -> None:
    world = session.WorldEnd(session.WorldRun(RUN, HASH, k=BEGUN - 1, begun=BEGUN), 1, "r1")
    for what in sequence:
        before, seated = world.process, world.stage in (session.SeatStage.SEATED, session.SeatStage.FAILING)
        if isinstance(what, str):
            acts: dict[str, Callable[[], Any]] = {
                "dismiss": lambda: world.dismiss("go", orderly=True),
                "end": world.end,
                "expect": lambda: world.expect(2),
            }
            acts[what]()
        else:
            for effect in world.arrived(what, NOW):
                if isinstance(effect, session.Deliver):
                    assert seated
                    assert (what.incarnation, what.instance) == before
                    assert what.run == RUN
                    assert BEGUN - session.OLDEST <= what.k < BEGUN
                if isinstance(effect, session.Send) and isinstance(effect.message, phases.Stop):
                    assert (effect.message.incarnation, effect.message.instance) == (what.incarnation, what.instance)
                if isinstance(effect, session.Refuse):
                    assert effect.reason in ("stranger", "seat", "ahead", "late")
                if isinstance(effect, session.Unlike):
                    assert before is None
            assert world.process in (before, (getattr(what, "incarnation", 0), getattr(what, "instance", 0)))
            assert world.process == before or before is None  # a seat is taken once
        assert (world.process is None) == (world.stage in (session.SeatStage.VACANT, session.SeatStage.EXPECTED))


class Watched(dict[Any, Any]):
    """A table that remembers which of its steps were taken."""

    def __init__(self, table: Mapping[Any, Any]) -> None:
        super().__init__(table)
        self.taken: set[Any] = set()

    def get(self, key: Any, default: Any = None) -> Any:
        self.taken.add(key)
        return super().get(key, default)


def test_every_step_and_every_refusal_can_happen(monkeypatch: pytest.MonkeyPatch) -> None:
    robot, seat = Watched(session.ROBOT), Watched(session.SEAT)
    monkeypatch.setattr(session, "ROBOT", robot)
    monkeypatch.setattr(session, "SEAT", seat)
    for at, message, cell in columns(ROBOT_CASES):
        test_a_message_to_a_robot(at, message, cell)
    for at, message, cell in columns(WORLD_CASES):
        test_a_message_to_the_world(at, message, cell)
    test_a_tick_whose_phase_b_has_come_is_taken_whole()
    test_phase_b_of_an_older_tick_counts_and_ends_no_wait()
    test_a_process_that_is_gone_may_say_farewell_but_answers_no_more()
    test_only_the_process_that_was_started_takes_the_seat()
    assert session.ROBOT.keys() - robot.taken == set()
    assert session.SEAT.keys() - seat.taken == set()
    for event in (session.RobotEvent.STRANGER, session.SeatEvent.STRANGER):
        assert not any(on is event for _, on in (*session.ROBOT, *session.SEAT))
