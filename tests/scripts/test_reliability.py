from pathlib import Path

import numpy as np
import pytest

from lic_drake.evaluate.reliability import Reliability
from scripts.tables import reliability


def test_what_was_expected_stands_beside_what_came(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reliability, "CATEGORIES", {"sphere-aperture-clutter": ""})
    expected, refused = reliability.tabulate(Path("notebooks/results"))
    rows = {row[1:3]: row for row in expected.rows if row is not None}
    for method, won in (("gp", "213"), ("knn", "208")):  # As in table_pr2.md.
        assert rows[method, "1"][4] == "300" and rows[method, "1"][-1] == won
    assert [row[:3] for row in refused.rows if row] == [row[:3] for row in expected.rows if row]


def test_intervals_are_those_of_both_sources_of_chance() -> None:
    sure = Reliability(np.array([0.0, 1.0]), np.zeros((2, 2)), 1000)
    low, high = reliability.spread(sure, np.full(400, 0.5))
    assert (low, high) == pytest.approx((200 - 16.4, 200 + 16.4), abs=3.0)
    wide = Reliability(np.array([0.0, 1.0]), np.diag([0.04, 0.0]), 100)
    assert np.ptp(reliability.spread(wide, np.full(400, 0.5))) > 1.5 * (high - low)
