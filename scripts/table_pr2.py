"""Rebuilds the table of the PR2's success from the recorded trials.

python scripts/table_pr2.py
"""

import sys
from pathlib import Path

from lic_drake.evaluate.report import run_script, write_table_files
from lic_drake.evaluate.space_table import oracle_table, space_table
from lic_drake.evaluate.trials import TrialTable, read_trials
from lic_drake.experience.store import ExperienceLibrary


def write(results: Path) -> list[Path]:
    trials = TrialTable(read_trials(results / "sphere-aperture-clutter" / "trials.parquet"))
    every = ExperienceLibrary(results / "bounds" / "sphere-aperture-clutter" / "factorial")
    tables = [space_table(trials), oracle_table(trials, every.columns())]
    return write_table_files(results, "table_pr2", tables)


if __name__ == "__main__":
    sys.exit(run_script(write, __doc__))
