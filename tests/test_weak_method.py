import gc
import weakref

import numpy as np
import pytest
from pydrake.solvers import MathematicalProgram

from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.starts import make_starts
from lic_drake.robots.planar import planar_arm
from lic_drake.select.planar_program import PlanarProgram
from lic_drake.select.pointing_program import PointingProgram
from lic_drake.weak_method import weakly


class Owner:
    """Holds a program that calls it."""

    def __init__(self, weak: bool) -> None:
        self.program = MathematicalProgram()
        x = self.program.NewContinuousVariables(1)
        self.program.AddCost(weakly(self.cost) if weak else self.cost, x)

    def cost(self, x: np.ndarray) -> object:
        return (x[0] - 1.0) ** 2


@pytest.mark.parametrize("weak", [True, False])
def test_an_object_dies_unless_its_own_program_holds_its_method(weak: bool) -> None:
    owner = Owner(weak)
    (cost,) = owner.program.GetAllCosts()
    assert owner.program.EvalBinding(cost, np.array([3.0]))[0] == 4.0
    reference = weakref.ref(owner)
    del owner
    gc.collect()
    assert (reference() is None) == weak


def test_programs_of_selections_die_with_the_robot_in_them() -> None:
    scenario = load_scenario("sphere-aperture-clutter")
    starts = make_starts(scenario, scenario.sample_instance("evaluation", 0))
    program = PointingProgram(starts)
    in_space, robot = weakref.ref(program), weakref.ref(starts.checker)
    in_plane = weakref.ref(PlanarProgram(planar_arm().kinematics))
    del starts, program
    gc.collect()
    assert in_space() is None and robot() is None and in_plane() is None
