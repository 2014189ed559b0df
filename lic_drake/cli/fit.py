"""`lic fit`: learns from anybody's table of rollouts what to decide in a situation."""

import argparse
from pathlib import Path
from typing import Any

from lic_drake.cli.arguments import (
    Subparsers,
    add_command,
    print_result,
    quick_imports,
)
from lic_drake.errors import LicError, check_writable, quoted, remark


def add_parser(subparsers: Subparsers) -> None:
    """Adds the subcommand to the command line."""
    parser = add_command(
        subparsers,
        "fit",
        run,
        "learn from any table of rollouts what to decide",
        "Reads a CSV or Parquet file with one attempt a row, of any robot and any task. Columns are"
        " taken as they are, in any unit; give an angle that wraps around as its sine and cosine."
        " With --at it prints the decision with the highest estimate there, within the ranges that"
        " the table has, and the probability, with its 90 % interval, that choices with such an"
        " estimate succeed. Those choices are attempts of the table: a fifth of the scenes at a"
        " time is not learned from; of five or more attempts of it in like situations, the one with"
        " the highest estimate is a choice. The interval reflects only how few these choices are,"
        " not how far the best of all decisions differs from the best of those few: tried on 52"
        " made-up tables it held the true rate in 34. Without --at it only says what was learned.",
        "lic fit rollouts.parquet --decide base_x base_y --given object_x object_y --group scene"
        " --at object_x=0.4 object_y=0.6 --map map.png",
        ["--json"],
    )
    parser.add_argument(
        "file",
        metavar="FILE",
        type=Path,
        help=".csv or .parquet file of attempts, folder of a LeRobot data set or .hdf5 file of a"
        " robomimic one; each number of an episode's first observation becomes a column",
    )
    for name, what in (
        ("--decide", "columns with what was decided"),
        ("--given", "columns with what was known before, such as where the object is"),
    ):
        parser.add_argument(
            name,
            metavar="COLUMN",
            nargs="+",
            required=True,
            help=f"{what} (no default: required)",
        )
    parser.add_argument(
        "--success",
        metavar="COLUMN",
        default="success",
        help="column with 1 for success and 0 for failure (default: %(default)s)",
    )
    parser.add_argument(
        "--group",
        metavar="COLUMN",
        help="column that is equal in attempts of one scene; without it, scenes that have several"
        " make the probability too high (default: each row is a scene of its own)",
    )
    parser.add_argument(
        "--method",
        metavar="NAME",
        default="gp",
        help="estimator: gp, for up to 8,000 rows, or knn (default: %(default)s)",
    )
    parser.add_argument(
        "--at",
        metavar="COLUMN=VALUE",
        nargs="+",
        default=[],
        help="situation to decide in, a value for each --given column (default: none)",
    )
    parser.add_argument(
        "--map",
        metavar="FILE",
        type=Path,
        help="picture to write, of the estimate over the first two --decide columns with the"
        " nearest attempts, needs --at (default: none)",
    )


@quick_imports()
def run(args: argparse.Namespace) -> int:
    """Fits, and prints what to decide."""
    at = read_situation(args.at)
    if args.map and (not at or len(args.decide) < 2):
        raise LicError("--map draws two --decide columns in a situation; give both, and --at")

    from lic_drake.estimate.rollouts import read_rollouts
    from lic_drake.evaluate.decisions import fit_rollouts
    from lic_drake.evaluate.reliability import FEWEST

    columns = {"decide": args.decide, "given": args.given}
    rollouts = read_rollouts(args.file, **columns, success=args.success, group=args.group)
    if at:
        rollouts.situation(at)
    if args.map:
        check_writable(args.map.parent)
    if args.group is None:
        remark("lic: without --group each row is taken for a scene of its own")
    model = fit_rollouts(rollouts, args.method, say=remark)
    rows, (_, successes) = rollouts.rows, model.held_out
    values: dict[str, Any] = {
        "rollouts": len(rows.y),
        "groups": rollouts.num_groups,
        "success_rate": float(rows.y.mean()),
        "held_out_choices": len(successes),
        "success_rate_of_choices": float(successes.mean()),
    }
    if at:
        chosen = model.choose(at)
        values |= {"at": chosen.at, "decision": chosen.values, "estimated_success": chosen.estimate}
        if chosen.probability is None:
            remark(
                f"lic: no probability is known: the table has only {len(successes)} choices to hold"
                f" out, {FEWEST} are needed; add rollouts in other scenes"
            )
        else:
            values |= {"probability": chosen.probability, "interval": chosen.interval}
        if args.map:
            from lic_drake.show.decisions import decisions_figure
            from lic_drake.show.figures import save_figure

            save_figure(decisions_figure(model, chosen), args.map)
    print_result(args, values)
    return 0


def read_situation(texts: list[str]) -> dict[str, float]:
    """Returns the values of --at by column; a LicError says what is wrong with one."""
    at: dict[str, float] = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            number = float(value)
        except ValueError:
            raise LicError(f"--at needs COLUMN=NUMBER, got {quoted(text)}") from None
        if name in at:
            raise LicError(f"--at has two values of {quoted(name)}; give one")
        at[name] = number
    return at
