"""Records a PR2 that moves base, torso and arm to a start, reaches, and comes back (paper V-B)."""

import math
from collections.abc import Sequence

import numpy as np
from pydrake.geometry import MeshcatVisualizer, MeshcatVisualizerParams, Role
from pydrake.multibody.meshcat import ContactVisualizer, ContactVisualizerParams
from pydrake.systems.framework import DiagramBuilder

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.pointing_starts import mobile_positions
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.trace import ReachTrace
from lic_drake.robots.pr2 import Pr2Arm
from lic_drake.scene.collision import CollisionChecker
from lic_drake.scene.scene import add_scene
from lic_drake.show.approach import WAITING_DEG, plan_approach
from lic_drake.show.meshes import wear_meshes
from lic_drake.show.pr2_meshes import LinkMesh
from lic_drake.show.recording import MeshcatRecording
from lic_drake.types import Vector

MOVE_S = 1.0
"""So long base, torso and arm each take to their places in the recording, at least, seconds."""

ARM_RAD_PER_S = 1.2
"""Average speed of the arm's fastest joint on its way."""

_FORCES = "/drake/contact_forces"

RETRACT_SPEED = 4.0
"""So many times faster than it came in the arm goes back."""


class MobileRecording(MeshcatRecording):
    """A Meshcat scene of one environment in which a whole PR2 is recorded.

    Moves between reaches are drawn, not simulated, and nothing but the robot moves. The arm goes
    back the way it came, waits while base and torso move, and passes the board on a path without
    collisions; where the planner finds none, it takes the straight line.

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
        self._q = self._waiting = np.deg2rad(WAITING_DEG)
        self._checker = CollisionChecker(arm, instance, scenario.scene)
        self._springs_back = instance.stems is not None
        self._draw(self._b0, self._q)

    def move_to(self, b0: Vector, q: Vector) -> None:
        """Records base, torso and arm moving to a start, in that order.

        Args:
            b0: Place of the base and height of the torso, shape (3,), metres.
            q: Joint angles, shape (7,), radians.
        """
        base = np.array([*b0[:2], self._b0[2]])
        for place in (base, b0):
            self._follow(place, self._q[None])
        self._follow(b0, self._approach(b0, q))

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
        """Records the arm going back the way it came, and to its waiting posture.

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
        self._follow(self._b0, self._approach(self._b0, self._q)[::-1])

    def _show_forces(self, shown: bool) -> None:
        """Shows contact forces from now on, or not: between reaches nothing is simulated."""
        self._meshcat.SetProperty(_FORCES, "visible", shown, self._clock_s)

    def _approach(self, b0: Vector, q: Vector) -> Vector:
        """Returns a path of the arm from its waiting posture to a start, shape (k, 7), radians."""
        path = plan_approach(self._checker, b0, q)
        return np.array([self._waiting, q]) if path is None else path

    def _follow(self, b0: Vector, path: Vector) -> None:
        """Records a move of base and torso to b0 and of the arm along a path; none if it is there.

        Each is slow at its ends, and takes at least `MOVE_S`.
        """
        old_b0 = self._b0
        ways = np.vstack([self._q, path])
        passed = np.append(0.0, np.cumsum(np.abs(np.diff(ways, axis=0)).max(axis=1)))
        if np.allclose(b0, old_b0) and passed[-1] < 1e-6:
            return
        frames = round(max(MOVE_S, passed[-1] / ARM_RAD_PER_S) * self._frames_per_second)
        for share in 0.5 - 0.5 * np.cos(np.pi * np.arange(1, frames + 1) / frames):
            q = [np.interp(share * passed[-1], passed, angle) for angle in ways.T]
            self._draw(old_b0 + share * (b0 - old_b0), np.array(q))
            self._clock_s += 1.0 / self._frames_per_second

    def _draw(self, b0: Vector, q: Vector) -> None:
        self._b0, self._q = b0, q
        positions = mobile_positions(b0, q[None])[0]
        self._plant.SetPositions(self._plant_context, self._scene.arm, positions)
        self._context.SetTime(self._clock_s)
        self._diagram.ForcedPublish(self._context)
