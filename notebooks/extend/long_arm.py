"""An arm of your own: the planar testbed's with another forearm, here 6 cm longer and softer."""

from functools import cache
from xml.etree import ElementTree

from lic_drake import Arm, register_robot
from lic_drake.paths import models_dir
from lic_drake.robots.planar import make_planar_arm

LONGER_M = 0.06
SOFTER = 0.5


def _describe() -> str:
    """Returns the description: URDF text, written from scratch or, as here, from another one."""
    robot = ElementTree.parse(models_dir() / "planar_arm.urdf").getroot()
    robot.set("name", "long_arm")
    ElementTree.register_namespace("drake", "http://drake.mit.edu")
    drake = "{http://drake.mit.edu}"
    # The elbow's link grows, and what follows moves along: at zero the arm points along -y.
    (forearm,) = robot.findall("link[@name='link2']")
    for capsule in forearm.iter(f"{drake}capsule"):
        capsule.set("length", str(float(capsule.get("length", "0")) + LONGER_M))
    for part in ("inertial", "visual", "collision"):
        _shift(forearm.find(f"{part}/origin"), 0.5 * LONGER_M)
    _shift(robot.find("joint[@name='joint3']/origin"), LONGER_M)
    for gains in robot.iter(f"{drake}controller_gains"):
        for gain in ("p", "d"):
            gains.set(gain, str(SOFTER * float(gains.get(gain, "0"))))
    return ElementTree.tostring(robot, encoding="unicode")


def _shift(origin: ElementTree.Element | None, by_m: float) -> None:
    """Moves an origin along -y."""
    assert origin is not None
    x, y, z = map(float, origin.get("xyz", "0 0 0").split())
    origin.set("xyz", f"{x} {y - by_m} {z}")


@cache
def long_arm() -> Arm:
    """Returns the arm, read once a process."""
    return make_planar_arm("long-arm", _describe())


register_robot("long-arm", long_arm)
