from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.fake_reach import make_record
from support.fake_reach import make_request as make_collection

from lic_drake.errors import RequestError
from lic_drake.evaluate.trials import read_trials
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.scenario import load_scenario
from scripts.unknown_category.comparison import (
    NAMES,
    Comparison,
    compare,
    make_strategies,
    unknown_category_table,
)

LEFT_SUCCEEDS = {"cylinder-clutter": True, "passage-clutter": False}
"""Categories between which the best starts change sides."""


def reach(request: ReachRequest) -> ReachRecord:
    """Succeeds on one side only; where a failure ends, tells the category."""
    left = LEFT_SUCCEEDS[request.scenario.category]
    success = (request.start.x0[1] > 0.0) == left
    y = 0.2 if left else -0.2
    return replace(
        make_record(request),
        **{"success": success, "outcome": "reached" if success else "stuck"},
        **{"final_x": 0.5, "final_y": y, "final_phi": 0.0, "final_vx": 0.0, "final_vy": 0.01},
    )


@pytest.fixture
def comparison(tmp_path: Path) -> Comparison:
    libraries = {}
    for category in LEFT_SUCCEEDS:
        scenario = load_scenario(category)
        request = make_collection(scenario=scenario, max_goals=2, max_starts=None)
        library = libraries[category] = ExperienceLibrary(tmp_path / category)
        for environment in range(3):
            records = list(map(reach, request.reaches(environment)))
            library.write_shard(f"training-{environment}", records, scenario)
    return Comparison(libraries=libraries, goals_of="passage-clutter", results=tmp_path / "results")


@pytest.mark.slow
def test_all_strategies_meet_the_same_goals_and_a_failure_tells_the_category(
    comparison: Comparison,
) -> None:
    made: list[str] = []

    def counted(request: ReachRequest) -> ReachRecord:
        made.append(request.key)
        return reach(request)

    rows, beliefs = compare(
        comparison, range(2), say=lambda _: None, reach=counted, estimator="knn"
    )
    assert read_trials(comparison.results / "trials.parquet") == rows
    first = [row for row in rows if row.attempt == 1]
    assert len(first) == 2 * 2 * len(NAMES)
    rate = {
        (name, number): np.mean(
            [
                any(r.success for r in rows if key(r) == key(row) and r.attempt <= number)
                for row in first
                if row.method == name
            ]
        )
        for name in NAMES
        for number in (1, 2)
    }
    assert rate["known", 1] == 1.0
    assert rate["wrong", 1] == 0.0
    # The mixtures begin on one side, the same in both categories.
    assert rate["final", 1] == rate["failure", 1] == rate["fixed", 1] == 0.5
    assert rate["final", 2] == rate["failure", 2] == 1.0
    believed = [p for of in beliefs["final"].values() for p in of]
    assert len(believed) == 2 and min(believed) > 0.9
    goals = {tuple(r.p_WG) for c in LEFT_SUCCEEDS for r in records_of(comparison, c)}
    assert len(goals) == 2
    again, _ = compare(comparison, range(2), say=lambda _: None, reach=pytest.fail, estimator="knn")
    assert [replace(r, seconds=0.0) for r in again] == [replace(r, seconds=0.0) for r in rows]
    table = unknown_category_table(rows, beliefs)
    assert [row[0] for row in table.rows if row] == list(NAMES.values())
    assert table.rows[0][1].startswith("100.0 (") and table.rows[0][1].endswith("4/4)")
    assert table.rows[1][-1] == "100 (2)"


def key(row: object) -> tuple[object, ...]:
    return (row.variant, row.method, row.environment)


def records_of(comparison: Comparison, category: str) -> list[ReachRecord]:
    return ExperienceLibrary(comparison.results / category).records()


def test_categories_that_share_no_starts_cannot_be_mixed(comparison: Comparison) -> None:
    other = load_scenario("passage-clutter", "{task: {start_line: {x_m: 0.33}}}")
    request = make_collection(scenario=other, max_goals=1)
    library = ExperienceLibrary(comparison.results / "other")
    library.write_shard("all", list(map(reach, request.reaches(0))), other)
    cylinders = comparison.libraries["cylinder-clutter"]
    mixed = {"cylinder-clutter": cylinders, "passage-clutter": library}
    with pytest.raises(RequestError, match="have other arms or start lines"):
        make_strategies(replace(comparison, libraries=mixed), "knn")
    with pytest.raises(RequestError, match="two categories are compared"):
        make_strategies(replace(comparison, libraries={"cylinder-clutter": cylinders}), "knn")
