import numpy as np
import pytest

from patrol.ground.ways import lengths_along
from patrol.tours.round import Round
from patrol.tours.visits import Ground, Visit, longest_gaps_m, plan_visits

SIDE, ROW, VAULT = 21, 10, 0


def ground(due_m: float) -> tuple[Round, Ground]:
    """A round along the edge of a square of 20 m, 80 m long, and a place in its middle."""
    edge = [(0, col) for col in range(20)] + [(row, 20) for row in range(20)]
    edge += [(20, col) for col in range(20, 0, -1)] + [(row, 0) for row in range(20, 0, -1)]
    places = np.array([row * SIDE + col for row, col in edge])
    base = Round(80.0, places, np.arange(80.0), places, np.arange(80), places)
    middle = np.array([ROW * SIDE + 12])
    vault = Round(1.0, middle, np.zeros(1), middle, np.zeros(1, dtype=np.int64), middle)
    ways = lengths_along(np.ones((SIDE, SIDE), dtype=np.bool_), [(ROW, 12)], 2**30)[1:-1, 1:-1]
    return base, Ground(vault, (ways / 100.0).astype(np.float32), due_m)


@pytest.mark.parametrize(("robots", "due_m", "most_m"), [(1, 70.0, 125.0), (2, 35.0, 125.0), (2, 60.0, 100.0)])
def test_visits_are_few_and_as_close_as_due(robots: int, due_m: float, most_m: float) -> None:
    base, vault = ground(due_m)
    visits = plan_visits(base, {VAULT: vault}, robots)
    assert visits
    assert longest_gaps_m(base, [VAULT], robots, [visits])[0, 0] <= due_m
    assert base.length_m + sum(visit.length_m for visit in visits) <= most_m


@pytest.mark.filterwarnings("error")
def test_ground_without_a_visit_yet_is_never_come_by() -> None:
    base, _ = ground(35.0)
    gaps_m = longest_gaps_m(base, [VAULT, 1], 1, [[Visit(VAULT, 0, 10.0), Visit(VAULT, 40, 10.0)]])
    assert gaps_m.tolist() == [[50.0, np.inf]]


def test_a_visit_counts_in_its_middle_however_long_it_is() -> None:
    """Visits of 10 m and 30 m at 0 m and 40 m of a round of 80 m: their middles are at 5 m and 65 m of 120 m."""
    base, _ = ground(35.0)
    assert longest_gaps_m(base, [VAULT], 1, [[Visit(VAULT, 0, 10.0), Visit(VAULT, 40, 30.0)]]).tolist() == [[60.0]]
