"""Rebuilds Tables I to IV and those of the PR2 and of foliage from the recorded trials.

python scripts/tables/run.py
"""

import sys
from pathlib import Path

from lic_drake.evaluate.trials import TrialTable, read_trials
from lic_drake.experience.store import ExperienceLibrary
from scripts.common import run_script, write_table_files, write_tables
from scripts.tables.foliage import foliage_table
from scripts.tables.pr2 import oracle_table, space_table


def write(results: Path) -> list[Path]:
    paths = [path for number in (1, 2, 3, 4) for path in write_tables(results, number)]
    trials = TrialTable(read_trials(results / "sphere-aperture-clutter" / "trials.parquet"))
    every = ExperienceLibrary(results / "bounds" / "sphere-aperture-clutter" / "factorial")
    tables = [space_table(trials), oracle_table(trials, every.columns())]
    paths += write_table_files(results, "table_pr2", tables)
    trials = TrialTable(read_trials(results / "foliage-aperture-clutter" / "trials.parquet"))
    return paths + write_table_files(results, "table_foliage", [foliage_table(trials)])


if __name__ == "__main__":
    sys.exit(run_script(write, __doc__))
