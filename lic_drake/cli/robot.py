"""`lic robot` looks at a robot; `lic train` makes it collect, learn and be evaluated."""

import argparse
from pathlib import Path

from lic_drake.cli.arguments import (
    INCOMPLETE,
    Subparsers,
    add_command,
    category_of,
    overrides_of,
    print_result,
    whole_number,
    with_robot,
    workers_of,
)
from lic_drake.errors import RenderingError, check_writable, remark


def add_parser(subparsers: Subparsers) -> None:
    """Adds both subcommands to the command line."""
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
    train = add_command(
        subparsers,
        "train",
        run_train,
        "collect, learn and evaluate within a budget",
        "Reaches in rounds of new environments, from starts that COST proposes in the first round"
        " and then the estimate that was learned so far; after 60 % of the budget, compares RND,"
        " COST and the estimate on unseen environments. Before spheres 8 of 20 apertures are"
        " blocked, unless --set says otherwise. Leaves a library, a table and a demonstration. Run"
        " again, it goes on where it was, with a budget of minutes for as many more.",
        "lic train out/mine --robot mine.yaml --minutes 10",
        ["--robot", "--category", "--set", "--workers", "--scheduler", "--json"],
    )
    train.add_argument("out", metavar="FOLDER", type=Path, help="folder to write to")
    budget = train.add_mutually_exclusive_group(required=True)
    for name, text in (
        ("--minutes", "time for learning and evaluation, minutes (no default: this or --reaches)"),
        ("--reaches", "number of reaches, about (no default: this or --minutes)"),
    ):
        budget.add_argument(name, metavar="N", type=whole_number(1), help=text)


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


def run_train(args: argparse.Namespace) -> int:
    """Trains, demonstrates, and prints the table."""
    from lic_drake.evaluate.table import format_rates, summarize_trials
    from lic_drake.evaluate.training import train, training_library
    from lic_drake.evaluate.trials import TrialTable
    from lic_drake.experience.schema import write_atomically
    from lic_drake.show.demonstration import demonstrate

    category = args.category or category_of(args.robot)
    with workers_of(args) as workers:
        rows = train(
            args.out,
            category,
            with_robot(overrides_of(args.set, category), args.robot),
            minutes=args.minutes,
            reaches=args.reaches,
            workers=workers,
            say=remark,
        )
    library, rates = training_library(args.out), summarize_trials(TrialTable(rows), attempts=2)
    text, table = format_rates(rates), args.out / "table.md"
    write_atomically(table, lambda temporary: temporary.write_text(text, encoding="utf-8"))
    shown = demonstrate(library.scenario(), library, "gp", 0, args.out / "demo", say=remark)
    values = {
        "library": str(library.path),
        "reaches": library.num_reaches,
        "table": str(table),
        "rates": rates,
        "demo": str(shown.files["recording"]),
    }
    print_result(args, values, f"{text}library: {values['library']}\ndemo: {values['demo']}")
    return 0
