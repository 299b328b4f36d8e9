import tracemalloc
import zlib
from array import array
from collections.abc import Iterator
from dataclasses import fields
from typing import Any

import msgpack
import numpy as np
import pytest

from patrol.errors import Malformed
from patrol.wire import read_sparingly
from runtime.messages import feed
from tests.fleets import answer_so_far

MB = 1 << 20


def test_thinned_values_may_grow() -> None:
    values = array("f", [1.0, 2.0, 3.0])
    found = feed.thinned(values, 2)
    values.append(4.0)
    assert found.tolist() == [1.0, 3.0]


@pytest.fixture
def answer() -> dict[str, Any]:
    """The fields of an answer on a terrain of 4 x 5 points."""
    says: dict[str, Any] = msgpack.unpackb(answer_so_far())
    assert feed.read_so_far(msgpack.packb(says)).asked == (b"asked",)
    return says


@pytest.fixture
def frugal() -> Iterator[None]:
    """Nothing makes many objects of a few bytes."""
    tracemalloc.start()
    yield
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 150 * MB


@pytest.mark.parametrize(
    "says",
    [
        *([number, [], True, None] for number in (1 << 62, -1)),
        *([0, [[]], True, None], [0, [b""] * (feed.MAX_RECORDS + 1), True, None]),
        *([0, [], True, pace] for pace in (float("inf"), float("nan"), 0.0)),
        *([0, [], 1, None], [0, [], True], [0, [], True, None, None]),
    ],
)
def test_what_is_no_batch_is_garbled(says: list[object]) -> None:
    assert read_sparingly(feed.Batch, feed.batch_bytes(feed.Batch(0, (b"a",), running=True, pace=2.0))).records == (
        b"a",
    )
    with pytest.raises(Malformed):
        read_sparingly(feed.Batch, msgpack.packb(says))


@pytest.mark.usefixtures("frugal")
@pytest.mark.parametrize(
    ("field", "value"),
    [
        *(("every", every) for every in (1 << 62, 0, 1 << 25)),
        *(("number", number) for number in (-1, 1, 2)),
        *(("shape", shape) for shape in ([1 << 20, 1 << 20], [4, 9], [-4, -5], [5], [4.0, 5.0])),
        *(("areas", areas) for areas in ([], [1])),
        *(("area_of", [[1, 1]]), ("area_of", [[1]]), ("area_of", {})),
        *(("passable", grid) for grid in (7, zlib.compress(b"\xff"))),
        ("seen", zlib.compress(b"")),
        ("seen", zlib.compress(np.full(20, 2**31 - 1, dtype="<i4").tobytes())),
        ("seen", zlib.compress(np.full(20, -2, dtype="<i4").tobytes())),
        *(("seen", zlib.compress(np.array([2] * 19 + [tick], dtype="<i4").tobytes())) for tick in (-2, 3)),
        ("mfow", bytes(4)),
        ("mfow", np.full(3, np.nan, dtype="<f4").tobytes()),
        *((field, np.array([0, 1, np.nan], dtype="<f4").tobytes()) for field in ("mfow", "fog_mean")),
        ("mfow", bytes(1 << 20)),
        ("events", [b""] * (feed.MAX_EVENTS + 1)),
        ("events", [[]]),
        ("last", 7),
        ("pace", float("inf")),
        ("running", None),
        ("news", [1]),
    ],
)
def test_an_answer_that_cannot_be_is_garbled(field: str, value: object, answer: dict[str, Any]) -> None:
    with pytest.raises(Malformed):
        feed.read_so_far(msgpack.packb({**answer, field: value}))


@pytest.mark.parametrize("tick", [-1, 0, 2])
def test_points_seen_up_to_the_last_tick_or_never(tick: int, answer: dict[str, Any]) -> None:
    ages = [2] * 19 + [tick]
    packed = zlib.compress(np.array(ages, dtype="<i4").tobytes())
    assert feed.read_so_far(msgpack.packb({**answer, "number": 3, "seen": packed})).last_seen.ravel().tolist() == ages


@pytest.mark.usefixtures("frugal")
def test_grids_that_are_small_only_while_packed_are_refused(answer: dict[str, Any]) -> None:
    side = 5000
    bits = zlib.compress(np.full(side * side // 8, 255, dtype=np.uint8).tobytes())
    seen = zlib.compress(np.zeros(side * side, dtype=np.int32).tobytes())
    large = {**answer, "shape": [side, side], "passable": bits, "keep_out": bits, "seen": seen}
    payload = msgpack.packb({**large, "areas": 20 * [bits]})
    assert len(payload) < MB
    tracemalloc.reset_peak()
    with pytest.raises(Malformed, match="too much memory"):
        feed.read_so_far(payload)


def test_an_answer_must_fit_what_is_known(answer: dict[str, Any]) -> None:
    payload = msgpack.packb(answer)
    first = feed.read_so_far(payload, fits=lambda header, height, width: (header, height, width) == (b"header", 4, 5))
    again = feed.read_so_far(payload, first)
    assert again.ground is first.ground
    with pytest.raises(Malformed, match="another run"):
        feed.read_so_far(msgpack.packb({**answer, "header": b"other"}), first)
    with pytest.raises(Malformed, match="another size"):
        feed.read_so_far(payload, fits=lambda *_: False)


def test_a_run_so_far_comes_back_as_it_was() -> None:
    """Grids whose sides differ, areas that overlap in part, and other numbers for each field."""
    passable, keep_out = np.ones((3, 5), dtype=np.bool_), np.zeros((3, 5), dtype=np.bool_)
    passable[0, 4], keep_out[2, 1] = False, True
    one, two = np.zeros((3, 5), dtype=np.bool_), np.zeros((3, 5), dtype=np.bool_)
    one[:2, :3] = two[1:, 2:4] = True
    last_seen = np.full((3, 5), -1, dtype=np.int32)
    last_seen[one | two] = [4, -1, 0, 5, 3, 2, 1, 5, 4]
    so_far = feed.SoFar(
        number=11,
        header=b"header",
        last=b"last",
        last_seen=last_seen,
        events=(b"e1", b"e2"),
        event=7,
        asked=(b"asked",),
        every=2,
        mfow=np.array([1.0, 2.5, 3.0], dtype=np.float32),
        fog_mean=np.array([0.5, 1.5, 2.0], dtype=np.float32),
        running=False,
        pace=2.5,
        charge={1: 0.25, 9: 1.0},
        ground=feed.Ground(passable, keep_out, (one, two), {1: 0, 9: 1}),
    )
    again = feed.read_so_far(feed.so_far_bytes(so_far))
    for field in fields(feed.SoFar):
        before, after = getattr(so_far, field.name), getattr(again, field.name)
        if isinstance(before, np.ndarray):
            assert np.array_equal(after, before), field.name
            assert after.dtype == before.dtype
        elif field.name != "ground":
            assert after == before, field.name
    grids = (again.ground.passable, again.ground.keep_out, *again.ground.areas)
    assert all(np.array_equal(*pair) for pair in zip(grids, (passable, keep_out, one, two), strict=True))
    assert again.ground.area_of == {1: 0, 9: 1}
    assert np.array_equal(again.ground.patrolled, one | two)


@pytest.mark.parametrize(("every", "values"), [(1, [0.0, 1.0, 2.0]), (2, [0.0, 2.0]), (3, [0.0])])
def test_every_n_th_value_is_kept_from_the_first_on(every: int, values: list[float]) -> None:
    assert feed.thinned(array("f", [0.0, 1.0, 2.0]), every).tolist() == values


@pytest.mark.parametrize(
    ("robots", "size"),
    [(0, 131_072), (1, 131_072 + 2048 + 64), (10, 131_072 + 20_480 + 6400), (10_000, feed.MAX_BATCH)],
)
def test_the_longest_record_grows_with_the_square_of_the_fleet(robots: int, size: int) -> None:
    assert feed.longest_record(robots) == size
