"""The known clutter categories. A new one is a file of your own that calls `register_category`."""

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
    """What a category offers: a dataclass of parameters that can draw an environment."""

    def sample(self, rng: np.random.Generator) -> ClutterInstance:
        """Draws one environment."""
        ...


_CATEGORIES: Registry[type[ClutterSampler]] = Registry("category", ScenarioError)


def register_category(name: str, sampler: type[ClutterSampler]) -> None:
    """Makes a category known under a name.

    Its module must not say `from __future__ import annotations`: Drake's YAML reader needs the
    types themselves.

    Args:
        name: What scenario files call it.
        sampler: A dataclass of its parameters, each with a type and a default, with a method
            `sample` that draws an environment.

    Raises:
        ScenarioError: The name is taken, or the class is not such a dataclass.
    """
    if not isinstance(sampler, type) or not dataclasses.is_dataclass(sampler):
        raise ScenarioError(
            f"the sampler of category {name!r} must be a dataclass of its parameters, got"
            f" {sampler!r}; decorate the class with @dataclass(kw_only=True)"
        )
    if not callable(getattr(sampler, "sample", None)):
        raise ScenarioError(
            f"the sampler of category {name!r} has no method sample(rng); add one that returns a"
            " ClutterInstance"
        )
    for item in dataclasses.fields(sampler):
        if item.default is item.default_factory is dataclasses.MISSING:
            raise ScenarioError(
                f"the parameter {item.name!r} of category {name!r} has no default; give it one, so"
                " that scenario files may leave it out"
            )
        if isinstance(item.type, str):
            raise ScenarioError(
                f"the parameter {item.name!r} of category {name!r} has a type in quotes; leave out"
                " `from __future__ import annotations`, which scenario files cannot be read with"
            )
    _CATEGORIES.register(name, sampler)


def get_category(name: str) -> type[ClutterSampler]:
    """Returns the parameter class of a category.

    Raises:
        ScenarioError: The category is unknown.
    """
    return _CATEGORIES.get(name)


def category_names() -> tuple[str, ...]:
    """Returns the names of all known categories."""
    return _CATEGORIES.names()


register_category("cylinder-clutter", CylinderClutter)
register_category("passage-clutter", PassageClutter)
register_category("cylinder-aperture-clutter", CylinderApertureClutter)
register_category("sphere-aperture-clutter", SphereApertureClutter)
register_category("foliage-aperture-clutter", FoliageApertureClutter)
