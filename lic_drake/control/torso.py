"""The height of the torso as a parameter of the systems that need to know where the arm is."""

import numpy as np
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from lic_drake.robots.arm import Arm


class RaisableArm:
    """The arm of a system, on a torso whose height is a parameter of the system's contexts.

    So one diagram serves a robot that reaches from many places.

    Args:
        system: The system, which gets the parameter.
        arm: The arm; its own height is the default.
    """

    def __init__(self, system: LeafSystem, arm: Arm) -> None:
        self._arm = arm
        self._index = int(system.DeclareNumericParameter(BasicVector(np.array([arm.torso_m]))))

    def at(self, context: Context) -> Arm:
        """Returns the arm as it stands in a context of the system."""
        return self._arm.raised(float(context.get_numeric_parameter(self._index).GetAtIndex(0)))

    def raise_to(self, context: Context, torso_m: float) -> None:
        """Sets the height, metres, in a context of the system."""
        context.get_mutable_numeric_parameter(self._index).SetAtIndex(0, torso_m)
