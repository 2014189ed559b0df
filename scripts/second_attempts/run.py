"""Makes second attempts after failures of LIC-1 in training environments, as a library for LIC-2.

python scripts/second_attempts/run.py models/experience/cylinder-clutter \
    notebooks/results/second_attempts/cylinder-clutter --first 20 --environments 20
"""

import argparse
import os
import sys
from pathlib import Path

from lic_drake.experience.store import ExperienceLibrary
from scripts.second_attempts.collect import collect_second_attempts


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("library", type=Path, help="library that LIC-1 learns from")
    parser.add_argument("output", type=Path, help="folder for the attempts")
    parser.add_argument("--first", type=int, default=20, help="index of the first environment")
    parser.add_argument("--environments", type=int, default=20)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    args = parser.parse_args()
    count = collect_second_attempts(
        ExperienceLibrary(args.library),
        ExperienceLibrary(args.output),
        range(args.first, args.first + args.environments),
        workers=args.workers,
    )
    print(f"{count} second attempts in {args.output}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
