"""The known robots. A new one is a file of your own that calls `register_robot`."""

from collections.abc import Callable

from lic_drake.errors import ScenarioError
from lic_drake.registry import Registry
from lic_drake.robots.arm import Arm
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
    """Returns a robot; a ScenarioError if it is unknown."""
    return _ROBOTS.get(name)()


register_robot("planar-arm", planar_arm)
register_robot("pr2", pr2_arm)
