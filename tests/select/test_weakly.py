import gc
import weakref

import numpy as np
import pytest
from pydrake.solvers import MathematicalProgram
from support.select_surfaces import random_model

from lic_drake.estimate.features import features_of
from lic_drake.reach.scenario import load_scenario
from lic_drake.select.objective import Objective
from lic_drake.select.program import LicProgram, weakly
from lic_drake.select.situation import Situation
from lic_drake.starts import make_starts


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


@pytest.mark.parametrize("category", ["cylinder-clutter", "sphere-aperture-clutter"])
def test_programs_of_selections_die_with_the_robot_in_them(category: str) -> None:
    scenario = load_scenario(category)
    starts = make_starts(scenario, scenario.sample_instance("evaluation", 0))
    situation = Situation(p_WG=np.zeros(3), starts=starts)
    features = features_of(category).first
    program = LicProgram(situation, Objective(model=random_model(0, features), p_WG=np.zeros(3)))
    references = [weakref.ref(program), weakref.ref(starts)]
    if starts.checker is not None:
        references.append(weakref.ref(starts.checker))
    del starts, situation, program
    gc.collect()
    assert all(reference() is None for reference in references)
