"""Kernels of the inboxes: which positions and contacts listeners accept, and which looks they learn of.

A table has a row for each listener and a column for each sender. All that a listener knows of a sender is a cell of it.
The frames of a tick are judged in their order, for all listeners that they reach.
"""

from __future__ import annotations

import math

import numpy as np
from numba import from_dtype, njit, types

CELL = np.dtype(
    [
        ("sequence", np.int64),  # of its newest accepted frame, NOTHING for none
        ("at", np.int64),  # the tick at which that was heard
        ("start", np.float64),  # when its sequence 0 would have come, had it taken as long as its quickest frame, s
        ("used", np.uint64),  # bit i: the frame i sequences before the newest was accepted
        ("looks", np.uint64),  # bit i: what it saw i sequences before the newest is known, by frame or trail
        ("x", np.int32),  # of the newest, cm
        ("y", np.int32),  # cm
        ("heading", np.int16),  # mrad
        ("back_x", np.int16),  # from there to the first place of its trail, cm; 0 without one
        ("back_y", np.int16),  # cm
        ("doubts", np.int16),  # how many frames in a row follow one another, but not the newest accepted
        ("doubt_sequence", np.int64),  # of the last of them
        ("doubt_at", np.int64),  # the tick at which that was heard
        ("doubt_x", np.int32),  # cm
        ("doubt_y", np.int32),  # cm
        ("moved_x", np.float32),  # in a tick, between the two newest, cm; 0 for a jump, or where there is but one
        ("moved_y", np.float32),  # cm
    ],
    align=True,
)
"""A listener's knowledge of a sender."""

FRAME = np.dtype(
    [
        ("kind", np.int64),  # POSITION, REPORT, or why no listener accepts it
        ("sender", np.int64),  # its column; NO_SENDER for contacts and what cannot be decoded
        ("sequence", np.int64),
        ("x", np.int32),  # cm
        ("y", np.int32),  # cm
        ("heading", np.int16),  # mrad
        ("back_x", np.int16),  # as in a cell
        ("back_y", np.int16),
        ("trail", np.int16),  # how many places its trail has
    ],
    align=True,
)
"""The content of a frame."""

NOTHING = -1
"""The sequence of a sender that was not heard."""

NO_SENDER = -1
NO_ROBOT = -2
"""The column of a listener that is not a robot."""

POSITION, REPORT = 0, 1
"""Kinds of frames that may be accepted; the others are reasons."""

ACCEPTED, OWN, UNKNOWN, OLD, AHEAD, TOO_FAST = 1, 2, 3, 4, 5, 6
"""Judgements of a frame, where 0 is that it was not heard: all from `OWN` on are reasons for refusing it."""

THEN = 128
"""Mark of a frame's looks: they are not of the tick in which it came."""

ROUNDING = 0.02
"""Rounding to centimetres moves each of two positions by up to 0.5 cm along each axis, m."""

_STEADY = 3
"""Frames in a row that agree with each other before a jump is believed: localisation jumps honestly, once."""

_FAR_AHEAD = 64
"""Without the fleet's ticks, compare a sender's frame with its earlier ones: how much further than its clock can have
run a sequence may be, in steps. Covers stalls of the network."""

_SLACK = 4.0
"""Steps by which a contact's sequence may differ from that of a frame that some robot would send now."""

_CELL, _FRAME = from_dtype(CELL), from_dtype(FRAME)
_CELLS = types.Array(_CELL, 2, "C")
_ROW = types.Array(_CELL, 1, "C")
_FRAMES = types.Array(_FRAME, 1, "C")
_COUNTS = types.Array(types.int64, 2, "C")
_ROWS = types.Array(types.int64, 1, "C")
_REACHES = types.Array(types.uint8, 2, "C", readonly=True)
_FLAGS = types.Array(types.uint8, 2, "C")
_TICKS = types.Array(types.int32, 2, "C")
_PLACES = types.Array(types.float64, 2, "C")
_B = types.boolean
_F = types.float64
_I = types.int64

_ONE = np.uint64(1)
_NONE = np.uint64(0)


@njit(_B(_F, _F, _F, _F, _F), cache=True, nogil=True, error_model="numpy")
def _is_beyond(x, y, from_x, from_y, reach):
    """Return True if a place (cm) is farther from another than m."""
    across, up = x - from_x, y - from_y
    return math.sqrt(across * across + up * up) / 100.0 > reach


@njit(_I(_FRAME, _I, _I, _I, _I, _F, _I, _F, _F, _B, _I), cache=True, nogil=True, error_model="numpy")
def _why_implausible(frame, sequence, at, x, y, start, tick, step, speed, knows_ticks, span):
    """Return why a frame cannot follow an earlier one of its sender (sequence, tick, cm), or 0.

    For example, at 1 m/s and 0.5 s per tick, a frame that comes 4 ticks and 4 sequences after the earlier one may lie
    2.52 m from it: 2 s and one tick of driving, and 2 cm for rounding.

    The time that the sender had is the time between the arrivals and, where the earlier frame was delayed, what the
    sequences say on top: its delay, beyond the least of its sender's frames so far, shows in its sequence.
    """
    before = at * step
    elapsed = tick * step - before
    steps = frame.sequence - sequence
    # A clock may run twice as fast as this one before its frames count as too far ahead.
    if not knows_ticks and steps > 2.0 * elapsed / step + _FAR_AHEAD:
        return AHEAD
    # Bounded, or a frame with a very low sequence would excuse a jump of any length.
    delay = min(max(before - sequence * step - start, 0.0), span * step)
    held_up = min(max(steps * step - elapsed, 0.0), delay)
    far = _is_beyond(frame.x, frame.y, x, y, speed * (elapsed + held_up + step) + ROUNDING)
    return TOO_FAST if far else 0


@njit(_I(_CELL, _FRAME, _I, _F, _F, _B, _I), cache=True, nogil=True, error_model="numpy")
def _judge_position(cell, frame, tick, step, speed, knows_ticks, span):
    """Accept or refuse a frame of another robot; a newer one replaces the known state of it, a late one does not."""
    number = frame.sequence
    ago = cell.sequence - number
    begins = cell.sequence == NOTHING
    if not begins:
        outdated = ago >= span
        if 0 <= ago < span:
            # Each sequence counts once: the same frame again is a replay or an echo.
            if cell.used >> np.uint64(ago) & _ONE:
                return OLD
            # It must lead to the newest one in as many steps as lie between them: only its place is new.
            if _is_beyond(frame.x, frame.y, cell.x, cell.y, speed * (ago + 1) * step + ROUNDING):
                return TOO_FAST
            cell.used |= _ONE << np.uint64(ago)
            return ACCEPTED
        if outdated and knows_ticks:
            return OLD
        last = (cell.sequence, cell.at, cell.x, cell.y, cell.start)
        wrong = OLD if outdated else _why_implausible(frame, *last, tick, step, speed, knows_ticks, span)
        if wrong != 0:
            agrees = cell.doubts > 0 and number > cell.doubt_sequence
            # A jump is believed if the frames after it agree with each other, whatever the newest accepted one says.
            if agrees:
                doubt = (cell.doubt_sequence, cell.doubt_at, cell.doubt_x, cell.doubt_y, cell.start)
                agrees = _why_implausible(frame, *doubt, tick, step, speed, knows_ticks, span) == 0
            # The doubts begin anew with this frame when it does not fit the ones before.
            cell.doubts = cell.doubts + 1 if agrees else 1
            cell.doubt_sequence, cell.doubt_at, cell.doubt_x, cell.doubt_y = number, tick, frame.x, frame.y
            if cell.doubts < _STEADY:
                return wrong
        # Without the fleet's ticks, enough frames that agree with each other show that the sender has started anew.
        begins = outdated
    newer = np.uint64(-ago)
    # Also keeps the shifts below 64, where their result is not defined.
    in_window = not begins and -ago < span
    cell.used = (cell.used << newer if in_window else _NONE) | _ONE
    cell.looks = cell.looks << newer if in_window else _NONE
    start = tick * step - number * step
    # Delays only ever add, so the quickest frame tells best when its sender began.
    cell.start = start if begins else min(start, cell.start)
    # A jump of its localisation is no movement.
    moves = not begins and not _is_beyond(frame.x, frame.y, cell.x, cell.y, speed * (1 - ago) * step + ROUNDING)
    cell.moved_x = (frame.x - cell.x) / -ago if moves else 0.0
    cell.moved_y = (frame.y - cell.y) / -ago if moves else 0.0
    cell.sequence, cell.at, cell.doubts = number, tick, 0
    cell.x, cell.y, cell.heading = frame.x, frame.y, frame.heading
    cell.back_x, cell.back_y = frame.back_x, frame.back_y
    return ACCEPTED


@njit(_I(_ROW, _FRAME, _I, _F), cache=True, nogil=True, error_model="numpy")
def _judge_contact(row, frame, tick, step):
    """Accept a contact that some robot would report about now, going on from its last accepted frame."""
    nearest = math.inf
    for column in range(row.size):
        cell = row[column]
        if cell.sequence != NOTHING:
            # 0 if a robot that was last heard then had gone on sending one sequence per tick.
            lead = frame.sequence - cell.sequence - (tick * step - cell.at * step) / step
            if abs(lead) < abs(nearest):
                nearest = lead
    if nearest == math.inf:
        return UNKNOWN
    # A contact bears no sender's name; a replayed one is refused because no robot's sequence is near its own.
    if abs(nearest) > _SLACK:
        return AHEAD if nearest > 0.0 else OLD
    return ACCEPTED


@njit(
    _B(_CELLS, _COUNTS, _ROWS, _ROWS, _FRAMES, _REACHES, _I, _F, _F, _B, _I, _I, _FLAGS, _FLAGS, _TICKS),
    cache=True,
    nogil=True,
    error_model="numpy",
)
def hear(cells, refused, rows, own, frames, reaches, tick, step, speed, knows_ticks, every, span, fate, looks, since):
    """Judge a tick's frames.

    A position counts at the tick it arrives: robots' clocks need not agree. A late one counts as many ticks before the
    newest one as their sequences are apart. The i-th place of a trail counts i times `every` ticks before its frame.

    Args:
        cells: CELL (n, s), of the listeners and senders; changed in place.
        refused: int64 (n, reasons), how many frames each listener has refused so far; changed in place.
        rows: int64 (m,), the rows of those that listen now.
        own: int64 (n,), each listener's own column, or `NO_ROBOT`.
        frames: FRAME (f,), in their order.
        reaches: uint8 (m, f), not 0 where a frame reaches a listener.
        tick: Now.
        step: s per tick.
        speed: Of the fastest robot, m/s.
        knows_ticks: Whether the listeners' ticks are the fleet's. Otherwise frames that are too old or too far ahead
            are accepted too, once enough of them agree with each other: a forged one then shuts no robot out.
        every: Ticks between the places of a trail.
        span: How many sequences are remembered, at most 64.
        fate: uint8 (m, f), zeros; set to `ACCEPTED` or a reason where a frame is heard.
        looks: uint8 (m, f), zeros; bit i is set where the place i of an accepted frame, 0 for its own, is news to a
            listener, and `THEN` where place 0 is of another tick than now.
        since: int32 (m, f), zeros; set to how many ticks ago place 0 was there, where `THEN` is set.

    Returns:
        Whether any look is not of place 0 and now.
    """
    past = False
    for m in range(rows.size):
        me = rows[m]
        row = cells[me]
        for f in range(frames.size):
            if reaches[m, f] == 0:
                continue
            frame = frames[f]
            kind = frame.kind
            # `NO_ROBOT` is not `NO_SENDER`: a listener that is no robot takes no frame for its own.
            if frame.sender == own[me]:
                kind = OWN
            elif kind == REPORT:
                kind = _judge_contact(row, frame, tick, step)
            elif kind == POSITION:
                # Unsigned: the sender of a position is a column, so numba may skip the negative-index check.
                cell = row[np.uint64(frame.sender)]
                kind = _judge_position(cell, frame, tick, step, speed, knows_ticks, span)
                if kind == ACCEPTED:
                    ago = cell.sequence - frame.sequence
                    then = cell.at - ago
                    news = 0
                    for trail_index in range(frame.trail + 1):
                        back = trail_index * every
                        # No place of a trail lies before the run's begin or the sender's first frame.
                        if back > min(then, frame.sequence) or ago + back >= span:
                            break
                        # A look counts once, however often it is told of: with quality below 1 ages would change.
                        # Unsigned: a signed shift by 63 would give a negative number.
                        bit = _ONE << np.uint64(ago + back)
                        if not cell.looks & bit:
                            cell.looks |= bit
                            news |= 1 << trail_index
                    if news != 0 and then != tick:
                        since[m, f] = tick - then
                        news |= THEN
                    looks[m, f] = news
                    # Bit 0 alone is a look of now; any other bit, `THEN` included, is of an earlier tick.
                    past |= news > 1
            fate[m, f] = kind
            if kind != ACCEPTED:
                refused[me, kind] += 1
    return past


@njit(
    _I(types.Array(_CELL, 1, "C", readonly=True), _ROWS, _I, _F, _ROWS, _ROWS, _ROWS, _PLACES), cache=True, nogil=True
)
def columns_heard(row, names, since, per_m, numbers, sequences, ticks, places):
    """Put together in columns the robots that a listener has heard since a tick.

    For example, since tick 90, a sender that was heard at ticks 80 and 95 counts with its place at 95, and one heard
    last at 89 does not count.

    Args:
        row: CELL (s,), the listener's.
        names: int64 (s,), the senders' numbers.
        since: The tick.
        per_m: cm in a metre.
        numbers: int64 (s,); the first rows of this and the next three are filled in, in the order of the senders.
        sequences: int64 (s,), of the newest position of each.
        ticks: int64 (s,), when that was heard.
        places: float64 (s, 2), x and y in m.

    Returns:
        How many robots they are.
    """
    count = 0
    for column in range(row.size):
        cell = row[column]
        if cell.sequence != NOTHING and cell.at >= since:
            numbers[count], sequences[count], ticks[count] = names[column], cell.sequence, cell.at
            places[count, 0] = cell.x / per_m
            places[count, 1] = cell.y / per_m
            count += 1
    return count
