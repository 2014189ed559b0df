"""Rebuilds Table IV, success in cylinder-aperture-clutter, from the recorded trials.

python scripts/table_4_aperture.py
"""

import sys

from lic_drake.evaluate.report import run_table_script

if __name__ == "__main__":
    sys.exit(run_table_script(4, __doc__))
