"""`lic demo` shows one reach; `lic gallery` shows selected reaches on one static page."""

import argparse
from pathlib import Path

from lic_drake.cli.arguments import (
    Subparsers,
    add_command,
    add_count,
    category_of,
    overrides_of,
    print_result,
    quick_imports,
    whole_number,
    with_robot,
)
from lic_drake.errors import LicError, check_writable, remark
from lic_drake.paths import shipped_libraries, shipped_library

_FOLIAGE, _SPHERES = "foliage-aperture-clutter", "sphere-aperture-clutter"

_SEEDS = {
    "cylinder-clutter": 13,
    "passage-clutter": 24,
    "cylinder-aperture-clutter": 73,
    "iiwa14-sphere-aperture-clutter": 59,
}
"""Environments in which the first attempt fails and the second succeeds, else 0."""


def add_parser(subparsers: Subparsers) -> None:
    """Adds both subcommands to the command line."""
    parser = add_command(
        subparsers,
        "demo",
        run,
        "select a start, reach into unseen clutter, and record it",
        "Tries once more if the reach fails. Writes a recording that plays offline (demo.html),"
        " demo.json, pictures, for foliage also what the cameras saw, and, if rendering is"
        " available, stills and a film (film.webp). A page shows all of it (index.html).",
        "lic demo --robot pr2 --seed 3 --out out",
        ["--robot", "--category", "--method", "--library", "--set"],
    )
    parser.add_argument(
        "--seed",
        metavar="N",
        type=whole_number(0),
        help="environment, and seed of random choices (default: for most libraries one that takes"
        " two attempts)",
    )
    parser.add_argument(
        "--visuals",
        choices=["primitives", "drake_models"],
        default="primitives",
        help="appearance of the PR2: primitives, or the meshes of package://drake_models, found in"
        " ROS_PACKAGE_PATH or the cache of Drake's downloads (default: %(default)s)",
    )
    parser.add_argument(
        "--out", type=Path, default=Path("out"), help="folder to write to (default: %(default)s)"
    )
    gallery = add_command(
        subparsers,
        "gallery",
        run_gallery,
        "show selected reaches on one static page",
        "Writes index.html, which works offline: recordings, stills, estimates and numbers of"
        " successful and failed reaches, in environments that are in no library, of each shipped"
        " library or of one.",
        "lic gallery out/gallery --each 2",
        ["--method", "--library", "--seed", "--json"],
    )
    gallery.add_argument("out", metavar="OUT", type=Path, help="folder to write to")
    add_count(gallery, "--each", 1, "number of successes, and of failures, per library")


def run(args: argparse.Namespace) -> int:
    """Runs the demonstration and prints the files it has written."""
    with quick_imports():
        from lic_drake.experience.schema import scenario_text
        from lic_drake.experience.store import ExperienceLibrary
        from lic_drake.perception.config import load_cameras
        from lic_drake.reach.scenario import load_scenario, parse_scenario
        from lic_drake.robots.registry import get_robot
        from lic_drake.show.demonstration import demonstrate
        from lic_drake.show.pr2_meshes import find_drake_models

    category = args.category or category_of(args.robot)
    foliage, meshes = category == _FOLIAGE, args.visuals == "drake_models"
    # Libraries of a robot other than the category's own have its name, too.
    robot = "" if load_scenario(category).robot == args.robot else args.robot
    load_scenario(category, with_robot("", robot))  # Refuses an arm of the plane in space.
    overrides = overrides_of(args.set, category)
    # In foliage, experience comes from spheres: the demonstration is about transfer (paper V-B).
    learned = _SPHERES if foliage else category
    path = args.library or shipped_library(learned, robot)
    if args.library is None and not path.exists():
        raise LicError(
            f"no experience of {robot} in {learned} is shipped; make some with: lic train out/mine"
            f" --robot {robot} --minutes 10, and add --library out/mine/learning/reaches"
        )
    library = ExperienceLibrary(path)
    scenario = library.scenario()
    if args.robot and get_robot(args.robot).digest != scenario.arm().digest:
        raise LicError(f"{library.path} is for --robot {scenario.robot}, not {args.robot}")
    if args.category and not foliage and args.category != scenario.category:
        raise LicError(
            f"{library.path} is of {scenario.category}, not --category {args.category}; choose"
            " another --library or omit --category"
        )
    scenario = parse_scenario(scenario_text(scenario), overrides, source="--set")
    if foliage:
        scenario = load_scenario(category, with_robot(overrides, scenario.robot))
    if meshes and scenario.robot != "pr2":
        raise LicError(f"--visuals drake_models is for --robot pr2, not {scenario.robot}; omit it")
    default = _SEEDS.get(shipped_library(category, robot).name, 0)
    result = demonstrate(
        scenario,
        library,
        args.method,
        default if args.seed is None else args.seed,
        args.out,
        drake_models=find_drake_models() if meshes else None,
        cameras=load_cameras("foliage") if foliage else None,
    )
    for kind, path in result.files.items():
        print(f"{kind}: {path}")
    return 0


def run_gallery(args: argparse.Namespace) -> int:
    """Writes the page."""
    from lic_drake.experience.schema import write_atomically
    from lic_drake.experience.store import ExperienceLibrary
    from lic_drake.select.registry import check_method
    from lic_drake.show.gallery import STREAM, choose_exhibits, make_gallery, numbers_of

    check_method(args.method)
    check_writable(args.out)
    path = args.out / "index.html"
    if path.is_dir():
        raise LicError(f"cannot write {path}: it is a folder; delete it or choose another OUT")
    paths = [args.library] if args.library else shipped_libraries()
    libraries = [ExperienceLibrary(path) for path in paths]
    overrides = []
    for library in libraries:  # Fails before the first one is learned from.
        scenario = library.scenario()
        scenario.sample_goal(STREAM, args.seed)
        overrides.append(overrides_of("", scenario.category))
    exhibits = [
        exhibit
        for library, over in zip(libraries, overrides, strict=True)
        for exhibit in choose_exhibits(library, args.method, args.each, args.seed, remark, over)
    ]
    page = make_gallery(exhibits, args.method)
    write_atomically(path, lambda temporary: temporary.write_text(page, encoding="utf-8"))
    trials = [
        {
            "robot": exhibit.scenario.arm().name,
            "category": exhibit.scenario.category,
            "environment": exhibit.environment,
            "goal": exhibit.p_WG.tolist(),
            "success": exhibit.success,
            "attempts": [numbers_of(i, a) for i, a in enumerate(exhibit.attempts, start=1)],
        }
        for exhibit in exhibits
    ]
    values = {"page": str(path), "method": args.method, "trials": trials}
    text = f"page: {path} ({len(page) / 1e6:.1f} MB, {len(exhibits)} trials)"
    print_result(args, values, text)
    return 0
