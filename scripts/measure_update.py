"""Measures how much quicker a Gaussian process goes on learning than it begins again.

python scripts/measure_update.py

Needs the records of scripts/learn_from_real.py.
"""

import sys
from pathlib import Path

import numpy as np

from lic_drake.estimate.categories import features_of
from lic_drake.estimate.features import ExperienceRows
from lic_drake.evaluate.report import run_script, write_table_files
from lic_drake.evaluate.update_time import time_update, update_table
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library

CATEGORY = "passage-clutter"
SIZES = (10, 100, 300, 1000, 2000)


def write(results: Path) -> list[Path]:
    features = features_of(CATEGORY).first
    rows = features.rows(ExperienceLibrary(shipped_library(CATEGORY)).columns())
    real = features.rows(ExperienceLibrary(results / "real_experience" / "records").columns())
    times = [
        time_update(rows, ExperienceRows(Z=real.Z[:n], f=real.f[:n], environment=np.arange(n)))
        for n in SIZES
    ]
    return write_table_files(results, "update", [update_table(times, len(rows.f))])


if __name__ == "__main__":
    sys.exit(run_script(write, __doc__))
