"""The PR2 for tests: short scenarios, fixed balls in its way, and what its skin feels."""

import numpy as np

from lic_drake.clutter.instance import ClutterInstance, make_objects
from lic_drake.reach.diagram import ReachDiagram, make_reach_diagram
from lic_drake.reach.scenario import load_scenario
from lic_drake.robots.pr2 import pr2_arm

SCENARIO = load_scenario("sphere-aperture-clutter")


ARM = pr2_arm()


def spheres(*centres: np.ndarray, radius: float = 0.05, movable: bool = False) -> ClutterInstance:
    p_WO = np.reshape(centres, (-1, 3))
    return make_objects("sphere", [radius], p_WO, mass=0.1, movable=movable)


def felt(clutter: ClutterInstance, q: np.ndarray) -> tuple[ReachDiagram, np.ndarray]:
    """A diagram with the arm at rest at q, and what the taxels read there."""
    made = make_reach_diagram(SCENARIO, clutter)
    context = made.diagram.CreateDefaultContext()
    made.set_start(context, q, np.zeros(3))
    return made, np.array(made.diagram.GetOutputPort("taxel_force").Eval(context))
