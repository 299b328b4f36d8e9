"""Links of many frames as columns of numbers, since the links of a tick grow with the square of the fleet.

Both kinds read like tuples of rows and equal them; fast code reads the columns.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from typing import Any, Generic, NamedTuple, TypeVar, cast, overload

import numpy as np
from numpy.typing import NDArray

Row = TypeVar("Row", bound=tuple[Any, ...])
Column = NDArray[np.int64]

MAX_SHORT = 2**32 - 1
"""The largest sequence that a robot's frame can have."""


class _Rows(Sequence[Row], Generic[Row]):
    """Rows of equal kind, held as columns."""

    __slots__ = ("_sequence", "destination", "source")

    def __init__(self, source: Column, destination: Column, sequence: Column | None) -> None:
        """Take the columns, int64 (n,), which must not change any more.

        The sequence is that of `patrol.journal.records.frame_sequence`; None where `_compute_sequences` lays it out.
        """
        self.source = source
        self.destination = destination
        self._sequence = sequence

    @property
    def sequence(self) -> Column:
        """The frames' sequences, int64 (n,)."""
        if self._sequence is None:
            self._sequence = self._compute_sequences()
        return self._sequence

    def __len__(self) -> int:
        return self.source.size

    @overload
    def __getitem__(self, index: int) -> Row: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Row, ...]: ...

    def __getitem__(self, index: int | slice) -> Row | tuple[Row, ...]:
        if isinstance(index, slice):
            return tuple(self._iterate_rows(index))
        # `or None`: the slice after index -1 would end at 0 and be empty.
        return next(iter(self._iterate_rows(slice(index, index + 1 or None))))

    def __iter__(self) -> Iterator[Row]:
        return self._iterate_rows(slice(None))

    def __eq__(self, other: object) -> bool:
        if other is self:
            return True
        if isinstance(other, _Rows) and (isinstance(other, type(self)) or isinstance(self, type(other))):
            return len(self) == len(other) and self._has_equal_rows(other)
        if isinstance(other, Sequence) and not isinstance(other, str | bytes):
            return len(self) == len(other) and all(mine == row for mine, row in zip(self, other, strict=True))
        return NotImplemented

    def __hash__(self) -> int:
        return hash(tuple(self))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({tuple(self)!r})"

    def _iterate_rows(self, part: slice) -> Iterator[Row]:
        columns = (self.source[part].tolist(), self.destination[part].tolist(), self.sequence[part].tolist())
        return cast("Iterator[Row]", zip(*columns, strict=True))

    def _compute_sequences(self) -> Column:
        """Return the sequences, where they were not given.

        For example, frames 0 and 1 with the sequences 7 and 9 and links of the frames 0, 0 and 1 give 7, 7 and 9.
        """
        raise NotImplementedError

    def _has_equal_rows(self, other: Any) -> bool:
        """Return True if the rows of another object of this kind, of equal number, are the same."""
        return (
            _columns_equal(self.sequence, other.sequence)
            and _columns_equal(self.source, other.source)
            and _columns_equal(self.destination, other.destination)
        )


def _columns_equal(mine: Column, theirs: Column) -> bool:
    return mine is theirs or bool((mine == theirs).all())


class Links(_Rows[tuple[int, int, int]]):
    """Rows of (source, destination, sequence), held as columns of the same names, int64 (n,).

    For example, ``links_of([(1, 2, 7), (1, 3, 7)])`` has the column `destination` (2, 3) and the first
    row (1, 2, 7).
    """

    __slots__ = ()


class Pairs(NamedTuple):
    """Some frames on their way, each with each of its receivers, by frame and receiver; read-only."""

    frame: Column  # each link's place among the frames
    source: Column
    destination: Column
    robots: Column  # both: destination << 16 | source
    rises: bool  # whether the links are in the order of source and destination, and none is there twice


def pairs_of(frame: Column, source: Column, destination: Column) -> Pairs:
    """Make `Pairs` of its first three columns, which must not change any more."""
    # Robots' numbers have 16 bits, so two fit side by side and compare like pairs.
    order = source << 16 | destination
    pairs = Pairs(frame, source, destination, destination << 16 | source, bool((order[1:] > order[:-1]).all()))
    for column in pairs[:4]:
        column.flags.writeable = False
    return pairs


class WholeLinks(Links):
    """The links of frames of which none is missing from its pairs.

    The pairs are those of many ticks. So a tick has one sequence for each frame, in `of_frames`, and one for each link
    only where that column is read.
    """

    __slots__ = ("of_frames", "pairs")

    def __init__(self, pairs: Pairs, of_frames: Column) -> None:
        super().__init__(pairs.source, pairs.destination, None)
        self.pairs = pairs
        self.of_frames = of_frames

    def _compute_sequences(self) -> Column:
        return self.of_frames[self.pairs.frame]

    def _has_equal_rows(self, other: Any) -> bool:
        if isinstance(other, WholeLinks) and np.array_equal(self.of_frames, other.of_frames):
            return self.pairs is other.pairs or all(map(_columns_equal, self.pairs[:3], other.pairs[:3]))
        return super()._has_equal_rows(other)


class Drops(_Rows[tuple[int, int, int, str]]):
    """Rows of (source, destination, sequence, cause), held as columns, int64 (n,).

    The column `cause` holds indices into `causes`, which has each cause once.
    """

    __slots__ = ("cause", "causes")

    def __init__(
        self, source: Column, destination: Column, sequence: Column, cause: Column, causes: tuple[str, ...]
    ) -> None:
        super().__init__(source, destination, sequence)
        self.cause = cause
        self.causes = causes

    def _iterate_rows(self, part: slice) -> Iterator[tuple[int, int, int, str]]:
        columns = (self.source[part].tolist(), self.destination[part].tolist(), self.sequence[part].tolist())
        names = self.causes
        return zip(*columns, (names[cause] for cause in self.cause[part].tolist()), strict=True)

    def _has_equal_rows(self, other: Any) -> bool:
        if not super()._has_equal_rows(other):
            return False
        if self.causes == other.causes:
            return _columns_equal(self.cause, other.cause)
        return [self.causes[cause] for cause in self.cause] == [other.causes[cause] for cause in other.cause]


class ToOthers(NamedTuple):
    """Some frames on their way to all receivers but their own senders; read-only."""

    pairs: Pairs
    reaches: NDArray[np.bool_]  # (receivers, frames), whether there is a link from a frame to a receiver


@lru_cache(maxsize=2)
def to_others(sources: tuple[int, ...], receivers: tuple[int, ...]) -> ToOthers:
    """Find the links of some frames, once for as long as the same robots send and hear.

    The sources are in the order of the frames, the receivers ascending. For example, frames of 1 and 2 to the receivers
    1, 2 and 3 have the links 1-2, 1-3, 2-1 and 2-3.
    """
    of, to = np.array(sources, dtype=np.int64), np.array(receivers, dtype=np.int64)
    is_other = of[:, None] != to[None, :]
    frame, receiver = np.nonzero(is_other)
    reaches = np.ascontiguousarray(is_other.T)
    reaches.flags.writeable = False
    return ToOthers(pairs_of(frame, of[frame], to[receiver]), reaches)


def places_of(links: Links | Drops) -> NDArray[np.uint64] | None:
    """Return one number for each link, uint64 (n,), that sorts links by source, destination and sequence.

    For example, the link (1, 2, 7) has the number 0x1_0002_0000_0007. The robots' numbers must be below
    2^16. None where a sequence takes more than 32 bits, which only forged frames can have.
    """
    if (links.sequence > MAX_SHORT).any():
        return None
    # In place after the first step: a large fleet has millions of links.
    places = links.source << 16
    places |= links.destination
    places <<= 32
    places |= links.sequence
    return places.view(np.uint64)


def joined(first: Links, second: Links | Drops) -> Links:
    """Join the links of both, one after the other."""
    if not len(second):
        return first
    pairs = ((first.source, second.source), (first.destination, second.destination), (first.sequence, second.sequence))
    return Links(*(np.concatenate(pair) for pair in pairs))


def links_of(rows: Iterable[tuple[int, int, int]]) -> Links:
    """Make columns of rows of (source, destination, sequence); rows that are columns already stay as they are."""
    if isinstance(rows, Links):
        return rows
    columns = _as_columns(tuple(rows), 3)
    return Links(columns[0], columns[1], columns[2])


def drops_of(rows: Iterable[tuple[int, int, int, str]]) -> Drops:
    """Make columns of rows of (source, destination, sequence, cause), likewise.

    For example, causes "loss:f1", "range:f2" and "loss:f1" give the column `cause` (0, 1, 0).
    """
    if isinstance(rows, Drops):
        return rows
    links_and_causes = tuple(rows)
    causes = tuple(dict.fromkeys(cause for *_, cause in links_and_causes))
    number = {cause: index for index, cause in enumerate(causes)}
    columns = _as_columns(tuple((*link, number[cause]) for *link, cause in links_and_causes), 4)
    return Drops(columns[0], columns[1], columns[2], columns[3], causes)


def _as_columns(rows: Sequence[Sequence[int]], wide: int) -> NDArray[np.int64]:
    return np.ascontiguousarray(np.array(rows, dtype=np.int64).reshape(-1, wide).T)


NO_DROPS = drops_of(())
