"""Learning initial conditions for reaching into unknown clutter, on Drake.

Implements Park, Kapusta, Kim, Rehg and Kemp, "Learning to Reach into the Unknown: Selecting
Initial Conditions When Reaching in Clutter". A `Start`, tried in a `Scenario`, becomes a
`ReachRecord`; records become an `ExperienceLibrary`; a library becomes a `SuccessEstimator`; an
estimator and a `Situation` become a `Start`. The names below are imported when they are first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lic_drake.clutter.registry import category_names as category_names
    from lic_drake.clutter.registry import register_category as register_category
    from lic_drake.errors import LicError as LicError
    from lic_drake.estimate.estimator import SuccessEstimator as SuccessEstimator
    from lic_drake.estimate.estimator import from_sklearn as from_sklearn
    from lic_drake.estimate.registry import register_estimator as register_estimator
    from lic_drake.estimate.rollouts import read_rollouts as read_rollouts
    from lic_drake.evaluate.decisions import fit_rollouts as fit_rollouts
    from lic_drake.evaluate.robot_check import check_robot as check_robot
    from lic_drake.evaluate.trial import Evaluation as Evaluation
    from lic_drake.evaluate.trial import run_evaluation as run_evaluation
    from lic_drake.evaluate.trial import run_trial as run_trial
    from lic_drake.experience.collect import CollectionRequest as CollectionRequest
    from lic_drake.experience.collect import collect as collect
    from lic_drake.experience.runner import simulate as simulate
    from lic_drake.experience.store import ExperienceLibrary as ExperienceLibrary
    from lic_drake.paths import shipped_library as shipped_library
    from lic_drake.reach.diagram import make_reach_diagram as make_reach_diagram
    from lic_drake.reach.request import ReachRecord as ReachRecord
    from lic_drake.reach.request import ReachRequest as ReachRequest
    from lic_drake.reach.scenario import Scenario as Scenario
    from lic_drake.reach.scenario import load_scenario as load_scenario
    from lic_drake.reach.session import instance_of as instance_of
    from lic_drake.reach.session import run_reach as run_reach
    from lic_drake.reach.session import simulate_request as simulate_request
    from lic_drake.reach.start import Start as Start
    from lic_drake.reach.start import Starts as Starts
    from lic_drake.robots.arm import Arm as Arm
    from lic_drake.robots.registry import register_robot as register_robot
    from lic_drake.select.program import LicProgram as LicProgram
    from lic_drake.select.registry import make_selector as make_selector
    from lic_drake.select.situation import FailedReach as FailedReach
    from lic_drake.select.situation import Situation as Situation
    from lic_drake.show.apertures import draw_aperture_map as draw_aperture_map
    from lic_drake.show.apertures import estimate_apertures as estimate_apertures
    from lic_drake.show.density import densities_figure as densities_figure
    from lic_drake.show.recording import Recording as Recording
    from lic_drake.show.views import draw_snapshot as draw_snapshot
    from lic_drake.show.views import draw_view as draw_view
    from lic_drake.show.views import snapshots_figure as snapshots_figure
    from lic_drake.starts import make_starts as make_starts

__version__ = "0.1.0"

_HOMES = {
    "Arm": "robots.arm",
    "CollectionRequest": "experience.collect",
    "Evaluation": "evaluate.trial",
    "ExperienceLibrary": "experience.store",
    "FailedReach": "select.situation",
    "LicError": "errors",
    "LicProgram": "select.program",
    "ReachRecord": "reach.request",
    "ReachRequest": "reach.request",
    "Recording": "show.recording",
    "Scenario": "reach.scenario",
    "Situation": "select.situation",
    "Start": "reach.start",
    "Starts": "reach.start",
    "SuccessEstimator": "estimate.estimator",
    "category_names": "clutter.registry",
    "check_robot": "evaluate.robot_check",
    "collect": "experience.collect",
    "densities_figure": "show.density",
    "draw_aperture_map": "show.apertures",
    "draw_snapshot": "show.views",
    "draw_view": "show.views",
    "estimate_apertures": "show.apertures",
    "fit_rollouts": "evaluate.decisions",
    "from_sklearn": "estimate.estimator",
    "instance_of": "reach.session",
    "load_scenario": "reach.scenario",
    "make_reach_diagram": "reach.diagram",
    "make_selector": "select.registry",
    "make_starts": "starts",
    "read_rollouts": "estimate.rollouts",
    "register_category": "clutter.registry",
    "register_estimator": "estimate.registry",
    "register_robot": "robots.registry",
    "run_evaluation": "evaluate.trial",
    "run_reach": "reach.session",
    "run_trial": "evaluate.trial",
    "shipped_library": "paths",
    "simulate": "experience.runner",
    "simulate_request": "reach.session",
    "snapshots_figure": "show.views",
}

__all__ = ["__version__", *_HOMES]


def __getattr__(name: str) -> Any:
    """Imports a public name when it is first used."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Returns the public names."""
    return sorted(__all__)
