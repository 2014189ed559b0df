"""Tries every discrete start at evaluation goals: what the best choice could attain.

python scripts/bounds/run.py cylinder-clutter --environments 40 --goals 10
python scripts/bounds/run.py passage-clutter --environments 300
python scripts/bounds/run.py cylinder-aperture-clutter --environments 100
python scripts/bounds/run.py sphere-aperture-clutter --environments 100 --still \
    --set '{clutter: {num_blocked: 10}}'
"""

import argparse
import os
import sys
from pathlib import Path

from lic_drake.evaluate.batch import simulate_requests
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.pointing_starts import pointing_starts
from lic_drake.reach.request import ReachRequest
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.starts import make_starts


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenario", help="name of a shipped scenario")
    parser.add_argument("--environments", type=int, default=40)
    parser.add_argument("--goals", type=int, default=1, help="random goals in each environment")
    parser.add_argument("--common-goals", action="store_true", help="the same goals in all of them")
    parser.add_argument("--stream", default="evaluation", help="seed stream of the environments")
    parser.add_argument("--set", default="", metavar="YAML", help="values put over the scenario")
    parser.add_argument("--still", action="store_true", help="base and torso of a PR2 stay")
    parser.add_argument("--out", type=Path, default=Path("notebooks/results/bounds"))
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    args = parser.parse_args()
    scenario = load_scenario(args.scenario, args.set)
    requests = []
    for environment in range(args.environments):
        instance = scenario.sample_instance(args.stream, environment)
        find = pointing_starts if args.still else make_starts
        grid = find(scenario, instance).grid
        for goal in range(args.goals):
            at = 0 if args.common_goals else environment
            p_WG = scenario.sample_goal(args.stream, at, goal)
            requests += [
                ReachRequest(scenario, args.stream, environment, p_WG, start) for start in grid
            ]
    library = ExperienceLibrary(args.out / args.scenario / "factorial")
    library.create()
    found = simulate_requests(requests, library, scenario, args.workers, print)
    won = sum(found[request.key].success for request in requests)
    print(f"{won} of {len(requests)} reaches at the goal; kept in {library.path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
