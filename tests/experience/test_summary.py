from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import binomtest
from support.fake_reach import make_record, make_request

from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.summary import summarize


def test_a_summary_agrees_with_pandas(tmp_path: Path) -> None:
    request = make_request()
    library = ExperienceLibrary(tmp_path / "library")
    for environment in request.environment_indices:
        records = [make_record(item) for item in request.reaches(environment)]
        library.write_shard(f"shard-{environment}", records, request.scenario)
    frame = pd.read_parquet(library.path)
    summary = summarize(library)
    assert (summary.reaches, summary.shards, summary.journalled) == (36, 3, 0)
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
