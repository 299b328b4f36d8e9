"""Simulated odometry: the truth with drift, and noise on every message."""

from __future__ import annotations

from dataclasses import dataclass

from patrol.pose import Pose
from patrol.random import Purpose, gauss
from ros2.wire.frames import composed, inverted

__all__ = ["Errors"]


@dataclass(frozen=True, slots=True)
class Errors:
    """The errors of odometry."""

    noise_m: float = 0.0  # standard deviation of x and y in each message
    noise_rad: float = 0.0  # standard deviation of the heading in each message
    drift: float = 0.0  # of the position, as a share of the way, always in the same direction
    drift_rad: float = 0.0  # of the heading, rad per m
    found_m: float = 0.0  # standard deviation of x and y of each pose that the localisation finds
    found_rad: float = 0.0  # standard deviation of its heading


class DriftingOdometry:
    """Counts a robot's way from where it was switched on.

    `counted` is where the robot has come to since then by its own count, before the noise of messages. The noise is
    drawn by `identity`, seed and number of the robot.
    """

    def __init__(self, start: Pose, errors: Errors, identity: tuple[int, int]) -> None:
        self.counted = Pose(0.0, 0.0, 0.0)
        self._last = start
        self._errors = errors
        self._identity = identity
        self._said = 0
        self._localised = 0
        self._found_error = Pose(0.0, 0.0, 0.0)

    def move(self, pose: Pose, counted: Pose | None = None) -> None:
        """Take in that the robot has moved to a true pose.

        `counted` is the motion that its wheels counted, in its own frame, drift included; None for the true motion, to
        which drift is added.
        """
        moved = composed(inverted(self._last), pose)
        self._last = pose
        if counted is not None:
            self.counted = composed(self.counted, counted)
            return
        way = (moved.x**2 + moved.y**2) ** 0.5
        # Drift grows with the way, as that of worn wheels does, and not with time.
        stretch = 1.0 + self._errors.drift
        turn = moved.heading + self._errors.drift_rad * way
        self.counted = composed(self.counted, Pose(moved.x * stretch, moved.y * stretch, turn))

    def say(self) -> Pose:
        """Return the pose in the next message, in the frame of the odometry."""
        self._said += 1
        x, y, heading = (self._noise_draw(self._said, part) for part in range(3))
        errors = self._errors
        noise = Pose(x * errors.noise_m, y * errors.noise_m, heading * errors.noise_rad)
        counted = self.counted
        return composed(Pose(counted.x + noise.x, counted.y + noise.y, counted.heading), Pose(0.0, 0.0, noise.heading))

    @property
    def correction(self) -> Pose:
        """The pose of the odometry's frame on the map, as wrong as the newest pose that the localisation found."""
        return composed(self.found, inverted(self.counted))

    @property
    def found(self) -> Pose:
        """The robot's pose on the map by its localisation: the truth, and the error of the newest `localise`."""
        return composed(self._last, self._found_error)

    def localise(self) -> None:
        """Let the localisation find the pose anew: with another error."""
        self._localised += 1
        x, y, heading = (self._noise_draw(self._localised, part) for part in range(3, 6))
        errors = self._errors
        self._found_error = Pose(x * errors.found_m, y * errors.found_m, heading * errors.found_rad)

    def _noise_draw(self, count: int, part: int) -> float:
        seed, number = self._identity
        return gauss(seed, Purpose.ODOMETRY, number, count, part)
