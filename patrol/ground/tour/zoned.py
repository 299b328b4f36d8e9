"""Ground whose points count differently, and its rounds: one for each group of weights next to each other.

*Classes* are the distinct weights of the ground, ascending. A *group* is some classes next to each other, and has a
round over their ground. A *division* gives every class to one group and every robot to one group. The best division is
the one in which the greatest weight times the time between two robots is least:

    two classes, of weight 1 (a tour of 540 m) and 10 (60 m); both together take 560 m; 6 robots at 1 m/s
    one group:   10 * 560 / 6                 = 933
    two groups:  max(1 * 540 / 3, 10 * 60 / 3) = 200      three robots for each

Where a class has a wanted age, divisions that keep it go first.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from patrol.ground.fields import load_grid
from patrol.ground.tour.round import Round

MOST_CLASSES = 4
"""Distinct weights of the ground of a fleet that follows rounds."""

KEPT = 1.25
"""How many times shorter than a wanted age the time between two robots should be, so that it is kept in practice."""

FACTS = "zoned.json"

Classes = tuple[int, int]
"""Numbers of the first and the last class of a group."""


class Group(NamedTuple):
    """Some classes next to each other, and the number of robots on their round."""

    classes: Classes
    robots: int


@dataclass(frozen=True, eq=False)
class ZonedGround:
    """The weights of a terrain's points while some zones are in force, and the rounds over the ground of each group.

    Attributes:
        weights: float64 (height, width), read-only: how many times the age of a point counts.
        classes: The distinct weights of the patrolled points, ascending.
        wanted: For each class, the least age that a zone of it wants, s; None without such a zone.
        rounds: By group; empty where there are no rounds, or too many classes for them.
        speed: Of the robots, m/s.
    """

    weights: NDArray[np.float64]
    classes: tuple[float, ...]
    wanted: tuple[float | None, ...]
    rounds: Mapping[Classes, Round]
    speed: float

    def divide(self, robots: int) -> tuple[Group, ...]:
        """Divide robots between groups.

        Args:
            robots: How many, at least 1.

        Returns:
            The groups of the best division, by ascending weight; empty without rounds.
        """
        if not self.rounds:
            return ()
        return min(self._divisions(robots), key=lambda groups: (self._excess(groups), self.cost_s(groups), len(groups)))

    def cost_s(self, groups: tuple[Group, ...]) -> float:
        """Return the greatest weight times the time between two robots of a division, s.

        Args:
            groups: The division.
        """
        return max(self.classes[group.classes[1]] * self._interval_s(group) for group in groups)

    def wish_kept(self, groups: tuple[Group, ...], number: int) -> bool:
        """Return True if the robots of a division come back to a class within its wanted age.

        Args:
            groups: The division.
            number: Of the class.
        """
        wanted = self.wanted[number]
        (group,) = (group for group in groups if group.classes[0] <= number <= group.classes[1])
        return wanted is None or self._interval_s(group) <= wanted

    def _interval_s(self, group: Group) -> float:
        return self.rounds[group.classes].length_m / (group.robots * self.speed)

    def _excess(self, groups: tuple[Group, ...]) -> float:
        """Return how many times too long the robots of a division take for the wish that is kept worst, at least 1."""
        excess = 1.0
        for group in groups:
            for wanted in self.wanted[group.classes[0] : group.classes[1] + 1]:
                if wanted is not None:
                    excess = max(excess, KEPT * self._interval_s(group) / wanted)
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
        facts = {"classes": self.classes, "wanted": self.wanted, "rounds": list(self.rounds), "speed": self.speed}
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
        return ZonedGround(weights, tuple(facts["classes"]), tuple(facts["wanted"]), rounds, facts["speed"])
