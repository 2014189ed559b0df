"""Builds the diagram of one environment, simulates a reach in it, and reads its ports."""

import numpy as np

import lic_drake as lic

scenario = lic.load_scenario("cylinder-clutter")
instance = scenario.sample_instance("training", 3)
start = lic.make_starts(scenario, instance).grid[10]
p_RG = np.array([0.6, 0.1, 0.0])  # The goal; the fixed base has R at W.

reach = lic.make_reach_diagram(scenario, instance)
context = reach.diagram.CreateDefaultContext()
reach.set_start(context, start.q, p_RG)
# Not Simulator(diagram): that would integrate the continuous plant by Runge-Kutta.
simulator = reach.make_simulator(context)
for time_s in np.arange(0.5, 4.1, 0.5):
    simulator.AdvanceTo(time_s)
    q = reach.diagram.GetOutputPort("arm_state").Eval(context)[:3]
    force = reach.diagram.GetOutputPort("taxel_force").Eval(context)
    distance = np.linalg.norm(scenario.arm().calc_pose(q).p_RE - p_RG)
    print(f"{time_s:.1f} s: {distance:.3f} m to go, largest taxel force {force.max():.2f} N")
