from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binomtest
from support.fake_reach import make_record, make_request

from lic_drake.experience.add import add_rows
from lic_drake.experience.check import check_library, recompute, summarize
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.scenario import load_scenario

REQUEST = make_request()
RECORDS = [[make_record(item) for item in REQUEST.reaches(e)] for e in range(3)]
ROW = {"goal_x": 0.6, "goal_y": 0.1, "start_y": 0.0, "start_phi": 1.0, "success": 1}


@pytest.fixture
def library(tmp_path: Path) -> ExperienceLibrary:
    library = ExperienceLibrary(tmp_path / "library")
    for environment in range(3):
        library.write_shard(f"shard-{environment}", RECORDS[environment], REQUEST.scenario)
    return library


def test_only_a_complete_library_is_sound(library: ExperienceLibrary) -> None:
    report = {"shards": 3, "reaches": 36, "damaged": {}, "duplicates": [], "incomplete": []}
    report |= {"scenarios": [REQUEST.scenario.digest], "requested": 36, "missing": 0}
    assert check_library(library, REQUEST) == {**report, "is_sound": True}
    library.shard_path("shard-1").unlink()
    report |= {"shards": 2, "reaches": 24, "missing": 12, "incomplete": [1]}
    assert check_library(library, REQUEST) == {**report, "is_sound": False}
    report |= {"requested": None, "missing": None, "incomplete": []}
    assert check_library(library) == {**report, "is_sound": True}


def test_duplicates_and_mixed_scenarios_are_reported(library: ExperienceLibrary) -> None:
    twice = library.write_shard("twice", RECORDS[1][2:4], REQUEST.scenario)
    report = check_library(library)
    assert set(report["duplicates"]) == {record.key for record in RECORDS[1][2:4]}
    assert not report["is_sound"]
    twice.unlink()
    other = load_scenario("cylinder-clutter", "{stop: {timeout_s: 20}}")
    records = [make_record(item) for item in make_request(scenario=other).reaches(0)]
    library.write_shard("other", records, other)
    report = check_library(library)
    assert set(report["scenarios"]) == {REQUEST.scenario.digest, other.digest}
    assert not report["is_sound"]


def test_every_simulated_row_is_drawn_once_and_differences_in_the_last_bit_are_found(
    library: ExperienceLibrary,
) -> None:
    simulated = library.successes().keys()
    changed = next(row for row in library.records() if row.outcome == "stuck")
    add_rows(library, [ROW], source="lab")

    def reach(request: ReachRequest) -> ReachRecord:
        record = make_record(request)
        if request.key != changed.key:
            return record
        final_x = float(np.nextafter(record.final_x, np.inf))
        return replace(record, outcome="timeout", final_x=final_x, wall_time_s=7.0)

    found = list(recompute(library, 100, np.random.default_rng(3), reach))
    assert sorted(old.key for old, _, _ in found) == sorted(simulated)
    assert [(old.key, old.outcome, new.outcome, names) for old, new, names in found if names] == [
        (changed.key, "stuck", "timeout", ["outcome", "final_x"])
    ]


def test_rows_of_the_shipped_libraries_are_reproduced() -> None:
    # Not bit for bit: that holds on the processor that collected them.
    found = []
    for name, rows in (("cylinder-clutter", 2), ("passage-clutter", 3)):
        library = ExperienceLibrary(shipped_library(name))
        found += recompute(library, rows, np.random.default_rng(3))
    assert len(found) == 5
    assert sum(old.outcome != new.outcome for old, new, _ in found) <= 1


def test_a_summary_agrees_with_pandas(library: ExperienceLibrary) -> None:
    frame = pd.read_parquet(library.path)
    add_rows(library, [ROW] * 3, source="lab", weight=4.0)
    summary = summarize(library)
    counts = {"reaches": 36, "shards": 4, "environments": 3, "goals": 4, "starts": 3}
    assert {name: summary[name] for name in counts} == counts
    assert summary["outcomes"] == frame["outcome"].value_counts().to_dict()
    assert list(summary["outcomes"].values()) == sorted(summary["outcomes"].values())[::-1]
    assert summary["successes"] == frame["success"].sum()
    interval = binomtest(summary["successes"], 36).proportion_ci(0.9, method="wilson")
    np.testing.assert_allclose(summary["success_interval"], (interval.low, interval.high))
    assert summary["scenario"] == REQUEST.scenario.digest
    assert summary["added"] == {"lab": {"reaches": 3, "successes": 3, "weights": [4.0]}}
