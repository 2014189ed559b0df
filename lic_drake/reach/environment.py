"""`Environment`: one drawn environment as a base finds it, and reaches simulated in it."""

import numpy as np

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.request import is_within_reach
from lic_drake.reach.rig import Rig
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.simulation import Cache, Simulation, simulate
from lic_drake.reach.sleeping import MovedTooFarError, World, make_sleeping
from lic_drake.reach.start import Start
from lic_drake.reach.trace import ReachResult, ReachTrace
from lic_drake.robots.kinematics import rigid_pose
from lic_drake.types import Vector

MAX_DIAGRAMS = 16
"""Number of diagrams, some MB each, that are kept."""

START_TOLERANCE = 1e-4
"""Largest distance of a hand from the pose x0 that joint angles were given for, metres, radians."""


class Environment:
    """One environment of a scenario, used for many reaches from one base.

    The simulated world is the robot's frame R, which b0 carries and which stands still during a
    reach: the environment is moved by -b0 instead (T_b0 of paper Eq. 3).

    Args:
        sleep: Whether objects may sleep until the arm comes near (`lic_drake.reach.sleeping`);
            without, a reach costs three times as much and ends the same.
        b0: Base and torso, as of a `Start`; by default as the scenario's task has it.
        cache: Where diagrams are kept; by default its own.

    Raises:
        ScenarioError: The torso cannot be there.
    """

    def __init__(
        self,
        scenario: Scenario,
        instance: ClutterInstance,
        sleep: bool = True,
        b0: Vector | None = None,
        cache: Cache[Rig] | None = None,
    ) -> None:
        self.scenario = scenario
        self.instance = instance
        self.arm = scenario.arm()
        self.b0 = scenario.task.b0 if b0 is None else b0
        height_m = float(self.b0[2])
        self.arm.check_height(height_m)
        diagrams = Cache[Rig](MAX_DIAGRAMS, cyclic=True) if cache is None else cache
        self._world = World(scenario, instance.translated(-self.b0), height_m, diagrams)
        self._token = object()
        self._sleeping = make_sleeping(self._world) if sleep else None

    def reach(
        self, p_WG: Vector, x0: Vector, keep_states: bool = False, q: Vector | None = None
    ) -> ReachResult:
        """Simulates a reach; a goal out of the arm's reach is known to fail without.

        x0 and q are as in a `Start` (paper III-E); with `keep_states` the trace holds the whole
        scene.
        """
        p_RG, x0_R = p_WG - self.b0, Start(x0, self.b0).x0_R
        if not is_within_reach(self.scenario, p_RG):
            return ReachResult("unreachable", ReachTrace(), "the goal is beyond the arm's reach")
        angles = self.arm.solve_ik(x0_R) if q is None else q[None]
        wrong = "" if len(angles) else "no configuration within the joint limits"
        if q is not None and not self._is_at(q, x0_R):
            wrong = "the joint angles do not bring the hand to x0"
        if wrong:
            return ReachResult("invalid_start", ReachTrace(), wrong)
        result = self._reach_from(angles, p_RG, keep_states)
        result.trace.translate(self.b0, clutter_too=self.instance.stems is None)
        return result

    def _reach_from(self, angles: Vector, p_RG: Vector, keep_states: bool) -> ReachResult:
        if self._sleeping is not None:
            try:
                return self._reach_in(self._sleeping, angles, p_RG, keep_states)
            except MovedTooFarError:
                pass  # Something moved too far at once: repeat the reach with all objects awake.
            finally:
                self._sleeping.release()
        awake = self._world.rig(self._token, self._world.instance)
        return self._reach_in(Simulation(awake), angles, p_RG, keep_states)

    def _reach_in(
        self, simulation: Simulation, angles: Vector, p_RG: Vector, keep_states: bool
    ) -> ReachResult:
        q0 = angles[0]
        for q in angles if len(angles) > 1 else ():
            simulation.begin(q, p_RG)
            if not simulation.is_in_collision():
                q0 = q
                break
        result = simulate(simulation, self.scenario, q0, p_RG, keep_states)
        result.trace.statistics = simulation.statistics()
        if result.trace.q:
            q_clutter = simulation.state().q_clutter
            result.trace.q_clutter = q_clutter if np.all(np.isfinite(q_clutter)) else None
        return result

    def _is_at(self, q: Vector, x0_R: Vector) -> bool:
        """Returns whether joint angles bring the hand to a pose."""
        pose, (p_RE, R_RE) = self.arm.calc_pose(q), rigid_pose(x0_R)
        error = max(np.abs(pose.p_RE - p_RE).max(), np.abs(pose.R_RE - R_RE).max())
        return bool(error <= START_TOLERANCE)
