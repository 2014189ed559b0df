"""The known clutter categories. A new one is a new file and one line here."""

from typing import Protocol

import numpy as np

from lic_drake.clutter.aperture import CylinderApertureClutter
from lic_drake.clutter.cylinder import CylinderClutter
from lic_drake.clutter.foliage import FoliageApertureClutter
from lic_drake.clutter.instance import ClutterInstance
from lic_drake.clutter.passage import PassageClutter
from lic_drake.clutter.sphere import SphereApertureClutter
from lic_drake.errors import ScenarioError


class ClutterSampler(Protocol):
    """What a category offers: a dataclass of parameters that can draw an environment."""

    def sample(self, rng: np.random.Generator) -> ClutterInstance:
        """Draws one environment."""
        ...


_CATEGORIES: dict[str, type[ClutterSampler]] = {}


def register_category(name: str, sampler: type[ClutterSampler]) -> None:
    """Makes a category known under `name`; `sampler` is a dataclass of its parameters."""
    _CATEGORIES[name] = sampler


def get_category(name: str) -> type[ClutterSampler]:
    """Returns the parameter class of a category.

    Raises:
        ScenarioError: The category is unknown.
    """
    if name not in _CATEGORIES:
        raise ScenarioError(f"unknown category {name!r}; choose one of {', '.join(_CATEGORIES)}")
    return _CATEGORIES[name]


def category_names() -> tuple[str, ...]:
    """Returns the names of all known categories."""
    return tuple(_CATEGORIES)


register_category("cylinder-clutter", CylinderClutter)
register_category("passage-clutter", PassageClutter)
register_category("cylinder-aperture-clutter", CylinderApertureClutter)
register_category("sphere-aperture-clutter", SphereApertureClutter)
register_category("foliage-aperture-clutter", FoliageApertureClutter)
