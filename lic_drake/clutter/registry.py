"""Registry of clutter categories; user code adds one with `register_category`."""

import dataclasses
from typing import Protocol

import numpy as np

from lic_drake.clutter.cylinder import CylinderApertureClutter, CylinderClutter
from lic_drake.clutter.foliage import FoliageApertureClutter
from lic_drake.clutter.instance import ClutterInstance
from lic_drake.clutter.passage import PassageClutter
from lic_drake.clutter.sphere import SphereApertureClutter
from lic_drake.errors import ScenarioError
from lic_drake.registry import Registry


class ClutterSampler(Protocol):
    """A dataclass of parameters from which environments are sampled."""

    def sample(self, rng: np.random.Generator) -> ClutterInstance:
        """Samples one environment."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Category:
    """A clutter category and the features of its reaches (paper IV-A).

    Attributes:
        sampler: The dataclass of its parameters.
        in_space: Whether hands and goals are in space, else in the plane.
        observed: LIC-2's features of the first reach, the paper's o: columns of
            `lic_drake.experience.pairs`. None: no LIC-2.
    """

    sampler: type[ClutterSampler]
    in_space: bool
    observed: tuple[str, ...] | None


_CATEGORIES: Registry[Category] = Registry("category", ScenarioError)

# The paper's x0': in the plane a start is a position on the line and a direction.
_FIRST_START = ("first_start_y", "first_start_phi")


def register_category(
    name: str,
    sampler: type[ClutterSampler],
    *,
    in_space: bool = False,
    observed: tuple[str, ...] | None = _FIRST_START,
) -> None:
    """Registers a category, by its name in scenario files; see `Category`.

    The sampler is a dataclass of parameters, each with a default and a type (not a string: Drake's
    YAML reader needs the type itself), with a method `sample(rng)`; else it is a ScenarioError.
    """
    can_sample = callable(getattr(sampler, "sample", None))
    if not isinstance(sampler, type) or not dataclasses.is_dataclass(sampler) or not can_sample:
        raise ScenarioError(
            f"the sampler of category {name!r} must be a class decorated with"
            f" @dataclass(kw_only=True) and have a method sample(rng), got {sampler!r}"
        )
    for item in dataclasses.fields(sampler):
        if item.default is item.default_factory is dataclasses.MISSING:
            raise ScenarioError(f"parameter {item.name!r} of category {name!r} needs a default")
        if isinstance(item.type, str):
            raise ScenarioError(
                f"the type of parameter {item.name!r} of category {name!r} is a string; remove"
                " `from __future__ import annotations`"
            )
    category = Category(sampler=sampler, in_space=in_space, observed=observed)
    _CATEGORIES.register(name, category, made_by=sampler)


def get_category(name: str) -> Category:
    """Returns the category with this name; a ScenarioError if it is unknown."""
    return _CATEGORIES.get(name)


def category_names() -> tuple[str, ...]:
    """Returns the names of all registered categories."""
    return _CATEGORIES.names()


_AT_REST, _MOVING = ("first_final_x", "first_final_y"), ("first_final_vx", "first_final_vy")
register_category("cylinder-clutter", CylinderClutter, observed=_FIRST_START + _AT_REST)
register_category("passage-clutter", PassageClutter, observed=_FIRST_START + _MOVING)
register_category("cylinder-aperture-clutter", CylinderApertureClutter)
# Behind a board a failure says little: LIC-1 away from it succeeded in 20 of 297 second attempts,
# LIC-2 from local rows in 6 (notebooks/results/ablation/space_features.md).
register_category("sphere-aperture-clutter", SphereApertureClutter, in_space=True, observed=None)
register_category("foliage-aperture-clutter", FoliageApertureClutter, in_space=True, observed=None)
