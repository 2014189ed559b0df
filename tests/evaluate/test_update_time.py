from dataclasses import replace

import numpy as np

from lic_drake.estimate.features import ExperienceRows
from lic_drake.evaluate.update_time import time_update, update_table


def test_an_update_is_timed_against_what_gives_the_same() -> None:
    rng = np.random.default_rng(0)
    rows = ExperienceRows(
        Z=rng.uniform(size=(150, 4)),
        f=rng.integers(0, 2, 150).astype(float),
        environment=np.arange(150) // 10,
    )
    added = replace(rows, Z=rng.uniform(size=(150, 4)), weight=3.0)
    time = time_update(rows, added)
    assert time.records == 150
    assert 0.0 < time.update_s < time.fit_s
    assert 0.0 < time.condition_s < time.fit_s
    assert time.difference < 1e-9
    (row,) = update_table([time], reaches=150).rows
    assert row is not None and row[0] == "150"
