"""Other robots: those that were on the plan when they were heard last are where it has them now."""

from types import SimpleNamespace
from typing import Any

from agent.policies.common_plan.others import NEARBY, Others
from agent.policies.common_plan.plan import CommonPlan
from patrol.pose import Pose
from patrol.radio.peers import Peer
from tests.agent.policies.common_plan.test_plan import plan_on, prepared

STRIDE = 0.5


def view(tick: int, **peers: Peer) -> Any:
    """Return the first robot's view at a tick, in the left room; peers are named as r2."""
    known = {int(name[1:]): peer for name, peer in peers.items()}
    return SimpleNamespace(tick=tick, peers=known, reported=Pose(4.0, 4.0, 0.0), stride=STRIDE)


def heard(plan: CommonPlan, tick: int, aside: float = 0.0, late: int = 0) -> Peer:
    """The second robot at a tick, so far beside where the plan has it."""
    x, y = plan.places(tick)[1].tolist()
    return Peer(tick - late, Pose(x, y + aside, 0.0), tick)


def test_one_that_is_heard_now_is_where_it_is_heard() -> None:
    plan = plan_on(prepared())
    plan.advance_to(50)
    assert Others(plan, 1).note(view(50, r2=heard(plan, 50))) is None


def test_one_that_kept_to_the_plan_is_where_the_plan_has_it() -> None:
    plan = plan_on(prepared())
    plan.advance_to(90)
    others = Others(plan, 1)
    peer = heard(plan, 50)
    others.note(view(50, r2=peer))
    found = others.note(view(80, r2=peer))
    assert found is not None
    assert (found[2].pose.x, found[2].pose.y) == tuple(plan.places(80)[1].tolist())
    assert found[2].tick == 80


def test_one_that_was_never_heard_is_taken_to_keep_to_the_plan() -> None:
    plan = plan_on(prepared())
    plan.advance_to(60)
    found = Others(plan, 1).note(view(60))
    assert found is not None
    assert list(found) == [2]


def test_one_that_was_elsewhere_is_where_it_was_heard_until_it_is_back() -> None:
    plan = plan_on(prepared())
    plan.advance_to(90)
    others = Others(plan, 1)
    astray = heard(plan, 50, aside=2.0 * STRIDE)
    others.note(view(50, r2=astray))
    assert others.note(view(51, r2=astray)) is None
    back = heard(plan, 60, aside=0.5 * STRIDE)
    others.note(view(60, r2=back))
    assert others.note(view(61, r2=back)) is not None


def test_a_position_that_took_its_time_may_be_off_by_more() -> None:
    plan = plan_on(prepared())
    plan.advance_to(90)
    others = Others(plan, 1)
    late = heard(plan, 50, aside=2.0 * STRIDE, late=3)
    assert others.note(view(50, r2=late)) is not None


def test_robots_outside_the_plan_count_as_they_are_heard_if_they_are_near() -> None:
    plan = plan_on(prepared())
    plan.advance_to(60)
    near, far = Peer(60, Pose(5.0, 4.0, 0.0), 60), Peer(60, Pose(5.0 + NEARBY * STRIDE, 4.0, 0.0), 60)
    found = Others(plan, 1).note(view(60, r7=near, r8=far))
    assert found is not None
    assert sorted(found) == [2, 7]
    assert found[7] == near
