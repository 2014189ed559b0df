"""Rebuilds the table of the PR2's success before foliage from the recorded trials.

python scripts/table_foliage.py
"""

import sys
from pathlib import Path

from lic_drake.evaluate.foliage_table import foliage_table
from lic_drake.evaluate.report import run_script, write_table_files
from lic_drake.evaluate.trials import TrialTable, read_trials


def write(results: Path) -> list[Path]:
    path = results / "foliage-aperture-clutter" / "trials.parquet"
    return write_table_files(
        results, "table_foliage", [foliage_table(TrialTable(read_trials(path)))]
    )


if __name__ == "__main__":
    sys.exit(run_script(write, __doc__))
