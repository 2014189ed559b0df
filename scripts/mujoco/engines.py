"""The engines that are compared: Drake as the package uses it, and MuJoCo."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.environment import MAX_DIAGRAMS, Environment
from lic_drake.reach.request import ReachRequest
from lic_drake.reach.rig import Rig
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.simulation import Cache, simulate
from lic_drake.reach.trace import ReachResult
from scripts.mujoco.mujoco_scene import MujocoConfig
from scripts.mujoco.mujoco_simulation import MujocoSimulation


@cache
def _diagrams(engine: "Engine") -> Cache[Rig]:
    """Returns the diagrams that an engine keeps, as a session does."""
    return Cache(MAX_DIAGRAMS, cyclic=True)


@dataclass(frozen=True, kw_only=True)
class Engine:
    """A simulator and how it is used; plain data that pickles.

    Attributes:
        name: Heading in the tables.
        mujoco: How MuJoCo simulates; None for Drake.
        time_step_s: Step of Drake's plant, seconds; None for what the scenario says.
        sleep: Whether objects sleep in Drake until the arm comes near.
    """

    name: str
    mujoco: MujocoConfig | None = None
    time_step_s: float | None = None
    sleep: bool = True

    def prepare(
        self, scenario: Scenario, instance: ClutterInstance
    ) -> Callable[[ReachRequest], ReachResult]:
        """Builds an environment.

        Returns:
            A function that simulates a reach in it; start and goal must be within reach.
        """
        if self.mujoco is not None:
            simulation = MujocoSimulation(scenario, instance, self.mujoco)
            arm = scenario.arm()
            return lambda request: simulate(
                simulation,
                scenario,
                arm.solve_ik(request.start.x0)[0],
                request.goal,
            )
        if self.time_step_s is not None:
            scenario = replace(
                scenario, scene=replace(scenario.scene, time_step_s=self.time_step_s)
            )
        environment = Environment(scenario, instance, self.sleep, cache=_diagrams(self))
        return lambda request: environment.reach(request.goal, request.start.x0)
