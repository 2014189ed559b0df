"""Rebuilds Table III, success in passage-clutter, from the recorded trials.

python scripts/table_3_passage.py
"""

import sys

from lic_drake.evaluate.report import run_table_script

if __name__ == "__main__":
    sys.exit(run_table_script(3, __doc__))
