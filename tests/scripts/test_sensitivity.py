from pathlib import Path

import pytest
from support.made_up import part_of_shipped

from scripts.sensitivity.run import VARIANTS, compare


def test_strategies_are_read_from_the_same_reaches(tmp_path: Path) -> None:
    library = part_of_shipped(tmp_path / "library", "cylinder-clutter", 3, least_y=0.15)
    cells = compare(library)
    rnd, cost, lic, oracle, gain = (float(cell.split(" ±")[0]) for cell in cells[:5])
    assert rnd == pytest.approx(100.0 * library.columns()["success"].mean(), abs=0.06)
    assert rnd < min(cost, lic) and max(cost, lic) < oracle
    assert gain == pytest.approx(lic - cost, abs=0.11)
    assert 0.0 <= float(cells[5]) <= 1.0
    assert len(VARIANTS) == len(set(VARIANTS.values()))
