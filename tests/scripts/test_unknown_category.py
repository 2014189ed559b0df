from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.fake_reach import make_record
from support.fake_reach import make_request as make_collection

from lic_drake.evaluate.trials import read_trials
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.scenario import load_scenario
from scripts.unknown_category.run import (
    NAMES,
    common_scenario,
    compare,
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


def make_libraries(folder: Path) -> dict[str, ExperienceLibrary]:
    libraries = {}
    for category in LEFT_SUCCEEDS:
        scenario = load_scenario(category)
        request = make_collection(scenario=scenario, max_goals=2, max_starts=None)
        library = libraries[category] = ExperienceLibrary(folder / category)
        for environment in range(3):
            records = list(map(reach, request.reaches(environment)))
            library.write_shard(f"training-{environment}", records, scenario)
    return libraries


@pytest.mark.slow
def test_all_strategies_meet_the_same_goals_and_a_failure_tells_the_category(
    tmp_path: Path,
) -> None:
    libraries, results = make_libraries(tmp_path), tmp_path / "results"
    goals = common_scenario(libraries["passage-clutter"])
    rows, beliefs = compare(libraries, goals, results, range(2), reach, "knn")
    assert read_trials(results / "trials.parquet") == rows
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
    records = [r for c in LEFT_SUCCEEDS for r in ExperienceLibrary(results / c).records()]
    assert len({tuple(r.p_WG) for r in records}) == 2
    again, _ = compare(libraries, goals, results, range(2), pytest.fail, "knn")
    assert [replace(r, seconds=0.0) for r in again] == [replace(r, seconds=0.0) for r in rows]
    table = unknown_category_table(rows, beliefs)
    assert [row[0] for row in table.rows if row] == list(NAMES.values())
    assert table.rows[0][1].startswith("100.0 (") and table.rows[0][1].endswith("4/4)")
    assert table.rows[1][-1] == "100 (2)"


def key(row: object) -> tuple[object, ...]:
    return (row.variant, row.method, row.environment)
