"""A robot's knowledge of a graph: visits to its vertices, its own and those of others, and where others are going.

All of it comes from positions. A robot visits a vertex when it is within a tolerance of it, or passes by so close from
one position to the next.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.graph import Graph

if TYPE_CHECKING:
    from agent.view import View

LATE_TICKS = 2
"""Ticks between two positions of a robot up to which it is taken to have come straight from one to the other."""

LEFT = 0.1
"""Share of an edge after which a robot is taken to be on its way along it."""


@dataclass(slots=True)
class Other:
    """Another robot on the graph."""

    place: tuple[float, float]  # where it was heard last, x and y in m
    tick: int  # when it was heard there
    at: int  # the vertex that it visited last; the nearest one before its first visit
    aim: int | None = None  # the neighbour of `at` that it is going to; None where that cannot be told


@dataclass(slots=True)
class Known:
    """The knowledge of one robot; arrays have one value for each vertex."""

    graph: Graph  # at places that the robot can reach
    tolerance: float  # distance from a vertex within which it is visited, m
    step: float  # length of a tick, s
    number: int  # the robot's
    team: int  # number of robots that patrol from the start
    at: int = -1  # the vertex that the robot visited last; the nearest one before its first visit
    place: tuple[float, float] | None = None  # where the robot is, x and y in m
    now_s: float = 0.0  # since tick 0
    visited_s: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))  # last visit by any robot; 0 at first
    own_s: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))  # the same of this robot alone
    found_s: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))  # idleness at its last arrival
    ended_s: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))  # summed idleness that visits ended
    visits: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))  # by all robots
    visitor: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))  # last robot; 0 for none
    others: dict[int, Other] = field(default_factory=dict)  # those that are heard, by number
    draw: Callable[[int], float] = lambda _: 0.0  # a random number in [0, 1) for a question 0, 1, ... of this tick
    _inside: dict[int, frozenset[int]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("visited_s", "own_s", "found_s", "ended_s", "visits", "visitor"):
            if not (array := getattr(self, name)).size:
                setattr(self, name, np.zeros(self.graph.size, dtype=array.dtype))

    @property
    def idleness(self) -> NDArray[np.float64]:
        """float64 (v,), time since the last visit of each vertex, s."""
        return self.now_s - self.visited_s

    @property
    def own_idleness(self) -> NDArray[np.float64]:
        """float64 (v,), the same by this robot's own visits, s."""
        return self.now_s - self.own_s

    @property
    def mean_idleness(self) -> NDArray[np.float64]:
        """float64 (v,), mean idleness that visits ended at each vertex, as if it were visited now as well, s."""
        return (self.ended_s + self.idleness) / (self.visits + 1)

    @property
    def neighbours(self) -> list[int]:
        """The neighbours of where the robot is, in the graph's order; itself where it has none."""
        return [neighbour for neighbour, _ in self.graph.edges[self.at]] or [self.at]

    @property
    def reached(self) -> list[int]:
        """The vertices that a way leads to, but for the one where the robot is."""
        lengths = self.graph.lengths[self.at]
        return [vertex for vertex in range(self.graph.size) if vertex != self.at and lengths[vertex] < np.inf]

    @property
    def aims(self) -> dict[int, int]:
        """The vertices that others are going to, by robot number."""
        return {number: rival.aim for number, rival in self.others.items() if rival.aim is not None}

    def length(self, neighbour: int) -> float:
        """Return the length of the edge to a neighbour, m."""
        return float(self.graph.lengths[self.at, neighbour])

    def pick(self, candidates: list[int], scores: list[float]) -> int:
        """Return the candidate with the greatest score; one of them at random where several have it."""
        best = max(scores)
        equal = [vertex for vertex, score in zip(candidates, scores, strict=True) if score == best]
        return equal[int(self.draw(0) * len(equal))]

    def look(self, view: View) -> list[int]:
        """Take note of this tick's positions, and return the vertices that the robot itself visits."""
        self.now_s = view.time_s
        self.draw = view.draw
        here = view.reported.x, view.reported.y
        if self.at < 0:
            self.at = self.graph.nearest(*here)
        visited = self.graph.within(self.place or here, here, self.tolerance)
        self.place = here
        for vertex in visited:
            self.arrive(vertex)
        self._note_stay(self.number, here, visited)
        for number, peer in sorted(view.peers.items()):
            self._hear_robot(number, (peer.pose.x, peer.pose.y), peer.tick)
        for number in [number for number in self.others if number not in view.peers]:
            del self.others[number]
        return visited

    def arrive(self, vertex: int) -> None:
        """Take note that the robot itself visits a vertex."""
        if vertex not in self._inside.get(self.number, ()):
            self.found_s[vertex] = self.now_s - self.visited_s[vertex]
        self._note_visit(self.number, vertex, self.now_s)
        self.own_s[vertex] = self.now_s
        self.at = vertex

    def _note_visit(self, number: int, vertex: int, time_s: float) -> None:
        """Take note that a robot is at a vertex; one that stays there visits it once."""
        if vertex not in self._inside.get(number, ()):
            self.visits[vertex] += 1
            self.ended_s[vertex] += max(time_s - self.visited_s[vertex], 0.0)
        self.visited_s[vertex] = max(self.visited_s[vertex], time_s)
        self.visitor[vertex] = number

    def _note_stay(self, number: int, place: tuple[float, float], visited: list[int]) -> None:
        """Take note of the vertices that a robot has not left again."""
        places = self.graph.places
        self._inside[number] = frozenset(v for v in visited if math.dist(places[v], place) <= self.tolerance)

    def _hear_robot(self, number: int, place: tuple[float, float], tick: int) -> None:
        rival = self.others.get(number)
        if rival is None:
            rival = self.others[number] = Other(place, tick, self.graph.nearest(*place))
        elif tick <= rival.tick:
            return
        begin = rival.place if tick - rival.tick <= LATE_TICKS else place
        visited = self.graph.within(begin, place, self.tolerance)
        for vertex in visited:
            self._note_visit(number, vertex, tick * self.step)
            rival.at = vertex
        self._note_stay(number, place, visited)
        rival.place, rival.tick = place, tick
        rival.aim = self._aim_of(rival)

    def _aim_of(self, other: Other) -> int | None:
        """Return the neighbour that a robot goes to, with the least detour over its place; None before it leaves."""
        best, shortest = None, math.inf
        away = math.dist(other.place, self.graph.places[other.at])
        for neighbour, length in self.graph.edges[other.at]:
            if away < max(LEFT * length, self.tolerance):
                continue
            straight = math.dist(self.graph.places[other.at], self.graph.places[neighbour])
            detour = away + math.dist(other.place, self.graph.places[neighbour]) - straight
            if detour < shortest:
                best, shortest = neighbour, detour
        return best
