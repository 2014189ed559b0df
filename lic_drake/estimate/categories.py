"""What the robot knows before its first and second reach in each category (paper IV-A).

A new category calls `register_features` beside `lic_drake.clutter.registry.register_category`.
"""

from dataclasses import dataclass, replace

from lic_drake.estimate.checks import EstimateError
from lic_drake.estimate.features import PLANAR_LIC1, SPACE_LIC1, FeatureMap
from lic_drake.registry import Registry


@dataclass(frozen=True, kw_only=True)
class CategoryFeatures:
    """The features of a category's two models.

    Attributes:
        first: Of LIC-1: goal and start.
        second: Of LIC-2: also what the first reach showed, the paper's o.
    """

    first: FeatureMap
    second: FeatureMap


_CATEGORIES: Registry[CategoryFeatures] = Registry("category with features", EstimateError)

# The paper's x0': in the plane a start is its place on the line and its direction.
_FIRST_START = ("first_start_y", "first_start_phi")


def register_features(
    name: str, first: FeatureMap = PLANAR_LIC1, observed: tuple[str, ...] = _FIRST_START
) -> None:
    """Makes the features of a category known.

    Args:
        name: The clutter category.
        first: Features of LIC-1; by default those of the plane.
        observed: What LIC-2 has besides, see `FeatureMap.observed`; by default where the first
            reach started.

    Raises:
        EstimateError: A feature is unknown, or the category has other features already.
    """
    features = CategoryFeatures(first=first, second=replace(first, observed=observed))
    if _CATEGORIES.entries.get(name, features) != features:
        raise EstimateError(
            f"the category {name!r} has other features already; choose another name for yours"
        )
    _CATEGORIES.register(name, features)


def features_of(category: str) -> CategoryFeatures:
    """Returns the features of a category.

    Raises:
        EstimateError: The category is unknown.
    """
    return _CATEGORIES.get(category)


register_features(
    "cylinder-clutter", PLANAR_LIC1, (*_FIRST_START, "first_final_x", "first_final_y")
)
register_features(
    "passage-clutter", PLANAR_LIC1, (*_FIRST_START, "first_final_vx", "first_final_vy")
)
register_features("cylinder-aperture-clutter", PLANAR_LIC1, _FIRST_START)
register_features("sphere-aperture-clutter", SPACE_LIC1, ("first_start_y", "first_start_z"))
register_features("foliage-aperture-clutter", SPACE_LIC1, ("first_start_y", "first_start_z"))
