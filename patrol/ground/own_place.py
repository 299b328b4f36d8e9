"""A robot's own place: what its localisation says, smoothed by its own motion where that jitters."""

from __future__ import annotations

from patrol.ground.swept_path import advance
from patrol.pose import Command, Pose

_GAINS = 1.0, 0.3, 0.1, 0.03, 0.01
"""Shares of a localised place in the place believed; the rest is the place before, moved on as commanded."""

_MEMORY = 1.0 / 60.0
"""Share of the newest tick in the mean by which they are compared."""

_TICKS = 20
"""Ticks in a row in which a gain below 1 has to be better, so that a few errors that cancel do not count."""

_BETTER = 0.7
"""A gain below 1 needs a mean squared error below so much of that of gain 1."""

_STEADY_M2 = 1e-8
"""Mean squared error of gain 1 up to which nothing jitters."""

_FAR = 4.0
"""Times the mean error from which on a place is left out once, and believed if the next is as far."""


class OwnPlace:
    """The place that a robot takes itself to be at. Call `take` once a tick, the ticks counting up.

    Each gain predicts the next localised place: by the place that it gives now, and the command. That which has
    predicted best lately is believed. Where localisation jitters that is a small one; where bodies do not move as
    commanded, or nothing is wrong, it is 1, which leaves localised places as they are, to the bit. Headings always are.
    """

    def __init__(self, step: float) -> None:
        """Begin with nothing known; a tick takes `step` s."""
        self._step = step
        self._k = -2
        self._localised = Pose(0.0, 0.0, 0.0)
        self._places = [(0.0, 0.0)] * len(_GAINS)
        self._errors = [0.0] * len(_GAINS)  # mean squared errors of their predictions, m2
        self._ticks = 0  # in those means
        self._better = 0  # ticks in a row in which a gain below 1 was better
        self._age = 0  # ticks since the places were those localised
        self._was_far = False

    def take(self, k: int, localised: Pose, last: Command, bumped: bool) -> Pose:
        """Return the robot's pose at tick k, by the command of the tick before, whose move may have been cancelled.

        After a tick that is left out all begins anew.
        """
        before, self._localised = self._localised, localised
        follows, self._k = k == self._k + 1, k
        if not follows:
            self._ticks = self._better = 0
            self._begin(localised)
            return localised
        end = before if bumped else advance(before, last, self._step)
        move_x, move_y = end.x - before.x, end.y - before.y
        expected = [(x + move_x, y + move_y) for x, y in self._places]
        offs = [(localised.x - x, localised.y - y) for x, y in expected]
        squares = [x * x + y * y for x, y in offs]
        best = self._best()
        if best and squares[best] > _FAR**2 * self._errors[best]:
            self._was_far = not self._was_far
            if self._was_far:
                self._places = expected
                return Pose(*expected[best], localised.heading)
            self._begin(localised)
            return localised
        self._was_far = False
        self._note(squares)
        self._places = [
            (x + share * off_x, y + share * off_y)
            for (x, y), (off_x, off_y), gain in zip(expected, offs, _GAINS, strict=True)
            for share in (max(gain, 1.0 / self._age),)
        ]
        return Pose(*self._places[best], localised.heading) if best else localised

    def _begin(self, localised: Pose) -> None:
        """Let all gains begin at a localised place."""
        self._places = [(localised.x, localised.y)] * len(_GAINS)
        self._age, self._was_far = 1, False

    def _note(self, squares: list[float]) -> None:
        """Take the squared errors (m2) of a tick's predictions into their means."""
        self._ticks += 1
        self._age += 1
        share = max(_MEMORY, 1.0 / self._ticks)
        self._errors = [mean + share * (new - mean) for mean, new in zip(self._errors, squares, strict=True)]
        raw = self._errors[0]
        self._better = self._better + 1 if raw > _STEADY_M2 and min(self._errors) < _BETTER * raw else 0

    def _best(self) -> int:
        """Return the number of the gain to believe."""
        return min(range(len(_GAINS)), key=self._errors.__getitem__) if self._better >= _TICKS else 0
