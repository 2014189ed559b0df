"""`lic select`: selects a start without reaching."""

import argparse

from lic_drake.cli.arguments import (
    DEFAULT_SCENARIO,
    Subparsers,
    add_command,
    print_result,
    quick_imports,
)
from lic_drake.errors import LicError, remark
from lic_drake.paths import shipped_library


def add_parser(subparsers: Subparsers) -> None:
    """Adds the subcommand to the command line."""
    parser = add_command(
        subparsers,
        "select",
        run,
        "select the start of a reach",
        "Prints it, in metres and radians, with the estimate of its success, learned from an"
        " experience library, and with the probability, and its 90 % interval, that choices with"
        " such an estimate succeed: known where the library has choices in other environments, made"
        " by `lic evaluate LIBRARY/choices --library LIBRARY --stream calibration --methods gp`.",
        "lic select --goal 0.6 0.1 --failed"
        ' "{start_y: 0.1, start_phi: 0.52, final_x: 0.5, final_y: 0.05}"',
        ["--goal", "--method", "--library", "--seed", "--json"],
    )
    parser.add_argument(
        "--failed",
        action="append",
        default=[],
        metavar="YAML|FILE",
        help="a failed attempt: a file written by `lic reach --json`, or values named like a"
        " record's columns (metres, radians, m/s): start_y, start_phi and, for LIC-2, the final"
        " pose; in space start_y and start_z of the aperture, base_y and torso; may be repeated"
        " (default: none)",
    )
    parser.add_argument(
        "--least",
        metavar="P",
        type=float,
        help="smallest probability of success that is worth an attempt: the price of an attempt"
        " divided by the worth of a success; below it worth_trying is false (default: none)",
    )


@quick_imports()
def run(args: argparse.Namespace) -> int:
    """Selects and prints the start."""
    import numpy as np

    from lic_drake.cli.requests import read_failure, read_goal, require
    from lic_drake.estimate.features import features_of
    from lic_drake.estimate.registry import estimator_names
    from lic_drake.evaluate.reliability import FEWEST, read_reliability
    from lic_drake.experience.pairs import FIRST_PREFIX
    from lic_drake.experience.store import ExperienceLibrary
    from lic_drake.reach.request import check_goal
    from lic_drake.select.registry import make_selector, needs_library
    from lic_drake.select.situation import Situation
    from lic_drake.starts import make_starts

    needs_library(args.method)
    if args.least is not None and not 0.0 <= args.least <= 1.0:
        raise LicError(f"--least must be from 0 to 1, got {args.least:g}")
    library = ExperienceLibrary(args.library or shipped_library(DEFAULT_SCENARIO))
    scenario = library.scenario()
    p_WG = read_goal(scenario, args.goal or [])
    starts = make_starts(scenario, scenario.sample_instance("evaluation", args.seed))
    bases = np.unique(starts.grid.b0, axis=0)
    check_goal(scenario, p_WG - bases[np.argmin(np.linalg.norm((bases - p_WG)[:, 1:], axis=1))])
    failed = tuple(read_failure(scenario, starts, text) for text in args.failed)
    rng = np.random.default_rng(args.seed)
    second = features_of(scenario.category).second
    if second is not None and args.method in estimator_names():  # It has a LIC-2.
        needed = [name.removeprefix(FIRST_PREFIX) for name in second.observed]
        for reach in failed:
            hint = f"; or use --method {args.method}1, which only avoids where it began"
            require(reach.shown, needed, hint)
    attempt = len(failed) + 1
    reliability = read_reliability(library.path, args.method, attempt)
    if reliability is None and args.least is not None:
        raise LicError(
            f"{library.path} has no {FEWEST} choices of {args.method} for attempt {attempt}, so"
            " no probability is known; make some as `lic select --help` says, or omit --least"
        )
    selector = make_selector(args.method, library.columns(), rng, remark)
    chosen = selector.select(Situation(p_WG=p_WG, starts=starts, failed=failed))
    assert chosen.start.q is not None
    values = {
        "method": chosen.method,
        "start": chosen.start.x0.tolist(),
        "base": chosen.start.b0[:2].tolist(),
        "torso": float(chosen.start.b0[2]),
        "joint_angles": chosen.start.q.tolist(),
        "estimated_success": chosen.probability,
        "seconds": chosen.seconds,
    }
    if reliability is not None and chosen.probability is not None:
        probability = float(reliability.probabilities(np.array([chosen.probability]))[0])
        values |= {
            "probability": probability,
            "interval": reliability.interval(chosen.probability),
            "choices": reliability.count,
        }
        if args.least is not None:
            values["worth_trying"] = probability >= args.least
    print_result(args, values)
    return 0
