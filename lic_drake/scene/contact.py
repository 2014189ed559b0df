"""Surfaces: a compliant skin on the arm, rigid clutter, and colours of clutter."""

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    ProximityProperties,
)
from pydrake.multibody.plant import CoulombFriction

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.config import check_numbers
from lic_drake.types import Vector

_SKIN_FRICTION = 1e6
# Drake combines two coefficients to 2 a b / (a + b). A skin with a very large coefficient gives
# every arm-object pair twice the object's own: 0.4, against 0.2 between objects, the values of the
# authors' simulator.

FIXED_COLOR, MOVABLE_COLOR, STEM_COLOR, BRANCH_COLOR = np.array(
    [
        [0.55, 0.25, 0.2, 1.0],
        [0.95, 0.7, 0.35, 1.0],
        [0.3, 0.42, 0.16, 1.0],
        [0.33, 0.24, 0.15, 1.0],
    ]
)
"""RGBA of fixed and movable objects, of elastic stems and of fixed branches."""
LEAF_COLORS = np.array([[0.13, 0.45, 0.12, 1.0], [0.2, 0.55, 0.16, 1.0], [0.3, 0.6, 0.2, 1.0]])
"""Of leaves, alternating."""
MATERIAL_COLORS = {
    "wood": np.array([0.43, 0.27, 0.14, 1.0]),
    "clay": np.array([0.52, 0.30, 0.24, 1.0]),
    "cardboard": np.array([0.70, 0.55, 0.38, 1.0]),
}
"""Of the materials that a `ClutterInstance` may name."""


@dataclass(kw_only=True)
class ContactConfig:
    """Contact parameters; the scenario files explain the defaults."""

    # Modulus of the arm's skin, Pa: with the meshes below, a link against a cylinder is as stiff as
    # the authors' contact spring, 48 kN/m.
    skin_modulus_Pa: float = 1e8
    # Hunt & Crossley dissipation of skin and objects, s/m.
    dissipation_s_per_m: float = 1.0
    # Friction between two objects, half of that between arm and object (authors' simulator).
    object_friction: float = 0.2
    # Stiffness of the point contact between two objects, N/m (authors' simulator: 48 kN/m;
    # two equal springs in series).
    object_stiffness_N_per_m: float = 9.6e4
    # Largest edge of the contact meshes, metres.
    skin_mesh_m: float = 0.005
    object_mesh_m: float = 0.004

    def __post_init__(self) -> None:
        check_numbers(
            self,
            positive=["skin_modulus_Pa", "object_stiffness_N_per_m"],
            non_negative=["dissipation_s_per_m", "object_friction"],
            # A finer mesh would not fit into memory.
            ranges={"skin_mesh_m": (1e-4, 10.0), "object_mesh_m": (1e-4, 10.0)},
        )


def skin_properties(config: ContactConfig) -> ProximityProperties:
    """Returns the compliant-hydroelastic properties of the arm's skin."""
    properties = ProximityProperties()
    AddContactMaterial(
        dissipation=config.dissipation_s_per_m,
        friction=CoulombFriction(_SKIN_FRICTION, _SKIN_FRICTION),
        properties=properties,
    )
    AddCompliantHydroelasticProperties(config.skin_mesh_m, config.skin_modulus_Pa, properties)
    return properties


def object_properties(config: ContactConfig) -> ProximityProperties:
    """Returns the rigid-hydroelastic properties of a clutter object.

    Two rigid objects have no hydroelastic contact; Drake falls back to point contact for them.
    """
    properties = ProximityProperties()
    AddContactMaterial(
        dissipation=config.dissipation_s_per_m,
        point_stiffness=config.object_stiffness_N_per_m,
        friction=CoulombFriction(config.object_friction, config.object_friction),
        properties=properties,
    )
    AddRigidHydroelasticProperties(config.object_mesh_m, properties)
    return properties


def object_color(instance: ClutterInstance, i: int) -> Vector:
    """Returns the colour of an object, shape (4,), by its material or else by its mobility."""
    by_mobility = MOVABLE_COLOR if instance.movable[i] else FIXED_COLOR
    return MATERIAL_COLORS.get(instance.material[i], by_mobility)
