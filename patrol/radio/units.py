"""The units of the wire: whole centimetres, milliradians and milliseconds, and their values in m, rad and s.

Everything inside a program is in metres, radians and seconds (`patrol.pose`); only a position message is not. These
functions scale and do not round: `patrol.radio.message` rounds when it makes a frame. There each pose is scaled with
the numbers themselves, because a call costs more than its work.
"""

from __future__ import annotations

CM_PER_M = 100.0
MRAD_PER_RAD = 1000.0
MS_PER_S = 1000.0


def m_to_cm(length: float) -> float:
    """Convert a length in m to cm."""
    return length * CM_PER_M


def cm_to_m(length: float) -> float:
    """Convert a length in cm to m."""
    return length / CM_PER_M


def s_to_ms(time: float) -> float:
    """Convert a time in s to ms."""
    return time * MS_PER_S


def ms_to_s(time: float) -> float:
    """Convert a time in ms to s."""
    return time / MS_PER_S
