"""What the robot knows before its first and second reach in each category (paper IV-A).

A new category is one line here.
"""

from dataclasses import dataclass, replace

from lic_drake.estimate.checks import EstimateError
from lic_drake.estimate.features import PLANAR_LIC1, SPACE_LIC1, FeatureMap


@dataclass(frozen=True, kw_only=True)
class CategoryFeatures:
    """The features of a category's two models.

    Attributes:
        first: Of LIC-1: goal and start.
        second: Of LIC-2: also what the first reach showed, the paper's o.
    """

    first: FeatureMap
    second: FeatureMap


_CATEGORIES: dict[str, CategoryFeatures] = {}


def register_category(name: str, first: FeatureMap, observed: tuple[str, ...]) -> None:
    """Makes the features of a category known.

    Args:
        name: The clutter category.
        first: Features of LIC-1.
        observed: What LIC-2 has besides, see `FeatureMap.observed`.
    """
    _CATEGORIES[name] = CategoryFeatures(first=first, second=replace(first, observed=observed))


def features_of(category: str) -> CategoryFeatures:
    """Returns the features of a category.

    Raises:
        EstimateError: The category is unknown.
    """
    if category not in _CATEGORIES:
        raise EstimateError(
            f"no features are known for the category {category!r}, only for"
            f" {', '.join(_CATEGORIES)}; call register_category"
        )
    return _CATEGORIES[category]


# The paper's x0': in the plane a start is its place on the line and its direction.
_FIRST_START = ("first_start_y", "first_start_phi")

register_category(
    "cylinder-clutter", PLANAR_LIC1, (*_FIRST_START, "first_final_x", "first_final_y")
)
register_category(
    "passage-clutter", PLANAR_LIC1, (*_FIRST_START, "first_final_vx", "first_final_vy")
)
register_category("cylinder-aperture-clutter", PLANAR_LIC1, _FIRST_START)
register_category("sphere-aperture-clutter", SPACE_LIC1, ("first_start_y", "first_start_z"))
