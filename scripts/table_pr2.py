"""Rebuilds the table of the PR2's success from the recorded trials.

python scripts/table_pr2.py
"""

import sys
from pathlib import Path

from lic_drake.evaluate.report import run_script, write_table_files
from lic_drake.evaluate.space_table import space_table
from lic_drake.evaluate.trials import TrialTable, read_trials


def write(results: Path) -> list[Path]:
    path = results / "sphere-aperture-clutter" / "trials.parquet"
    return write_table_files(results, "table_pr2", [space_table(TrialTable(read_trials(path)))])


if __name__ == "__main__":
    sys.exit(run_script(write, __doc__))
