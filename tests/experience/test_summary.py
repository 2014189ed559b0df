from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import binomtest
from support.fake_reach import fill_library, make_record, make_request

from lic_drake.experience.add import add_rows
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.summary import SourceSummary, summarize


def test_a_summary_agrees_with_pandas(tmp_path: Path) -> None:
    request = make_request()
    library = ExperienceLibrary(tmp_path / "library")
    for environment in request.environment_indices:
        records = [make_record(item) for item in request.reaches(environment)]
        library.write_shard(f"shard-{environment}", records, request.scenario)
    frame = pd.read_parquet(library.path)
    summary = summarize(library)
    assert (summary.reaches, summary.shards, summary.added) == (36, 3, ())
    assert (summary.environments, summary.goals, summary.starts) == (3, 4, 3)
    assert summary.streams == ("training",)
    assert summary.outcomes == frame["outcome"].value_counts().to_dict()
    assert list(summary.outcomes.values()) == sorted(summary.outcomes.values(), reverse=True)
    assert summary.successes == frame["success"].sum()
    assert summary.success_rate == frame["success"].mean()
    interval = binomtest(summary.successes, 36).proportion_ci(0.9, method="wilson")
    np.testing.assert_allclose(summary.success_interval, (interval.low, interval.high))
    np.testing.assert_allclose(summary.simulated_s, frame["duration_s"].sum())
    assert summary.scenario == request.scenario.digest


def test_rows_of_other_sources_are_counted_apart(tmp_path: Path) -> None:
    library = ExperienceLibrary(fill_library(tmp_path / "library"))
    before = summarize(library)
    rows = [{"goal_x": 0.6, "goal_y": 0.1, "start_y": 0.0, "start_phi": 1.0, "success": 1}] * 3
    add_rows(library, rows, source="lab", weight=4.0)
    after = summarize(library)
    assert after.added == (SourceSummary(source="lab", reaches=3, successes=3, weights=(4.0,)),)
    assert (after.reaches, after.successes) == (before.reaches, before.successes)
