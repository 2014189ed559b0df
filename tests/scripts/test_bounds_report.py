import re
from pathlib import Path

import numpy as np
import pytest

from lic_drake.experience.store import ExperienceLibrary
from lic_drake.select.baselines import corridor_cost
from scripts.bounds.table import bounds_tables

RESULTS = Path(__file__).resolve().parents[2] / "notebooks" / "results"


@pytest.fixture(scope="module")
def rates() -> dict[tuple[str, str, str], float]:
    """Rates of the committed records: (category, attempts, choice) -> success, %."""
    found = {}
    for table in bounds_tables(RESULTS):
        match = re.search(r"Bounds in ([\w-]+),", table.caption)
        assert match is not None
        for row in table.rows:
            assert row is not None
            found[match.group(1), row[0], row[1]] = float(row[2])
    return found


def test_cost_is_what_a_plain_loop_finds(rates: dict[tuple[str, str, str], float]) -> None:
    records = ExperienceLibrary(RESULTS / "bounds/passage-clutter/factorial").records()
    cheapest: dict[int, tuple[float, bool]] = {}
    for record in records:
        cost = float(corridor_cost(record.start.x0[None], record.p_WG)[0])
        best = cheapest.get(record.environment, (np.inf, False))
        cheapest[record.environment] = min(best, (cost, record.success))
    share = np.mean([success for _, success in cheapest.values()])
    found = rates["passage-clutter", "1", "COST, discrete starts"]
    assert found == pytest.approx(100 * share, abs=0.051)


@pytest.mark.parametrize("category", ["cylinder-clutter", "passage-clutter"])
def test_nothing_beats_the_oracle_and_lic_comes_near_the_best_start_for_each_goal(
    category: str, rates: dict[tuple[str, str, str], float]
) -> None:
    mine = {choice: rate for (c, k, choice), rate in rates.items() if (c, k) == (category, "1")}
    assert max(mine.values()) == mine["oracle"]
    lic = mine["LIC(GP), discrete starts"]
    assert lic > mine["RND"]
    assert lic >= 0.97 * mine["best start for each goal, held out"]
