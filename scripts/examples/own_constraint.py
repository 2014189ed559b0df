"""Adds a constraint and a cost to the optimisation over the PR2's base, torso and arm."""

import numpy as np

import lic_drake as lic

library = lic.ExperienceLibrary(lic.shipped_library("sphere-aperture-clutter"))
scenario = library.scenario()
selector = lic.make_selector("knn", library.columns())
starts = lic.make_starts(scenario, scenario.sample_instance("evaluation", 0))
p_WG = scenario.sample_goal("evaluation", 0)
situation = lic.Situation(p_WG=p_WG, starts=starts)

free = selector.solve(selector.program(situation))

program = selector.program(situation)  # An ordinary MathematicalProgram.
x, y, torso = program.b0
free_y = free.start.b0[1]
program.AddConstraint(y <= free_y - 0.2)  # A wall that the robot does not know of.
program.AddCost(0.1 * (torso - scenario.task.b0[2]) ** 2)  # Lifting takes time.
bound = selector.solve(program)

for name, chosen in (("free", free), ("bound", bound)):
    print(f"{name}: b0 {np.round(chosen.start.b0, 3)}, estimated {chosen.probability:.2f}")
assert bound.start.b0[1] <= free_y - 0.2 + 1e-6
