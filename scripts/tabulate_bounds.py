"""Tabulates what the best choice of starts could attain, and the share that LIC attains.

python scripts/tabulate_bounds.py
"""

import sys
from pathlib import Path

from lic_drake.evaluate.bounds_report import bounds_tables
from lic_drake.evaluate.report import run_script, write_table_files


def write(results: Path) -> list[Path]:
    return write_table_files(results, "bounds", bounds_tables(results))


if __name__ == "__main__":
    sys.exit(run_script(write, __doc__))
