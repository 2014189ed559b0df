"""Reaches from every discrete start to evaluation goals, for the best possible choice.

python scripts/bounds/run.py cylinder-clutter --environments 40 --goals 10
python scripts/bounds/run.py passage-clutter --environments 300
python scripts/bounds/run.py cylinder-aperture-clutter --environments 100
python scripts/bounds/run.py sphere-aperture-clutter --environments 100 --still \
        --set '{clutter: {num_blocked: 10}}'
"""

from lic_drake.reach.request import ReachRequest
from lic_drake.reach.scenario import load_scenario
from lic_drake.starts import board_starts, make_starts
from scripts.common import add_results, add_workers, keep_reaches, make_parser, run_script


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("scenario", help="name of a shipped scenario")
    parser.add_argument("--environments", type=int, default=40)
    parser.add_argument("--goals", type=int, default=1, help="random goals in each environment")
    parser.add_argument("--grid-goals", action="store_true", help="those of a collection instead")
    parser.add_argument("--stream", default="evaluation", help="seed stream of the environments")
    parser.add_argument("--set", default="", metavar="YAML", help="values put over the scenario")
    parser.add_argument("--still", action="store_true", help="base and torso of a PR2 stay")
    add_results(parser)
    add_workers(parser)
    args = parser.parse_args()
    scenario = load_scenario(args.scenario, args.set)
    requests = []
    for environment in range(args.environments):
        instance = scenario.sample_instance(args.stream, environment)
        grid = (board_starts if args.still else make_starts)(scenario, instance).grid.without_q()
        if args.grid_goals:
            goals = list(scenario.goals(args.stream, environment))
        else:
            goals = [scenario.sample_goal(args.stream, environment, g) for g in range(args.goals)]
        for p_WG in goals:
            requests += [
                ReachRequest(scenario, args.stream, environment, p_WG, start) for start in grid
            ]
    goals_folder = "grid" if args.grid_goals else "random"
    folder = args.results / "bounds" / args.scenario / goals_folder
    records = keep_reaches(requests, folder, args.workers)
    won = sum(record.success for record in records)
    print(f"{won} of {len(requests)} reaches at the goal; kept in {folder}")


if __name__ == "__main__":
    run_script(main)
