import numpy as np
from support.worlds import box, cylinder, make_clutter

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.diagram import ReachDiagram, make_reach_diagram
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.simulation import Simulation
from lic_drake.reach.sleeping.waking import set_fixed_objects

SCENARIO = load_scenario("cylinder-clutter")
HERE = make_clutter(cylinder(0.6, 0.3), box(0.5, -0.6, (0.3, 0.1, 0.2)), cylinder(0.3, 0.5))
THERE = make_clutter(box(0.35, 0.2, (0.2, 0.2, 0.2)), cylinder(0.2, -0.4), cylinder(0.7, 0.0))


def forces(made: ReachDiagram, furniture: ClutterInstance | None = None) -> np.ndarray:
    """The sum of the taxel forces in random configurations, N."""
    simulation = Simulation(made)
    context = simulation.context
    if furniture is not None:
        set_fixed_objects(simulation, furniture)
    arm, rng = SCENARIO.arm(), np.random.default_rng(1)
    total = []
    for q in rng.uniform(arm.q_min, arm.q_max, (60, 3)):
        made.set_start(context, q, np.zeros(3))
        total.append(np.sum(made.diagram.GetOutputPort("taxel_force").Eval(context)))
    return np.array(total)


def test_contacts_are_those_of_a_scene_that_was_built_so() -> None:
    here = make_reach_diagram(SCENARIO, HERE)
    expected = forces(make_reach_diagram(SCENARIO, THERE))
    assert np.count_nonzero(expected) > 5
    np.testing.assert_array_equal(forces(here, THERE), expected)
    assert not np.array_equal(forces(here), expected)  # Other contexts stay as they are.


def test_what_is_fixed_may_overlap() -> None:
    # Objects that are welded together are no contacts, which Drake's solver would not accept.
    overlapping = make_clutter(*(box(0.3, 0.02 * i, (0.1, 0.1, 0.1)) for i in range(3)))
    made = make_reach_diagram(SCENARIO, HERE)
    simulation = Simulation(made)
    set_fixed_objects(simulation, overlapping)
    context = simulation.context
    results = made.scene.plant.get_contact_results_output_port().Eval(
        made.scene.plant.GetMyContextFromRoot(context)
    )
    assert results.num_hydroelastic_contacts() == 0
