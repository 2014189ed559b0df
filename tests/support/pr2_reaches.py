"""The PR2 for tests: short scenarios, fixed balls in its way, and what its skin feels."""

import numpy as np

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.diagram import ReachDiagram, make_reach_diagram
from lic_drake.reach.scenario import Scenario, load_scenario
from lic_drake.robots.pr2 import Pr2Arm

SCENARIO = load_scenario("sphere-aperture-clutter")


def pr2_of(scenario: Scenario) -> Pr2Arm:
    arm = scenario.arm()
    assert isinstance(arm, Pr2Arm)
    return arm


ARM = pr2_of(SCENARIO)


def spheres(*centres: np.ndarray, radius: float = 0.05, movable: bool = False) -> ClutterInstance:
    n = len(centres)
    return ClutterInstance(
        category="test",
        shape=("sphere",) * n,
        size=np.tile([radius, 0.0, 0.0], (n, 1)),
        p_WO=np.reshape(centres, (n, 3)),
        yaw=np.zeros(n),
        mass=np.full(n, 0.1),
        movable=np.full(n, movable),
    )


def felt(clutter: ClutterInstance, q: np.ndarray) -> tuple[ReachDiagram, np.ndarray]:
    """A diagram with the arm at rest at q, and what the taxels read there."""
    made = make_reach_diagram(SCENARIO, clutter)
    context = made.diagram.CreateDefaultContext()
    made.set_start(context, q, np.zeros(3))
    return made, np.array(made.diagram.GetOutputPort("taxel_force").Eval(context))
