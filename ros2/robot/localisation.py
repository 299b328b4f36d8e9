"""The robot's pose on the map now: its odometry, corrected by its localisation, and brought up to this moment.

Odometry is smooth and frequent, but drifts. A localisation corrects it now and then: by the transform of the odometry's
frame in the map's, which AMCL, slam_toolbox and Cartographer publish on ``tf``, or by poses such as ``amcl_pose``.
All times are the robot's, in s. Without a fresh pose there is none: nothing is guessed for longer than `LONGEST_S`.

Odometry is believed as far as it comes from one sender, in its order, and without jumps. It moves as a body does. A
pose that is farther from the last ones than speed and time allow means that the robot was restarted and counts from
another place, that it was carried, or that another node sends. Then the robot's pose is unknown until its odometry has
been steady for `SETTLED_S` and a localisation has placed it on the map anew.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import TYPE_CHECKING

from patrol.errors import printable
from patrol.pose import Pose
from ros2.wire.frames import apart, composed, inverted, travelled

if TYPE_CHECKING:
    from ros2.wire.messages import Odometry, PoseWithCovarianceStamped, TFMessage, Twist


LONGEST_S = 0.5
"""The longest time over which a pose is carried on by its velocity, s."""

AHEAD_S = 0.1
"""Largest lead of a stamp over the robot's time, s: clocks on two machines never agree quite."""

CORRECTION_S = 5.0
"""Greatest age of the newest transform from map to odometry, s. AMCL repeats it with every scan."""

CORRECTED_M = 10.0
"""Longest drive on odometry after the last pose of the localisation, m. AMCL sends one after each 0.2 m
or so, and none to a robot that stands."""

MATCH_S = 0.2
"""Largest difference in time between a pose and the odometry that it is compared with, s."""

Variances = tuple[float, float, float]
"""Of x and y, m², and of the heading, rad²."""

VARIANCES: Variances = (0.25, 0.25, (math.pi / 12.0) ** 2)
"""The variances that RViz gives a pose that is set by hand: of half a metre, and 15 degrees."""

SAME_MAP = Pose(0.0, 0.0, 0.0)
"""The transform of a robot whose map is ours."""

SPEED = 0.25
"""The top speed of a small and careful robot, m/s."""

RADIUS = 0.25
"""The radius of its body, m."""

_STANDS = 0.02
"""A robot stands whose speed and turn rate add up to less than this, in m/s and rad/s: odometry is noisy."""
_MOST_CHILDREN = 256
"""Frames that are kept: robots that share a topic send theirs too."""


class Source(StrEnum):
    """The source of corrections of the odometry."""

    TF = "tf"
    POSE = "pose"
    ODOMETRY = "odometry"


@dataclass(frozen=True, slots=True)
class Fix:
    """The pose of the robot."""

    pose: Pose  # on the map, now
    twist: Twist  # by its odometry, in its own frame


@dataclass(frozen=True, slots=True)
class _Correction:
    """The pose of the odometry's frame on the map."""

    pose: Pose
    arrived_s: float
    driven_m: float


@dataclass(frozen=True, slots=True)
class LocalisationSettings:
    """The settings by which a robot is found on the map."""

    source: Source = Source.TF  # what corrects the odometry
    map_frame: str = "map"
    # on the map; without corrections odometry counts from there, otherwise the localisation is told
    start: Pose | None = None
    variances: Variances = VARIANCES  # of `start`
    transform: Pose = SAME_MAP  # pose of the robot's own map on ours, if it has another
    fresh_s: float = 0.3  # longest time since the newest odometry arrived
    delay_s: float | None = None  # age of odometry when it arrives; None to go by its stamps
    speed: float = SPEED  # top speed, m/s; a robot that moves faster must say so in its odometry
    # how fast the robot can turn, rad/s: while messages are missing, it may have turned like that; between others it
    # turns as both of them say
    turn_rate: float = SPEED / RADIUS


class Localisation:
    """Puts together where the robot is.

    `why` says why there is no pose, in one line with the remedy; it is empty if there is one.
    """

    def __init__(self, settings: LocalisationSettings) -> None:
        self.why = "no odometry has come"
        self._settings = settings
        self._odometer = Odometer(settings)
        self._fixed: dict[str, _Correction] = {}
        self._moving: dict[str, _Correction] = {}
        self._posed: _Correction | None = None
        self._refused = ""
        self._begun: _Correction | None = None
        self._lost = False
        self._early: PoseWithCovarianceStamped | None = None

    @property
    def frames(self) -> Mapping[str, float]:
        """The frames that transforms on the map lead to, each with the time of its newest transform, s."""
        return MappingProxyType(
            {name: correction.arrived_s for name, correction in {**self._fixed, **self._moving}.items()}
        )

    def odometry(self, message: Odometry, arrived_s: float, sender: bytes = b"") -> None:
        """Take in odometry; once it counts from somewhere else, it must be corrected anew.

        `sender` stands for the node that sent it, empty where that is not known.
        """
        is_first, other_frame = not self._odometer.frame, message.frame != self._odometer.frame
        jumped = self._odometer.take(message, arrived_s, sender)
        if jumped:
            self._moving.clear()
            self._fixed.clear()
        if jumped or (other_frame and not is_first):
            self._posed = self._begun = self._early = None
            self._lost = True
        newest, start = self._odometer.newest, self._settings.start
        if is_first and newest is not None and start is not None:
            self._begun = _Correction(composed(start, inverted(newest.pose)), arrived_s, newest.driven_m)
        if self._early is not None:
            early, self._early = self._early, None
            self.localised(early, arrived_s)

    def transforms(self, message: TFMessage, arrived_s: float, *, fixed: bool) -> None:
        """Take in transforms; only those of frames on the map matter.

        If `fixed`, they came on ``tf_static``, and so hold for ever.
        """
        corrections = self._fixed if fixed else self._moving
        for transform in message.transforms:
            if _frame_name(transform.frame) == _frame_name(self._settings.map_frame):
                self._keep_transform(
                    corrections,
                    _frame_name(transform.child_frame),
                    _Correction(self._on_our_map(transform.pose), arrived_s, 0.0),
                )
            elif _frame_name(transform.child_frame) == _frame_name(self._odometer.frame):
                self._refuse_frame(Source.TF, f"transforms of {transform.child_frame} on tf are in", transform.frame)

    def _keep_transform(self, kept: dict[str, _Correction], child: str, correction: _Correction) -> None:
        """Keep a frame's transform; of many frames the oldest makes room, but never the odometry's own."""
        # Out and in again, so that the first one in the dict is the oldest.
        kept.pop(child, None)
        kept[child] = correction
        if len(kept) > _MOST_CHILDREN:
            del kept[next(name for name in kept if name != _frame_name(self._odometer.frame))]

    def localised(self, message: PoseWithCovarianceStamped, arrived_s: float) -> None:
        """Take in a pose on the map; it is held against the odometry of its time."""
        if _frame_name(message.frame) != _frame_name(self._settings.map_frame):
            self._refuse_frame(Source.POSE, "poses of the localisation are in", message.frame)
            return
        readings = self._odometer.readings
        if not readings:
            self._early = message
            return
        at_s = message.stamp_ns / 1e9
        nearest, ahead_s = readings[-1], 0.0
        if self._settings.delay_s is None:
            nearest = min(readings, key=lambda one: abs(one.stamp_s - at_s))
            ahead_s = at_s - nearest.stamp_s
        if self._precedes_all(at_s):
            nearest, ahead_s = readings[0], 0.0
        elif abs(ahead_s) > MATCH_S:
            return
        then = travelled(nearest.pose, nearest.twist, ahead_s)
        self._posed = _Correction(composed(self._on_our_map(message.pose), inverted(then)), arrived_s, nearest.driven_m)

    def _refuse_frame(self, source: Source, words: str, frame: str) -> None:
        """Note that corrections come in a frame that is not the map's."""
        if source is self._settings.source:
            why = f"{printable(words)} the frame {printable(frame)!r}, not {self._settings.map_frame}"
            self._refused = f"{why}; correct that, or give --map-frame"

    def _on_our_map(self, pose: Pose) -> Pose:
        return composed(self._settings.transform, pose)

    def _precedes_all(self, at_s: float) -> bool:
        """Return True if a pose is from before the first odometry of a robot that stood then.

        A localisation is silent while a robot stands, so that its latched pose may be old. Since then the robot has
        driven less than it takes for another one: no more than some 0.2 m.
        """
        readings = self._odometer.readings
        first = readings[0]
        stood = math.hypot(first.twist.vx, first.twist.vy) + abs(first.twist.turn_rate) < _STANDS
        return self._posed is None and stood and len(readings) < REMEMBERED and at_s < first.stamp_s

    def at(self, now_s: float) -> Fix | None:
        """Return the robot's pose now; None, and `why`, if it is unknown."""
        newest = self._odometer.newest
        self.why = self._odometry_fault(newest, now_s) or self._correction_fault(newest, now_s)
        if newest is None or self.why:
            return None
        correction = self._newest_correction()
        assert correction is not None  # else there would be a reason
        age_s = max(0.0, now_s - newest.stamp_s)
        return Fix(travelled(composed(correction.pose, newest.pose), newest.twist, age_s), newest.twist)

    def correction_age_s(self, now_s: float) -> float | None:
        """Return the age of the correction in use, s, or None without one; called from any thread."""
        correction = self._newest_correction()
        return None if correction is None else abs(now_s - correction.arrived_s)

    def _odometry_fault(self, newest: OdometryReading | None, now_s: float) -> str:
        if newest is None:
            return "no odometry has come"
        if doubt := self._odometer.doubt(now_s):
            return doubt
        silent_s = abs(now_s - newest.arrived_s)  # a clock may have been set back
        if silent_s > self._settings.fresh_s:
            return f"no odometry for {silent_s:.1f} s"
        age_s = now_s - newest.stamp_s
        if age_s > LONGEST_S:
            return f"odometry is {age_s:.1f} s old by its stamps; set NTP on both machines, or give --delay"
        if age_s < -AHEAD_S:
            return f"odometry is {-age_s:.1f} s ahead by its stamps; set NTP on both machines, or give --delay"
        return ""

    def _correction_fault(self, newest: OdometryReading | None, now_s: float) -> str:
        correction, frame = self._newest_correction(), self._odometer.frame
        source, wanted = self._settings.source, f"{self._settings.map_frame} -> {frame}"
        if correction is None and self._lost:
            remedy = "start this agent anew where the robot stands then"
            if source is not Source.ODOMETRY:
                remedy = f"is the robot's localisation running? If it has none, {remedy}"
            return f"odometry counts from somewhere else, and nothing has said where that is on the map; {remedy}"
        if source is Source.ODOMETRY:
            return "" if correction is not None else "it is not known where the robot started; give --start X,Y,HEADING"
        if correction is None:
            missing = f"no transform {wanted} on tf" if source is Source.TF else "no pose of a localisation has come"
            return self._refused or f"{missing}; start the robot's localisation, or give --localisation"
        corrected_s = self.correction_age_s(now_s) or 0.0
        if source is Source.TF and _frame_name(frame) in self._moving and corrected_s > CORRECTION_S:
            return f"no transform {wanted} for {corrected_s:.1f} s; is the robot's localisation running?"
        if source is Source.POSE and newest is not None and newest.driven_m - correction.driven_m > CORRECTED_M:
            return f"no pose of a localisation for {newest.driven_m - correction.driven_m:.1f} m; is it running?"
        return ""

    def _newest_correction(self) -> _Correction | None:
        if self._settings.source is Source.ODOMETRY:
            return self._begun
        if self._settings.source is Source.POSE:
            return self._posed
        frame = _frame_name(self._odometer.frame)
        return self._moving.get(frame) or self._fixed.get(frame)


def _frame_name(frame: str) -> str:
    """Return a frame's name as tf compares it: old robots put a slash before it."""
    return frame.lstrip("/")


SETTLED_S = 1.0
"""For how long odometry must be steady, or of one sender, before it counts again, s."""

JUMP_M, JUMP_RAD = 0.5, 1.0
"""Largest change of odometry that is no jump, m and rad: the noise of its poses, and the lateness of a message."""

USUAL_S = 0.1
"""Time between two messages of which none between them is missing, s."""

MOST_RAD = 3.0
"""A turn that is larger is a jump, however fast the robot can turn: of nearly half a turn the sense is unknown."""

BACK_S = 0.1
"""Least step back of arrivals that means that a clock was set back, s."""

SLOW_GAPS = 3
"""Number of late messages in a row that mean slow odometry; one alone may get lost."""

REMEMBERED = 256
"""Messages that are remembered."""

_DRIVEN_S = 0.5
"""The longest time between two messages over which a velocity counts as driven, s."""
_MOST_SENDERS = 16
"""Senders that are kept; two are one too many already."""


@dataclass(frozen=True, slots=True)
class OdometryReading:
    """A message of odometry."""

    stamp_s: float
    arrived_s: float
    pose: Pose  # in the odometry's frame
    twist: Twist  # in the body's own frame
    driven_m: float  # way until then, by its velocities: the noise of poses would add up


class Odometer:
    """Takes in odometry; all times are the robot's, in s.

    `readings` holds what is believed, the newest last, without what came before a silence. `frame` is that of its
    poses, empty before the first; `jumped_m` is the length of the last jump.
    """

    def __init__(self, settings: LocalisationSettings) -> None:
        self.readings: deque[OdometryReading] = deque(maxlen=REMEMBERED)
        self.frame = ""
        self.jumped_m = 0.0
        self._settings = settings
        self._senders: dict[bytes, float] = {}
        self._astray: OdometryReading | None = None
        self._astray_since_s = 0.0
        self._strayed_s = -math.inf
        self._gaps_s: deque[float] = deque(maxlen=SLOW_GAPS)

    @property
    def newest(self) -> OdometryReading | None:
        """The newest message, as far as it is believed."""
        return self.readings[-1] if self.readings else None

    def take(self, message: Odometry, arrived_s: float, sender: bytes = b"") -> bool:
        """Take in a message, and return True if odometry counts from another place from now on.

        Corrections of its frame are void then. A message older than the last is left out while that is fresh.
        `sender` stands for the node that sent it, empty where that is not known.
        """
        self._note_sender(sender, arrived_s)
        last = self.newest
        reading = self._read_message(message, arrived_s, last)
        if last is None or message.frame != self.frame:
            self.frame = message.frame
            self._begin_anew(reading)
            return False
        latest = self._astray or last
        self._gaps_s.append(arrived_s - latest.arrived_s)
        renewed = not -BACK_S <= arrived_s - latest.arrived_s <= self._settings.fresh_s
        if not renewed and reading.stamp_s <= latest.stamp_s:
            return False
        if self._can_follow(last, reading) and self._keeps_its_speed(reading):
            self._astray = None
            if renewed:  # stamps from before mean nothing any more
                self.readings.clear()
            self.readings.append(reading)
            return False
        self.jumped_m, _ = apart(last.pose, reading.pose)
        if not renewed and not self._has_settled(reading):
            return False
        self._begin_anew(reading)
        return True

    def doubt(self, now_s: float) -> str:
        """Return why the odometry cannot be believed now, in one line; empty if it can."""
        lately = sum(abs(now_s - at_s) <= SETTLED_S for at_s in self._senders.values())
        if lately > 1:
            return f"odometry comes from {lately} senders; end all but one, or give --topic odom=TOPIC"
        if abs(now_s - self._strayed_s) <= SETTLED_S:
            return f"odometry has jumped by {self.jumped_m:.1f} m"
        if len(self._gaps_s) == SLOW_GAPS and min(self._gaps_s) > self._settings.fresh_s:
            each_s, fresh_s = max(self._gaps_s), self._settings.fresh_s
            slow = f"odometry comes every {each_s:.2f} s, and --fresh allows {fresh_s:g} s"
            return f"{slow}; publish it more often, or raise --fresh"
        return ""

    def _read_message(self, message: Odometry, arrived_s: float, last: OdometryReading | None) -> OdometryReading:
        delay_s = self._settings.delay_s
        stamp_s = message.stamp_ns / 1e9 if delay_s is None else arrived_s - delay_s
        driven_m = 0.0
        if last is not None:
            lapsed_s = min(max(0.0, arrived_s - last.arrived_s), _DRIVEN_S)
            driven_m = last.driven_m + _measure_speed(message.twist) * lapsed_s
        return OdometryReading(stamp_s, arrived_s, message.pose, message.twist, driven_m)

    def _note_sender(self, sender: bytes, arrived_s: float) -> None:
        self._senders.pop(sender, None)
        self._senders[sender] = arrived_s
        if len(self._senders) > _MOST_SENDERS:
            del self._senders[next(iter(self._senders))]

    def _begin_anew(self, reading: OdometryReading) -> None:
        self._astray, self._strayed_s = None, -math.inf
        self.readings.clear()
        self.readings.append(reading)

    def _has_settled(self, reading: OdometryReading) -> bool:
        """Return True if poses after a jump have been steady for long enough to count from now on."""
        if self._astray is None or not self._can_follow(self._astray, reading):
            self._astray_since_s = reading.arrived_s
        self._astray, self._strayed_s = reading, reading.arrived_s
        return reading.arrived_s - self._astray_since_s >= SETTLED_S

    def _keeps_its_speed(self, reading: OdometryReading) -> bool:
        """Return True if many small jumps make no large one."""
        second = [earlier for earlier in self.readings if 0.0 <= reading.arrived_s - earlier.arrived_s <= SETTLED_S]
        return not second or self._can_follow(second[0], reading)

    def _can_follow(self, before: OdometryReading, after: OdometryReading) -> bool:
        """Return True if a body that was at the one can be at the other."""
        lapsed_s = max(after.stamp_s - before.stamp_s, after.arrived_s - before.arrived_s, 0.0)
        time_s = min(lapsed_s, SETTLED_S) + self._settings.fresh_s  # messages that waited arrive together
        speed = max(self._settings.speed, min(_measure_speed(before.twist), _measure_speed(after.twist)))
        reported = min(abs(before.twist.turn_rate), abs(after.twist.turn_rate)) * time_s
        unseen = self._settings.turn_rate * max(0.0, min(lapsed_s, SETTLED_S) - USUAL_S)
        moved, turned = apart(before.pose, after.pose)
        long_ago = after.arrived_s - before.arrived_s > self._settings.fresh_s  # it may have turned all round
        return moved <= JUMP_M + speed * time_s and (
            long_ago or turned <= min(JUMP_RAD + max(reported, unseen), MOST_RAD)
        )


def _measure_speed(twist: Twist) -> float:
    return math.hypot(twist.vx, twist.vy)
