"""The rivals of our kernels: their results agree with ours where they are installed."""

import numpy as np
import pytest

from bench.ours import Dilatation, WholeWave
from bench.rivals import WAVES, Disagreement, agreement, checked_wave, dilatation_rival, version_of
from patrol.ground.terrain import BoolGrid

START = (30, 40)


def field() -> BoolGrid:
    is_open = np.ones((60, 80), dtype=np.bool_)
    is_open[[0, -1], :] = is_open[:, [0, -1]] = False
    is_open[20:22, 5:60] = False
    is_open[40:, 50] = False
    return is_open


@pytest.mark.parametrize("name", WAVES)
def test_a_rival_finds_the_lengths_that_we_find(name: str) -> None:
    if not version_of(WAVES[name].package):
        pytest.skip(f"{WAVES[name].package} is not installed: make rivals")
    _, says = checked_wave(name, field(), START)
    assert says.startswith("lengths ")


def test_what_scikit_image_keeps_can_be_used_again() -> None:
    module = pytest.importorskip("skimage.graph")
    is_open, other = field(), (10, 10)
    costs = np.where(is_open, 1.0, -1.0)
    kept = module.MCP_Geometric(costs, fully_connected=True)
    for start in (START, START, other, START):
        lengths = module.MCP_Geometric(costs, fully_connected=True).find_costs([start])[0]
        assert np.array_equal(kept.find_costs([start])[0], lengths)
    call = WAVES["scikit-image, MCP_Geometric"].begin(module, is_open, START)
    first = call().copy()
    assert np.array_equal(call(), first)


def test_our_wave_knows_the_lengths_on_open_ground_and_what_no_path_reaches() -> None:
    is_open = field()
    is_open[50:55, 10:15] = False
    is_open[51:54, 11:14] = True  # a closed room
    lengths = WholeWave(is_open, START).lengths()
    assert lengths[START] == 0.0
    assert lengths[33, 44] == pytest.approx(3 * 1.41 + 1.0)
    assert np.isinf(lengths[52, 12])
    assert np.isinf(lengths[20, 30])


def test_a_rival_that_is_not_installed_has_no_version() -> None:
    assert version_of("no-such-library-as-this") == ""
    assert version_of("numpy") == np.__version__


def test_lengths_that_differ_beyond_the_definitions_are_no_rival() -> None:
    rival = WAVES["tcod, dijkstra2d"]
    ours = np.array([[0.0, 10.0, 200.0, np.inf]])
    assert agreement("r", rival, ours, ours) == "lengths equal"
    assert agreement("r", rival, ours, np.array([[0.0, 10.0, 199.0, 7.0]])) == "lengths within 0.5 %"
    for wrong in (210.0, 100.0, np.nan, np.inf):
        with pytest.raises(Disagreement, match="1 of 3 lengths differ from ours beyond reason"):
            agreement("r", rival, ours, np.array([[0.0, 10.0, wrong, np.inf]]))


@pytest.mark.parametrize("walls", [False, True])
def test_scipy_dilates_as_we_do(walls: bool) -> None:
    pytest.importorskip("scipy")
    is_open = np.ones((40, 50), dtype=np.bool_)
    if walls:
        is_open[20, 5:45] = False
        is_open[:, 30] = False
    seen = np.random.default_rng(1).integers(0, 90, is_open.shape).astype(np.int32)
    ours = Dilatation(seen, is_open, 6, 100)
    ours.run()
    call = dilatation_rival(seen, is_open, 6, 100)
    assert np.array_equal(ours.dilated[is_open], call()[is_open])
    assert not np.array_equal(ours.dilated, seen)
