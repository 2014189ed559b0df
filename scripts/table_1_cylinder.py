"""Rebuilds Table I, success in cylinder-clutter, from the recorded trials.

python scripts/table_1_cylinder.py
"""

import sys

from lic_drake.evaluate.report import run_table_script

if __name__ == "__main__":
    sys.exit(run_table_script(1, __doc__))
