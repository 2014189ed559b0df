"""Makes the selector for clutter of an unknown category from the categories' libraries."""

from collections.abc import Mapping

from lic_drake.errors import RequestError
from lic_drake.experience.schema import scenario_text
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.scenario import Scenario, parse_scenario
from lic_drake.robots.planar import PlanarArm
from lic_drake.select.planar_lic import PlanarLic
from lic_drake.select.registry import make_selector
from scripts.unknown_category.final_position import FinalPositions
from scripts.unknown_category.mixture import Category, MixtureLic, check_distribution

COMMON_STARTS = "{task: {start_line: {phi_step_deg: 15.0}}}"
"""Put over the scenarios of the plane, whose grids of starts are 30 and 45 degrees apart on the
same line: this one holds both, and optimisations begin from the same candidates in all of them."""


def with_common_starts(library: ExperienceLibrary) -> Scenario:
    """Returns the scenario of a library with the starts that all categories share."""
    return parse_scenario(
        scenario_text(library.scenario()), COMMON_STARTS, source="the common starts"
    )


def check_comparable(scenarios: Mapping[str, Scenario]) -> PlanarArm:
    """Returns the arm that all scenarios share.

    Raises:
        RequestError: They have other arms or start lines, or the robot is not a planar arm.
    """
    one, *others = scenarios.values()
    arm = one.arm()
    same = all((s.robot, s.task.start_line) == (one.robot, one.task.start_line) for s in others)
    if not (same and isinstance(arm, PlanarArm)):
        raise RequestError(
            f"{' and '.join(scenarios)} have other arms or start lines; take categories of the"
            " planar arm with the same task.start_line"
        )
    return arm


def make_mixture(
    libraries: Mapping[str, ExperienceLibrary], probability: Mapping[str, float], estimator: str
) -> MixtureLic:
    """Returns a selector that has learned from a library for each category.

    Args:
        libraries: The libraries by category.
        probability: How likely each category is; they add up to 1.
        estimator: Of LIC, see `lic_drake.estimate.registry.estimator_names`.

    Raises:
        RequestError: Categories do not fit together, or the probabilities are no distribution.
    """
    check_distribution(probability)
    arm = check_comparable({name: with_common_starts(lib) for name, lib in libraries.items()})
    categories = {}
    for name, library in libraries.items():
        columns = library.columns()
        lic = make_selector(estimator, arm, columns, category=name)
        if not isinstance(lic, PlanarLic):
            raise RequestError(f"a mixture needs an estimator such as gp or knn, got {estimator!r}")
        final = FinalPositions.fit(lic.first.features, columns)
        categories[name] = Category(probability=probability[name], lic=lic, final=final)
    return MixtureLic(arm, categories, method=f"mixture of {estimator}")
