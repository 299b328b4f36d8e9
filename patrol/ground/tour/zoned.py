"""Ground whose points count differently, and its rounds: one for each group of weights next to each other.

*Classes* are the distinct weights of the ground, ascending. A *group* is some classes next to each other, and has a
round over their ground. A *division* gives every class to one group and every robot to one group. The best division is
the one in which the greatest weight times the time between two robots is least:

    two classes, of weight 1 (a tour of 540 m) and 10 (60 m); both together take 560 m; 6 robots at 1 m/s
    one group:   10 * 560 / 6                 = 933
    two groups:  max(1 * 540 / 3, 10 * 60 / 3) = 200      three robots for each

Where a class has a wanted age, divisions that keep it go first. A group whose round is too long for a wanted age comes
by that class more often than once a round (`patrol.ground.tour.visits`). For example, two robots at 1 m/s on a round of
172 m come by every 86 s. With a second visit of 20 m they come by every 96 s, and by what is visited every 48 s.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from patrol.ground.fields import load_grid
from patrol.ground.tour.round import Round
from patrol.ground.tour.visits import Ground, longest_gaps_m, plan_visits, with_visits

MOST_CLASSES = 4
"""Distinct weights of the ground of a fleet that follows rounds."""

KEPT = 1.25
"""A class is visited where a group's round alone would take more than a wanted age divided by this to come back to it.
Visits are put in until that is met, so that the age is kept in practice."""

VISITS = 1.2
"""How many times better a division with visits has to be than one without, as robots keep even distances less well."""

FACTS = "zoned.json"

Classes = tuple[int, int]
"""Numbers of the first and the last class of a group."""


class Group(NamedTuple):
    """Some classes next to each other, and the number of robots on their round."""

    classes: Classes
    robots: int


class LaidOut(NamedTuple):
    """The round of a group.

    Attributes:
        round: With the visits of its classes.
        ages_s: By class, the time between two robots that come by it, s.
    """

    round: Round
    ages_s: Mapping[int, float]


@dataclass(frozen=True, eq=False)
class ZonedGround:
    """The weights of a terrain's points while some zones are in force, and the rounds over the ground of each group.

    Attributes:
        weights: float64 (height, width), read-only: how many times the age of a point counts.
        classes: The distinct weights of the patrolled points, ascending.
        wanted: For each class, the least age that a zone of it wants, s; None without such a zone.
        rounds: By group, without visits; empty where there are no rounds, or too many classes for them.
        speed: Of the robots, m/s.
        ways: For each class that may be visited, float32 (height, width): length of the way from each point to the
            nearest place of the round over its ground, m; infinity where no way leads.
    """

    weights: NDArray[np.float64]
    classes: tuple[float, ...]
    wanted: tuple[float | None, ...]
    rounds: Mapping[Classes, Round]
    speed: float
    ways: Mapping[int, NDArray[np.float32]] = field(default_factory=dict)
    _laid_out: dict[Group, LaidOut] = field(default_factory=dict)

    def divide(self, robots: int) -> tuple[Group, ...]:
        """Divide robots between groups.

        Args:
            robots: How many, at least 1.

        Returns:
            The groups of the best division, by ascending weight; empty without rounds.
        """
        if not self.rounds:
            return ()
        return min(self._divisions(robots), key=self._rank)

    def _rank(self, groups: tuple[Group, ...]) -> tuple[float, float, int]:
        """Return what is least for the best division."""
        visits = any(self.round_of(group) is not self.rounds[group.classes] for group in groups)
        return self._excess(groups), (VISITS if visits else 1.0) * self.cost_s(groups), len(groups)

    def cost_s(self, groups: tuple[Group, ...]) -> float:
        """Return the greatest weight times the time between two robots of a division, s.

        Args:
            groups: The division.
        """
        return max(self.classes[number] * age_s for group in groups for number, age_s in self._ages_s(group))

    def wish_kept(self, groups: tuple[Group, ...], number: int) -> bool:
        """Return True if the robots of a division come back to a class within its wanted age.

        Args:
            groups: The division.
            number: Of the class.
        """
        wanted = self.wanted[number]
        return wanted is None or dict(pair for group in groups for pair in self._ages_s(group))[number] <= wanted

    def round_of(self, group: Group) -> Round:
        """Return the round of a group, the same one for each call.

        Args:
            group: The group.
        """
        return self._lay_out(group).round

    def _ages_s(self, group: Group) -> Iterable[tuple[int, float]]:
        """Return for each class of a group the time between two robots that come by it, s."""
        return self._lay_out(group).ages_s.items()

    def _lay_out(self, group: Group) -> LaidOut:
        """Put in visits of the classes for which the group's round is too long."""
        if group not in self._laid_out:
            self._laid_out[group] = self._with_visits(group)
        return self._laid_out[group]

    def _with_visits(self, group: Group) -> LaidOut:
        (first, last), whole, speed = group.classes, self.rounds[group.classes], group.robots * self.speed
        due_s = {n: wish / KEPT for n in range(first, last + 1) if (wish := self.wanted[n]) is not None}
        late = [n for n in due_s if n in self.ways and first < last and whole.length_m / speed > due_s[n]]
        if not late:
            return LaidOut(whole, dict.fromkeys(range(first, last + 1), whole.length_m / speed))
        while last in late and last > first:
            last -= 1  # visits alone show that class
        base = self.rounds[first, last]
        grounds = {n: Ground(self.rounds[n, n], self.ways[n], due_s[n] * self.speed) for n in late}
        visits = plan_visits(base, grounds, group.robots)
        laid_out = with_visits(base, grounds, visits)
        gaps_s = longest_gaps_m(base, late, group.robots, [visits])[0] / self.speed
        numbers = range(first, group.classes[1] + 1)
        return LaidOut(
            laid_out, dict.fromkeys(numbers, laid_out.length_m / speed) | dict(zip(late, gaps_s.tolist(), strict=True))
        )

    def _excess(self, groups: tuple[Group, ...]) -> float:
        """Return how many times too long the robots of a division take for the wish that is kept worst, at least 1."""
        excess = 1.0
        for group in groups:
            for number, age_s in self._ages_s(group):
                if (wanted := self.wanted[number]) is not None:
                    excess = max(excess, age_s / wanted)
        return excess

    def _divisions(self, robots: int) -> Iterator[tuple[Group, ...]]:
        count = len(self.classes)
        for groups in range(1, min(count, robots) + 1):
            for cuts in combinations(range(1, count), groups - 1):
                firsts, ends = (0, *cuts), (*cuts, count)
                for marks in combinations(range(1, robots), groups - 1):
                    shares = np.diff((0, *marks, robots)).tolist()
                    yield tuple(
                        Group((first, end - 1), share) for first, end, share in zip(firsts, ends, shares, strict=True)
                    )

    def save(self, folder: Path) -> None:
        """Write the arrays as .npy files and the rest as JSON.

        Args:
            folder: Where to write; it is made when missing.
        """
        folder.mkdir(parents=True, exist_ok=True)
        np.save(folder / "weights.npy", self.weights)
        for (first, last), laid_out in self.rounds.items():
            laid_out.save(folder / f"{first}-{last}")
        for number, ways in self.ways.items():
            np.save(folder / f"ways-{number}.npy", ways)
        facts = {
            "classes": self.classes,
            "wanted": self.wanted,
            "rounds": list(self.rounds),
            "speed": self.speed,
            "ways": list(self.ways),
        }
        (folder / FACTS).write_text(json.dumps(facts), encoding="utf-8")

    @staticmethod
    def load(folder: Path) -> ZonedGround:
        """Load what `save` wrote, memory-mapped and read-only.

        Args:
            folder: The folder that `save` wrote into.
        """
        facts = json.loads((folder / FACTS).read_text(encoding="utf-8"))
        rounds = {(first, last): Round.load(folder / f"{first}-{last}") for first, last in facts["rounds"]}
        weights = load_grid(folder / "weights.npy")
        ways = {number: load_grid(folder / f"ways-{number}.npy") for number in facts["ways"]}
        return ZonedGround(weights, tuple(facts["classes"]), tuple(facts["wanted"]), rounds, facts["speed"], ways)
