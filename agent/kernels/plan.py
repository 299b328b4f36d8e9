"""Kernels of the common plan: ages of points, and routes of all robots to all stations, improved by small moves."""

from __future__ import annotations

import math

import numpy as np
from numba import njit, types

int64 = types.int64
float64 = types.float64
POINTS = types.Array(types.int64, 1, "C", readonly=True)
PATROLLED = types.Array(types.boolean, 2, "C", readonly=True)
TICKS = types.Array(types.int32, 2, "C", readonly=True)
WEIGHTS = types.Array(types.float64, 1, "C", readonly=True)
AGES = types.Array(types.float64, 1, "C")
WITNESSES = types.Array(types.int64, 2, "C")
uint64 = index = types.uint64
"""Also for indices: unsigned, so that numba skips the negative-index check."""


@njit(types.void(POINTS, PATROLLED, TICKS, WEIGHTS, int64, float64, AGES), cache=True, nogil=True)
def weighted_ages(points, patrolled, last_seen, weights, tick, step, ages):
    """Find how long ago some points were last seen, times their weights.

    For example, at tick 10 with steps of 0.5 s, a point of weight 2 that was last seen at tick 4 gives 6 s.

    Args:
        points: int64 (n,), their flat indices.
        patrolled: bool (h, w), the points that have an age.
        last_seen: int32 (h, w), when each was last seen.
        weights: float64 (n,), of each; (0,) where all count the same.
        tick: Now.
        step: Length of a tick, s.
        ages: float64 (n,), overwritten: s.
    """
    # Flat, since a division for each point would take longer than all the rest.
    has_age, seen = patrolled.ravel(), last_seen.ravel()
    for i in range(points.size):
        point = index(points[i])
        ages[i] = 0.0
        if has_age[point]:
            ages[i] = (tick - max(int64(seen[point]), 0)) * step
            if weights.size:
                ages[i] *= weights[i]


@njit(types.void(POINTS, POINTS, PATROLLED, TICKS, int64, float64, WITNESSES, AGES), cache=True, nogil=True)
def oldest_ages(points, begins, patrolled, last_seen, tick, step, witnesses, ages):
    """Find how long ago the oldest point of each station was last seen.

    For example, at tick 20 with steps of 0.5 s, a station whose points were last seen at 8, 12 and 19 has the age 6 s.

    Each station has a witness, a point that is as old as any of it. As long as it has not been seen again, it still is,
    since points only become fresher; so the others are not looked at.

    Args:
        points: int64 (n,), flat indices, station by station.
        begins: int64 (s + 1,), where the points of each station begin, and where the last ones end.
        patrolled: bool (h, w), the points that have an age; the same ones as when the witnesses were found.
        last_seen: int32 (h, w), when each point was last seen; never less than when the witnesses were found.
        tick: Now.
        step: Length of a tick, s.
        witnesses: int64 (s, 2), kept from call to call: each station's witness and when it was seen; the witness is -1
            at first, and for a station without a point that has an age.
        ages: float64 (s,), overwritten: s, 0 for a station without a point that has an age.
    """
    has_age, seen = patrolled.ravel(), last_seen.ravel()
    for station in range(begins.size - 1):
        point, since = witnesses[station]
        if point < 0 or max(int64(seen[index(point)]), 0) != since:
            # The tick itself gives the age 0, for a station without a point that counts.
            point, since = -1, tick
            for i in range(begins[station], begins[station + 1]):
                seen_at = max(int64(seen[index(points[i])]), 0)
                if has_age[index(points[i])] and (point < 0 or seen_at < since):
                    point, since = points[i], seen_at
            witnesses[station, 0], witnesses[station, 1] = point, since
        ages[station] = (tick - since) * step


PLACES = types.Array(types.float64, 2, "C", readonly=True)
WAYS = types.Array(types.float64, 2, "C")


@njit(types.void(PLACES, POINTS, PLACES, PLACES, float64, WAYS), cache=True, nogil=True)
def guess_ways(places, seen_from, spots, apart, longest, ways):
    """Find about how long the way from each of some places to each station is.

    That is the mean of the way by the station from which a place is seen and of the shortest way that there could be.

    Args:
        places: float64 (n, 2), x and y in m.
        seen_from: int64 (n,), the station from which each place is seen; below 0 for the nearest one.
        spots: float64 (stations, 2), x and y of each in m.
        apart: float64 (stations, stations), how long the way from each to each is, m.
        longest: Longest way that counts, m.
        ways: float64 (n, stations), overwritten: m.
    """
    away = np.empty(spots.shape[0])
    for i in range(places.shape[0]):
        nearest = 0
        for k in range(spots.shape[0]):
            across, up = spots[k, 0] - places[i, 0], spots[k, 1] - places[i, 1]
            away[k] = math.sqrt(across * across + up * up)
            nearest = k if away[k] < away[nearest] else nearest
        # By the triangle inequality the true way lies between the difference and the sum of the two ways.
        station = seen_from[i] if seen_from[i] >= 0 else nearest
        first = away[station]
        for k in range(spots.shape[0]):
            around = min(apart[station, k] + first, longest)
            ways[i, k] = 0.5 * (around + max(away[k], apart[station, k] - first))


ROUTES = types.Array(types.int64, 2, "C")
COUNTS = types.Array(types.int64, 1, "C")
NUMBERS = types.Array(types.int64, 1, "C", readonly=True)
NEAR = types.Array(types.int64, 2, "C", readonly=True)
ROW = types.Array(types.float64, 1, "C", readonly=True)
TIMES = types.Array(types.float64, 2, "C", readonly=True)
INPUTS = (TIMES, TIMES, ROW, ROW, ROW, NEAR)
TIMED = types.Tuple(INPUTS[:5])  # type: ignore[no-untyped-call]
PINNED = types.Array(types.boolean, 1, "C", readonly=True)
PLANS = types.Array(types.int64, 3, "C")
PLAN_COUNTS = types.Array(types.int64, 2, "C")
COSTS = types.Array(types.float64, 1, "C")
NOTED = types.Array(types.float64, 2, "C")
STATE = types.Array(types.uint64, 1, "C")

LONGEST_MOVE = 3
"""Stations that one move puts elsewhere, at most."""


@njit(int64(STATE, int64), cache=True, nogil=True)
def _draw_below(state, limit):
    """Draw an integer from 0 to limit - 1 (splitmix64)."""
    # All constants are uint64: together with an int64, numba would make a float of it.
    state[0] += np.uint64(0x9E3779B97F4A7C15)
    z = state[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z ^= z >> np.uint64(31)
    # The upper half, scaled to the range: faster than a division.
    return np.int64(z >> np.uint64(32)) * limit >> 32


@njit(float64(ROUTES, int64, COUNTS, int64, int64, TIMED, NOTED, NOTED), cache=True, nogil=True)
def _cost(routes, robot, tail, since, count, timed, costs, arrivals):
    """Return the cost of a robot's route with another tail, `tail[since:count]`.

    That is the sum of the eighth powers of the stations' ages when the robot visits them.
    """
    leads, apart, paces, ages, rates = timed
    cost, arrival = costs[robot, since], arrivals[robot, since]
    before = routes[robot, max(since - 1, 0)]
    for k in range(since, count):
        here = tail[k]
        # The first leg begins at the robot and not at a station.
        arrival = leads[robot, here] if k == 0 else arrival + apart[before, here] * paces[robot]
        age = ages[here] + rates[here] * arrival
        square = age * age
        fourth = square * square
        cost += fourth * fourth  # the oldest stations count most, and do not count alone
        before = here
    return cost


@njit(types.void(ROUTES, int64, COUNTS, int64, int64, TIMED, NOTED, NOTED, COUNTS, COUNTS), cache=True, nogil=True)
def _note(routes, robot, tail, since, count, timed, costs, arrivals, owner, position):
    """Give a robot's route another tail, as of `_cost`; note whose its stations are, and what they cost up to each."""
    leads, apart, paces, ages, rates = timed
    for k in range(since, count):
        here = tail[k]
        routes[robot, k] = here
        owner[here], position[here] = robot, k
        arrival = (
            leads[robot, here] if k == 0 else arrivals[robot, k] + apart[routes[robot, k - 1], here] * paces[robot]
        )
        age = ages[here] + rates[here] * arrival
        square = age * age
        fourth = square * square
        costs[robot, k + 1], arrivals[robot, k + 1] = costs[robot, k] + fourth * fourth, arrival


@njit(float64(ROUTES, COUNTS, PINNED, *INPUTS, int64, STATE), cache=True, nogil=True)
def _improve(routes, counts, pinned, leads, apart, paces, ages, rates, near, moves, state):
    """Change routes in place by random small moves, each of which is kept if the plan costs no more; return its cost.

    A move puts up to three stations of a route beside a near one, reverses a stretch of one route, or swaps the ends of
    two routes. The first station of a pinned route stays.
    """
    robots, size = routes.shape[0], ages.size
    owner, position = np.zeros(size, np.int64), np.zeros(size, np.int64)
    # Of as many of a route's first stations as the index says: their cost, and when the last is visited.
    costs, arrivals = np.zeros((robots, size + 1)), np.zeros((robots, size + 1))
    timed = leads, apart, paces, ages, rates
    for r in range(robots):
        _note(routes, r, routes[r], 0, counts[r], timed, costs, arrivals, owner, position)
    # What a move puts behind the stations that stay, at the places where it would stand.
    first, second = np.zeros(size, np.int64), np.zeros(size, np.int64)
    for _ in range(moves):
        station = _draw_below(state, size)
        near_station = near[station, _draw_below(state, near.shape[1])]
        r, q, i, j = owner[station], owner[near_station], position[station], position[near_station]
        kind = _draw_below(state, 4)
        first_free, least_other = np.int64(pinned[r]), np.int64(pinned[q])  # the first places that may change
        first_count, second_count, first_since = 0, counts[q], 0
        if kind < 2:  # put stations from u on behind v
            count = min(1 + _draw_below(state, LONGEST_MOVE), counts[r] - i)
            # A run of stations cannot be put behind one of its own.
            if i < first_free or (r == q and i <= j < i + count):
                continue
            turned = _draw_below(state, 2) == 1
            second_since = block = j + 1
            if r != q:
                first_since, first_count, second_count = i, counts[r] - count, counts[q] + count
                for k in range(i, first_count):
                    first[k] = routes[r, k + count]
                for k in range(j + 1, counts[q]):
                    second[k + count] = routes[q, k]
            elif j < i:
                for k in range(j + 1, i):
                    second[k + count] = routes[r, k]
                for k in range(i + count, counts[r]):
                    second[k] = routes[r, k]
            else:
                second_since, block = i, j + 1 - count
                for k in range(i, block):
                    second[k] = routes[r, k + count]
                for k in range(j + 1, counts[r]):
                    second[k] = routes[r, k]
            for k in range(count):
                second[block + k] = routes[r, i + (count - 1 - k if turned else k)]
        elif r == q:  # reverse
            # Kind 2 leaves the earlier of the two where it is, kind 3 turns it as well.
            low, high = min(i, j) + (kind == 2), max(i, j)
            second_since = low = max(low, first_free)
            if high <= low:
                continue
            for k in range(low, counts[r]):
                second[k] = routes[r, low + high - k if k <= high else k]
        else:  # v follows u, and what followed u follows what came before v
            second_since = j = max(j, least_other)
            first_since = i + 1
            first_count, second_count = first_since + counts[q] - j, j + counts[r] - first_since
            for k in range(first_since, first_count):
                first[k] = routes[q, k - first_since + j]
            for k in range(j, second_count):
                second[k] = routes[r, k - j + first_since]
        if second_count == 0 or (r != q and first_count == 0):
            continue  # a robot without a route would get none again
        cost_before = costs[q, counts[q]]
        cost_after = _cost(routes, q, second, second_since, second_count, timed, costs, arrivals)
        if r != q:
            cost_before += costs[r, counts[r]]
            cost_after += _cost(routes, r, first, first_since, first_count, timed, costs, arrivals)
        # A plan of the same cost is taken too: it may lead on to better ones.
        if cost_after > cost_before:
            continue
        counts[q] = second_count
        _note(routes, q, second, second_since, second_count, timed, costs, arrivals, owner, position)
        if r != q:
            counts[r] = first_count
            _note(routes, r, first, first_since, first_count, timed, costs, arrivals, owner, position)
    total = 0.0
    for r in range(robots):
        total += costs[r, counts[r]]
    return total


@njit(types.void(ROUTES, COUNTS, PINNED, *INPUTS, int64, uint64), cache=True, nogil=True)
def improve(routes, counts, pinned, leads, apart, paces, ages, rates, near, moves, seed):
    """Improve a plan.

    Args:
        routes: int64 (robots, stations), the stations that each robot visits in order; changed in place.
        counts: int64 (robots,), how many these are; each station is in one route. Changed in place.
        pinned: bool (robots,), whether the first station of each route stays.
        leads: float64 (robots, stations), time until each robot could be at each station, s.
        apart: float64 (stations, stations), length of the way from each station to each, m.
        paces: float64 (robots,), time that each robot takes for a metre, s.
        ages: float64 (stations,), weighted age of each station now, s.
        rates: float64 (stations,), by how much that grows in a second.
        near: int64 (stations, n), the nearest stations of each.
        moves: How many moves are tried.
        seed: Of the draws.
    """
    state = np.array([seed], dtype=np.uint64)
    _improve(routes, counts, pinned, leads, apart, paces, ages, rates, near, moves, state)


@njit(
    types.void(ROUTES, COUNTS, PINNED, int64, NUMBERS, *INPUTS, int64, uint64, PLANS, PLAN_COUNTS, COSTS),
    cache=True,
    nogil=True,
)
def compare(
    routes,
    counts,
    pinned,
    robot,
    choices,
    leads,
    apart,
    paces,
    ages,
    rates,
    near,
    moves,
    seed,
    plans,
    plan_counts,
    costs,
):
    """Find for each of some stations the plan in which one robot visits it first.

    Args:
        routes: As for `improve`; not changed.
        counts: Likewise.
        pinned: As for `improve`; the robot's own first station stays as well.
        robot: Row of the robot.
        choices: int64 (n,), the stations.
        leads: As for `improve`.
        apart: As for `improve`.
        paces: As for `improve`.
        ages: As for `improve`.
        rates: As for `improve`.
        near: As for `improve`.
        moves: How many moves are tried for each.
        seed: Of the draws, which are the same for each.
        plans: int64 (n, robots, stations), overwritten: the routes.
        plan_counts: int64 (n, robots), overwritten.
        costs: float64 (n,), overwritten: the plan's cost, the eighth root of the sum of powers of ages, s.
    """
    stays = pinned.copy()
    stays[robot] = True
    for c in range(choices.size):
        for r in range(counts.size):
            count = 0
            for i in range(counts[r]):
                # Taken out of whichever route it is in, and put first in the robot's own below.
                if routes[r, i] != choices[c]:
                    plans[c, r, count] = routes[r, i]
                    count += 1
            plan_counts[c, r] = count
        route_length = plan_counts[c, robot]
        # From the end, so that no station is overwritten before it has moved.
        for i in range(route_length, 0, -1):
            plans[c, robot, i] = plans[c, robot, i - 1]
        plans[c, robot, 0] = choices[c]
        plan_counts[c, robot] = route_length + 1
        # The same draws for each choice, so that costs differ by the choice and not by luck.
        state = np.array([seed], dtype=np.uint64)
        cost = _improve(plans[c], plan_counts[c], stays, leads, apart, paces, ages, rates, near, moves, state)
        costs[c] = math.sqrt(math.sqrt(math.sqrt(cost)))
