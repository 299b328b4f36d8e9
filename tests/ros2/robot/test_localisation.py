import math
from typing import Any

import pytest

from patrol.pose import Limits, Pose
from ros2.robot.localisation import Fix, Localisation, LocalisationSettings, Source
from ros2.robot.options import DriveSettings
from ros2.wire.frames import composed
from ros2.wire.messages import Odometry, PoseWithCovarianceStamped, TFMessage, Transform, Twist

# Not the product's own, so that a wrong one there is noticed.
CORRECTED_M = 10.0
CORRECTION_S = 5.0
LONGEST_S = 0.5
SETTLED_S = 1.0
SLOW_GAPS = 3

NOW = 1_700_000_000.0
STILL, AHEAD = Twist(0.0, 0.0, 0.0), Twist(1.0, 0.0, 0.0)
SHIFT = Pose(10.0, 5.0, math.pi / 2)
PLACE = Pose(1.0, 0.0, 0.0)


def ns(time_s: float) -> int:
    return round(time_s * 1e9)


def odometry(at_s: float, pose: Pose = PLACE, twist: Twist = STILL, frame: str = "odom") -> Odometry:
    return Odometry(ns(at_s), frame, "base_link", pose, twist)


def transform(at_s: float, pose: Pose = SHIFT, frame: str = "map", child: str = "odom") -> TFMessage:
    return TFMessage((Transform(ns(at_s), frame, child, pose),))


def found(localisation: Localisation, now_s: float = NOW) -> Fix:
    fix = localisation.at(now_s)
    assert fix is not None, localisation.why
    assert localisation.why == ""
    return fix


def why_unknown(localisation: Localisation, now_s: float = NOW) -> str:
    assert localisation.at(now_s) is None
    return localisation.why


def with_odometry(**settings: Any) -> Localisation:
    localisation = Localisation(LocalisationSettings(**settings))
    localisation.odometry(odometry(NOW), NOW)
    return localisation


def with_tf(pose: Pose = SHIFT, **settings: Any) -> Localisation:
    localisation = Localisation(LocalisationSettings(**settings))
    localisation.transforms(transform(NOW, pose), NOW, fixed=False)
    localisation.odometry(odometry(NOW), NOW)
    return localisation


def tell(localisation: Localisation, pose: Pose, stamp_s: float = NOW, now_s: float = NOW, frame: str = "map") -> None:
    """The robot's localisation says where it is."""
    localisation.localised(PoseWithCovarianceStamped(ns(stamp_s), frame, pose), now_s)


def near(pose: Pose, x: float, y: float, heading: float = math.pi / 2) -> None:
    assert (pose.x, pose.y, pose.heading) == pytest.approx((x, y, heading), abs=1e-6)


def test_map_odom_and_base_are_put_together_and_brought_up_to_now_by_the_velocity_of_the_odometry() -> None:
    localisation = with_tf()
    near(found(localisation).pose, 10.0, 6.0)
    localisation.odometry(odometry(NOW, twist=Twist(2.0, 0.0, 0.0)), NOW + 0.1)  # the same stamp again: left out
    localisation.odometry(odometry(NOW + 0.01, twist=Twist(2.0, 0.0, 0.0)), NOW + 0.1)
    near(found(localisation, NOW + 0.21).pose, 10.0, 6.4)


def test_without_fresh_odometry_there_is_no_pose() -> None:
    assert why_unknown(Localisation(LocalisationSettings())) == "no odometry has come"
    localisation = with_tf(fresh_s=0.3)
    found(localisation, NOW + 0.29)
    assert why_unknown(localisation, NOW + 0.31) == "no odometry for 0.3 s"
    late = NOW + 1.0 + LONGEST_S + 0.1
    localisation.odometry(odometry(NOW + 1.0), late)
    assert "0.6 s old by its stamps; set NTP" in why_unknown(localisation, late)


@pytest.mark.parametrize(
    ("period_s", "why"), [(0.4, "comes every 0.40 s, and --fresh allows 0.3 s"), (0.3, ""), (0.1, "")]
)
def test_odometry_that_is_slower_than_it_stays_fresh_is_said_also_right_after_a_message(
    period_s: float, why: str
) -> None:
    localisation, now_s = with_tf(), NOW
    for count in range(1, SLOW_GAPS + 1):
        assert localisation.at(NOW + (count - 1) * period_s) is not None, "a few may get lost"
        now_s = NOW + count * period_s
        localisation.odometry(odometry(now_s), now_s)
    assert (localisation.at(now_s) is None) == bool(why)
    assert why in localisation.why
    localisation.odometry(odometry(now_s + 0.1), now_s + 0.1)
    found(localisation, now_s + 0.1)


def test_odometry_of_a_clock_that_is_ahead_is_no_pose_unless_its_delay_is_given() -> None:
    localisation = with_tf()
    localisation.odometry(odometry(NOW + 3.0), NOW + 0.1)
    assert "ahead by its stamps; set NTP on both machines, or give --delay" in why_unknown(localisation, NOW + 0.1)
    told = with_tf(delay_s=0.1)
    told.odometry(odometry(NOW + 3.0, twist=Twist(1.0, 0.0, 0.0)), NOW + 0.1)
    near(found(told, NOW + 0.2).pose, 10.0, 6.2)


def test_older_odometry_changes_nothing_while_the_newest_is_fresh_and_counts_when_it_is_not() -> None:
    localisation = with_tf()
    localisation.odometry(odometry(NOW - 0.05, Pose(7.0, 0.0, 0.0)), NOW + 0.1)
    near(found(localisation, NOW + 0.1).pose, 10.0, 6.0)
    localisation = with_tf(delay_s=0.0)
    localisation.odometry(odometry(5.0, Pose(7.0, 0.0, 0.0)), NOW + 10.0)  # a robot that was restarted
    localisation.transforms(transform(NOW + 10.0), NOW + 10.0, fixed=False)
    near(found(localisation, NOW + 10.0).pose, 10.0, 12.0)


@pytest.mark.parametrize(
    ("source", "words"),
    [
        (Source.TF, "transforms of odom on tf are in the frame 'world'"),
        (Source.POSE, "poses of the localisation are in the frame 'odom'"),
    ],
)
def test_corrections_in_a_frame_that_is_not_the_maps_are_named(source: Source, words: str) -> None:
    localisation = with_odometry(source=source)
    localisation.transforms(transform(NOW, frame="world"), NOW, fixed=False)
    tell(localisation, PLACE, frame="odom")
    assert why_unknown(localisation) == f"{words}, not map; correct that, or give --map-frame"
    localisation.transforms(transform(NOW), NOW, fixed=False)
    tell(localisation, PLACE)
    found(localisation)


def test_a_transform_of_the_odometrys_frame_is_needed_also_of_old_robots_which_write_a_slash_before_frames() -> None:
    localisation = with_odometry()
    localisation.transforms(transform(NOW, child="other"), NOW, fixed=False)
    assert why_unknown(localisation).startswith("no transform map -> odom on tf; start the robot's localisation")
    localisation.transforms(transform(NOW, frame="/map", child="/odom"), NOW, fixed=False)
    found(localisation)


def test_a_moving_transform_grows_old_and_a_fixed_one_does_not() -> None:
    late = NOW + CORRECTION_S + 1.0
    for fixed in (False, True):
        localisation = Localisation(LocalisationSettings())
        localisation.transforms(transform(NOW), NOW, fixed=fixed)
        localisation.odometry(odometry(late), late)
        assert (localisation.at(late) is not None) == fixed


def test_a_pose_of_a_localisation_is_held_against_the_odometry_of_its_time() -> None:
    localisation = Localisation(LocalisationSettings(Source.POSE))
    for tick in range(11):
        at_s = NOW + 0.05 * tick
        localisation.odometry(odometry(at_s, Pose(0.05 * tick, 0.0, 0.0), AHEAD), at_s)
    tell(localisation, composed(SHIFT, Pose(0.2, 0.0, 0.0)), NOW + 0.2, NOW + 0.5)
    near(found(localisation, NOW + 0.5).pose, 10.0, 5.5)


@pytest.mark.parametrize("first", ["pose", "odometry"])
def test_the_latched_pose_of_a_robot_that_has_stood_for_long_holds(first: str) -> None:
    localisation = Localisation(LocalisationSettings(Source.POSE))
    if first == "pose":
        tell(localisation, composed(SHIFT, PLACE), NOW - 600.0)
    localisation.odometry(odometry(NOW), NOW)
    if first == "odometry":
        tell(localisation, composed(SHIFT, PLACE), NOW - 600.0)
    near(found(localisation).pose, 10.0, 6.0)


def test_poses_of_times_that_do_not_count_are_left_out() -> None:
    driving = Localisation(LocalisationSettings(Source.POSE))
    driving.odometry(odometry(NOW, twist=Twist(0.5, 0.0, 0.0)), NOW)
    tell(driving, SHIFT, NOW - 600.0)
    assert driving.at(NOW) is None, "it drives, and the pose is old"
    localisation = with_odometry(source=Source.POSE)
    tell(localisation, SHIFT, NOW + 9.0)
    assert "no pose of a localisation has come" in why_unknown(localisation), "there is no odometry of that time"


def test_a_localisation_that_has_ended_is_noticed_by_the_way_that_was_driven() -> None:
    localisation = with_odometry(source=Source.POSE)
    tell(localisation, SHIFT)
    for tick in range(1, round(CORRECTED_M / 0.1) + 2):
        at_s = NOW + 0.1 * tick
        localisation.odometry(odometry(at_s, twist=AHEAD), at_s)
        assert (localisation.at(at_s) is not None) == (tick <= round(CORRECTED_M / 0.1)), tick
    assert "no pose of a localisation for 10.1 m" in localisation.why


def test_odometry_alone_counts_from_the_start_that_is_given() -> None:
    localisation = Localisation(LocalisationSettings(Source.ODOMETRY, start=SHIFT))
    localisation.odometry(odometry(NOW, Pose(3.0, 3.0, 1.0)), NOW)
    near(found(localisation).pose, SHIFT.x, SHIFT.y, SHIFT.heading)
    unknown = Localisation(LocalisationSettings(Source.ODOMETRY))
    unknown.odometry(odometry(NOW), NOW)
    assert "give --start X,Y,HEADING" in why_unknown(unknown, NOW)


@pytest.mark.parametrize("fixed", [False, True])
def test_many_frames_on_a_shared_topic_never_keep_out_the_odometrys_own(fixed: bool) -> None:
    localisation = with_odometry()
    for number in range(1000):
        localisation.transforms(transform(NOW, child=f"robot{number}/odom"), NOW, fixed=fixed)
    localisation.transforms(transform(NOW), NOW, fixed=fixed)
    for number in range(1000):
        localisation.transforms(transform(NOW, child=f"frame{number}"), NOW, fixed=fixed)
    near(found(localisation).pose, 10.0, 6.0)
    assert len(localisation.frames) == 256


def feed(localisation: Localisation, begin_s: float, seconds: float, x: float, sender: bytes = b"") -> float:
    """Odometry at a place, with its transform, 20 times a second; when it ends."""
    for number in range(1, round(seconds * 20) + 1):
        now_s = begin_s + number / 20
        localisation.odometry(odometry(now_s, Pose(x, 0.0, 0.0)), now_s, sender)
        localisation.transforms(transform(now_s), now_s, fixed=False)
    return begin_s + seconds


def test_odometry_of_two_senders_is_believed_of_none_until_one_has_gone() -> None:
    localisation = with_tf()
    now_s = feed(localisation, NOW, 1.0, 1.0)
    found(localisation, now_s)
    localisation.odometry(odometry(now_s + 0.01, Pose(1.1, 0.0, 0.0)), now_s + 0.01, b"b")
    assert (
        why_unknown(localisation, now_s + 0.02)
        == "odometry comes from 2 senders; end all but one, or give --topic odom=TOPIC"
    )
    found(localisation, feed(localisation, now_s, SETTLED_S + 0.1, 1.0))


def test_a_jump_of_odometry_is_not_believed_and_one_bad_message_does_no_lasting_harm() -> None:
    localisation = with_tf()
    now_s = feed(localisation, NOW, 1.0, 1.0)
    localisation.odometry(odometry(now_s + 0.05, Pose(6.0, 0.0, 0.0)), now_s + 0.05)
    assert why_unknown(localisation, now_s + 0.05) == "odometry has jumped by 5.0 m"
    now_s = feed(localisation, now_s + 0.05, SETTLED_S + 0.1, 1.0)
    near(found(localisation, now_s).pose, 10.0, 6.0)


def test_two_senders_that_take_turns_are_never_believed_even_if_nobody_tells_them_apart() -> None:
    localisation = with_tf()
    now_s = NOW
    for turn in range(100):
        now_s = feed(localisation, now_s, 0.05, 6.0 if turn % 2 else 1.0)
        assert turn == 0 or localisation.at(now_s) is None, turn


def test_small_jumps_one_after_the_other_are_a_jump() -> None:
    localisation, now_s = with_tf(), NOW
    for number in range(1, 6):
        now_s = feed(localisation, now_s, 0.05, 1.0 + 0.4 * number)
    assert "odometry has jumped" in why_unknown(localisation, now_s)


@pytest.mark.parametrize(("turn_rate", "after_s", "turn"), [(1.0, 0.05, 1.6), (8.0, 0.05, 1.6), (100.0, 0.25, 3.1)])
def test_odometry_that_turns_at_once_or_half_round_has_jumped(turn_rate: float, after_s: float, turn: float) -> None:
    localisation = with_tf(turn_rate=turn_rate)
    localisation.odometry(odometry(NOW + after_s, Pose(1.0, 0.0, turn)), NOW + after_s)
    assert localisation.at(NOW + after_s) is None


@pytest.mark.parametrize(("model", "turn_rate"), [("differential", 8.0), ("car", 0.5)])
def test_how_fast_a_body_can_turn_is_its_own_without_the_margin(model: str, turn_rate: float) -> None:
    settings = DriveSettings(margin=0.25).of_body(model, Limits(2.0, 0.5, 4.0))
    assert settings.localisation.turn_rate == turn_rate


@pytest.mark.parametrize(("turn_rate", "steady"), [(8.0, True), (1.0, False)])
def test_a_robot_that_turns_as_fast_as_it_can_has_not_jumped(turn_rate: float, steady: bool) -> None:
    """The messages of 0.25 s are lost, in which it began to turn on the spot at 8 rad/s."""
    localisation = with_tf(turn_rate=turn_rate)
    localisation.odometry(odometry(NOW + 0.25, Pose(1.0, 0.0, 2.0), Twist(0.0, 0.0, 8.0)), NOW + 0.25)
    assert (localisation.at(NOW + 0.25) is not None) is steady


@pytest.mark.parametrize("speed", [2.0, 0.25])
def test_a_robot_that_drives_as_fast_as_it_may_or_as_it_says_has_not_jumped(speed: float) -> None:
    localisation, now_s = with_tf(speed=speed), NOW
    told = STILL if speed == 2.0 else Twist(2.0, 0.0, 0.0)
    for number in range(1, 200):
        now_s = NOW + number / 20
        localisation.odometry(odometry(now_s, Pose(1.0 + 0.1 * number, 0.0, 0.0), told), now_s)
        if number > 10:  # nobody is at full speed at once
            localisation.transforms(transform(now_s), now_s, fixed=False)
    found(localisation, now_s)


def test_where_odometry_counts_from_somewhere_else_a_new_correction_is_waited_for() -> None:
    settled = SETTLED_S + 0.1
    localisation = with_tf()
    now_s = feed(localisation, NOW, 1.0, 1.0)
    for number in range(round(settled * 20)):
        localisation.odometry(odometry(now_s + number / 20, Pose(9.0, 0.0, 0.0)), now_s + number / 20)
    now_s += settled
    begins = "odometry counts from somewhere else, and nothing has said where"
    assert why_unknown(localisation, now_s).startswith(begins)
    localisation.transforms(transform(now_s), now_s, fixed=False)
    near(found(localisation, now_s).pose, 10.0, 14.0)


@pytest.mark.parametrize("silent_s", [0.05, 60.0])
def test_odometry_alone_is_lost_for_good_once_it_counts_from_somewhere_else(silent_s: float) -> None:
    localisation = Localisation(LocalisationSettings(Source.ODOMETRY, start=SHIFT))
    now_s = feed(localisation, NOW, 1.0, 5.0)
    found(localisation, now_s)
    now_s = feed(localisation, now_s + silent_s, 10.0, 0.0)
    assert why_unknown(localisation, now_s).endswith("start this agent anew where the robot stands then")


def test_a_robot_that_was_silent_and_stood_is_where_it_was() -> None:
    localisation = Localisation(LocalisationSettings(Source.ODOMETRY, start=SHIFT))
    now_s = feed(localisation, NOW, 1.0, 5.0)
    near(found(localisation, feed(localisation, now_s + 60.0, 0.1, 5.1)).pose, 10.0, 5.1)


def test_where_the_delay_is_given_stamps_mean_nothing() -> None:
    localisation = with_tf(delay_s=0.1)
    looks = [NOW + 1.0 + number / 100 for number in range(200)]
    for number in range(100):
        now_s = NOW + 1.0 + number / 50
        localisation.odometry(odometry(0.0), now_s)
        localisation.transforms(transform(now_s), now_s, fixed=False)
        assert all(localisation.at(look) is not None for look in looks if now_s <= look < now_s + 0.02), number


@pytest.mark.parametrize(("clock_s", "stamps_s"), [(-3600.0, -3600.0), (-3600.0, -3600.3), (-0.5, -0.5)])
def test_a_clock_that_is_set_back_is_followed_at_once(clock_s: float, stamps_s: float) -> None:
    localisation = with_tf()
    now_s = feed(localisation, NOW, 1.0, 1.0)
    localisation.odometry(odometry(now_s + 0.05 + stamps_s, Pose(1.0, 0.0, 0.0)), now_s + 0.05 + clock_s)
    localisation.transforms(transform(0.0), now_s + 0.05 + clock_s, fixed=False)
    near(found(localisation, now_s + 0.05 + clock_s).pose, 10.0, 6.0)


def test_poses_and_transforms_of_a_robot_with_a_map_of_its_own_are_put_on_ours() -> None:
    """Its map lies at (10, 5) on ours, turned to the left; there it is at (1, 0)."""
    near(found(with_tf(Pose(0.0, 0.0, 0.0), transform=SHIFT)).pose, 10.0, 6.0)
    posed = with_odometry(source=Source.POSE, transform=SHIFT)
    tell(posed, Pose(2.0, 1.0, 0.5))
    near(found(posed).pose, 9.0, 7.0, math.pi / 2 + 0.5)


@pytest.mark.parametrize("speed", [0.25, 1.0])
@pytest.mark.parametrize("more_m", [-0.01, 0.01])
def test_a_jump_is_longer_than_half_a_metre_and_the_way_of_its_time(speed: float, more_m: float) -> None:
    """A twentieth of a second has passed, and messages may have waited for as long as they stay fresh."""
    settings = LocalisationSettings(speed=speed)
    localisation = with_tf(speed=speed)
    way_m = 0.5 + speed * (0.05 + settings.fresh_s) + more_m
    localisation.odometry(odometry(NOW + 0.05, Pose(1.0 + way_m, 0.0, 0.0)), NOW + 0.05)
    assert (localisation.at(NOW + 0.05) is not None) is (more_m < 0.0)
