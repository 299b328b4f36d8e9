"""The model `path-loss`: distance, walls, shadowing and interference.

The power that a robot receives from another (dBm) follows log-distance path loss with log-normal shadowing (T. S.
Rappaport, "Wireless Communications: Principles and Practice", 2nd ed., section 4.9), and each wall on the line takes
its share (J. M. Keenan and A. J. Motley, "Radio coverage in buildings", BT Technology Journal 8(1), 1990):

    received = power - reference - 10 exponent log10(max(d, 1 m) / 1 m) - wall W - shadowing G(link)

G is a standard normal draw for each directed link, kept for the run or for `redraw` seconds.

Each frame begins at a moment of its tick that is drawn for it, without listening first (pure ALOHA), and takes
`airtime`. The frames of other robots that overlap it raise the noise at a receiver that they reach, if only faintly. A
receiver's own frame is as strong as `power`, so a robot does not hear while it sends. The margin (dB) is how much more
there is than a receiver needs, and it decides with which probability the frame is received:

    margin = received - 10 log10(sum of noise and interference, mW) - (sensitivity - noise)
    P(received) = 1 / (1 + exp(-margin / edge))

Without interference that is `received` - `sensitivity`. A frame that a fault has dropped on a link is not there for
that receiver, so it does not interfere either. A stranger's frames come from nowhere: they are received and disturb
none.
"""

from __future__ import annotations

import math
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from patrol.kernels.elementary import exp, log10, power
from patrol.random import Purpose, draw, mix
from worldsim.kernels.radio import below, normals, walls_between
from worldsim.radio.fates import STRANGER
from worldsim.radio.models import ModelSetup, OnAir
from worldsim.radio.rules import BEAM

_MOST = 700.0
"""Beyond it exp overflows."""


class Drawn(IntEnum):
    """Purposes of this model's draws: the value after the seed and `Purpose.RADIO`, before those named here."""

    SHADOWING = 0
    """Window, sender, receiver."""
    MOMENT = 1
    """Source, sequence."""
    RECEPTION = 2
    """Source, receiver, sequence."""


def window_of(k: int, step: float, redraw: float | None) -> int:
    """Return how often shadowing has been drawn anew by tick k: each `redraw` seconds; None for never.

    For example, 2 in tick 10 with steps of 0.5 s and a redraw each 2 s.
    """
    return 0 if redraw is None else math.floor(k * step / redraw + 1e-9)


class PathLoss:
    """Loses frames by distance, walls and interference."""

    def __init__(self, setup: ModelSetup) -> None:
        """Draw nothing yet; the setup's options are `patrol.scenario.radio_spec.PathLossOptions`."""
        self.options = setup.options
        self._seed = setup.seed
        self._step = setup.step
        terrain = setup.terrain
        self._walls = np.ascontiguousarray(~terrain.passable).view(np.uint8)
        self._grid = (terrain.point, *terrain.origin)
        self._drawn: tuple[int, tuple[int, ...]] = (-1, ())
        self._shadowing = np.zeros((0, 0))

    def lost(self, air: OnAir) -> NDArray[np.bool_]:
        """Say which frames are not received; see the top of this file."""
        of_robot = air.origin != STRANGER
        if not of_robot.any():
            return np.zeros(air.on_the_way.shape, dtype=np.bool_)
        options = self.options
        numbers = sorted({*air.receivers.tolist(), *air.origin.tolist()} - {STRANGER})
        levels = self._received_levels(air, numbers)
        senders = np.searchsorted(numbers, np.where(of_robot, air.origin, numbers[0]))
        received = levels[senders[:, None], np.searchsorted(numbers, air.receivers)[None, :]]
        margin = received - self._noise_levels(air, received, of_robot) - (options.sensitivity - options.noise)
        states = [mix(self._seed, Purpose.RADIO, Drawn.RECEPTION, source) for source in air.source.tolist()]
        is_heard = below(np.array(states, dtype=np.uint64), air.receivers, air.sequence, self._reception_chance(margin))
        lost: NDArray[np.bool_] = (is_heard == 0) & of_robot[:, None]
        return lost

    def _received_levels(self, air: OnAir, numbers: list[int]) -> NDArray[np.float64]:
        """The power that each robot receives from each, dBm, float64 (senders, receivers)."""
        options = self.options
        places = np.array([(air.poses[number].x, air.poses[number].y) for number in numbers])
        apart = places[:, None, :] - places[None, :, :]
        # The law holds from 1 m on; nearer, the power would grow without bound.
        distance = np.maximum(np.hypot(apart[..., 0], apart[..., 1]), 1.0)
        levels: NDArray[np.float64] = options.power - options.reference - 10.0 * options.exponent * log10(distance)
        if options.wall > 0.0:
            levels -= options.wall * walls_between(self._walls, *self._grid, places, BEAM)
        window = window_of(air.k, self._step, options.redraw)
        if self._drawn != (window, tuple(numbers)):
            self._drawn = window, tuple(numbers)
            of_link = (self._seed, Purpose.RADIO, Drawn.SHADOWING, window)
            states = np.array([mix(*of_link, number) for number in numbers], dtype=np.uint64)
            self._shadowing = normals(states, np.array(numbers, dtype=np.int64))
        levels -= options.shadowing * self._shadowing
        # A robot's own frame drowns all others while it sends.
        np.fill_diagonal(levels, options.power)
        return levels

    def _noise_levels(
        self, air: OnAir, received: NDArray[np.float64], of_robot: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        """Noise and interference that each frame meets at each receiver, dBm, float64 (f, r)."""
        options = self.options
        noise = np.full(received.shape, 10.0 ** (options.noise / 10.0))
        if options.airtime > 0.0:
            sent = zip(air.source.tolist(), air.sequence.tolist(), strict=True)
            begins = [self._step * draw(self._seed, Purpose.RADIO, Drawn.MOMENT, *frame) for frame in sent]
            overlap = np.abs(np.subtract.outer(begins, begins)) < options.airtime
            overlap &= np.not_equal.outer(air.origin, air.origin) & np.logical_and.outer(of_robot, of_robot)
            is_own = np.equal.outer(air.origin, air.receivers) & np.any(air.on_the_way, axis=1, keepdims=True)
            disturbing = np.where(air.on_the_way | is_own, power(10.0, received / 10.0), 0.0)
            frames, disturbers = np.nonzero(overlap)
            np.add.at(noise, frames, disturbing[disturbers])
        # Powers add up in mW, not in dB.
        levels: NDArray[np.float64] = 10.0 * log10(noise)
        return levels

    def _reception_chance(self, margin: NDArray[np.float64]) -> NDArray[np.float64]:
        """With which probability a frame is received.

        For example, 0.5 with a margin of 0 dB, and 0.88 with a margin of 2 dB and an edge of 1 dB.
        """
        edge = self.options.edge
        if edge == 0.0:
            return (margin >= 0.0).astype(np.float64)
        # By `exp` of our own kernels: traces depend on its last bit.
        chance: NDArray[np.float64] = 1.0 / (1.0 + exp(np.clip(-margin / edge, -_MOST, _MOST)))
        return chance
