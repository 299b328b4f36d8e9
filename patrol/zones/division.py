"""Ground whose points count differently, and its rounds: one for each group of weights next to each other.

*Classes* are the distinct weights of the ground, ascending. A *group* is some classes next to each other, and has a
round over their ground. A *division* gives every class to one group and every robot to one group. The best division is
the one in which the greatest weight times the time between two robots is least:

    two classes, of weight 1 (a tour of 540 m) and 10 (60 m); both together take 560 m; 6 robots at 1 m/s
    one group:   10 * 560 / 6                 = 933
    two groups:  max(1 * 540 / 3, 10 * 60 / 3) = 200      three robots for each

Where a class has a wanted age, divisions that keep it go first. A group whose round is too long for a wanted age is
taken to come by that class more often than once a round (`patrol.tours.visits`). For example, two robots at 1 m/s on a
round of 172 m come by every 86 s. With a second visit of 20 m they come by every 96 s, and by what is visited every
48 s.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from heapq import heapify, heapreplace
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from patrol.ground.fields import load_grid
from patrol.tours.round import Round
from patrol.tours.visits import MOST_VISITS, Ground, longest_gaps_m, plan_visits

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


class GroupAges(NamedTuple):
    """The ages that a group keeps, or what is known of them before its visits are chosen."""

    is_chosen: bool  # True once the visits of its classes are chosen, or it has none
    ages_s: Mapping[int, float]  # by class, between two robots that come by it; lower bounds before visits are chosen
    visits: bool  # whether the round has visits


@dataclass(frozen=True, eq=False)
class ZonedGround:
    """The weights of a terrain's points while some zones are in force, and the rounds over the ground of each group."""

    weights: NDArray[np.float64]  # (height, width), read-only: how many times the age of a point counts
    classes: tuple[float, ...]  # the distinct weights of the patrolled points, ascending
    wanted: tuple[float | None, ...]  # by class, the least age that a zone of it wants, s; None without such a zone
    rounds: Mapping[Classes, Round]  # without visits; empty where there are none, or too many classes for them
    speed: float  # of the robots, m/s
    ways: Mapping[int, NDArray[np.float32]] = field(default_factory=dict)
    """By class that may be visited: length (m) of the way from each point to the nearest place of its round, or inf."""

    def save(self, folder: Path) -> None:
        """Write the arrays as .npy files and the rest as JSON into a folder, which is made when missing."""
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
        """Load what `save` wrote, memory-mapped and read-only."""
        facts = json.loads((folder / FACTS).read_text(encoding="utf-8"))
        rounds = {(first, last): Round.load(folder / f"{first}-{last}") for first, last in facts["rounds"]}
        weights = load_grid(folder / "weights.npy")
        ways = {number: load_grid(folder / f"ways-{number}.npy") for number in facts["ways"]}
        return ZonedGround(weights, tuple(facts["classes"]), tuple(facts["wanted"]), rounds, facts["speed"], ways)


class Divisions:
    """The divisions of robots over zoned ground, and what is known of their groups."""

    def __init__(self, zoned: ZonedGround, group_ages: dict[Group, GroupAges] | None = None) -> None:
        """Begin without any, or with those of ground that has the same rounds and wishes."""
        self.zoned = zoned
        self.group_ages = {} if group_ages is None else group_ages

    def best_s(self, robots: int) -> float | None:
        """Return `cost_s` of the best division of robots, at least 1; None without rounds."""
        groups = self.divide(robots)
        return self.cost_s(groups) if groups else None

    def divide(self, robots: int) -> tuple[Group, ...]:
        """Divide robots, at least 1, between groups: the best division by ascending weight, or none without rounds."""
        if not self.zoned.rounds:
            return ()
        ranked = [
            (self._rank_division(groups), number, groups) for number, groups in enumerate(self._list_divisions(robots))
        ]
        heapify(ranked)
        while True:
            # Visits take long to choose. They are chosen only in the division that may still be the best one.
            rank, number, groups = ranked[0]
            bounded = next((group for group in groups if not self._known_ages(group).is_chosen), None)
            if bounded is not None:
                self._ages_s(bounded)
            elif rank == self._rank_division(groups):
                return groups
            heapreplace(ranked, (self._rank_division(groups), number, groups))

    def _rank_division(self, groups: tuple[Group, ...]) -> tuple[float, float, int]:
        """Return what is least for the best division; a lower bound before all of its visits are chosen.

        It begins with how many times too long the robots take for the wish that is kept worst, at least 1.
        """
        all_ages = [self._known_ages(group) for group in groups]
        excess, cost_s = 1.0, 0.0
        for ages in all_ages:
            for number, age_s in ages.ages_s.items():
                cost_s = max(cost_s, self.zoned.classes[number] * age_s)
                if (wanted := self.zoned.wanted[number]) is not None:
                    excess = max(excess, age_s / wanted)
        return excess, (VISITS if any(ages.visits for ages in all_ages) else 1.0) * cost_s, len(groups)

    def cost_s(self, groups: tuple[Group, ...]) -> float:
        """Return the greatest weight times the time between two robots of a division, s."""
        return max(self.zoned.classes[number] * age_s for group in groups for number, age_s in self._ages_s(group))

    def wish_kept(self, groups: tuple[Group, ...], number: int) -> bool:
        """Return True if the robots of a division come back to a class within its wanted age."""
        wanted = self.zoned.wanted[number]
        return wanted is None or dict(pair for group in groups for pair in self._ages_s(group))[number] <= wanted

    def _ages_s(self, group: Group) -> Iterable[tuple[int, float]]:
        """Return for each class of a group the time between two robots that come by it, s."""
        if not self._known_ages(group).is_chosen:
            self.group_ages[group] = self._chosen_ages(group)
        return self.group_ages[group].ages_s.items()

    def _known_ages(self, group: Group) -> GroupAges:
        """Return the ages of a group, or bounds if it is to have visits that are not chosen yet."""
        if group not in self.group_ages:
            self.group_ages[group] = self._bounded_ages(group)
        return self.group_ages[group]

    def _bounded_ages(self, group: Group) -> GroupAges:
        """Return the ages on a group's round without visits, or else lower bounds with visits."""
        (first, last), speed = group.classes, group.robots * self.zoned.speed
        base, due_s = self._visited_round(group)
        ages_s = dict.fromkeys(range(first, last + 1), base.length_m / speed)
        if not due_s:
            return GroupAges(True, ages_s, visits=False)
        # At least one visit to ground that the round leaves out, and at most MOST_VISITS to any.
        unseen = {n for n in due_s if not np.isin(base.points, self.zoned.rounds[n, n].points).any()}
        visit_m = {
            n: 2.0 * float(self.zoned.ways[n].reshape(-1)[base.places].min()) + self.zoned.rounds[n, n].length_m
            for n in due_s
        }
        least_m = base.length_m + sum(visit_m[n] for n in unseen)
        ages_s = dict.fromkeys(range(first, last + 1), least_m / speed)
        for n in due_s:
            shown, others_m = (0, least_m - visit_m[n]) if n in unseen else (1, least_m)
            gaps_m = [(others_m + count * visit_m[n]) / (count + shown) for count in (1 - shown, MOST_VISITS)]
            ages_s[n] = min(gaps_m) / speed
        return GroupAges(False, ages_s, visits=True)

    def _visited_round(self, group: Group) -> tuple[Round, Mapping[int, float]]:
        """Return the round of a group before its visits, and by class to be visited how often they are due, s."""
        (first, last), full_round = group.classes, self.zoned.rounds[group.classes]
        round_s = full_round.length_m / (group.robots * self.zoned.speed)
        wishes = {
            n: wish
            for n in range(first, last + 1)
            if n in self.zoned.ways and (wish := self.zoned.wanted[n]) is not None
        }
        late = {n: wish / KEPT for n, wish in wishes.items() if first < last and round_s > wish / KEPT}
        while last in late and last > first:
            last -= 1  # visits alone show that class
        return self.zoned.rounds[first, last] if late else full_round, late

    def _chosen_ages(self, group: Group) -> GroupAges:
        base, due_s = self._visited_round(group)
        speed = group.robots * self.zoned.speed
        grounds = {
            n: Ground(self.zoned.rounds[n, n], self.zoned.ways[n], interval_s * self.zoned.speed)
            for n, interval_s in due_s.items()
        }
        visits = plan_visits(base, grounds, group.robots)
        length_m = base.length_m + sum(visit.length_m for visit in visits)
        gaps_s = longest_gaps_m(base, list(due_s), group.robots, [visits])[0] / self.zoned.speed
        ages_s = dict.fromkeys(range(group.classes[0], group.classes[1] + 1), length_m / speed)
        return GroupAges(True, ages_s | dict(zip(due_s, gaps_s.tolist(), strict=True)), visits=True)

    def _list_divisions(self, robots: int) -> Iterator[tuple[Group, ...]]:
        count = len(self.zoned.classes)
        for groups in range(1, min(count, robots) + 1):
            for cuts in combinations(range(1, count), groups - 1):
                firsts, ends = (0, *cuts), (*cuts, count)
                for marks in combinations(range(1, robots), groups - 1):
                    shares = np.diff((0, *marks, robots)).tolist()
                    yield tuple(
                        Group((first, end - 1), share) for first, end, share in zip(firsts, ends, shares, strict=True)
                    )
