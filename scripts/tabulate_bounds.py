"""Tabulates what the best choice of starts could attain, and the share that LIC attains.

python scripts/tabulate_bounds.py
"""

import argparse
import sys
from pathlib import Path

from lic_drake.errors import LicError
from lic_drake.evaluate.bounds_report import bounds_tables
from lic_drake.evaluate.report import RESULTS, write_table_files


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder of all records")
    args = parser.parse_args()
    try:
        for path in write_table_files(args.results, "bounds", bounds_tables(args.results)):
            print(path)
    except LicError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
