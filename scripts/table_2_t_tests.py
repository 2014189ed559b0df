"""Rebuilds Table II, tests between strategies in cylinder-clutter, from the recorded trials.

python scripts/table_2_t_tests.py
"""

import sys

from lic_drake.evaluate.report import run_table_script

if __name__ == "__main__":
    sys.exit(run_table_script(2, __doc__))
