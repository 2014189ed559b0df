"""What is concluded from touch, against where the objects really are."""

import numpy as np
import pytest
from support.reaches import free_space, reach_request
from support.worlds import ARM, box, cylinder, make_clutter

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.control.taxels import make_taxels
from lic_drake.reach.environment import Environment
from lic_drake.reach.trace import ReachTrace
from lic_drake.select.felt import Felt, feel

SCENARIO = free_space(6.0)
X0 = reach_request(SCENARIO).start.x0
P_WG = np.array([0.7, 0.0, 0.0])
RADIUS = 0.01


def reach(
    instance: ClutterInstance, b0: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> ReachTrace:
    x0 = X0 + [*b0[:2], 0.0]
    return Environment(SCENARIO, instance, b0=np.array(b0)).reach(P_WG, x0).trace


def felt(*traces: ReachTrace, known: ClutterInstance | None = None) -> Felt:
    layout = make_taxels(ARM, SCENARIO.scene.taxels_per_m)
    return feel(traces, ARM, layout, RADIUS, known or make_clutter())


@pytest.mark.parametrize("base_y", [0.0, 0.1])
def test_what_does_not_yield_is_found_where_it_is(base_y: float) -> None:
    trace = reach(make_clutter(cylinder(0.52, -0.05)), (0.0, base_y, 0.0))
    found = felt(trace)
    np.testing.assert_allclose(found.still, [[0.52, -0.05]], atol=0.006)
    assert len(found.pushed) == 0
    assert felt(trace, trace).still.shape == (1, 2)


def test_what_yields_is_found_where_it_was_pushed_to() -> None:
    trace = reach(make_clutter(cylinder(0.52, -0.05, movable=True)))
    found = felt(trace)
    assert len(found.still) == 0 and trace.q_clutter is not None
    assert np.linalg.norm(trace.q_clutter[0] - [0.52, -0.05]) > 0.03
    np.testing.assert_allclose(found.pushed, trace.q_clutter, atol=0.015)
    # A later reach that touches nothing does not make it forgotten.
    np.testing.assert_array_equal(felt(trace, reach(make_clutter())).pushed, found.pushed)


def test_nothing_is_where_the_arm_was() -> None:
    trace = reach(make_clutter())
    found = felt(trace)
    assert len(found.still) == len(found.pushed) == 0
    tip, aside = trace.p_WE[-1][:2], np.array([0.5, 0.9])
    gaps = found.gaps(np.array([tip, trace.p_WE[len(trace.p_WE) // 2][:2], aside]))
    assert np.all(gaps[:2] < 0.0) and gaps[2] > 0.3


def test_what_is_known_is_not_taken_for_something_else() -> None:
    wall = box(0.52, -0.09, (0.06, 0.1, 0.2), yaw=0.6)
    trace = reach(make_clutter(wall))
    assert max(trace.peak_force) > 3.0
    assert len(felt(trace).still) > 0
    found = felt(trace, known=make_clutter(wall))
    assert len(found.still) == len(found.pushed) == 0
    elsewhere = felt(trace, known=make_clutter(box(0.52, 0.5, (0.06, 0.1, 0.2))))
    np.testing.assert_array_equal(elsewhere.still, felt(trace).still)
