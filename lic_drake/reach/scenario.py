"""Scenarios: everything that a reach depends on but its environment, goal and start.

A scenario is a YAML file; the shipped ones are in models/scenarios. Unknown keys are errors.
"""

import dataclasses
import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.clutter.registry import ClutterSampler, get_category
from lic_drake.config import merge, read_mapping, read_named, read_section
from lic_drake.control.mpc import PRESETS, MpcConfig
from lic_drake.errors import RequestError, ScenarioError
from lic_drake.paths import scenarios_dir
from lic_drake.reach.task import StopConfig, Task
from lic_drake.robots.arm import Arm
from lic_drake.robots.described import robot_path
from lic_drake.robots.registry import get_robot
from lic_drake.scene.scene import SceneConfig
from lic_drake.seeds import make_generator
from lic_drake.types import Vector

_LATER_FIELDS = frozenset(
    "random_goals base torso_m stand progress_m progress_time_s deadzone_m drag_N_s_per_m"
    " taxels_per_m calm_move_m calm_change_N".split()
)
"""Fields that digests leave out at their defaults: the first libraries are older than they are."""

_PLACES = {False: "in the plane", True: "in space"}


@dataclass(kw_only=True)
class Scenario:
    """A category of clutter, a robot and how they are simulated; plain data that pickles."""

    category: str
    robot: str
    clutter: ClutterSampler
    task: Task = field(default_factory=Task)
    scene: SceneConfig = field(default_factory=SceneConfig)
    mpc: MpcConfig = field(default_factory=MpcConfig)
    stop: StopConfig = field(default_factory=StopConfig)

    @property
    def digest(self) -> str:
        """Identifies the scenario's values: 12 hexadecimal digits."""
        identity = _identity(self) | {"robot": self.arm().digest}
        values = json.dumps(identity, sort_keys=True, default=repr)
        return hashlib.sha256(values.encode()).hexdigest()[:12]

    def arm(self) -> Arm:
        """Returns the robot's arm, in its frame R."""
        return get_robot(self.robot)

    def sample_instance(self, stream: str, environment: int) -> ClutterInstance:
        """Draws the environment with this index in a seed stream."""
        return self.clutter.sample(make_generator(stream, self.category, environment))

    def sample_goal(self, stream: str, environment: int, index: int = 0) -> Vector:
        """Returns p_WG, shape (3,), metres: drawn from the goal area or, without one, as offered.

        A RequestError says that the environment does not offer that many goals.
        """
        if self.task.goal_area is not None:
            return self.task.goal_area.sample(make_generator(stream, "goal", environment, index))
        goals = self.goals(stream, environment)
        if index >= len(goals):
            raise RequestError(
                f"an environment of {self.category} offers {len(goals)} goal, {index + 1} were"
                " asked for; take one goal in each of more environments"
            )
        return np.asarray(goals[index])

    def goals(self, stream: str, environment: int) -> Vector:
        """Returns the goals that a collection tries in an environment, shape (n, 3), metres."""
        area = self.task.goal_area
        if area is None:
            p_WG = self.sample_instance(stream, environment).p_WG
            return np.empty((0, 3)) if p_WG is None else p_WG[np.newaxis]
        if area.random_goals == 0:
            return area.grid()
        return np.array(
            [self.sample_goal(stream, environment, i) for i in range(area.random_goals)]
        )


def _identity(part: Any) -> dict[str, Any]:
    """Returns the values that make a scenario what it is; see `_LATER_FIELDS`."""
    values = {}
    for item in dataclasses.fields(part):
        value = getattr(part, item.name)
        if item.name not in _LATER_FIELDS or value != item.default:
            values[item.name] = _identity(value) if dataclasses.is_dataclass(value) else value
    return values


def load_scenario(name_or_path: str | Path, overrides: str = "") -> Scenario:
    """Reads a shipped scenario by its name, or a YAML file by its path.

    Args:
        name_or_path: For instance "cylinder-clutter" or "mine.yaml".
        overrides: YAML text merged over the file, for instance "{mpc: {preset: ijrr_2013}}".

    Raises:
        ScenarioError: No such scenario, or a key or value that does not fit.
    """
    content = read_named(name_or_path, scenarios_dir(), "scenario")
    return parse_scenario(content, overrides, source=str(name_or_path))


def parse_scenario(content: str | bytes, overrides: str = "", source: str = "scenario") -> Scenario:
    """Builds a scenario from YAML text; see `load_scenario`."""
    data = merge(read_mapping(content, source), read_mapping(overrides, "overrides"))
    sections = [item.name for item in dataclasses.fields(Scenario)]
    unknown = [str(key) for key in data if key not in sections]
    if unknown:
        raise ScenarioError(f"{source}: unknown key {unknown[0]!r}; known: {sorted(sections)}")
    for key in ("category", "robot"):
        if not isinstance(data.get(key), str):
            raise ScenarioError(f"{source}: {key} must be a name, got {data.get(key)!r}")
    category, robot = get_category(data["category"]), robot_path(data["robot"], source)
    arm, preset = get_robot(robot), "haptic_mpc_2013"
    if category.in_space == arm.is_planar:
        raise ScenarioError(
            f"{source}: {data['category']} is clutter {_PLACES[category.in_space]}, but {arm.name}"
            f" is an arm {_PLACES[not arm.is_planar]}; choose another category or robot"
        )
    mpc: Any = data.get("mpc")
    if mpc is None or isinstance(mpc, dict):
        mpc = arm.mpc | (mpc or {})
        preset = mpc.pop("preset", preset)
    if not isinstance(preset, str) or preset not in PRESETS:
        raise ScenarioError(f"{source}: unknown mpc preset {preset!r}; choose {list(PRESETS)}")
    scenario = Scenario(
        category=data["category"],
        robot=robot,
        clutter=read_section(category.sampler, data.get("clutter"), f"{source}: clutter"),
        task=read_section(Task, data.get("task"), f"{source}: task"),
        scene=read_section(SceneConfig, data.get("scene"), f"{source}: scene"),
        mpc=read_section(MpcConfig, mpc, f"{source}: mpc", defaults=PRESETS[preset]()),
        stop=read_section(StopConfig, data.get("stop"), f"{source}: stop"),
    )
    arm.check_height(scenario.task.torso_m)
    _check_stiffness(arm, scenario.mpc, source)
    if scenario.task.goal_area is None and len(scenario.goals("training", 0)) == 0:
        raise ScenarioError(
            f"{source}: task: goal_area cannot be null, because an environment of"
            f" {scenario.category} offers no goal; give its lower and upper corner"
        )
    if scenario.task.base and scenario.sample_instance("training", 0).p_WA is None:
        raise ScenarioError(
            f"{source}: task: a base that moves along a track needs apertures, and an environment"
            f" of {scenario.category} has none; leave task.base out"
        )
    return scenario


def _check_stiffness(arm: Arm, mpc: MpcConfig, source: str) -> None:
    """Refuses joints so stiff that one control step can press harder than contacts may be.

    The controller lets forces rise by small steps that it predicts with a soft contact, whereas a
    rigid one changes them by the joint's stiffness.
    """
    levers = np.where(arm.levers > 0.0, arm.levers, np.inf)  # Without skin beyond it: no force.
    rise_N = np.deg2rad(mpc.max_change_deg) * arm.stiffness / levers
    worst = int(np.argmax(rise_N))
    if np.isfinite(mpc.max_change_deg) and rise_N[worst] > mpc.force_threshold_N:
        raise ScenarioError(
            f"{source}: {arm.joint_names[worst]} of {arm.name}, {arm.stiffness[worst]:g} Nm/rad, is"
            f" too stiff for a controller at {mpc.rate_hz:g} Hz: a step of {mpc.max_change_deg:g}"
            f" degrees changes the force at its end by {rise_N[worst]:.1f} N, and the threshold is"
            f" {mpc.force_threshold_N:g} N; lower its stiffness or mpc.max_change_deg"
        )
