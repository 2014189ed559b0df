"""Contact properties: a compliant skin on the arm, rigid clutter."""

from dataclasses import dataclass

from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    ProximityProperties,
)
from pydrake.multibody.plant import CoulombFriction

from lic_drake.config import check_numbers

MESH_RANGE_M = (1e-4, 10.0)
"""Range of contact mesh sizes; a finer mesh would not fit into memory."""

_SKIN_FRICTION = 1e6
# Drake combines two coefficients to 2 a b / (a + b). A skin with a very large coefficient gives
# every arm-object pair twice the object's own: 0.4, against 0.2 between objects, the values of the
# authors' simulator.


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
            ranges={"skin_mesh_m": MESH_RANGE_M, "object_mesh_m": MESH_RANGE_M},
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
