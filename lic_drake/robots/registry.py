"""The known robots. A new one is a new file and one line here."""

from collections.abc import Callable

from lic_drake.errors import ScenarioError
from lic_drake.robots.arm import Arm
from lic_drake.robots.planar import planar_arm
from lic_drake.robots.pr2 import pr2_arm

_ROBOTS: dict[str, Callable[[], Arm]] = {}


def register_robot(name: str, make: Callable[[], Arm]) -> None:
    """Makes a robot known under `name`; `make` returns it and should cache it."""
    _ROBOTS[name] = make


def get_robot(name: str) -> Arm:
    """Returns a robot.

    Raises:
        ScenarioError: The robot is unknown.
    """
    if name not in _ROBOTS:
        raise ScenarioError(f"unknown robot {name!r}; choose one of {', '.join(_ROBOTS)}")
    return _ROBOTS[name]()


register_robot("planar-arm", planar_arm)
register_robot("pr2", pr2_arm)
