"""Tabulates second attempts, LIC-2 beside other choices, from the recorded trials.

python scripts/tabulate_second_attempts.py
"""

import argparse
import sys
from pathlib import Path

from lic_drake.errors import LicError
from lic_drake.evaluate.paper import TABLES
from lic_drake.evaluate.report import RESULTS, load_trials, write_table_files
from lic_drake.evaluate.second_table import second_attempts_table


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder of all records")
    args = parser.parse_args()
    try:
        tables = [
            second_attempts_table(load_trials(args.results, category), category, estimator)
            for category in TABLES
            for estimator in ("gp", "knn")
        ]
        for path in write_table_files(args.results, "second_attempts", tables):
            print(path)
    except LicError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
