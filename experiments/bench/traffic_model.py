"""A model of a fleet's messages: how many a router delivers, what that costs it, and when one is not enough.

Every robot sends one position frame a tick. *Everybody* hears everybody, so deliveries grow with the square of the
fleet. Where robots hear only those *near* them, they grow with the fleet alone, as long as its density stays the same.
Ground is taken as a square, and robots as spread evenly over it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class RouterCost:
    """What one delivery costs a router.

    Attributes:
        core_s: Processor time, s.
        wire_bytes: Bytes on the wire, frame and all headers, the sender's share included.
    """

    core_s: float
    wire_bytes: float


@dataclass(frozen=True, slots=True)
class Fleet:
    """A fleet as far as its messages go.

    Attributes:
        robots: How many.
        rate: Frames that each sends, 1/s.
        density: Robots per m2.
    """

    robots: int
    rate: float
    density: float

    @property
    def side(self) -> float:
        """Of its ground, m."""
        return math.sqrt(self.robots / self.density)

    def heard(self, reach: float = math.inf) -> float:
        """How many others a robot hears, away from the border of the ground.

        Args:
            reach: From how far it hears, m.
        """
        others = float(self.robots - 1)
        return others if math.isinf(reach) else min(others, self.density * math.pi * reach * reach)

    def deliveries(self, reach: float = math.inf) -> float:
        """Messages that are delivered, 1/s.

        Args:
            reach: From how far robots hear, m.
        """
        return self.robots * self.heard(reach) * self.rate


def cores_needed(fleet: Fleet, cost: RouterCost, reach: float = math.inf) -> float:
    """How many cores of routers a fleet's deliveries take.

    Args:
        fleet: The fleet.
        cost: Of a delivery.
        reach: From how far robots hear, m.
    """
    return fleet.deliveries(reach) * cost.core_s


def largest_fleet(rate: float, cost: RouterCost, share: float) -> int:
    """The largest fleet in which everybody hears everybody that one router carries.

    Args:
        rate: Frames that each robot sends, 1/s.
        cost: Of a delivery.
        share: Of a core, or the number of cores, that the router may use.
    """
    pairs = share / (rate * cost.core_s)
    return math.floor(0.5 + math.sqrt(0.25 + pairs))


@dataclass(frozen=True, slots=True)
class Regions:
    """Routers that each serve a square region, and pass on what robots near its border send.

    Attributes:
        count: How many routers.
        robots: That each serves.
        foreign: Robots of other regions whose frames each takes in.
        core_share: Of a core that each needs.
    """

    count: int
    robots: float
    foreign: float
    core_share: float


def regions_of(fleet: Fleet, cost: RouterCost, reach: float, share: float) -> Regions:
    """The fewest equal square regions whose routers each stay within a share of a core.

    A router delivers to its robots what they hear, and passes the frames of those near the border on to its neighbours:
    a delivery each, counted where the frame is taken in.

    Args:
        fleet: The fleet.
        cost: Of a delivery.
        reach: From how far robots hear, m.
        share: Of a core that a router may use.

    Raises:
        ValueError: Not even a router for each robot stays within the share.
    """
    along = 1
    while True:
        side = fleet.side / along
        robots = fleet.robots / along**2
        around = min(side + 2.0 * reach, fleet.side) ** 2 - side**2
        foreign = 0.0 if along == 1 else fleet.density * around
        used = (robots * fleet.heard(reach) + foreign) * fleet.rate * cost.core_s
        if used <= share:
            return Regions(along**2, robots, foreign, used)
        if robots <= 1.0:
            raise ValueError(f"a router for each robot would still use {used:.3g} of a core")
        along += 1
