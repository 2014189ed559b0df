"""Draws the figures from the recorded trials, each as PNG and PDF.

python scripts/make_figures.py
python scripts/make_figures.py success_cylinder-clutter learning_curve
"""

import argparse
import sys
from pathlib import Path

from lic_drake.errors import LicError
from lic_drake.evaluate.gallery import FIGURES
from lic_drake.evaluate.report import RESULTS
from lic_drake.show.plots import save_figure


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", choices=list(FIGURES), help="default: all of them")
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder of all records")
    args = parser.parse_args()
    folder = args.results / "figures"
    failed = False
    for name in args.names or FIGURES:
        try:
            figure = FIGURES[name](args.results)
            folder.mkdir(parents=True, exist_ok=True)
            for suffix in (".png", ".pdf"):
                save_figure(figure, folder / f"{name}{suffix}")
        except LicError as error:
            print(f"error: {error}", file=sys.stderr)
            failed = True
        else:
            print(folder / f"{name}.png")
    return 2 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
