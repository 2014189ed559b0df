"""`lic gallery`: shows chosen reaches on one static page."""

import argparse
import json
import sys
from pathlib import Path

from lic_drake.cli.arguments import (
    Subparsers,
    add_json_argument,
    add_method_argument,
    non_negative_int,
    positive_int,
)


def add_parser(subparsers: Subparsers) -> None:
    """Adds the subcommand to the command line."""
    parser = subparsers.add_parser(
        "gallery",
        help="show chosen reaches on one static page",
        description="Writes index.html: recordings, stills and numbers of reaches in environments"
        " that are in no library, successes and failures of each category. The page is one file"
        " that needs no network, for a web server or a mail.",
        epilog="example: lic gallery out/gallery --each 2",
    )
    parser.add_argument("out", metavar="OUT", type=Path, help="folder to write to")
    add_method_argument(parser)
    parser.add_argument(
        "--library",
        type=Path,
        nargs="+",
        metavar="FOLDER",
        help="experience libraries, one for each category to show (default: all shipped ones)",
    )
    parser.add_argument(
        "--each",
        type=positive_int,
        default=1,
        metavar="N",
        help="successes, and as many failures, in each category (default: %(default)s)",
    )
    parser.add_argument(
        "--seed",
        type=non_negative_int,
        default=0,
        metavar="N",
        help="index of the environment to begin with (default: %(default)s)",
    )
    add_json_argument(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Runs the subcommand and returns the exit code."""
    from lic_drake.errors import check_writable
    from lic_drake.experience.schema import write_atomically
    from lic_drake.experience.store import ExperienceLibrary
    from lic_drake.paths import shipped_libraries
    from lic_drake.select.registry import check_method
    from lic_drake.show.gallery import choose_exhibits, make_gallery, numbers_of

    check_method(args.method)
    check_writable(args.out)
    libraries = [ExperienceLibrary(path) for path in args.library or shipped_libraries()]
    for library in libraries:  # Before the first one is learned from.
        library.scenario()
    exhibits = [
        exhibit
        for library in libraries
        for exhibit in choose_exhibits(
            library,
            args.method,
            args.each,
            args.seed,
            say=lambda line: print(line, file=sys.stderr, flush=True),
        )
    ]
    path = args.out / "index.html"
    page = make_gallery(exhibits, args.method)
    write_atomically(path, lambda temporary: _write(temporary, page))
    if not args.json:
        print(f"page: {path} ({len(page) / 1e6:.1f} MB, {len(exhibits)} trials)")
        return 0
    content = {
        "page": str(path),
        "bytes": path.stat().st_size,
        "method": args.method,
        "trials": [
            {
                "category": exhibit.scenario.category,
                "environment": exhibit.environment,
                "goal": exhibit.p_WG.tolist(),
                "success": exhibit.success,
                "attempts": [numbers_of(i, a) for i, a in enumerate(exhibit.attempts, start=1)],
            }
            for exhibit in exhibits
        ],
    }
    print(json.dumps(content))
    return 0


def _write(path: Path, page: str) -> None:
    path.write_text(page, encoding="utf-8")
