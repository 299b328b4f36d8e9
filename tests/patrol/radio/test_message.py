import math
from dataclasses import astuple, fields, replace
from hashlib import blake2b

import msgpack
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from patrol.pose import Pose
from patrol.radio.message import MAX_FRAME, MAX_TRAIL, VERSION, Position, Rejected, RejectReason, decode, encode

KEY = b"0123456789abcdef"

deltas = st.integers(-(2**15), 2**15 - 1)
positions = st.builds(
    Position,
    robot=st.integers(0, 2**16 - 1),
    sequence=st.integers(0, 2**32 - 1),
    time_ms=st.integers(0, 2**32 - 1),
    x_cm=st.integers(-(2**31), 2**31 - 1),
    y_cm=st.integers(-(2**31), 2**31 - 1),
    heading_mrad=st.integers(0, 6283),
    trail=st.lists(st.tuples(deltas, deltas), max_size=MAX_TRAIL).map(tuple),
)
keys = st.none() | st.binary(min_size=1, max_size=64)
coordinates = st.floats(-2e7, 2e7)
poses = st.builds(Pose, coordinates, coordinates, st.floats(-100.0, 100.0))

HERE = Position(3, 120, 60_000, 1234, -567, 3141, ((-220, 0), (-219, 12)))
LONGEST = Position(65535, 2**32 - 1, 2**32 - 1, -(2**31), -(2**31), 6283, ((-(2**15), -(2**15)),) * MAX_TRAIL)


BODY = (1, 2, 3, 4, 5, 6)
"""What comes after the version, without a trail."""


def rejected(frame: bytes, key: bytes | None = None) -> RejectReason:
    with pytest.raises(Rejected) as caught:
        decode(frame, key)
    return caught.value.reason


def packed(*values: object) -> bytes:
    return bytes(msgpack.packb(list(values)))


@given(positions, keys)
def test_what_is_encoded_is_decoded(position: Position, key: bytes | None) -> None:
    assert decode(encode(position, key), key) == position


@given(positions)
@example(LONGEST)
def test_a_frame_fits_at_any_legal_value(position: Position) -> None:
    assert len(encode(replace(position, trail=()))) <= 28
    assert len(encode(position, KEY)) <= MAX_FRAME


def test_the_longest_frames_are_as_long_as_documented() -> None:
    assert len(encode(replace(LONGEST, trail=()))) == 28
    assert len(encode(LONGEST, KEY)) == 63


def test_the_bytes_of_a_frame_are_fixed() -> None:
    """Other implementations read these bytes: they change only together with VERSION."""
    assert encode(Position(3, 120, 60_000, 1234, -567, 3141)).hex() == "97010378cdea60cd04d2d1fdc9cd0c45"
    assert encode(HERE).hex() == "98010378cdea60cd04d2d1fdc9cd0c4594d1ff2400d1ff250c"
    body = bytes.fromhex("99010378cdea60cd04d2d1fdc9cd0c4594d1ff2400d1ff250c")
    assert encode(HERE, KEY) == body + b"\xc4\x08" + blake2b(body, key=KEY, digest_size=8).digest()


@given(poses)
def test_rounding_moves_a_pose_by_at_most_half_a_unit(pose: Pose) -> None:
    sent = Position.of(1, 0, 0.0, pose).pose
    assert abs(sent.x - pose.x) <= 0.005 + 1e-8
    assert abs(sent.y - pose.y) <= 0.005 + 1e-8
    assert abs(math.remainder(sent.heading - pose.heading, math.tau)) <= 0.0005 + 1e-12
    assert -math.pi < sent.heading <= math.pi


@given(poses, st.floats(0.0, 4e6))
def test_a_rounded_pose_is_sent_unchanged(pose: Pose, time_s: float) -> None:
    once = Position.of(1, 5, time_s, pose)
    assert Position.of(1, 5, once.time_ms / 1000.0, once.pose) == once


def test_a_clock_that_no_longer_fits_stays_at_the_largest_time() -> None:
    days_50 = 50 * 86_400.0  # 2**32 ms are 49.71 days
    for position in (Position.of(1, 9, days_50, Pose(1.0, 2.0, 0.0)), Position.of_contact(9, days_50, 1.0, 2.0)):
        assert decode(encode(position)).time_ms == 2**32 - 1
    assert Position.of(1, 9, 4294967.2, Pose(1.0, 2.0, 0.0)).time_ms == 4_294_967_200


@pytest.mark.parametrize(
    ("heading", "mrad"),
    [
        *((0.0, 0), (-1e-20, 0), (0.0006, 1), (-0.0001, 6283), (-0.00005, 0), (math.tau, 0)),
        *((math.pi, 3142), (-math.pi, 3142), (-math.pi / 2, 4712)),
    ],
)
def test_headings_are_rounded_round_the_circle(heading: float, mrad: int) -> None:
    assert Position.of(1, 0, 0.0, Pose(0.0, 0.0, heading)).heading_mrad == mrad


def test_the_trail_leads_back_from_the_position() -> None:
    position = Position.of(1, 9, 4.5, Pose(10.0, 5.0, 0.0), ((-220, 0), (-200, -100)))
    assert position.past == ((7.8, 5.0), (5.8, 4.0))


@pytest.mark.parametrize("field", [field.name for field in fields(Position) if field.name != "trail"])
@pytest.mark.parametrize("value", [-(2**31) - 1, 2**32, 1.0, True, None, "1"])
def test_a_position_holds_integers_in_range_only(field: str, value: object) -> None:
    with pytest.raises(ValueError, match=field):
        replace(HERE, **{field: value})  # type: ignore[arg-type]


@pytest.mark.parametrize("trail", [((0, 0),) * (MAX_TRAIL + 1), ((2**15, 0),), ((0.0, 0),), ((0,),), ((0, 0, 0),)])
def test_a_trail_holds_a_few_small_pairs_only(trail: tuple[tuple[int, int], ...]) -> None:
    with pytest.raises(ValueError):  # noqa: PT011 - Python's own words for a tuple of another length
        replace(HERE, trail=trail)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e300, -1e300])
def test_a_pose_or_time_that_does_not_fit_is_refused(value: float) -> None:
    for pose in (Pose(value, 0.0, 0.0), Pose(0.0, value, 0.0)):
        with pytest.raises(ValueError, match=r"outside|finite"):
            Position.of(1, 0, 0.0, pose)
    if value != 1e300:  # see above for a time that is too long
        with pytest.raises(ValueError, match=r"outside|finite"):
            Position.of(1, 0, value, Pose(0.0, 0.0, 0.0))


@pytest.mark.parametrize("key", [b"", b"x" * 65])
def test_a_key_is_neither_empty_nor_too_long(key: bytes) -> None:
    with pytest.raises(ValueError, match="key"):
        encode(HERE, key)
    with pytest.raises(ValueError, match="key"):
        decode(encode(HERE), key)


@given(st.binary(max_size=80), keys)
@example(b"", None)
@example(b"\xdd\xff\xff\xff\xff", None)
@example(b"\x91" * 64, None)
@example(b"\xc7\x00\xff", None)
@example(b"\xd4\x05\x00", None)
@example(b"\xd7\xff" + b"\xff" * 8, None)
@example(b"\xa1\xff", None)
def test_any_bytes_are_a_position_or_rejected(frame: bytes, key: bytes | None) -> None:
    try:
        position = decode(frame, key)
    except Rejected:
        return
    assert all(type(value) is int for value in astuple(replace(position, trail=()))[:-1])


@given(positions, st.data())
def test_no_byte_of_a_tagged_frame_can_be_changed(position: Position, data: st.DataObject) -> None:
    frame = bytearray(encode(position, KEY))
    place = data.draw(st.integers(0, len(frame) - 1))
    frame[place] ^= data.draw(st.integers(1, 255))
    assert rejected(bytes(frame), KEY) in (RejectReason.MALFORMED, RejectReason.VERSION, RejectReason.TAG)


@given(positions, st.binary(min_size=1, max_size=64).filter(lambda key: key != KEY))
def test_a_tag_of_another_key_is_refused(position: Position, other: bytes) -> None:
    assert rejected(encode(position, other), KEY) is RejectReason.TAG


@given(positions, st.binary(min_size=1, max_size=4))
def test_nothing_may_follow_a_frame(position: Position, more: bytes) -> None:
    assert rejected(encode(position) + more) is RejectReason.MALFORMED
    assert rejected(encode(position, KEY) + more, KEY) is RejectReason.MALFORMED


@given(positions, st.data())
def test_no_part_of_a_frame_is_a_frame(position: Position, data: st.DataObject) -> None:
    frame = encode(position)
    assert rejected(frame[: data.draw(st.integers(0, len(frame) - 1))]) is RejectReason.MALFORMED


def test_with_a_key_a_frame_without_a_tag_is_refused_and_without_one_a_tag_is_skipped() -> None:
    assert rejected(encode(HERE), KEY) is RejectReason.TAG
    assert decode(encode(HERE, KEY)) == HERE


def test_a_tag_covers_whether_there_is_a_trail_and_has_no_long_form() -> None:
    tagged, bare = encode(HERE, KEY), encode(replace(HERE, trail=()), KEY)
    assert rejected(tagged[:-10] + bare[-10:], KEY) is RejectReason.TAG
    body = encode(HERE, KEY)[:-10]
    assert rejected(body + b"\xc5\x00\x08" + b"12345678", KEY) is RejectReason.MALFORMED


@pytest.mark.parametrize("version", [0, 2, -1, 2**40])
def test_another_version_is_told_apart_from_rubbish(version: int) -> None:
    assert rejected(packed(version, 1, 2, 3, 4, 5, 6)) is RejectReason.VERSION
    assert rejected(packed(version, "whatever", {})) is RejectReason.VERSION


@pytest.mark.parametrize(
    "values",
    [
        *((), (VERSION,), (1.0, *BODY), (True, *BODY), ([VERSION], *BODY)),
        *((VERSION, 1, 2, 3, 4, 5, *last) for last in ((), (6.0,), (-1,), (6284,), (b"12345678",))),
        *((VERSION, True, 2, 3, 4, 5, 6), (VERSION, 65536, 2, 3, 4, 5, 6)),
        *((VERSION, 1, 2**32, 3, 4, 5, 6), (VERSION, 1, 2, 3, 2**31, 5, 6)),
        *((VERSION, *BODY, last) for last in (7, None, b"1234567", "12345678")),
        (VERSION, *BODY, {}),
        *((VERSION, *BODY, trail) for trail in ([], [1], [1, 2, 3], [1.0, 2], [[1, 2]], [0] * 2 * (MAX_TRAIL + 1))),
        *((VERSION, *BODY, b"12345678", [1, 2]), (VERSION, *BODY, [1, 2], [1, 2])),
        (VERSION, *BODY, [1, 2], b"12345678", b"12345678"),
    ],
)
def test_another_shape_is_malformed(values: tuple[object, ...]) -> None:
    assert rejected(packed(*values)) is RejectReason.MALFORMED


def test_too_long_a_frame_is_not_looked_at() -> None:
    wide = b"".join(b"\xcf" + value.to_bytes(8, "big") for value in (VERSION, 1, 2, 3, 4, 5, 6))
    assert decode(b"\x97" + wide) == Position(1, 2, 3, 4, 5, 6), "64 bytes, spelt wider than need be"
    assert rejected(b"\x98" + wide + b"\x92\x00\x00") is RejectReason.MALFORMED
    assert rejected(packed(VERSION, 1, 2, 3, 4, 5, 6, [0] * 70)) is RejectReason.MALFORMED
    assert rejected(b"\x91" * 10_000_000) is RejectReason.MALFORMED
