"""Tabulates second attempts, LIC-2 beside other choices, from the recorded trials.

python scripts/tabulate_second_attempts.py
"""

import sys
from pathlib import Path

from lic_drake.evaluate.paper import TABLES
from lic_drake.evaluate.report import load_trials, run_script, write_table_files
from lic_drake.evaluate.second_table import second_attempts_table


def write(results: Path) -> list[Path]:
    tables = [
        second_attempts_table(load_trials(results, category), category, estimator)
        for category in TABLES
        for estimator in ("gp", "knn")
    ]
    return write_table_files(results, "second_attempts", tables)


if __name__ == "__main__":
    sys.exit(run_script(write, __doc__))
