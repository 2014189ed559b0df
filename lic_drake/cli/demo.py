"""`lic demo`: select with LIC, reach, record."""

import argparse
from pathlib import Path
from typing import NamedTuple

from lic_drake.cli.arguments import (
    Subparsers,
    add_library_argument,
    add_method_argument,
    non_negative_int,
)


class _Demonstration(NamedTuple):
    """What is shown of a category unless told otherwise."""

    robot: str
    library: str
    overrides: str = ""
    cameras: str | None = None


_DEMONSTRATIONS = {
    "cylinder-clutter": _Demonstration("planar-arm", "cylinder-clutter"),
    "passage-clutter": _Demonstration("planar-arm", "passage-clutter"),
    "cylinder-aperture-clutter": _Demonstration("planar-arm", "cylinder-aperture-clutter"),
    "sphere-aperture-clutter": _Demonstration(
        "pr2", "sphere-aperture-clutter", "{clutter: {num_blocked: 8}}"
    ),
    # Learned among spheres: the transfer is the point (paper V-B).
    "foliage-aperture-clutter": _Demonstration("pr2", "sphere-aperture-clutter", cameras="foliage"),
}
_USUAL = {"planar-arm": "cylinder-clutter", "pr2": "sphere-aperture-clutter"}


def add_parser(subparsers: Subparsers) -> None:
    """Adds the subcommand to the command line."""
    parser = subparsers.add_parser(
        "demo",
        help="select a start from past experience, reach into unseen clutter, record it",
        description="Draws an environment that is in no library, selects a start pose from the"
        " shipped experience library, reaches, and tries once more if that fails. Writes demo.html"
        " (a recording that plays offline), path.png, demo.json, the estimated success over the"
        " starts (density.png in the plane, apertures.png for the PR2) and, with a renderer, stills"
        " of every attempt (attempt1_start.png and so on). Before foliage also sequence.html, with"
        " what the cameras saw, look1.png and so on, and views.webp.",
        epilog="example: lic demo --robot pr2 --seed 3 --out out",
    )
    parser.add_argument(
        "--robot",
        choices=tuple(_USUAL),
        default="planar-arm",
        help="planar-arm among cylinders, or pr2 before a board with blocked apertures (default:"
        " %(default)s)",
    )
    parser.add_argument(
        "--category",
        choices=tuple(_DEMONSTRATIONS),
        metavar="NAME",
        help="clutter category: cylinder-clutter, passage-clutter or cylinder-aperture-clutter for"
        " planar-arm; sphere-aperture-clutter or foliage-aperture-clutter for pr2, the latter with"
        " cameras that find apertures and goal (default: the first one of the robot)",
    )
    parser.add_argument(
        "--seed",
        type=non_negative_int,
        default=0,
        metavar="N",
        help="chooses environment and goal (default: 0)",
    )
    add_method_argument(parser)
    add_library_argument(parser, "the shipped one for the category, spheres for foliage")
    parser.add_argument(
        "--set",
        metavar="YAML",
        help="values put over the scenario (default: none; for spheres"
        f' "{_DEMONSTRATIONS["sphere-aperture-clutter"].overrides}")',
    )
    parser.add_argument(
        "--visuals",
        choices=("primitives", "drake_models"),
        default="primitives",
        help="what the PR2 looks like: the shapes of its own model, or the meshes of Drake's public"
        " one, package://drake_models, found in ROS_PACKAGE_PATH or in the cache of Drake's"
        " downloads (default: %(default)s)",
    )
    parser.add_argument(
        "--out", type=Path, default=Path("out"), help="folder to write to (default: %(default)s)"
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Runs the subcommand and returns the exit code."""
    from lic_drake.errors import LicError
    from lic_drake.experience.schema import scenario_text
    from lic_drake.experience.store import ExperienceLibrary
    from lic_drake.paths import shipped_library
    from lic_drake.perception.config import load_cameras
    from lic_drake.reach.scenario import load_scenario, parse_scenario
    from lic_drake.show.demonstration import demonstrate
    from lic_drake.show.pr2_meshes import find_drake_models

    category = args.category or _USUAL[args.robot]
    usual = _DEMONSTRATIONS[category]
    if usual.robot != args.robot:
        raise LicError(f"{category} is for --robot {usual.robot}, not {args.robot}")
    if args.visuals == "drake_models" and args.robot != "pr2":
        raise LicError(f"--visuals drake_models is for --robot pr2, not {args.robot}; leave it out")
    drake_models = find_drake_models() if args.visuals == "drake_models" else None
    library = ExperienceLibrary(args.library or shipped_library(usual.library))
    overrides = usual.overrides if args.set is None else args.set
    if usual.library == category:
        scenario = parse_scenario(scenario_text(library.scenario()), overrides, source="--set")
    else:
        scenario = load_scenario(category, overrides)
    cameras = None if usual.cameras is None else load_cameras(usual.cameras)
    result = demonstrate(
        scenario,
        library,
        args.method,
        args.seed,
        args.out,
        drake_models=drake_models,
        cameras=cameras,
    )
    for kind, path in result.files.items():
        print(f"{kind}: {path}")
    return 0
