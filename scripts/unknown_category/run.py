"""Compares selections where the clutter is either cylinder-clutter or passage-clutter.

python scripts/unknown_category/run.py

Goals are those of passages in both, so that they tell nothing of the category. Run again, it goes
on where it was.
"""

import argparse
import sys
from pathlib import Path

from lic_drake.errors import LicError
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from scripts.common import RESULTS, write_tables
from scripts.unknown_category.comparison import Comparison, compare, unknown_category_table

CATEGORIES = ("cylinder-clutter", "passage-clutter")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder of all records")
    parser.add_argument("--environments", type=int, default=150, help="of each category")
    args = parser.parse_args()
    comparison = Comparison(
        libraries={name: ExperienceLibrary(shipped_library(name)) for name in CATEGORIES},
        goals_of="passage-clutter",
        results=args.results / "unknown_category",
    )
    try:
        rows, beliefs = compare(
            comparison, range(args.environments), lambda line: print(line, flush=True)
        )
        table = unknown_category_table(rows, beliefs)
        paths = write_tables(args.results, "unknown_category", [table])
    except LicError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    for path in paths:
        print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main())
