"""The `lic` command. A subcommand is a module with `add_parser` and `run`, and a line here."""

import argparse
import os
import sys
from collections.abc import Sequence

import lic_drake
from lic_drake.cli import (
    bench,
    collect,
    demo,
    evaluate,
    exit_codes,
    experience,
    gallery,
    reach,
    select,
)
from lic_drake.cli.arguments import Subparsers
from lic_drake.errors import LicError

SUBCOMMANDS = (demo, reach, select, collect, experience, evaluate, gallery, bench)
"""Modules with `add_parser(subparsers)`, which sets `run(args) -> int` as a parser default."""


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command line and returns the exit code.

    Args:
        argv: Arguments without the program's name; those of the process by default.
    """
    args, unknown = make_parser().parse_known_args(argv)
    if unknown:  # The subcommand's own parser knows what it takes.
        args.parser.error(f"unrecognized arguments: {' '.join(unknown)}")
    try:
        code: int = args.run(args)
        sys.stdout.flush()
        return code
    except LicError as error:
        print(f"lic: error: {' '.join(str(error).split())}", file=sys.stderr)
        return exit_codes.USER_ERROR
    except KeyboardInterrupt:
        print("lic: interrupted", file=sys.stderr)
        return exit_codes.INTERRUPTED
    except BrokenPipeError:
        # The reader has gone (`lic ... | head`); Python must not complain when it flushes at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return exit_codes.BROKEN_PIPE


def make_parser() -> argparse.ArgumentParser:
    """Returns the parser of the whole command line."""
    parser = argparse.ArgumentParser(
        prog="lic",
        description="Learning initial conditions for reaching into unknown clutter, on Drake.",
        epilog="Each subcommand explains itself: lic collect --help",
    )
    parser.add_argument("--version", action="version", version=f"lic {lic_drake.__version__}")
    subparsers = parser.add_subparsers(title="subcommands", metavar="SUBCOMMAND", required=True)
    for subcommand in SUBCOMMANDS:
        subcommand.add_parser(subparsers)
    _name_parsers(subparsers)
    return parser


def _name_parsers(subparsers: Subparsers) -> None:
    """Lets parsed arguments know the parser of their subcommand."""
    for parser in subparsers.choices.values():
        parser.set_defaults(parser=parser)
        for action in parser._actions:
            if isinstance(action, argparse._SubParsersAction):
                _name_parsers(action)
