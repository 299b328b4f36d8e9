"""The constants that the documentation states are those of the code.

A constant that is changed without its page fails here, whatever other tests notice.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from agent.bodies import differential, manoeuvre, standoff
from agent.learned import network, observation
from agent.policies import charging, choice, commitment, forces, living, potential_field, pursuit, stochastic
from agent.policies.common_plan import drawing, following, missed, others
from agent.policies.common_plan import robots as planned_robots
from agent.policies.common_plan import stations as known_stations
from experiments.intruders import game, predictors
from experiments.intruders.infiltrator import Infiltrator
from fogwatch.planning import plan
from monitor.page import saved
from monitor.page.authorisation import MIN_TOKEN_LENGTH
from monitor.page.hub import TRAIL
from patrol import areas
from patrol.closures.spec import MOST_CLOSURES
from patrol.measures import nodes, stays, zoned
from patrol.radio import message
from patrol.regions.pieces import MOST_CORNERS, POCKET, SMOOTHED
from patrol.scenario import step
from patrol.tours import search
from patrol.tours.round import STRETCH
from ros2.robot import steering, stops
from runtime.net.settings import MOST_STRANGERS
from runtime.process.deadline import DECISION_LIMIT_S, MOST_CALLS
from runtime.reporting import metrics
from worldsim.checks import bodies, progress
from worldsim.output.traffic import MOST_ROBOTS
from worldsim.radio.rules import LEAST_BUCKET

DOCS = Path(__file__).parents[2] / "docs"
NUMBER = r"(\d(?:[\d,]*\d)?(?:\.\d+)?)"

INTRUDER = Infiltrator()

STATED: list[tuple[str, str, tuple[float, ...]]] = [
    # --- agent -------------------------------------------------------------------------------------------------------
    ("algorithm", "the greatest a^2 / (L + # m)", (choice.NEAR_M,)),
    ("algorithm", "come no nearer for # s (# s while less than a", (pursuit.NO_NEARER_S, pursuit.AT_HAND_S)),
    ("algorithm", "leaves out that place for # s", (pursuit.LEFT_OUT_S,)),
    ("algorithm", "twice as long each further time, up to # s", (pursuit.LONGEST_S,)),
    ("algorithm", "stay in free choices, at # % of ticks", (100.0 * commitment.RANDOM_MOVE,)),
    ("algorithm", "less than # sensor ranges along it from the first one (`STRETCH`)", (STRETCH,)),
    ("algorithm", "at # of their own speed (`PACE`)", (planned_robots.PACE,)),
    ("algorithm", "lost or late is more than # (`LOSSY`", (living.LOSSY,)),
    ("algorithm", "is heard for # s (`QUIET_S`)", (living.QUIET_S,)),
    ("algorithm", "that takes # s (`LEAST_S`)", (living.LEAST_S,)),
    ("algorithm", "up to # near ones (`CHOICES`)", (drawing.CHOICES,)),
    ("algorithm", "older than # (`STALE`)", (drawing.STALE,)),
    ("algorithm", "by # small moves (`MOVES`)", (drawing.MOVES,)),
    ("algorithm", "by # for each station (`MOVES_FIRST`)", (drawing.MOVES_FIRST,)),
    ("algorithm", "**Spread**: # (`SPREAD`)", (drawing.SPREAD,)),
    ("algorithm", "more than # robots (`FEW`)", (drawing.FEW,)),
    ("algorithm", "up to # of the time between two robots (`LATE`)", (others.LATE,)),
    ("algorithm", "for # of it or more (`FREE`)", (following.FREE,)),
    ("algorithm", "after # times that time (`OVERDUE`)", (missed.OVERDUE,)),
    ("algorithm", "After # s (`PERIOD_S`)", (drawing.PERIOD_S,)),
    ("algorithm", "for # of the time between two robots (`SPELL`)", (drawing.SPELL,)),
    ("algorithm", "after # s (`UNHEARD_S`)", (living.UNHEARD_S,)),
    ("algorithm", "stood still for # s (`STUCK_S`)", (living.STUCK_S,)),
    ("algorithm", "Every # s (`HOUR_S`)", (following.HOUR_S,)),
    ("algorithm", "at # ticks a tick (`CATCH_UP`)", (following.CATCH_UP,)),
    ("algorithm", "At most # neighbours (`MOST_TOGETHER`)", (known_stations.MOST_TOGETHER,)),
    ("algorithm", "with fewer than # stations for each (`LEAST_STATIONS`,", (stochastic.LEAST_STATIONS,)),
    ("algorithm", "shorter than # sensor ranges for each (`SHORT`)", (stochastic.SHORT,)),
    ("algorithm", "shorter than # (`SHORT_DENSE`)", (stochastic.SHORT_DENSE,)),
    ("algorithm", "more than # stations in each range (`DENSE`)", (stochastic.DENSE,)),
    ("algorithm", "shorter than # (`LONG`)", (stochastic.LONG,)),
    ("zones", "count # times as much as that (`MARGIN`)", (stochastic.MARGIN,)),
    ("algorithm", "by # small moves each time (`MOVES_BEST`)", (drawing.MOVES_BEST,)),
    ("algorithm", "anew after # s (`PERIOD_BEST_S`)", (drawing.PERIOD_BEST_S,)),
    ("algorithm", "at least # stations for each (`LEAST_BEST`)", (stochastic.LEAST_BEST,)),
    ("algorithm", "of about # stations at most (`STATIONS_TOGETHER`)", (known_stations.STATIONS_TOGETHER,)),
    ("algorithm", "more than # stations (`MOST_PLANNED`)", (stochastic.MOST_PLANNED,)),
    ("algorithm", "(a tour of more than # places)", (search.MOST_PLACES,)),
    ("algorithm", "Reverse costs # times forward", (manoeuvre.REVERSE,)),
    ("algorithm", "reverse costs it # times forward (`REVERSE_BLIND`)", (manoeuvre.REVERSE_BLIND,)),
    ("algorithm", "(# times for a car that", (manoeuvre.REVERSE_BLIND,)),
    ("algorithm", "a change of gear # turning radii", (manoeuvre.GEAR_CHANGE,)),
    ("algorithm", "After # poses it drives", (manoeuvre.MOST_NODES,)),
    ("algorithm", "off by a tenth of a stride or # rad", (manoeuvre.ASKEW,)),
    ("algorithm", "/ # m2)), A being", (forces.PAPER_AREA,)),
    ("algorithm", "in points of # m, whatever", (forces.PAPER_POINT,)),
    ("algorithm", "longest of #, # and # s", step.STEPS),
    ("algorithm", "drives farther than # of its body's", (step.STRIDE_SHARE,)),
    ("algorithm", "those within # s of each other add up", (standoff.CALM_S,)),
    ("algorithm", "an obstacle for # to # s", standoff.GIVES_WAY_S),
    ("algorithm", "after # s of bumps it gives way as well", (standoff.STILL_S,)),
    ("algorithm", "block each other again within # s", (standoff.AGAIN_S,)),
    ("algorithm", "*back off*: for up to # s", (standoff.BACKS_OFF_S,)),
    ("algorithm", "a misalignment of up to # rad", (differential.ASKEW,)),
    ("algorithm", "drives, # of it each step", (differential.GENTLY,)),
    ("algorithm", "outline of more than # corners", (MOST_CORNERS,)),
    ("energy", "is # times what the way there needs", (charging.DETOUR,)),
    ("energy", "is within # s, it charges up to # of", (charging.PASSING_S, charging.EARLY)),
    ("energy", "no robot has stood for # s", (charging.STOOD_S,)),
    ("energy", "where another has # of the capacity more", (charging.WORTH,)),
    ("environments", "seconds since then / #, at most 1", (observation.HEARD_S,)),
    ("environments", "come no nearer to it for # s", (network.NO_NEARER_S,)),
    # --- figures and checks ------------------------------------------------------------------------------------------
    ("progress", "for # s or longer, the robot stayed", (stays.TRAPPED_S,)),
    ("progress", "more than # moves a minute", (bodies.BUMPS_A_MINUTE,)),
    ("progress", "not been seen for more than half of the run; or for more than # s", (progress.SHORTEST_S,)),
    ("progress", "until the stay has lasted # s", (stays.TRAPPED_S,)),
    ("progress", "need a run of at least # s", (progress.SHORTEST_S,)),
    ("progress", "none with more than # places", (search.MOST_PLACES,)),
    ("run-folder", "came within # m of one of a lower number", (nodes.CLOSE_M,)),
    ("run-folder", "each robot at most once in # s", (nodes.AGAIN_S,)),
    ("run-folder", "for fleets of at most # robots", (MOST_ROBOTS,)),
    ("faults", "seen again within # x the mean MFoW", (progress.WITHIN,)),
    ("faults", "second's worth, at least # bytes", (LEAST_BUCKET,)),
    # --- limits ------------------------------------------------------------------------------------------------------
    ("closures", "at most #, with # times each", (MOST_CLOSURES, areas.MOST_TIMES)),
    ("network", "A frame has at most # bytes", (message.MAX_FRAME,)),
    ("network", "token of at least # characters", (MIN_TOKEN_LENGTH,)),
    ("operations", "At most # connections are served", (metrics.MOST_CONNECTIONS,)),
    ("operations", "for at most # s each", (metrics.LIMIT_S,)),
    ("page", "Of more than # ticks it leaves some out", (saved.MOST_FRAMES,)),
    ("page", "trail (# ticks)", (TRAIL,)),
    ("policies", "takes longer than # s of wall time", (DECISION_LIMIT_S,)),
    ("policies", "nests calls more than # deep", (MOST_CALLS,)),
    ("security", "While # strangers' connections", (MOST_STRANGERS,)),
    # --- ROS 2 -------------------------------------------------------------------------------------------------------
    ("ros2", "its odometry has said for # s that it stands", (stops.STANDS_S,)),
    ("ros2", "After # s it answers that it", (stops.LIMIT_S,)),
    ("ros2", "zero velocity, # ms apart", (1000.0 * steering.ZEROS_S,)),
    ("ros2", "Nav2 confirms, for # s", (steering.CONFIRM_S,)),
    # --- studies -----------------------------------------------------------------------------------------------------
    ("plan", "at least # s and twice the wanted age", (plan.LEAST_S,)),
    ("rivals", "at least # m inside", (INTRUDER.depth_m,)),
    ("rivals", "stay there for # s", (INTRUDER.stay_s,)),
    ("rivals", "that end within # s", (INTRUDER.within_s,)),
    ("rivals", "its stay is over. # such attempts", (INTRUDER.attempts,)),
    ("rivals", "for # s, of each robot", (predictors.FOLLOWED_S,)),
    ("rivals", "after the # moments at which one was nearest", (predictors.ANALOGS,)),
    ("rivals", "nearest to its place, now and # s before", (predictors.LAG_S,)),
    ("rivals", "told apart by # s up to # s", (predictors.AGE_BIN_S, predictors.AGE_BIN_S * predictors.AGE_BINS)),
    ("rivals", "it expects # of the sightings", (game.BETTER,)),
]
"""A page, its words with # for each number, and the numbers in the code."""

SPELT: list[tuple[str, str, float, float]] = [
    ("algorithm", "counts a tenth (option `separation`)", choice.OTHERS, 0.1),
    ("algorithm", "fallen below half of what it was", pursuit.STILL_STALE, 0.5),
    ("algorithm", "straight for at least five radii", differential.STRAIGHT_RADII, 5.0),
    ("algorithm", "shorter by five turning radii", manoeuvre.AHEAD, 5.0),
    ("algorithm", "or within half a stride of the place", manoeuvre.NEAR, 0.5),
    ("algorithm", "off by a tenth of a stride", manoeuvre.OFF_COURSE, 0.1),
    ("algorithm", "it has bumped twice", standoff.AGAIN, 2),
    ("algorithm", "three bumps or dead ends", standoff.OFTEN, 3),
    ("algorithm", "at least half as strongly as the strongest", potential_field.CLOSE_ENOUGH, 0.5),
    ("algorithm", "differ from it by at most 1.5 points", SMOOTHED, 1.5),
    ("algorithm", "pockets of wall at most a point wide", POCKET, 1.0),
    ("progress", "and at least five in the run", bodies.LEAST_BUMPS, 5),
    ("progress", "more than eight times the MFoW on the best tour", progress.STALE_TOURS, 8.0),
    ("progress", "of four times the MFoW on the best tour", progress.TOURS, 4.0),
    ("progress", "saw at most a tenth more points", progress.NEW_SHARE, 0.1),
    ("progress", "one circle of four times the sum of its radius and its stride", stays.ROAMING, 4.0),
    ("zones", "more than four weights", zoned.MOST_TOURS, 4),
    ("plan", "A run lasts twelve times the age", plan.INTERVALS, 12.0),
    ("ros2", "five times zero velocity", steering.LASTING_ZEROS, 5),
]
"""A page, words that state a number, the number in the code, and what the words mean."""


def text_of(page: str) -> str:
    """A page's text, with every run of blanks and line ends as one blank."""
    return " ".join((DOCS / f"{page}.md").read_text(encoding="utf-8").split())


@pytest.mark.parametrize(("page", "words", "values"), STATED, ids=lambda value: value if isinstance(value, str) else "")
def test_a_stated_constant_is_that_of_the_code(page: str, words: str, values: tuple[float, ...]) -> None:
    found = re.findall(re.escape(words).replace(r"\#", NUMBER), text_of(page))
    assert len(found) == 1, "the page has these words once; correct the row if it was written anew"
    numbers = [found[0]] if isinstance(found[0], str) else list(found[0])
    assert [float(number.replace(",", "")) for number in numbers] == pytest.approx(list(values), rel=1e-12)


@pytest.mark.parametrize(("page", "words", "value", "means"), SPELT)
def test_a_constant_in_words_is_that_of_the_code(page: str, words: str, value: float, means: float) -> None:
    assert words in text_of(page), "the page has these words; correct the row if it was written anew"
    assert value == means
