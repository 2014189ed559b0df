"""A reach under way in MuJoCo.

Sensor maths, controller and stop rules are those of the package; only the physics is MuJoCo's.
"""

import mujoco
import numpy as np

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.control.mpc_controller import HapticMpcController
from lic_drake.control.tactile_sensor import ContactPatch, calc_taxel_forces
from lic_drake.control.taxels import make_taxels
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.simulation import Simulation
from lic_drake.reach.trace import SceneState
from lic_drake.types import Vector
from scripts.mujoco.mujoco_scene import MujocoConfig, make_mujoco_scene


class MujocoSimulation(Simulation):
    """The arm and the clutter of one environment; replaces whatever is Drake's."""

    def __init__(self, scenario: Scenario, instance: ClutterInstance, config: MujocoConfig) -> None:
        self._arm = scenario.arm()
        scene = make_mujoco_scene(self._arm, instance, scenario.scene, config)
        self.model, self._link_of = scene.model, scene.link_of
        self.data = mujoco.MjData(self.model)
        self._joints = slice(0, len(self._arm.q_min))
        self._layout = make_taxels(self._arm, scenario.scene.taxels_per_m)
        self._controller = HapticMpcController(self._arm, self._layout, scenario.mpc)

    def begin(self, q: Vector, p_RG: Vector) -> None:
        """Puts the arm at rest at q and every object where the environment has it."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[self._joints] = q
        self.data.ctrl[:] = q
        self._context = self._controller.CreateDefaultContext()
        self._context.SetDiscreteState(np.append(q, np.zeros_like(q)))
        self._controller.GetInputPort("goal").FixValue(self._context, p_RG)
        self.sense()

    def is_in_collision(self) -> bool:
        """Returns whether anything is in contact."""
        return bool(np.any(self.data.contact.dist < 0.0))

    def advance_to(self, time_s: float) -> None:
        """Makes the control update of this instant and simulates up to a time."""
        steps = round((time_s - self.data.time) / self.model.opt.timestep)
        if steps > 0:
            self._control()
            self.step(steps)
            self._taxel_force = None

    def joint_angles(self) -> Vector:
        """Returns the arm's q, shape (m,), radians."""
        return self.data.qpos[self._joints].copy()

    def taxel_force(self) -> Vector:
        """Returns the sensor's reading, shape (num_taxels,), N."""
        if self._taxel_force is None:
            self.sense()
        return self._taxel_force

    def state(self) -> SceneState:
        """Returns the state of the arm and of the movable objects."""
        q, v, m = self.data.qpos, self.data.qvel, self._joints.stop
        return SceneState(q[:m].copy(), v[:m].copy(), q[m:].reshape(-1, 2), v[m:].reshape(-1, 2))

    def wake_near(self, q: Vector) -> None:
        """Does nothing: MuJoCo wakes objects by itself."""

    def step(self, steps: int) -> None:
        """Simulates some steps with the servos' present targets."""
        # What depends on positions and velocities is known from `sense`.
        mujoco.mj_step2(self.model, self.data)
        if steps > 1:
            mujoco.mj_step(self.model, self.data, steps - 1)

    def sense(self) -> None:
        """Solves the contacts of this instant and reads the taxels."""
        mujoco.mj_forward(self.model, self.data)
        patches = self._read_patches()
        if patches:
            pose = self._arm.calc_pose(self.joint_angles())
            self._taxel_force = calc_taxel_forces(self._layout, pose.R_RL, pose.p_RL, patches)
        else:
            self._taxel_force = np.zeros(self._layout.num_taxels)

    def _read_patches(self) -> list[ContactPatch]:
        """Returns the contacts of the skin: the normal force of the link on the object."""
        patches = []
        wrench = np.zeros(6)
        contacts = self.data.contact
        for i, geoms in enumerate(contacts.geom):
            links = self._link_of[geoms]
            if links.max() < 0:
                continue
            mujoco.mj_contactForce(self.model, self.data, i, wrench)
            if wrench[0] > 0.0:
                # The contact's x axis points from the first geometry to the second.
                sign = 1.0 if links[0] >= 0 else -1.0
                normal = sign * contacts.frame[i, :3]
                patches.append(
                    ContactPatch(
                        link=int(links.max()),
                        p_RQ=contacts.pos[i][None].copy(),
                        n_R=normal[None],
                        force=wrench[:1].copy(),
                    )
                )
        return patches

    def _control(self) -> None:
        """Lets the package's controller make its periodic update."""
        state = np.append(self.data.qpos[self._joints], self.data.qvel[self._joints])
        self._controller.GetInputPort("arm_state").FixValue(self._context, state)
        self._controller.GetInputPort("taxel_force").FixValue(self._context, self.taxel_force())
        desired = self._controller.EvalUniquePeriodicDiscreteUpdate(self._context).value()
        self._context.SetDiscreteState(desired)
        self.data.ctrl[:] = desired[self._joints]
