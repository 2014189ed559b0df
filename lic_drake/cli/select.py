"""`lic select`: chooses a start without reaching."""

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from lic_drake.cli.arguments import (
    Subparsers,
    add_json_argument,
    add_library_argument,
    add_method_argument,
    non_negative_int,
)

if TYPE_CHECKING:
    from lic_drake.select.registry import Selector
    from lic_drake.select.situation import FailedReach, Selection
    from lic_drake.starts import FeasibleStarts


def add_parser(subparsers: Subparsers) -> None:
    """Adds the subcommand to the command line."""
    parser = subparsers.add_parser(
        "select",
        help="choose the start of a reach",
        description="Chooses the start for a goal from an experience library and prints it with its"
        " estimated probability of success.",
        epilog="examples: lic select --goal 0.6 0.1 --method gp; lic select --goal 0.6 0.1 --failed"
        ' "{start_y: 0.1, start_phi: 0.52, final_x: 0.5, final_y: 0.05}"',
    )
    parser.add_argument(
        "--goal",
        type=float,
        nargs="+",
        required=True,
        metavar="METRES",
        help="goal, X Y or for the PR2 X Y Z, in metres (no default: must be given)",
    )
    add_method_argument(parser)
    parser.add_argument(
        "--failed",
        action="append",
        default=[],
        metavar="YAML|FILE",
        help="what an attempt that failed showed, by the names of a record's columns (metres,"
        " radians, m/s), or a file that `lic reach --json` wrote: start_y, start_phi and for LIC-2"
        " the final pose, for the PR2 start_y and start_z of the aperture, base_y and torso; may be"
        " given several times (default: none)",
    )
    add_library_argument(parser)
    parser.add_argument(
        "--seed", type=non_negative_int, default=0, metavar="N", help="for rnd (default: 0)"
    )
    add_json_argument(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Runs the subcommand and returns the exit code."""
    import numpy as np

    from lic_drake.errors import RequestError
    from lic_drake.experience.store import ExperienceLibrary
    from lic_drake.paths import shipped_library
    from lic_drake.reach.request import check_goal
    from lic_drake.select.registry import make_selector, needs_library
    from lic_drake.select.situation import Situation
    from lic_drake.starts import make_starts

    needs_library(args.method)
    library = ExperienceLibrary(args.library or shipped_library("cylinder-clutter"))
    scenario = library.scenario()
    instance = scenario.sample_instance("evaluation", args.seed)
    if len(args.goal) != instance.num_axes:
        raise RequestError(
            f"a goal of {scenario.category} is {instance.num_axes} numbers in metres, got"
            f" {len(args.goal)}: --goal {' '.join(map(str, args.goal))}"
        )
    p_WG = np.array([*args.goal, 0.0][:3])
    starts = make_starts(scenario, instance)
    bases = np.unique(starts.grid.b0, axis=0)
    check_goal(scenario, p_WG - bases[np.argmin(np.linalg.norm((bases - p_WG)[:, 1:], axis=1))])
    failed = tuple(_failed_reach(starts, _read_shown(text)) for text in args.failed)
    rng = np.random.default_rng(args.seed)
    selector = make_selector(args.method, scenario.arm(), library.columns(), rng, scenario.category)
    for reach in failed:
        _check_shown(selector, reach)
    chosen = selector.select(Situation(p_WG=p_WG, starts=starts, failed=failed))
    print(_to_json(chosen) if args.json else _describe(chosen, starts))
    return 0


def _to_json(chosen: "Selection") -> str:
    start = chosen.start
    assert start.q is not None
    return json.dumps(
        {
            "method": chosen.method,
            "start": start.x0.tolist(),
            "base": start.b0[:2].tolist(),
            "torso": float(start.b0[2]),
            "joint_angles": start.q.tolist(),
            "estimated_success": chosen.probability,
            "seconds": chosen.seconds,
        }
    )


def _describe(chosen: "Selection", starts: "FeasibleStarts") -> str:
    import numpy as np

    x0, b0, q = chosen.start.x0, chosen.start.b0, chosen.start.q
    assert q is not None
    base = f", base at y {b0[1]:+.3f} m" if np.any(starts.grid.b0[:, :2]) else ""
    if starts.arm.is_planar:
        where = f"start at y {x0[1]:+.3f} m, phi {np.rad2deg(x0[2]):+.1f} degrees"
    else:
        where = f"start in the aperture at y {x0[1]:+.3f} m, z {x0[2]:.3f} m"
        base = f", torso at {b0[2]:.3f} m{base}"
    success = chosen.probability
    estimate = "" if success is None else f", estimated success {100 * success:.1f} %"
    return (
        f"{chosen.method}: {where}{base}{estimate}; joint angles"
        f" {np.round(np.rad2deg(q), 1).tolist()} degrees; {chosen.seconds:.2f} s"
    )


def _read_shown(text: str) -> dict[str, float]:
    """Reads the numbers of a failed attempt from YAML or JSON, in the argument or in a file.

    Raises:
        LicError: It is no mapping, the file cannot be read, or a name is not a record's.
    """
    from dataclasses import fields

    from lic_drake.config import read_mapping
    from lic_drake.errors import RequestError
    from lic_drake.reach.request import ReachRecord

    if not text.lstrip().startswith("{"):
        try:
            text = Path(text).read_text(encoding="utf-8")
        except (OSError, ValueError) as error:
            raise RequestError(f"--failed: cannot read {text!r}: {error}") from None
    shown = read_mapping(text, "--failed")
    known = {item.name for item in fields(ReachRecord)}
    for name in shown:
        if name not in known:
            raise RequestError(f"--failed: {name!r} is no column of a record, as start_y is")
    return {name: float(x) for name, x in shown.items() if isinstance(x, int | float)}


def _failed_reach(starts: "FeasibleStarts", shown: dict[str, float]) -> "FailedReach":
    """Returns a failed attempt.

    Raises:
        RequestError: It does not say where it began.
    """
    import numpy as np

    from lic_drake.errors import RequestError
    from lic_drake.reach.start import Start
    from lic_drake.select.situation import FailedReach
    from lic_drake.starts import BoardStarts

    on_board = isinstance(starts, BoardStarts)
    needed = ["start_y", "start_z" if on_board else "start_phi"]
    varied = np.ptp(starts.grid.b0, axis=0) > 0.0
    needed += [name for name, v in zip(("base_x", "base_y", "torso"), varied, strict=True) if v]
    missing = [name for name in needed if name not in shown]
    if missing:
        raise RequestError(
            f"a failed attempt must say where it began: {', '.join(missing)} is missing of"
            f" {', '.join(needed)}"
        )
    b0 = starts.grid.b0[0].copy()
    for axis, name in enumerate(("base_x", "base_y", "torso")):
        b0[axis] = shown.get(name, b0[axis])
    if isinstance(starts, BoardStarts):
        p_WA = starts.nearest_aperture(shown["start_y"], shown["start_z"])
        start = starts.nearest(p_WA, b0) or Start(np.append(p_WA, [1.0, 0.0, 0.0, 0.0]), b0)
    else:
        x_m = shown.get("start_x", float(starts.grid.x0[0, 0]))
        start = Start(np.array([x_m, shown["start_y"], shown["start_phi"]]), b0)
    return FailedReach(start=start, shown={**FailedReach.from_start(start).shown, **shown})


def _check_shown(selector: "Selector", failed: "FailedReach") -> None:
    """Refuses a failed attempt that does not show all that LIC-2 is to know of it.

    Raises:
        RequestError: Something is missing.
    """
    from lic_drake.errors import RequestError
    from lic_drake.experience.pairs import FIRST_PREFIX
    from lic_drake.select.lic import LicSelector

    if not isinstance(selector, LicSelector) or selector.second is None:
        return
    needed = [name.removeprefix(FIRST_PREFIX) for name in selector.second.features.observed]
    missing = [name for name in needed if name not in failed.shown]
    if missing:
        raise RequestError(
            f"{selector.method} chooses a further start by what the failed attempt showed"
            f" ({', '.join(needed)}), and {', '.join(missing)} is missing; add it to --failed, or"
            f" take --method {selector.method}1, which only keeps away from where it began"
        )
