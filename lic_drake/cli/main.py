"""The `lic` command. Subcommands are added by the modules listed here."""

import argparse
import os
import sys
from collections.abc import Sequence

import lic_drake
from lic_drake.cli import collect, demo, evaluate, experience, explore, fit, reach, robot, select
from lic_drake.cli.arguments import BROKEN_PIPE, INTERRUPTED, USER_ERROR
from lic_drake.errors import LicError, remark

SUBCOMMANDS = (demo, explore, reach, select, fit, collect, experience, evaluate, robot)
"""Modules with `add_parser(subparsers)`, which sets `run(args) -> int` as a parser default."""


def main(argv: Sequence[str] | None = None) -> int:
    """Runs arguments, by default those of the process, and returns the exit code."""
    args, unknown = make_parser().parse_known_args(argv)
    if unknown:  # Reported with the usage of the subcommand.
        args.parser.error(f"unrecognized arguments: {' '.join(unknown)}")
    try:
        code: int = args.run(args)
        sys.stdout.flush()
        return code
    except LicError as error:
        remark(f"lic: error: {' '.join(str(error).split())}")
        return USER_ERROR
    except KeyboardInterrupt:
        resumable = args.run in (collect.run, evaluate.run, robot.run_train)
        hint = "; finished environments are kept, run the same command to resume"
        remark(f"lic: interrupted{hint if resumable else ''}")
        return INTERRUPTED
    except BrokenPipeError:
        # As in `lic ... | head`; keeps Python from complaining when it flushes at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE


def make_parser() -> argparse.ArgumentParser:
    """Returns the parser of the whole command line."""
    parser = argparse.ArgumentParser(
        prog="lic",
        description="Learning initial conditions for reaching into unknown clutter, on Drake.",
        epilog="Help on a subcommand: lic collect --help",
    )
    parser.add_argument("--version", action="version", version=f"lic {lic_drake.__version__}")
    subparsers = parser.add_subparsers(title="subcommands", metavar="SUBCOMMAND", required=True)
    for subcommand in SUBCOMMANDS:
        subcommand.add_parser(subparsers)
    return parser
