"""`lic robot` looks at a robot; `lic train` makes it collect, learn and be evaluated."""

import argparse
import math
import time
from pathlib import Path
from typing import Any

from lic_drake.cli.arguments import (
    INCOMPLETE,
    Subparsers,
    add_command,
    category_of,
    print_result,
    remark,
    whole_number,
    with_robot,
    workers_of,
)
from lic_drake.errors import RenderingError, check_writable

LEARNING = 0.6
"""Share of a training's budget that is spent before the evaluation begins."""

GOALS = 4
"""Goals in each environment of a round, where it has so many."""

LEAST, GROWTH = 8, 4
"""Environments of the first round; later ones have 1 for so many before, but no fewer."""

MANY = 10_000
"""Environments that no evaluation by time comes to the end of."""

METHODS = ("rnd", "cost", "gp")
"""Strategies that an evaluation compares."""


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
        " COST and the estimate on unseen environments. Leaves a library, a table and a"
        " demonstration. Run again, it goes on where it was, with a budget of minutes for as many"
        " more.",
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
    """Collects actively, evaluates, demonstrates, and prints the table."""
    from lic_drake.evaluate.table import format_rates, summarize_trials
    from lic_drake.evaluate.trial import Evaluation, run_evaluation
    from lic_drake.evaluate.trials import TrialTable
    from lic_drake.experience.schema import write_atomically
    from lic_drake.experience.store import ExperienceLibrary
    from lic_drake.reach.scenario import load_scenario
    from lic_drake.show.demonstration import demonstrate

    category, began_s = args.category or category_of(args.robot), time.monotonic()
    overrides = with_robot(args.set, args.robot)
    scenario = load_scenario(category, overrides)
    library = ExperienceLibrary(args.out / "learning" / "reaches")

    def is_spent(share: float) -> bool:
        if args.minutes is not None:
            return time.monotonic() - began_s >= share * 60.0 * args.minutes
        return len(library.successes()) >= share * args.reaches

    def evaluation(results: str, **values: Any) -> Evaluation:
        return Evaluation(
            experience=library.path,
            results=args.out / results,
            scenario_name=category,
            overrides=overrides,
            **values,
        )

    library.create()
    library.check_scenario(scenario, "the training")
    with workers_of(args) as workers:
        while not is_spent(LEARNING):
            held = len(library.successes())
            tried = 1 + int(library.columns()["environment"].max()) if held else 0
            method, environments = "gp" if held else "cost", max(LEAST, tried // GROWTH)
            remark(f"{held} reaches; up to {environments} environments with {method}")
            round_ = evaluation(
                "learning",
                methods=(method,),
                stream="training",
                first=tried,
                environments=environments,
                goals=1 if scenario.task.goal_area is None else GOALS,
                attempts=1,  # The library is of reaches into untouched environments.
                variant=f"from environment {tried}",
            )
            run_evaluation(round_, workers, say=remark, is_over=lambda: is_spent(LEARNING))
        remark(f"{len(library.successes())} reaches; {', '.join(METHODS)} on unseen environments")
        most = MANY
        if args.reaches is not None:
            most = math.ceil((1.0 - LEARNING) * args.reaches / (2 * len(METHODS)))
        compared = evaluation("evaluation", methods=METHODS, environments=most, goals=1)
        over = (lambda: is_spent(1.0)) if args.reaches is None else (lambda: False)
        rows = run_evaluation(compared, workers, say=remark, is_over=over)
    rates = summarize_trials(TrialTable(rows), compared.attempts)
    text, table = format_rates(rates), args.out / "table.md"
    write_atomically(table, lambda temporary: temporary.write_text(text, encoding="utf-8"))
    shown = demonstrate(scenario, library, "gp", 0, args.out / "demo", say=remark)
    values = {
        "library": str(library.path),
        "reaches": library.num_reaches,
        "table": str(table),
        "rates": rates,
        "demo": str(shown.files["recording"]),
    }
    print_result(args, values, f"{text}library: {values['library']}\ndemo: {values['demo']}")
    return 0
