from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binomtest
from support.fake_reach import make_record, make_request

from lic_drake.experience.add import add_rows
from lic_drake.experience.check import (
    Difference,
    SourceSummary,
    check_library,
    recompute,
    summarize,
)
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.scenario import load_scenario

REQUEST = make_request()
RECORDS = [[make_record(item) for item in REQUEST.reaches(e)] for e in range(3)]


@pytest.fixture
def library(tmp_path: Path) -> ExperienceLibrary:
    library = ExperienceLibrary(tmp_path / "library")
    for environment in range(3):
        library.write_shard(f"shard-{environment}", RECORDS[environment], REQUEST.scenario)
    return library


def test_only_a_complete_library_is_sound(library: ExperienceLibrary) -> None:
    report = check_library(library, REQUEST)
    assert (report.shards, report.reaches, report.requested, report.missing) == (3, 36, 36, 0)
    assert (report.incomplete, report.scenarios) == ((), (REQUEST.scenario.digest,))
    assert report.is_sound
    library.shard_path("shard-1").unlink()
    report = check_library(library, REQUEST)
    assert (report.missing, report.incomplete, report.is_sound) == (12, (1,), False)
    report = check_library(library)
    assert (report.requested, report.missing, report.incomplete) == (None, None, ())
    assert report.is_sound


def test_damaged_files_are_reported_and_the_others_counted(library: ExperienceLibrary) -> None:
    shard = library.shard_path("shard-1")
    shard.write_bytes(shard.read_bytes()[:1000])
    (library.path / "empty.parquet").touch()
    report = check_library(library, REQUEST)
    assert list(report.damaged) == ["empty.parquet", "shard-1.parquet"]
    assert all(f"{name} is damaged" in reason for name, reason in report.damaged.items())
    assert report.incomplete == (1,)
    assert (report.reaches, report.missing, report.is_sound) == (24, 12, False)


def test_duplicates_are_reported(library: ExperienceLibrary) -> None:
    library.write_shard("twice", RECORDS[1][2:4], REQUEST.scenario)
    report = check_library(library)
    assert set(report.duplicates) == {record.key for record in RECORDS[1][2:4]}
    assert not report.is_sound


def test_mixed_scenarios_are_reported(library: ExperienceLibrary) -> None:
    other = load_scenario("cylinder-clutter", "{stop: {timeout_s: 20}}")
    library.write_shard(
        "other",
        [
            replace(make_record(r), scenario=other.digest)
            for r in make_request(scenario=other).reaches(0)
        ],
        other,
    )
    report = check_library(library)
    assert set(report.scenarios) == {REQUEST.scenario.digest, other.digest}
    assert not report.is_sound


def rng() -> np.random.Generator:
    return np.random.default_rng(3)


def test_every_simulated_row_is_drawn_once_and_reproduced(library: ExperienceLibrary) -> None:
    row = {"goal_x": 0.6, "goal_y": 0.1, "start_y": 0.0, "start_phi": 1.0, "success": 1}
    simulated = library.successes().keys()
    add_rows(library, [row], source="lab")
    asked: list[str] = []

    def reach(request: ReachRequest) -> ReachRecord:
        asked.append(request.key)
        return make_record(request)

    assert recompute(library, 100, rng(), reach=reach) == []
    assert sorted(asked) == sorted(simulated)


def test_a_difference_in_the_last_bit_is_reported(library: ExperienceLibrary) -> None:
    row = next(r for r in library.records() if r.outcome == "stuck")

    def reach(request: ReachRequest) -> ReachRecord:
        record = make_record(request)
        if request.key != row.key:
            return record
        final_x = np.nextafter(record.final_x, np.inf)
        return replace(record, outcome="timeout", final_x=float(final_x), wall_time_s=7.0)

    found = recompute(library, 36, rng(), reach=reach)
    expected = Difference(key=row.key, fields=("outcome", "final_x"), outcomes=("stuck", "timeout"))
    assert found == [expected]


def test_rows_of_the_shipped_library_are_reproduced() -> None:
    # Not bit for bit: that holds on the processor that collected it.
    library = ExperienceLibrary(shipped_library("cylinder-clutter"))
    differing = recompute(library, 25, rng())
    assert sum(row.outcomes[0] != row.outcomes[1] for row in differing) <= 1


def test_a_summary_agrees_with_pandas(library: ExperienceLibrary) -> None:
    row = {"goal_x": 0.6, "goal_y": 0.1, "start_y": 0.0, "start_phi": 1.0, "success": 1}
    frame = pd.read_parquet(library.path)
    add_rows(library, [row] * 3, source="lab", weight=4.0)
    summary = summarize(library)
    assert (summary.reaches, summary.shards, summary.streams) == (36, 4, ("training",))
    assert (summary.environments, summary.goals, summary.starts) == (3, 4, 3)
    assert summary.outcomes == frame["outcome"].value_counts().to_dict()
    assert list(summary.outcomes.values()) == sorted(summary.outcomes.values(), reverse=True)
    assert summary.successes == frame["success"].sum()
    assert summary.success_rate == frame["success"].mean()
    interval = binomtest(summary.successes, 36).proportion_ci(0.9, method="wilson")
    np.testing.assert_allclose(summary.success_interval, (interval.low, interval.high))
    np.testing.assert_allclose(summary.simulated_s, frame["duration_s"].sum())
    assert summary.scenario == REQUEST.scenario.digest
    assert summary.added == (SourceSummary(source="lab", reaches=3, successes=3, weights=(4.0,)),)
