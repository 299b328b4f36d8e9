"""The robots that live, as one of them can tell: a silence is weighed against the silences before it.

Where one position in ten arrives, a robot is silent for a minute now and then, and lives. So a robot counts as dead
once its silence is much longer than those that others have ended by being heard again: silences at random would be so
long once in a hundred thousand times (`DOUBT`). Where nothing is lost, that is soon. A robot that was taken for dead
lives again once it is heard.

- While none is heard, the radio is gone and not the robots: all count on that did. Of two robots, each cannot tell, and
  takes the other one for dead.
- A robot that was heard last from about as far away as any is may have driven out of reach. Such silences are weighed
  against each other, and count as long until they are known to be short.
- One that stands still for long is stuck, and counts as little as a dead one. A spare one counts once it is heard.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.radio.peers import columns_of

if TYPE_CHECKING:
    from agent.ports import PolicySetup
    from agent.view import View

DOUBT = 1e-5
"""Chance of a silence at random from which on a robot counts as dead."""

SILENCES_S = 600.0
"""Time over which silences are averaged, s."""

PRIOR, PRIOR_S = 4.0, (20.0, 45.0)
"""A robot begins as if it had met so many silences of so many seconds of robots nearby, and of robots far away, since
it does not know the radio yet."""

AGAIN, LEAST_S = 1.5, 15.0
"""A robot counts for at least so many times the longest silence of the last time that `SILENCES_S` says, and so many
seconds. Where walls shadow, silences are longer than at random."""

LOSSY = 0.02
"""Share of lost and late positions from which on robots do not hear each other well; they do again at half of it."""

LATELY_S = 120.0
"""Time over which that share is measured, s."""

QUIET_S = 5.0
"""Time in which none of the robots that count is heard, after which they do not hear each other well, s."""

UNHEARD_S = 600.0
"""Time for which robots count that were never heard, s."""

EDGE = 0.8
"""Share of the greatest distance of which robots were heard from which on one is far away."""

REACH = 0.7
"""Share of the terrain's diagonal of which robots are heard where the radio reaches everywhere, so none is far away."""

STUCK_S = 30.0
"""Time for which a robot has to stand still to count no longer, s."""


class Living:
    """The robots that live, as one robot knows from what it hears."""

    def __init__(self, setup: PolicySetup) -> None:
        """Begin before anything is heard."""
        roster, terrain, self._step = setup.fleet.roster, setup.ground.terrain, setup.fleet.step
        self._number = setup.robot.spec.number
        count = max(spec.number for spec in roster) + 1
        self._members = np.zeros(count, dtype=np.bool_)
        self._members[[spec.number for spec in roster if not spec.spare]] = True
        self._members[self._number] = False
        self._heard = np.full(count, -1)  # tick at which each was heard last
        self._places = np.full((count, 2), np.inf)  # where each has stood since `_stood`
        self._stood = np.zeros(count, dtype=np.int64)
        self._longest_m = 0.0
        self._wide_m = REACH * terrain.point * math.hypot(*terrain.shape)
        self._is_far = np.zeros(count, dtype=np.intp)  # 1 for a robot that was far away when it was heard last
        # Recent silences together, and their squares, of robots nearby and of those far away.
        self._silent = PRIOR * np.array(PRIOR_S) / self._step
        self._squared = PRIOR * (np.array(PRIOR_S) / self._step) ** 2
        self._longest_silence = np.ones(2)  # of the recent ones, ticks; less each tick
        self._missed = self._expected = self._delay = 0.0  # of positions lately: lost ones, all, and ticks under way
        self.hears_well = True  # nearly all positions of robots that live arrive, and at once
        self._works_since = np.zeros(count, dtype=np.int64)  # tick since which the radio works for each that counts
        self._longest = np.full(2, np.inf)  # silence after which a robot counts as dead, ticks
        self._strides = np.zeros(count)
        self._strides[[spec.number for spec in roster]] = [spec.speed * self._step for spec in roster]
        self._tick = -1
        self._counts = self._members.copy()
        self._living = frozenset({self._number, *np.flatnonzero(self._counts).tolist()})

    def note(self, view: View) -> frozenset[int]:
        """Take note of who is heard at a tick, once; return the numbers of the robots that live, this one's too.

        While they are the same, so is the object.
        """
        if view.tick != self._tick:
            # While it was at a dock it did not listen.
            away = view.tick - self._tick - 1
            self._heard[self._heard >= 0] += away
            self._stood += away
            self._heard[[number for number in view.charging if self._heard[number] >= 0]] = view.tick - 1
            self._tick = view.tick
            self._hear(view)
            before, self._counts = self._counts, self._count_living(view)
            if not np.array_equal(before, self._counts):
                self._living = frozenset({self._number, *np.flatnonzero(self._counts).tolist()})
            self._judge_radio()
        return self._living

    def _hear(self, view: View) -> None:
        peers = columns_of(view.peers)
        new = peers.ticks > self._heard[peers.numbers]
        numbers, ticks, places = peers.numbers[new], peers.ticks[new], peers.places[new]
        is_known = self._heard[numbers] >= 0
        is_far = self._is_far[numbers[is_known]]
        # One that comes back after its death was silent for no longer than it took to notice that, as far as is known.
        silences = np.minimum((ticks - self._heard[numbers])[is_known], self._longest[is_far])
        remains = 1.0 - self._step / SILENCES_S
        self._silent = remains * self._silent + np.bincount(is_far, silences, 2)
        self._squared = remains * self._squared + np.bincount(is_far, silences**2, 2)
        self._longest_silence = np.maximum(remains * self._longest_silence, 1.0)
        np.maximum.at(self._longest_silence, is_far, silences)
        # What one has not sent that was taken for dead is not lost.
        lately, counted = 1.0 - self._step / LATELY_S, silences[self._counts[numbers[is_known]]]
        self._expected = lately * self._expected + float(counted.sum())
        self._missed = lately * self._missed + float(counted.sum() - counted.size)
        self._delay = lately * self._delay + float((ticks - peers.sequences[new]).sum())
        self._heard[numbers] = ticks
        self._members[numbers] = True
        moved = np.sqrt(((places - self._places[numbers]) ** 2).sum(axis=1)) > self._strides[numbers]
        self._places[numbers[moved]], self._stood[numbers[moved]] = places[moved], ticks[moved]
        away_m = np.sqrt(((places - (view.reported.x, view.reported.y)) ** 2).sum(axis=1))
        self._longest_m = max(self._longest_m, float(away_m.max(initial=0.0)))
        self._is_far[numbers] = (away_m >= EDGE * self._longest_m) & (self._longest_m < self._wide_m)

    def _judge_radio(self) -> None:
        if self._counts.any() and (self._tick - int(self._heard[self._counts].max())) * self._step > QUIET_S:
            self.hears_well = False
        elif self._expected > 0.0:
            share = (self._missed + self._delay) / self._expected
            self.hears_well = share <= (LOSSY if self.hears_well else 0.5 * LOSSY)

    def _count_living(self, view: View) -> NDArray[np.bool_]:
        # Of silences at random, the mean of the squares is twice the square of the mean.
        usual = np.maximum(0.5 * self._squared / self._silent, 1.0)
        longest = np.maximum(-math.log(DOUBT) * usual, np.maximum(AGAIN * self._longest_silence, LEAST_S / self._step))
        others = self._members & (self._heard >= 0)
        if np.count_nonzero(others) != 1 and view.tick - int(self._heard.max()) > longest[0]:
            self._works_since[self._counts] = view.tick  # and not for those that were dead before
        silent = view.tick - np.maximum(self._heard, self._works_since)
        unheard = np.maximum(UNHEARD_S / self._step, longest[1])
        self._longest = longest
        living = self._members & (silent <= np.where(self._heard < 0, unheard, longest[self._is_far]))
        living[columns_of(view.peers).numbers] = True
        living &= (self._heard - self._stood) * self._step <= STUCK_S
        living[list(view.charging)] = False
        return np.asarray(living, dtype=np.bool_)
