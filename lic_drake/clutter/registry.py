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


@dataclasses.dataclass(frozen=True, kw_only=True)
class Category:
    """A clutter category, and what its reaches can be learned from (paper IV-A).

    Attributes:
        sampler: The dataclass of its parameters.
        in_space: Whether hands and goals are in space, else in the plane.
        observed: What the first reach showed, the paper's o: columns of
            `lic_drake.experience.pairs` that LIC-2 takes as features. None: there is no
            LIC-2, and further starts are LIC-1's best away from the failed ones.
    """

    sampler: type[ClutterSampler]
    in_space: bool
    observed: tuple[str, ...] | None


_CATEGORIES: Registry[Category] = Registry("category", ScenarioError)

# The paper's x0': in the plane a start is its place on the line and its direction.
_FIRST_START = ("first_start_y", "first_start_phi")


def register_category(
    name: str,
    sampler: type[ClutterSampler],
    *,
    in_space: bool = False,
    observed: tuple[str, ...] | None = _FIRST_START,
) -> None:
    """Makes a category known under a name.

    Its module must not say `from __future__ import annotations`: Drake's YAML reader needs the
    types themselves.

    Args:
        name: What scenario files call it.
        sampler: A dataclass of its parameters, each with a type and a default, with a method
            `sample` that draws an environment.
        in_space: See `Category`.
        observed: See `Category`; by default where the first reach started.

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
    category = Category(sampler=sampler, in_space=in_space, observed=observed)
    _CATEGORIES.register(name, category, made_by=sampler)


def get_category(name: str) -> Category:
    """Returns a category.

    Raises:
        ScenarioError: The category is unknown.
    """
    return _CATEGORIES.get(name)


def category_names() -> tuple[str, ...]:
    """Returns the names of all known categories."""
    return _CATEGORIES.names()


register_category(
    "cylinder-clutter",
    CylinderClutter,
    observed=(*_FIRST_START, "first_final_x", "first_final_y"),
)
register_category(
    "passage-clutter",
    PassageClutter,
    observed=(*_FIRST_START, "first_final_vx", "first_final_vy"),
)
register_category("cylinder-aperture-clutter", CylinderApertureClutter)
# A failure behind a board tells little but that the first choice was wrong: LIC-1 away from the
# failed start succeeded in 20 of 297 second attempts (K-NN 28 of 312), LIC-2 from local rows in 6
# (22), and LIC-2 with LIC-1's estimate as a feature in 15 (25)
# (notebooks/results/ablation/space_features.md).
register_category("sphere-aperture-clutter", SphereApertureClutter, in_space=True, observed=None)
register_category("foliage-aperture-clutter", FoliageApertureClutter, in_space=True, observed=None)
