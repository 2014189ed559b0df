"""The known robots. A new one is a YAML file, or code of your own that calls `register_robot`."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from lic_drake.errors import ScenarioError
from lic_drake.paths import robots_dir
from lic_drake.registry import Registry
from lic_drake.robots.arm import Arm
from lic_drake.robots.described import described_robot
from lic_drake.robots.planar import planar_arm
from lic_drake.robots.pr2 import pr2_arm

_ROBOTS: Registry[Callable[[], Arm]] = Registry("robot", ScenarioError)


def register_robot(name: str, make: Callable[[], Arm]) -> None:
    """Makes a robot known under a name in scenario files.

    `make` is asked by every reach, so it should be decorated with `functools.cache`. Raises a
    ScenarioError if the name is taken, or `make` cannot be called.
    """
    if not callable(make):
        raise ScenarioError(
            f"robot {name!r} needs a function that returns it, got {make!r}; register the function,"
            " not the robot"
        )
    _ROBOTS.register(name, make)


def get_robot(name: str) -> Arm:
    """Returns a robot by its name or the path of its file; a ScenarioError if it is unknown."""
    if Path(name).suffix in (".yaml", ".yml"):
        return described_robot(name)
    return _ROBOTS.get(name)()


register_robot("planar-arm", planar_arm)
register_robot("pr2", pr2_arm)
for _path in sorted(robots_dir().glob("*.yaml")):
    register_robot(_path.stem, partial(described_robot, _path.stem))
