"""A reach under way in a diagram: its context, its simulator and what the rollout reads."""

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.diagram import ReachDiagram
from lic_drake.reach.trace import SceneState
from lic_drake.robots.arm import Arm
from lic_drake.scene.collision import is_touching
from lic_drake.scene.furnish import furnish
from lic_drake.scene.scene import SceneConfig
from lic_drake.types import Vector

ROUNDING = 1e-9
"""Four steps of exactly 10 ms end 1e-17 s before or after 40 ms; half of the control periods then
had a fifth step of that length, as dear as the others."""


class Simulation:
    """The arm and the clutter of one diagram, used for one reach after another.

    The context is kept, because making one costs as much as some ten control periods.
    """

    def __init__(self, reach_diagram: ReachDiagram, config: SceneConfig) -> None:
        self._reach_diagram = reach_diagram
        self._config = config
        scene = reach_diagram.scene
        self._plant, self._arm, self._clutter = scene.plant, scene.arm, scene.clutter
        self._instance: ClutterInstance | None = None
        self._height_m: float | None = None
        self._context = reach_diagram.diagram.CreateDefaultContext()
        self._plant_context = scene.plant.GetMyMutableContextFromRoot(self._context)
        self._num_axes = scene.num_axes
        self._p_WO_first = scene.plant.GetPositions(self._plant_context, scene.clutter).reshape(
            -1, self._num_axes
        )
        self._taxel_force = reach_diagram.diagram.GetOutputPort("taxel_force")

    def furnish(self, instance: ClutterInstance, arm: Arm, height_m: float) -> None:
        """Puts the fixed objects of another environment in the place of those that are there.

        Args:
            instance: As many fixed objects, and the same movable ones.
            arm: The arm.
            height_m: How far R is above the robot's floor, metres.
        """
        if instance is not self._instance or height_m != self._height_m:
            furnish(self._reach_diagram.scene, self._context, instance)
            arm.set_height(self._plant, self._plant_context, self._arm, height_m)
            self._instance, self._height_m = instance, height_m

    @property
    def num_movable(self) -> int:
        """Number of movable objects."""
        return len(self._p_WO_first)

    @property
    def time_s(self) -> float:
        """Time on the clock, seconds."""
        return float(self._context.get_time())

    def begin(self, q: Vector, p_RG: Vector, time_s: float = 0.0) -> None:
        """Puts the arm at rest at q and every object where the environment has it.

        Args:
            q: Joint angles, shape (m,), radians.
            p_RG: Goal, shape (3,), metres.
            time_s: Time on the clock, seconds.
        """
        self._context.SetTime(time_s)
        self._reach_diagram.set_start(self._context, q, p_RG)
        p_WO = self._p_WO_first
        self.set_state(self.state()._replace(p_WO=p_WO, v_WO=np.zeros_like(p_WO)))
        # A new one, because an integrator's memory would make a reach depend on the one before.
        self._simulator = Simulator(self._reach_diagram.diagram, self._context)
        if self._config.time_step_s == 0.0:
            longest_s = self._config.cenic_max_step_s * (1.0 + ROUNDING)
            simulator_config = SimulatorConfig(
                integration_scheme="cenic",
                accuracy=self._config.cenic_accuracy,
                max_step_size=longest_s,
                start_time=time_s,
            )
            ApplySimulatorConfig(simulator_config, self._simulator)
            # Not a tenth of it: nearly all steps are as long as they may be.
            self._simulator.get_mutable_integrator().request_initial_step_size_target(longest_s)
        self._initialized = False

    def find_free(self, angles: Vector) -> Vector | None:
        """Returns the first joint angles with which the arm touches nothing, shape (m,), or None.

        Args:
            angles: Joint angles to try, shape (n, m), radians.
        """
        for q in angles:
            self._plant.SetPositions(self._plant_context, self._arm, q)
            if not self.is_in_collision():
                free: Vector = q
                return free
        return None

    def is_in_collision(self) -> bool:
        """Tells whether the arm touches anything now."""
        return is_touching(self._reach_diagram.scene, self._context)

    def advance_to(self, time_s: float) -> None:
        """Simulates up to a time, not yet with the control update of that instant.

        Raises:
            RuntimeError: Drake found no solution, or a system failed.
        """
        if not self._initialized:
            self._simulator.Initialize()
            self._initialized = True
        self._simulator.AdvanceTo(time_s)

    def joint_angles(self) -> Vector:
        """Returns the arm's q, shape (m,), radians."""
        return self._plant.GetPositions(self._plant_context, self._arm)

    def taxel_force(self) -> Vector:
        """Returns the sensor's reading, shape (num_taxels,), N."""
        return np.asarray(self._taxel_force.Eval(self._context))

    def object_positions(self) -> Vector:
        """Returns p_WO of the movable objects, shape (n, num_axes), metres."""
        p_WO = self._plant.GetPositions(self._plant_context, self._clutter)
        return p_WO.reshape(-1, self._num_axes)

    def state(self) -> SceneState:
        """Returns the present state of the arm and of the movable objects."""
        plant, context = self._plant, self._plant_context
        return SceneState(
            q=plant.GetPositions(context, self._arm),
            v=plant.GetVelocities(context, self._arm),
            p_WO=plant.GetPositions(context, self._clutter).reshape(-1, self._num_axes),
            v_WO=plant.GetVelocities(context, self._clutter).reshape(-1, self._num_axes),
        )

    def set_state(self, state: SceneState) -> None:
        """Sets the state of the arm and of all movable objects."""
        plant, context = self._plant, self._plant_context
        plant.SetPositions(context, self._arm, state.q)
        plant.SetVelocities(context, self._arm, state.v)
        plant.SetPositions(context, self._clutter, state.p_WO.ravel())
        plant.SetVelocities(context, self._clutter, state.v_WO.ravel())

    def look_around(self, q: Vector) -> None:
        """Does nothing: every movable object is awake."""

    def take_over_control(self, other: "Simulation") -> None:
        """Takes over the state of the controller from a simulation of the same arm."""
        mine, theirs = self._reach_diagram.controller, other._reach_diagram.controller
        held = theirs.GetMyContextFromRoot(other._context).get_discrete_state()
        state = mine.GetMyMutableContextFromRoot(self._context).get_mutable_discrete_state()
        state.SetFrom(held)
