import numpy as np
from support.trial_rows import make_rows

from lic_drake.evaluate.statistics import mcnemar
from lic_drake.evaluate.trials import TrialTable
from scripts.tables.foliage import foliage_table


def test_what_was_learned_among_foliage_stands_beside_spheres_and_baselines() -> None:
    rows = [
        *make_rows("rnd", ["00"] * 9 + ["01"], variant="cameras"),
        *make_rows("gp", ["1"] * 6 + ["01"] + ["00"] * 3, variant="cameras"),
        *make_rows("gp", ["1"] * 8 + ["00"] * 2, variant="cameras-foliage"),
        *make_rows("cost", ["1"] + ["00"] * 9, variant="known"),
    ]
    cells = {row[:3]: row[3:] for row in foliage_table(TrialTable(rows)).rows if row is not None}
    seen = "seen by cameras"
    assert cells[seen, "1st attempt", "LIC(GP), spheres"][2] == "6/10"
    assert cells[seen, "total of two", "LIC(GP), spheres"][2] == "7/10"
    # Against RND of the same condition, though its variant is another one.
    spheres, rnd = np.arange(10) < 8, np.arange(10) == 9
    p = cells[seen, "total of two", "LIC(GP), foliage"][3]
    assert p == f"{mcnemar(spheres, rnd):.2g}"
    assert cells[seen, "total of two", "LIC(GP), foliage"][4] == ""
    assert cells["known", "1st attempt", "COST"][2:] == ("1/10", "", "")
