"""Puts a controller of one's own into the reach diagram and compares it with the MPC."""

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

import lic_drake as lic

SPEED_M_PER_S = 0.05


class Yielding(LeafSystem):
    """Goes straight for the goal; while a taxel feels too much, lets go of what pushes there."""

    def __init__(self, arm, layout, config) -> None:
        super().__init__()
        self.arm, self.config = arm, config
        self.arm_state = self.DeclareVectorInputPort("arm_state", 2 * arm.num_joints)
        self.taxel_force = self.DeclareVectorInputPort("taxel_force", layout.num_taxels)
        self.goal = self.DeclareVectorInputPort("goal", 3)
        desired_state = self.DeclareDiscreteState(2 * arm.num_joints)
        self.DeclareStateOutputPort("desired_state", desired_state)
        self.DeclarePeriodicDiscreteUpdateEvent(config.period_s, 0.0, self._update)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        q = self.arm_state.Eval(context)[: self.arm.num_joints]
        q_d = context.get_discrete_state_vector().value()[: self.arm.num_joints]
        if self.taxel_force.Eval(context).max() > self.config.force_threshold_N:
            q_d = q_d + 0.5 * (q - q_d)  # The nearer to where the arm is, the less it pushes.
        else:
            pose = self.arm.calc_pose(q)
            p_EG = self.goal.Eval(context) - pose.p_RE
            step = SPEED_M_PER_S * self.config.period_s * p_EG / max(np.linalg.norm(p_EG), 0.02)
            q_d = q_d + np.linalg.pinv(pose.Jv_E, rcond=1e-2) @ step
        discrete_state.set_value(np.append(q_d, np.zeros_like(q_d)))


scenario = lic.load_scenario("cylinder-clutter")
instance = scenario.sample_instance("training", 3)
start = lic.make_starts(scenario, instance).grid[10]
p_RG = np.array([0.6, 0.1, 0.0])  # The goal; the fixed base has R at W.

for name, options in (("MPC", {}), ("Yielding", {"controller": Yielding})):
    reach = lic.make_reach_diagram(scenario, instance, **options)
    context = reach.diagram.CreateDefaultContext()
    reach.set_start(context, start.q, p_RG)
    simulator, largest_N = reach.make_simulator(context), 0.0
    for time_s in np.arange(0.05, 6.0, 0.05):
        simulator.AdvanceTo(time_s)
        force = reach.diagram.GetOutputPort("taxel_force").Eval(context)
        largest_N = max(largest_N, force.max())
    q = reach.diagram.GetOutputPort("arm_state").Eval(context)[:3]
    distance_m = np.linalg.norm(scenario.arm().calc_pose(q).p_RE - p_RG)
    print(f"{name}: {distance_m:.3f} m to go, largest taxel force {largest_N:.1f} N")
