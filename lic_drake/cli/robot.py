"""`lic robot`: looks at a robot before anything is collected with it."""

import argparse
from pathlib import Path

from lic_drake.cli.arguments import INCOMPLETE, Subparsers, add_command, print_result, remark
from lic_drake.errors import RenderingError, check_writable


def add_parser(subparsers: Subparsers) -> None:
    """Adds the subcommand and its action to the command line."""
    parser = subparsers.add_parser(
        "robot",
        help="check a robot of your own",
        description="A robot is one YAML file beside its URDF or SDF model, like"
        " models/robots/iiwa14.yaml; scenario files and --set take its path: {robot: mine.yaml}.",
        epilog="example: lic robot check iiwa14",
    )
    actions = parser.add_subparsers(title="actions", metavar="ACTION", required=True)
    check = add_command(
        actions,
        "check",
        run_check,
        "show what a robot is, and let it reach and press",
        "Prints joints, limits, gains and skin, reaches a free goal, and presses on a wall until"
        " the force has settled. Exit code 1 if the goal is not reached or the force does not"
        " settle at the controller's threshold.",
        "lic robot check mine.yaml --out out",
        ["--json"],
    )
    check.add_argument("robot", metavar="NAME|FILE", help="robot, or path of its .yaml file")
    check.add_argument(
        "--out",
        metavar="FOLDER",
        type=Path,
        help="write a still of the robot pressing on the wall there (default: none)",
    )


def run_check(args: argparse.Namespace) -> int:
    """Checks the robot and prints what was found."""
    from lic_drake.evaluate.robot_check import check_robot

    if args.out is not None:
        check_writable(args.out)
    check = check_robot(args.robot)
    values = check.values()
    if args.out is not None:
        from lic_drake.show.figures import save_figure
        from lic_drake.show.stills import StillCamera, draw_still

        trace = check.pressing.trace
        try:
            camera = StillCamera(check.scenario, check.wall, check.p_WG_wall)
            still = camera.take("", trace.b0, trace.states[-1])
            path = args.out / f"{values['robot']}.png"
            save_figure(draw_still(still, values["robot"]), path, False)
            values["still"] = str(path)
        except RenderingError as error:
            remark(f"lic: no still: {error}")
    print_result(args, values)
    return 0 if check.reaches and check.settles else INCOMPLETE
