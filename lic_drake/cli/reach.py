"""`lic reach`: simulates one reach."""

import argparse
import dataclasses
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING

from lic_drake.cli.arguments import Subparsers, add_scenario_arguments, non_negative_int

if TYPE_CHECKING:
    from lic_drake.reach.request import ReachRecord, ReachRequest


def add_parser(subparsers: Subparsers) -> None:
    """Adds the subcommand to the command line."""
    parser = subparsers.add_parser(
        "reach",
        help="simulate one reach and print its record",
        description="Simulates one reach from a start pose to a goal in a random environment and"
        " prints its record. The exit code is 0 whether or not the goal was reached.",
        epilog="examples: lic reach --goal 0.6 0.1 --start-y 0.0 --start-phi 60 --environment 3;"
        " lic reach --scenario sphere-aperture-clutter --base-y 0.1 --torso 0.2",
    )
    add_scenario_arguments(parser)
    parser.add_argument(
        "--stream",
        default="evaluation",
        metavar="NAME",
        help="seed stream of the environment: training, evaluation, calibration or holdout"
        " (default: %(default)s)",
    )
    parser.add_argument(
        "--environment",
        type=non_negative_int,
        default=0,
        metavar="N",
        help="its index in it (default: 0)",
    )
    parser.add_argument(
        "--goal",
        type=float,
        nargs="+",
        metavar="METRES",
        help="goal, X Y or for the PR2 X Y Z, in metres, x into the clutter, y to the left"
        " (default: the one that the environment offers, else 0.6 0)",
    )
    parser.add_argument(
        "--start-y",
        type=float,
        metavar="Y",
        help="planar arm: start position on the start line, metres (default: 0)",
    )
    parser.add_argument(
        "--start-phi",
        type=float,
        metavar="DEG",
        help="planar arm: start orientation of the hand, degrees from straight ahead (default: 60)",
    )
    parser.add_argument(
        "--aperture",
        type=float,
        nargs=2,
        metavar=("Y", "Z"),
        help="PR2: the aperture to reach through, by its place in the board, metres (default: the"
        " open one nearest to the goal)",
    )
    parser.add_argument(
        "--base-y", type=float, metavar="Y", help="PR2: place of the base, metres (default: 0)"
    )
    parser.add_argument(
        "--torso",
        type=float,
        metavar="Z",
        help="PR2: height of the torso, metres (default: the scenario's)",
    )
    parser.add_argument(
        "--json",
        action="store_true",
        help="print the record as a JSON object (default: a sentence)",
    )
    parser.add_argument(
        "--record",
        type=Path,
        metavar="FILE.html",
        help="write a recording that plays offline (default: none)",
    )
    parser.add_argument(
        "--diagram",
        type=Path,
        metavar="FILE.svg",
        help="draw the Drake diagram: .svg, .png or .pdf (default: none)",
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Runs the subcommand and returns the exit code."""
    from lic_drake.cli.asked_reach import asked_reach
    from lic_drake.errors import RequestError
    from lic_drake.reach.scenario import load_scenario
    from lic_drake.reach.session import run_reach

    request = asked_reach(load_scenario(args.scenario, args.set), args)
    for path in (args.diagram, args.record):
        if path is not None:
            _check_writable(path)
    if args.diagram is not None:
        _draw(request, args.diagram)
    record = run_reach(request)
    if record.outcome == "invalid_start":
        raise RequestError(
            f"cannot start at {_describe_start(request)}: {record.detail}; `lic select` names a"
            " start that is possible"
        )
    if args.record is not None:
        _record(request, args.record)
    print(_to_json(record) if args.json else _describe(record))
    return 0


def _check_writable(path: Path) -> None:
    """Finds out before the simulation that a file cannot be written; leaves none behind."""
    from lic_drake.errors import LicError

    is_new = not path.exists()
    try:
        with path.open("ab"):
            pass
        if is_new:
            path.unlink()
    except OSError as error:
        raise LicError(f"cannot write {path}: {error.strerror}; choose another path") from None


def _to_json(record: "ReachRecord") -> str:
    """Returns the record as JSON, which has null for a figure that was never measured."""
    values = dataclasses.asdict(record)
    unmeasured = [k for k, v in values.items() if isinstance(v, float) and math.isnan(v)]
    return json.dumps({**values, **dict.fromkeys(unmeasured)})


def _draw(request: "ReachRequest", path: Path) -> None:
    from lic_drake.reach.diagram import make_reach_diagram
    from lic_drake.show.diagram_drawing import draw_diagram

    instance = request.scenario.sample_instance(request.stream, request.environment)
    draw_diagram(make_reach_diagram(request.scenario, instance).diagram, path)


def _record(request: "ReachRequest", path: Path) -> None:
    from lic_drake.reach.session import instance_of, simulate_request
    from lic_drake.show.recording import Recording

    recording = Recording(request.scenario, instance_of(request))
    trace = simulate_request(request, keep_states=True).trace
    recording.add_reach(trace, request.goal)
    recording.save(path)


def _describe_start(request: "ReachRequest") -> str:
    x0 = request.start.x0
    if len(x0) == 3:
        return f"y {x0[1]:g} m, phi {math.degrees(x0[2]):g} degrees"
    return f"the aperture at y {x0[1]:g} m, z {x0[2]:g} m"


def _describe(record: "ReachRecord") -> str:
    return (
        f"{record.outcome} after {record.duration_s:.2f} s ({record.wall_time_s:.2f} s of wall"
        f" time); nearest to the goal {1000 * record.min_distance:.0f} mm;"
        f" peak force {record.peak_force:.1f} N, mean contact {record.mean_force:.1f} N,"
        f" up to {record.peak_contacts} taxels loaded"
    )
