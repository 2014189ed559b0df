"""The known robots. A new one is a file of your own that calls `register_robot`."""

from collections.abc import Callable

from lic_drake.errors import ScenarioError
from lic_drake.extensions import load_extensions
from lic_drake.registration import add_entry
from lic_drake.robots.arm import Arm
from lic_drake.robots.planar import planar_arm
from lic_drake.robots.pr2 import pr2_arm

_ROBOTS: dict[str, Callable[[], Arm]] = {}


def register_robot(name: str, make: Callable[[], Arm]) -> None:
    """Makes a robot known under a name.

    Args:
        name: What scenario files call it.
        make: Returns the robot, which satisfies `lic_drake.robots.arm.Arm`; every reach asks for
            it, so it should be decorated with `functools.cache`.

    Raises:
        ScenarioError: The name is taken, or `make` cannot be called.
    """
    if not callable(make):
        raise ScenarioError(
            f"robot {name!r} needs a function that returns it, got {make!r}; register the function,"
            " not the robot"
        )
    add_entry(_ROBOTS, "robot", name, make, ScenarioError)


def get_robot(name: str) -> Arm:
    """Returns a robot.

    Raises:
        ScenarioError: The robot is unknown.
    """
    load_extensions()
    if name not in _ROBOTS:
        raise ScenarioError(f"unknown robot {name!r}; choose one of {', '.join(_ROBOTS)}")
    return _ROBOTS[name]()


register_robot("planar-arm", planar_arm)
register_robot("pr2", pr2_arm)
