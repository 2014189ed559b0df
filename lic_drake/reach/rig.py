"""The context of a reach diagram, and how it gets from one control instant to the next.

CENIC solves three times a step to know its error, which impacts need. An arm that creeps along an
object does not: `Stepper` first makes a few fixed steps of CENIC, one solve each. If the force on
the skin has changed at their end, because something was hit or has slipped, it simulates the period
again from its beginning, with error control.
"""

from collections import Counter
from typing import NamedTuple

import numpy as np
import pydrake.multibody.cenic  # noqa: F401  It gives the integrator its own options.

from lic_drake.reach.diagram import ReachDiagram
from lic_drake.reach.trace import SceneState
from lic_drake.scene.scene import set_steps
from lic_drake.types import Vector

_MOST_STEPS = 4
_COUNTS = {
    "integrator_num_steps_taken": "steps",
    "integrator_num_step_shrinkages_from_error_control": "shrunk",
    "cenic_total_solver_iterations": "iterations",
    "cenic_total_hessian_factorizations": "factorizations",
}


class Instant(NamedTuple):
    """All that a simulation goes on from: positions and velocities, and the controller's state."""

    time_s: float
    x: Vector
    held: Vector


class Rig:
    """A diagram and a context of it, used for one reach after another.

    Creating a context costs as much as some ten control periods. `shown` is for who changes the
    fixed objects.
    """

    def __init__(self, diagram: ReachDiagram) -> None:
        self.diagram, self.scene, self.plant = diagram, diagram.scene, diagram.scene.plant
        self.context = diagram.diagram.CreateDefaultContext()
        self.plant_context = self.plant.GetMyMutableContextFromRoot(self.context)
        self._taxel_force = diagram.diagram.GetOutputPort("taxel_force")
        controller = diagram.controller
        self._controller_context = controller.GetMyMutableContextFromRoot(self.context)
        self.q_clutter_first = self.clutter_positions().copy()
        self.shown: object = None

    def clutter_positions(self) -> Vector:
        """Returns the movable part of the clutter as in `SceneState.q_clutter`."""
        q_clutter = self.plant.GetPositions(self.plant_context, self.scene.clutter)
        return q_clutter.reshape(-1, self.scene.num_axes)

    def state(self) -> SceneState:
        """Returns the state of arm and clutter."""
        plant, context, scene = self.plant, self.plant_context, self.scene
        return SceneState(
            q=plant.GetPositions(context, scene.arm),
            v=plant.GetVelocities(context, scene.arm),
            q_clutter=self.clutter_positions(),
            v_clutter=plant.GetVelocities(context, scene.clutter).reshape(-1, scene.num_axes),
        )

    def set_state(self, state: SceneState) -> None:
        """Sets the state of arm and clutter."""
        plant, context, scene = self.plant, self.plant_context, self.scene
        plant.SetPositions(context, scene.arm, state.q)
        plant.SetVelocities(context, scene.arm, state.v)
        plant.SetPositions(context, scene.clutter, state.q_clutter.ravel())
        plant.SetVelocities(context, scene.clutter, state.v_clutter.ravel())

    def taxel_force(self) -> Vector:
        """Returns the sensor's reading, shape (num_taxels,), N."""
        return np.asarray(self._taxel_force.Eval(self.context))

    def save(self) -> Instant:
        """Returns where everything is; see `restore`."""
        held = self._controller_context.get_discrete_state_vector().value()
        x = self.plant.GetPositionsAndVelocities(self.plant_context)
        return Instant(self.context.get_time(), x, held.copy())

    def restore(self, instant: Instant) -> None:
        """Goes back to an instant."""
        self.context.SetTime(instant.time_s)
        self.plant.SetPositionsAndVelocities(self.plant_context, instant.x)
        self._controller_context.SetDiscreteState(instant.held)


class Stepper:
    """Advances a rig in one reach, from its present state."""

    def __init__(self, rig: Rig) -> None:
        self._rig, self._config = rig, rig.diagram.config
        self._simulator = rig.diagram.make_simulator(rig.context)
        self._simulator.Initialize()
        self._fixed_s = 0.0
        self._periods: Counter[str] = Counter()

    def advance_to(self, time_s: float) -> None:
        """Simulates up to a control instant, without its control update.

        Raises:
            RuntimeError: Drake found no solution, or a system failed.
        """
        config, rig = self._config, self._rig
        period_s = time_s - rig.context.get_time()
        if period_s <= 0.0 or config.calm_move_m == 0.0 or config.time_step_s > 0.0:
            self._simulator.AdvanceTo(time_s)
            return
        self._periods["periods"] += 1
        before, force = rig.save(), rig.taxel_force().sum()
        v = rig.plant.GetVelocities(rig.plant_context, rig.scene.arm)
        self._fix(period_s / self._steps(period_s * float(np.abs(v) @ rig.scene.robot.levers)))
        try:
            self._simulator.AdvanceTo(time_s)
            if abs(rig.taxel_force().sum() - force) <= config.calm_change_N:
                return
        except RuntimeError:
            pass  # No solution with so long steps; shorter ones may have one.
        self._periods = self.statistics() + Counter(repeated=1)
        rig.restore(before)
        self._fix(0.0)
        self._simulator.Initialize()  # It forgets its statistics.
        self._simulator.AdvanceTo(time_s)

    def statistics(self) -> Counter[str]:
        """Returns how often CENIC did what.

        "periods": control periods tried with fixed steps; "repeated": those simulated again;
        "steps", "shrunk" ones among them, "iterations" and "factorizations" of its solver.
        """
        counts = self._periods.copy()
        if self._config.time_step_s == 0.0:
            for name, value in self._simulator.get_integrator().GetStatisticsSummary():
                if name in _COUNTS:
                    counts[_COUNTS[name]] += int(value)
        return counts

    def _steps(self, move_m: float) -> int:
        """Returns in how many steps the arm makes a move."""
        if move_m > 2.0 * self._config.calm_move_m:
            return _MOST_STEPS
        return 2 if move_m > self._config.calm_move_m else 1

    def _fix(self, step_s: float) -> None:
        """Makes all steps equally long; with 0, CENIC controls its error again."""
        if step_s != self._fixed_s:
            set_steps(self._simulator, self._config, step_s)
            self._fixed_s = step_s
