"""`HapticMpcController`: the model predictive controller as a Drake system."""

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from lic_drake.control.mpc import HapticMpc, MpcConfig, MpcInput
from lic_drake.control.taxels import TaxelLayout
from lic_drake.robots.arm import Arm


class HapticMpcController(LeafSystem):
    """Moves the arm's equilibrium angles so that the tip approaches the goal with low forces.

    Input ports:
        arm_state: [q, v] of the arm, size 2 m, rad and rad/s.
        taxel_force: Normal force on each taxel, size num_taxels, N, compression positive.
        goal: p_RG, size 3, metres.
    Output port:
        desired_state: [q_d, 0], size 2 m, rad and rad/s, held between control steps: its state.
    """

    def __init__(self, arm: Arm, layout: TaxelLayout, config: MpcConfig) -> None:
        super().__init__()
        self._arm, self._layout = arm, layout
        self._mpc = HapticMpc(config, arm.stiffness, arm.q_min, arm.q_max)
        self._arm_state = self.DeclareVectorInputPort("arm_state", 2 * arm.num_joints)
        self._taxel_force = self.DeclareVectorInputPort("taxel_force", layout.num_taxels)
        self._goal = self.DeclareVectorInputPort("goal", 3)
        desired = self.DeclareDiscreteState(2 * arm.num_joints)
        self._desired = int(desired)
        self.DeclareStateOutputPort("desired_state", desired)
        self.DeclarePeriodicDiscreteUpdateEvent(config.period_s, 0.0, self._update)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        m = self._arm.num_joints
        q = np.asarray(self._arm_state.Eval(context))[:m]
        taxel_force = np.asarray(self._taxel_force.Eval(context))
        held = context.get_discrete_state(self._desired).value()[:m]
        q_d = self._mpc.pull_back(q, held)

        (loaded,) = (taxel_force > self._mpc.config.force_trim_N).nonzero()
        pose = self._arm.calc_pose(q)
        links = self._layout.link[loaded]
        turn = pose.R_RL[links]
        p_RC = pose.p_RL[links] + np.vecdot(turn, self._layout.p_LT[loaded, None])
        state = MpcInput(
            q=q,
            q_d=q_d,
            p_EG=np.asarray(self._goal.Eval(context)) - pose.p_RE,
            Jv_E=pose.Jv_E,
            normals=np.vecdot(turn, self._layout.n_L[loaded, None]),
            forces=taxel_force[loaded],
            Jv_C=self._arm.point_jacobians(pose, links, p_RC),
        )
        desired = np.zeros(2 * m)
        desired[:m] = q_d + self._mpc.step(state)
        discrete_state.set_value(self._desired, desired)
