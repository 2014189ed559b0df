"""`lic select` chooses a start without reaching; `lic reach` simulates one reach."""

import argparse
import dataclasses
import math
from pathlib import Path

from lic_drake.cli.arguments import (
    DEFAULT_SCENARIO,
    Subparsers,
    add_command,
    add_count,
    print_result,
    quick_imports,
    remark,
)
from lic_drake.errors import LicError, RequestError, check_writable
from lic_drake.paths import shipped_library


def add_parser(subparsers: Subparsers) -> None:
    """Adds both subcommands to the command line."""
    reach = add_command(
        subparsers,
        "reach",
        run,
        "simulate one reach and print its record",
        "The exit code is 0 whether or not the goal was reached.",
        "lic reach --goal 0.6 0.1 --start-y 0.0 --start-phi 60 --environment 3",
        ["--scenario", "--set", "--stream", "--goal", "--json"],
    )
    add_count(reach, "--environment", 0, "index of the environment in the stream", least=0)
    for name, metavar, text in (
        ("--start-y", "Y", "planar arm: position on the start line, metres (default: 0)"),
        ("--start-phi", "DEG", "planar arm: degrees from straight ahead (default: 60)"),
        ("--base-y", "Y", "arm in space: position of the base, metres (default: 0)"),
        ("--torso", "Z", "arm in space: height of its base, metres (default: the scenario's)"),
    ):
        reach.add_argument(name, type=float, metavar=metavar, help=text)
    reach.add_argument(
        "--aperture",
        type=float,
        nargs=2,
        metavar=("Y", "Z"),
        help="arm in space: place in the board of the aperture to reach through, metres (default:"
        " the open one nearest to the goal)",
    )
    reach.add_argument(
        "--record",
        type=Path,
        metavar="FILE.html",
        help="write a recording that plays offline (default: none)",
    )
    select = add_command(
        subparsers,
        "select",
        run_select,
        "select the start of a reach",
        "Prints it, in metres and radians, with the estimate of its success, learned from an"
        " experience library, and with the probability, and its 90 % interval, that choices with"
        " such an estimate succeed: known where the library has choices in other environments, made"
        " by `lic evaluate LIBRARY/choices --library LIBRARY --stream calibration --methods gp`.",
        "lic select --goal 0.6 0.1 --failed"
        ' "{start_y: 0.1, start_phi: 0.52, final_x: 0.5, final_y: 0.05}"',
        ["--goal", "--method", "--library", "--seed", "--json"],
    )
    select.add_argument(
        "--failed",
        action="append",
        default=[],
        metavar="YAML|FILE",
        help="a failed attempt: a file written by `lic reach --json`, or values named like a"
        " record's columns (metres, radians, m/s): start_y, start_phi and, for LIC-2, the final"
        " pose; in space start_y and start_z of the aperture, base_y and torso; may be repeated"
        " (default: none)",
    )
    select.add_argument(
        "--least",
        metavar="P",
        type=float,
        help="probability of success below which the answer is not to reach from here, the price of"
        " an attempt by what a success is worth (default: none)",
    )


def run(args: argparse.Namespace) -> int:
    """Simulates the reach and prints its record."""
    from lic_drake.cli.requests import make_request
    from lic_drake.reach.scenario import load_scenario
    from lic_drake.reach.session import instance_of, run_reach, simulate_request
    from lic_drake.reach.start import describe_start

    args.stream = args.stream or "evaluation"
    scenario = load_scenario(args.scenario or DEFAULT_SCENARIO, args.set)
    request = make_request(scenario, args)
    if args.record is not None:
        check_writable(args.record.parent)
        if args.record.is_dir():
            raise RequestError(f"cannot write {args.record}: it is a folder; name a file in it")
    record = run_reach(request)
    if record.outcome == "invalid_start":
        raise RequestError(
            f"cannot start at {describe_start(request.start)}: {record.detail}; `lic select` finds"
            " a possible start"
        )
    if args.record is not None:
        from lic_drake.show.recording import Recording

        recording = Recording(scenario, instance_of(request))
        recording.add_reach(simulate_request(request, keep_states=True).trace, request.goal)
        recording.save(args.record)
    values = dataclasses.asdict(record)
    # JSON has no NaN for values that were never measured.
    unmeasured = [k for k, v in values.items() if isinstance(v, float) and math.isnan(v)]
    text = (
        f"{record.outcome} after {record.duration_s:.2f} s ({record.wall_time_s:.2f} s of wall"
        f" time); minimum distance to the goal {1000 * record.min_distance:.0f} mm; peak force"
        f" {record.peak_force:.1f} N, mean contact force {record.mean_force:.1f} N, up to"
        f" {record.peak_contacts} taxels loaded"
    )
    print_result(args, values | dict.fromkeys(unmeasured), text)
    return 0


@quick_imports()
def run_select(args: argparse.Namespace) -> int:
    """Selects and prints the start."""
    import numpy as np

    from lic_drake.cli.requests import read_failure, read_goal, require
    from lic_drake.evaluate.reliability import FEWEST, read_reliability
    from lic_drake.experience.pairs import FIRST_PREFIX
    from lic_drake.experience.store import ExperienceLibrary
    from lic_drake.reach.request import check_goal
    from lic_drake.select.lic import LicSelector
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
    failed = tuple(read_failure(starts, text) for text in args.failed)
    rng = np.random.default_rng(args.seed)
    columns, category = library.columns(), scenario.category
    selector = make_selector(args.method, scenario.arm(), columns, rng, category, say=remark)
    if isinstance(selector, LicSelector) and selector.second is not None:
        needed = [name.removeprefix(FIRST_PREFIX) for name in selector.second.features.observed]
        for reach in failed:
            hint = f"; or use --method {selector.method}1, which only avoids where it began"
            require(reach.shown, needed, hint)
    attempt = len(failed) + 1
    reliability = read_reliability(library.path, args.method, attempt)
    if reliability is None and args.least is not None:
        raise LicError(
            f"{library.path} has no {FEWEST} choices of {args.method} for attempt {attempt}, so"
            " no probability is known; make some as `lic select --help` says, or omit --least"
        )
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
