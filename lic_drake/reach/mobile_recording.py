"""Records a PR2 that moves base, torso and arm to a start, reaches, and comes back (paper V-B)."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import MeshcatVisualizer, MeshcatVisualizerParams, Role
from pydrake.multibody.meshcat import ContactVisualizer, ContactVisualizerParams
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.pointing_starts import mobile_positions
from lic_drake.reach.recording import MeshcatRecording
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.trace import ReachTrace
from lic_drake.robots.pr2 import Pr2Arm
from lic_drake.robots.pr2_meshes import LinkMesh
from lic_drake.scene.meshes import wear_meshes
from lic_drake.scene.scene import add_scene

Vector = NDArray[np.float64]

MOVE_S = 1.0
"""How long base, torso and arm each take to their places in the recording, seconds."""

_FORCES = "/drake/contact_forces"

RETRACT_SPEED = 4.0
"""So many times faster than it came in the arm goes back."""


class MobileRecording(MeshcatRecording):
    """A Meshcat scene of one environment in which a whole PR2 is recorded.

    Moves between reaches are drawn, not simulated: the arm goes back the way it came, nothing else
    moves, and it does not look where it goes.

    Args:
        scenario: Robot, task and control rate.
        instance: The environment.
        meshes: What the robot wears instead of the shapes of its model.
    """

    def __init__(
        self, scenario: Scenario, instance: ClutterInstance, meshes: Sequence[LinkMesh] = ()
    ) -> None:
        super().__init__(scenario)
        builder = DiagramBuilder()
        arm = Pr2Arm(torso_m=scenario.task.torso_m, mobile=True)
        self._scene = add_scene(builder, arm, instance, scenario.scene, visuals=True)
        wear_meshes(self._scene, meshes)
        plant = self._plant = self._scene.plant
        for of in (self._scene.arm, self._scene.clutter):
            wanted = plant.get_desired_state_input_port(of)
            nothing = builder.AddSystem(ConstantVectorSource(np.zeros(wanted.size())))
            builder.Connect(nothing.get_output_port(), wanted)
        MeshcatVisualizer.AddToBuilder(
            builder,
            self._scene.scene_graph,
            self._meshcat,
            MeshcatVisualizerParams(role=Role.kIllustration),
        )
        ContactVisualizer.AddToBuilder(
            builder,
            plant,
            self._meshcat,
            ContactVisualizerParams(newtons_per_meter=50.0, force_threshold=0.05, radius=0.003),
        )
        self._diagram = builder.Build()
        self._context = self._diagram.CreateDefaultContext()
        self._plant_context = plant.GetMyMutableContextFromRoot(self._context)
        self._b0 = np.array([0.0, 0.0, scenario.task.torso_m])
        self._q = arm.q_home
        self._home = arm.q_home
        self._springs_back = instance.stems is not None
        self._draw(self._b0, self._q)

    def move_to(self, b0: Vector, q: Vector) -> None:
        """Records base, torso and arm moving to a start, in that order.

        Args:
            b0: Place of the base and height of the torso, shape (3,), metres.
            q: Joint angles, shape (7,), radians.
        """
        base = np.array([*b0[:2], self._b0[2]])
        for goal_b0, goal_q in ((base, self._q), (b0, self._q), (b0, q)):
            self._blend(goal_b0, goal_q)

    def add_reach(self, trace: ReachTrace, p_WG: Vector, b0: Vector) -> None:
        """Records a reach.

        Args:
            trace: Its samples with their states.
            p_WG: Its goal, shape (3,), metres.
            b0: Place of the base and height of the torso, shape (3,), metres.
        """
        self._draw_goal(p_WG)
        self._show_forces(True)
        begin = self._clock_s
        for k in range(0, len(trace.states), self._sample_steps()):
            state = trace.states[k]
            self._plant.SetPositions(self._plant_context, self._scene.clutter, state.p_WO.ravel())
            self._plant.SetVelocities(self._plant_context, self._scene.clutter, state.v_WO.ravel())
            self._clock_s = begin + trace.time_s[k]
            self._draw(b0, state.q)
        self._clock_s = math.ceil(self._clock_s + 1.0)

    def retract(self, trace: ReachTrace) -> None:
        """Records the arm going back the way it came, and to a posture between reaches.

        Stems go back with it, as they do when nothing holds them any more.
        """
        self._show_forces(False)
        step = round(RETRACT_SPEED * self._sample_steps())
        for state in [*trace.states[::-step], *trace.states[:1]]:
            if self._springs_back:
                self._plant.SetPositions(
                    self._plant_context, self._scene.clutter, state.p_WO.ravel()
                )
            self._draw(self._b0, state.q)
            self._clock_s += 1.0 / self._frames_per_second
        self._blend(self._b0, self._home)

    def _show_forces(self, shown: bool) -> None:
        """Shows contact forces from now on, or not: between reaches nothing is simulated."""
        self._meshcat.SetProperty(_FORCES, "visible", shown, self._clock_s)

    def _blend(self, b0: Vector, q: Vector) -> None:
        """Records a move on a straight line, slow at its ends; none if it is there already."""
        old_b0, old_q = self._b0, self._q
        if np.allclose(b0, old_b0) and np.allclose(q, old_q):
            return
        frames = round(MOVE_S * self._frames_per_second)
        for share in 0.5 - 0.5 * np.cos(np.pi * np.arange(1, frames + 1) / frames):
            self._draw(old_b0 + share * (b0 - old_b0), old_q + share * (q - old_q))
            self._clock_s += 1.0 / self._frames_per_second

    def _draw(self, b0: Vector, q: Vector) -> None:
        self._b0, self._q = b0, q
        positions = mobile_positions(b0, q[None])[0]
        self._plant.SetPositions(self._plant_context, self._scene.arm, positions)
        self._context.SetTime(self._clock_s)
        self._diagram.ForcedPublish(self._context)
