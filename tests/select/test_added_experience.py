"""Strategies of a library to which experience was added."""

import numpy as np
import pytest
from support.fake_reach import fill_library
from support.starts import ARM

from lic_drake.estimate.features import PLANAR_LIC1
from lic_drake.experience.added import add_records, added_columns
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
    add_records(library, rows, source="lab", weight=20.0)
    return library


def second(selector: object) -> Vector:
    """LIC-2's estimate after the failure of the added pair."""
    assert isinstance(selector, LicSelector) and selector.second is not None
    names = selector.second.features.names
    known = {"goal_x": 0.6, "goal_y": 0.1, "start_y": 0.2, "start_phi": 1.0}
    known |= {"first_start_y": 0.2, "first_start_phi": 1.0, "first_final_x": 0.1}
    return selector.second.estimator.values([[known.get(name, 0.1) for name in names]])


@pytest.mark.parametrize("method", ["gp1", "knn1", "knn1>cost"])
def test_the_first_attempts_estimates_take_what_was_added_in(
    method: str, library: ExperienceLibrary
) -> None:
    columns, added = library.columns(), added_columns(library)
    chosen = [make_selector(method, ARM, columns, added=extra) for extra in (None, added)]
    models = [getattr(selector, "first", selector) for selector in chosen]
    models = [getattr(model, "first", model) for model in models]
    before, after = (model.estimator.values(QUERY)[0] for model in models)
    assert after < 0.2 < before - 0.1


def test_the_second_attempts_estimates_learn_from_added_pairs(library: ExperienceLibrary) -> None:
    columns, added = library.columns(), added_columns(library)
    before = second(make_selector("knn", ARM, columns))
    after = second(make_selector("knn", ARM, columns, added=added))
    # The added failure was followed by itself, which fails again, and by the success.
    assert after[0] == pytest.approx(0.5, abs=0.05)
    assert before[0] != pytest.approx(0.5, abs=0.05)


def test_settings_come_from_the_simulation_alone(library: ExperienceLibrary) -> None:
    columns, added = library.columns(), added_columns(library)
    plain = fit_model("knn", PLANAR_LIC1, columns)
    assert fit_model("knn", PLANAR_LIC1, columns, {**added, "success": np.zeros(0)}) is not plain
    conditioned = fit_model("knn", PLANAR_LIC1, columns, added)
    np.testing.assert_array_equal(conditioned.estimator.bandwidth_, plain.estimator.bandwidth_)


def test_source_and_weight_may_be_columns_of_the_library(library: ExperienceLibrary) -> None:
    columns, added = library.columns(), added_columns(library)
    n, more = len(columns["success"]), len(added["success"])
    both = {
        name: np.concatenate([values, added[name]])
        for name, values in columns.items()
        if name in added
    }
    both["weight"] = np.concatenate([np.ones(n), added["weight"]])
    both["source"] = np.repeat(["simulation", "lab"], [n, more])
    apart, together = (
        fit_model("knn", PLANAR_LIC1, *data).estimator for data in ((columns, added), (both,))
    )
    np.testing.assert_allclose(together.values(QUERY), apart.values(QUERY), rtol=1e-12)
