"""`lic reach`: simulates one reach."""

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
)
from lic_drake.errors import RequestError, check_writable


def add_parser(subparsers: Subparsers) -> None:
    """Adds the subcommand to the command line."""
    parser = add_command(
        subparsers,
        "reach",
        run,
        "simulate one reach and print its record",
        "The exit code is 0 whether or not the goal was reached.",
        "lic reach --goal 0.6 0.1 --start-y 0.0 --start-phi 60 --environment 3",
        ["--scenario", "--set", "--stream", "--goal", "--json"],
    )
    add_count(parser, "--environment", 0, "index of the environment in the stream", least=0)
    for name, metavar, text in (
        ("--start-y", "Y", "planar arm: position on the start line, metres (default: 0)"),
        ("--start-phi", "DEG", "planar arm: degrees from straight ahead (default: 60)"),
        ("--base-y", "Y", "arm in space: position of the base, metres (default: 0)"),
        ("--torso", "Z", "arm in space: height of its base, metres (default: the scenario's)"),
    ):
        parser.add_argument(name, type=float, metavar=metavar, help=text)
    parser.add_argument(
        "--aperture",
        type=float,
        nargs=2,
        metavar=("Y", "Z"),
        help="arm in space: place in the board of the aperture to reach through, metres (default:"
        " the open one nearest to the goal)",
    )
    parser.add_argument(
        "--record",
        type=Path,
        metavar="FILE.html",
        help="write a recording that plays offline (default: none)",
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
        trace = simulate_request(request, keep_states=True).trace
        recording.add_reach(trace, request.goal, record.outcome)
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
