import numpy as np
import pytest
from support.reaches import start_angles, start_context
from support.worlds import box, cylinder, make_clutter

from lic_drake.control.taxels import planar_taxels
from lic_drake.reach.diagram import ReachDiagram, make_reach_diagram
from lic_drake.reach.scenario import load_scenario

SCENARIO = load_scenario("cylinder-clutter")
CLUTTER = make_clutter(
    cylinder(0.5, 0.3, movable=True), cylinder(0.6, -0.2), box(0.7, 0.1, (0.1, 0.1, 0.2))
)
P_WG = np.array([0.6, 0.1, 0.0])


@pytest.fixture(scope="module")
def reach_diagram() -> ReachDiagram:
    return make_reach_diagram(SCENARIO, CLUTTER)


def test_the_exported_ports_have_the_documented_names_and_sizes(
    reach_diagram: ReachDiagram,
) -> None:
    diagram = reach_diagram.diagram
    inputs = [diagram.get_input_port(i) for i in range(diagram.num_input_ports())]
    outputs = [diagram.get_output_port(i) for i in range(diagram.num_output_ports())]
    num_taxels = planar_taxels(SCENARIO.arm().skin, SCENARIO.arm().link_names).num_taxels
    assert {port.get_name(): port.size() for port in inputs} == {"goal": 3}
    assert {port.get_name(): port.size() for port in outputs} == {
        "arm_state": 6,
        "clutter_state": 4,
        "taxel_force": num_taxels,
        "desired_state": 6,
    }


def test_all_systems_run(reach_diagram: ReachDiagram) -> None:
    # An input that was left unconnected would raise in the first steps.
    context = start_context(reach_diagram, start_angles(SCENARIO), P_WG)
    simulator = reach_diagram.make_simulator(context)
    # As the project's: Drake's own would be Runge-Kutta with other steps.
    assert simulator.get_integrator().get_target_accuracy() == SCENARIO.scene.cenic_accuracy
    assert simulator.get_integrator().get_maximum_step_size() == pytest.approx(0.01)
    simulator.AdvanceTo(0.1)
    for port in ("arm_state", "clutter_state", "taxel_force", "desired_state"):
        assert np.all(np.isfinite(reach_diagram.diagram.GetOutputPort(port).Eval(context)))


def test_the_arm_rests_at_the_start_and_wants_to_stay_there(reach_diagram: ReachDiagram) -> None:
    q0 = start_angles(SCENARIO)
    context = start_context(reach_diagram, q0, P_WG)
    at_rest = np.append(q0, np.zeros(3))
    for port in ("arm_state", "desired_state"):
        np.testing.assert_array_equal(
            reach_diagram.diagram.GetOutputPort(port).Eval(context), at_rest
        )
    np.testing.assert_array_equal(
        reach_diagram.diagram.GetOutputPort("clutter_state").Eval(context), [0.5, 0.3, 0.0, 0.0]
    )
    goal = reach_diagram.controller.GetInputPort("goal")
    controller_context = reach_diagram.controller.GetMyContextFromRoot(context)
    np.testing.assert_array_equal(goal.Eval(controller_context), P_WG)
