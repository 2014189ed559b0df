"""Reaches from every discrete start to evaluation goals, for the best possible choice.

python scripts/bounds/run.py cylinder-clutter --environments 60 --goals 10
python scripts/bounds/run.py passage-clutter --environments 300
python scripts/bounds/run.py cylinder-aperture-clutter --environments 200
python scripts/bounds/run.py sphere-aperture-clutter --environments 100 --still \
        --set '{clutter: {num_blocked: 10}}'
"""

from lic_drake.reach.request import ReachRequest
from lic_drake.reach.scenario import load_scenario
from lic_drake.starts import board_starts, make_starts
from scripts.common import add_results, add_workers, keep_reaches, make_parser, run_script

STREAM = "evaluation"


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("scenario", help="name of a shipped scenario")
    parser.add_argument("--environments", type=int, default=40)
    parser.add_argument("--goals", type=int, default=1, help="random goals in each environment")
    parser.add_argument("--set", default="", metavar="YAML", help="values put over the scenario")
    parser.add_argument("--still", action="store_true", help="base and torso of a PR2 stay")
    add_results(parser)
    add_workers(parser)
    args = parser.parse_args()
    scenario = load_scenario(args.scenario, args.set)
    requests = []
    for environment in range(args.environments):
        instance = scenario.sample_instance(STREAM, environment)
        grid = (board_starts if args.still else make_starts)(scenario, instance).grid.without_q()
        for goal in range(args.goals):
            p_WG = scenario.sample_goal(STREAM, environment, goal)
            requests += [ReachRequest(scenario, STREAM, environment, p_WG, start) for start in grid]
    folder = args.results / "bounds" / args.scenario / "random"
    records = keep_reaches(requests, folder, args.workers)
    won = sum(record.success for record in records)
    print(f"{won} of {len(requests)} reaches at the goal; kept in {folder}")


if __name__ == "__main__":
    run_script(main)
