"""Forces of stale points on a robot, and the direction that they give (paper, "direction decision methods").

Lengths are in points of 0.1 m, whatever the size of the grid's points: in metres the paper's constants give no usable
patrol.

Sums may be changed before: obstacles close by scale them (`FuzzySectors`), and other robots add to them (`repel`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray

from patrol.ground.terrain import Terrain
from patrol.kernels.elementary import arctan2, exp, power
from patrol.pose import TAU, Pose, wrap
from patrol.radio.peers import Peer, places_of
from patrol.scenario import PotentialFieldOptions

PAPER_POINT = 0.1
"""Side in m of the paper's points; alpha, beta and l refer to it."""

PAPER_AREA = 100.0 * 88.0 / 5.0
"""Patrolled ground per robot, m2, to which `reach: area` refers: the terrain `open` with five robots."""

REMEMBERED = 16
"""Tables of f by age that are kept: those of one tick, unless more robots than so many believe in different fogs."""

OLDEST = 65534
"""Greatest age in ticks that forces tell from others, as for dilatation (`agent.kernels.dilate`): points that are older
pull alike, and no table grows with a count of ticks that another robot or a wrong epoch has moved by weeks."""

FloatArray = NDArray[np.float64]


def reach_scale(reach: str, area: float) -> float:
    """Return the factor by which the law of attraction reaches farther than the paper's: 1 or more.

    The paper's beta makes g4 fall to 1/e within 6.3 m, which suits its ground. Where each robot has more ground, all
    that is stale may lie too far away to differ in its pull. So `area` stretches all lengths by the root of the ratio
    of ``area`` (patrolled ground per robot, m2) to `PAPER_AREA`.
    """
    return max(1.0, math.sqrt(area / PAPER_AREA)) if reach == "area" else 1.0


def fow_force(name: str, fow: FloatArray, alpha: float) -> FloatArray:
    """Return f1 to f5 (paper, Table 1) for a fog of war from 0 to 1."""
    match name:
        case "f1":
            return fow
        case "f2":
            return fow**2
        case "f3":
            return exp(alpha * fow)
        case "f4":
            return exp(alpha * fow**2)
        case "f5":
            return exp(alpha * power(fow, 4.0))
        case _:
            raise ValueError(f"no function {name}")


def distance_force(name: str, length: FloatArray, beta: float, size: float) -> FloatArray:
    """Return g1 to g5 (paper, Table 1) for path lengths above 0, in points of 0.1 m; ``size`` is their l."""
    match name:
        case "g1":
            return 1.0 / length
        case "g2":
            return 1.0 / length**2
        case "g3":
            return exp(-size * length / beta)
        case "g4":
            return exp(-(length**2) / beta)
        case "g5":
            return exp(-power(length, 4.0) / (beta * size**2))
        case _:
            raise ValueError(f"no function {name}")


@lru_cache(maxsize=REMEMBERED)
def pull_by_age(name: str, alpha: float, mfow: int) -> FloatArray:
    """Return f by age up to ``mfow`` ticks, read-only; robots that believe in the same fog share the table."""
    return _read_only(fow_force(name, np.arange(mfow + 1, dtype=np.float64) / max(mfow, 1), alpha))


def _read_only(table: FloatArray) -> FloatArray:
    table.flags.writeable = False
    return table


class ForceLaw:
    """f and g as tables, and the horizon beyond which no point can change a decision.

    With N points, those farther than L add at most N f(1) g(L) to the force. They are left out once that is below
    ``tolerance`` times what nearer points exert. With f3 to f5, where even a fresh point exerts f(0) = 1, this bounds L
    before the fog is known. g1 and g2 fall so slowly that in practice nothing is left out.
    """

    def __init__(self, options: PotentialFieldOptions, point: float, points: int, longest: int, team: int = 1) -> None:
        """Tabulate g up to ``longest`` hundredths of a point; ``team`` counts with `reach: area` only."""
        self._options = options
        self._points = points
        unit = point / PAPER_POINT / 100.0 / reach_scale(options.reach, points * point * point / team)
        lengths = np.arange(1, longest + 1, dtype=np.float64) * unit
        decay = distance_force(options.distance, lengths, options.beta, options.length)
        # By length in hundredths of a point; 0 at length 0, because the robot's own point exerts no force.
        self.decay = np.concatenate([[0.0], decay])
        self._rising = -decay
        self.limit = longest  # length of the longest path that can matter, in hundredths of a point
        fresh, stale = fow_force(options.fow, np.array([0.0, 1.0]), options.alpha)
        self.limit = self.horizon(float(fresh) * float(decay[min(141, longest) - 1]), float(stale))
        self.decay = self.decay[: self.limit + 1].copy()
        self._rising = self._rising[: self.limit]

    def pull(self, mfow: int) -> FloatArray:
        """Return f by age up to ``mfow`` ticks, at most `OLDEST`, read-only."""
        return pull_by_age(self._options.fow, self._options.alpha, min(mfow, OLDEST))

    def horizon(self, exerted: float, stalest: float) -> int:
        """Return the longest path that can still matter, in hundredths of a point.

        ``exerted`` is the sum of the moduli of the forces known so far, ``stalest`` the largest value of f.
        """
        threshold = self._options.tolerance * exerted / (self._points * stalest) if stalest > 0.0 else math.inf
        return min(self.limit, int(self._rising.searchsorted(-threshold)) + 1)


def sector_table(sectors: int, reach: int) -> NDArray[np.uint16]:
    """Return the sector of every bearing, by offset in rows and columns from -``reach`` to ``reach`` points.

    The indices are the offsets plus ``reach``. Sector s is centred on the bearing s * 2 pi / sectors; a bearing on the
    border belongs to the later sector.
    """
    up, across = np.mgrid[-reach : reach + 1, -reach : reach + 1].astype(np.float64)
    table: NDArray[np.uint16] = (np.floor(arctan2(up, across) / (TAU / sectors) + 0.5) % sectors).astype(np.uint16)
    return table


def bearings_by_force(sums: NDArray[np.float64]) -> list[float]:
    """Mode method: return the bisectors of the sectors that exert force, rad, strongest first.

    Of equally strong sectors the lowest comes first.
    """
    forces = sums.tolist()
    order = sorted(range(len(forces)), key=forces.__getitem__, reverse=True)
    bearings = bisectors(len(forces))
    return [bearings[sector] for sector in order if forces[sector] > 0.0]


@cache
def bisectors(sectors: int) -> tuple[float, ...]:
    """Return the bearings on which the sectors are centred, rad."""
    return tuple(wrap(sector * TAU / sectors) for sector in range(sectors))


def bearings_by_vector(x: float, y: float, turns: int) -> list[float]:
    """Vector-sum method: return the bearing of the sum, then alternatives turned ever further to either side, rad.

    The alternatives are for a robot that cannot move in the direction of the sum. With them there are ``turns``
    bearings, and none when the sum is zero.
    """
    if x == 0.0 and y == 0.0:
        return []
    bearing = math.atan2(y, x)
    sides = (((index + 1) // 2) * (1 if index % 2 else -1) for index in range(turns))
    return [wrap(bearing + side * TAU / turns) for side in sides]


class FuzzySectors:
    """Obstacle avoidance inspired by fuzzy logic (paper, c_x): sectors with an obstacle close by count less.

    Scales each sector's sum by min(1, R_c / R_0), R_c being the distance to the closest obstacle in the sector, and R_0
    the given distance, m.

    Distances run from the centre of the robot's point to the centres of obstacle points. Everything beyond the terrain
    is an obstacle.
    """

    def __init__(self, terrain: Terrain, sectors: int, distance: float) -> None:
        reach = math.ceil(distance / terrain.point)
        self._distance = distance
        self._reach = reach
        self._blocked = np.pad(terrain.blocked, reach, constant_values=1)
        offsets = np.arange(-reach, reach + 1)
        away = terrain.point * np.hypot(offsets[:, None], offsets[None, :])
        near = away < distance
        near[reach, reach] = False
        self._near = np.flatnonzero(near)
        self._away = away.reshape(-1)[self._near]
        self._sector = sector_table(sectors, reach).reshape(-1)[self._near]
        self._sectors = sectors

    def coefficients(self, row: int, col: int) -> NDArray[np.float64]:
        """Return c_x of every sector, in [0, 1], at a robot's point of the terrain."""
        side = 2 * self._reach + 1
        blocked = self._blocked[row : row + side, col : col + side].reshape(-1)[self._near] != 0
        closest = np.full(self._sectors, self._distance)
        np.minimum.at(closest, self._sector[blocked], self._away[blocked])
        return closest / self._distance


def repel(sums: NDArray[np.float64], pose: Pose, peers: Mapping[int, Peer], options: PotentialFieldOptions) -> None:
    """Add repulsive forces from the peers to the sums of a `Pull`, in place.

    Each peer pushes straight away with ``repulsion`` times the sum of all attraction, times exp(-(d /
    repulsion_reach)^2). The paper gives no formula; this one is relative to the attraction, whatever its scale.
    """
    as_vector = options.direction == "vector"
    total = float(sums[2] if as_vector else sums.sum())
    for x, y in places_of(peers).tolist():
        across, up = pose.x - x, pose.y - y
        distance = math.hypot(across, up)
        if distance == 0.0:
            continue
        force = options.repulsion * total * math.exp(-((distance / options.repulsion_reach) ** 2))
        if as_vector:
            sums[0] += force * across / distance
            sums[1] += force * up / distance
        else:
            sums[round(math.atan2(up, across) / (TAU / sums.size)) % sums.size] += force
