"""Strategies of a library to which experience was added."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from support.fake_reach import fill_library

from lic_drake.estimate.features import PLANAR_LIC1
from lic_drake.experience.add import add_rows
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.select.lic import LicSelector
from lic_drake.select.registry import fit_model, make_selector
from lic_drake.types import Vector

QUERY = np.array([[0.6, 0.1, 0.2, 1.0]])
END = {f"final_{name}": 0.1 for name in ("x", "y", "phi", "vx", "vy")}


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ExperienceLibrary:
    """With thirty failures in as many places and a place with a failure and a success after it."""
    library = ExperienceLibrary(fill_library(tmp_path_factory.mktemp("library") / "mine"))
    start = {"goal_x": 0.6, "goal_y": 0.1, "start_y": 0.2, "start_phi": 1.0}
    rows = [{**start, "success": False} for _ in range(30)]
    rows += [{**start, **END, "success": won, "environment": 500} for won in (False, True)]
    add_rows(library, rows, source="lab", weight=20.0)
    return library


def without_and_with(library: ExperienceLibrary) -> list[dict[str, NDArray[Any]]]:
    """The columns of the simulated rows, and of all rows."""
    columns = library.columns()
    simulated = columns["source"] == "simulation"
    return [{name: values[simulated] for name, values in columns.items()}, columns]


def second(selector: object) -> Vector:
    """LIC-2's estimate after the failure of the added pair."""
    assert isinstance(selector, LicSelector) and selector.second is not None
    names = selector.second.features.columns
    known = {"goal_x": 0.6, "goal_y": 0.1, "start_y": 0.2, "start_phi": 1.0}
    known |= {"first_start_y": 0.2, "first_start_phi": 1.0, "first_final_x": 0.1}
    return selector.second.estimator.values([[known.get(name, 0.1) for name in names]])


@pytest.mark.parametrize("method", ["gp1", "knn1", "knn1>cost"])
def test_the_first_attempts_estimates_take_what_was_added_in(
    method: str, library: ExperienceLibrary
) -> None:
    chosen = [make_selector(method, columns) for columns in without_and_with(library)]
    models = [getattr(selector, "first", selector) for selector in chosen]
    models = [getattr(model, "first", model) for model in models]
    before, after = (model.estimator.values(QUERY)[0] for model in models)
    assert after < 0.5 * before


def test_the_second_attempts_estimates_learn_from_added_pairs(library: ExperienceLibrary) -> None:
    before, after = (second(make_selector("knn", columns)) for columns in without_and_with(library))
    # The added failure was followed by itself, which fails again, and by the success.
    assert after[0] == pytest.approx(0.5, abs=0.05)
    assert before[0] != pytest.approx(0.5, abs=0.05)


def test_settings_come_from_the_simulation_alone(library: ExperienceLibrary) -> None:
    plain, conditioned = (
        fit_model("knn", PLANAR_LIC1, columns).estimator for columns in without_and_with(library)
    )
    np.testing.assert_array_equal(conditioned.bandwidth_, plain.bandwidth_)
    assert np.any(conditioned.values(QUERY) != plain.values(QUERY))
