"""Looks for starts that reach the goals at which the first attempts of all strategies failed.

    python scripts/bounds/race.py sphere-aperture-clutter --environments 300
    python scripts/bounds/race.py foliage-aperture-clutter --environments 100

Where base and torso move there are too many starts to try all: those that LIC-1(GP) likes best,
some way apart, are tried in its order until one reaches the goal.
"""

from pathlib import Path

import numpy as np

from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.reach.request import ReachRequest
from lic_drake.reach.start import Starts
from lic_drake.select.lic import LicSelector
from lic_drake.select.registry import make_selector
from lic_drake.select.situation import Situation
from lic_drake.starts import make_starts
from lic_drake.types import BoolVector
from scripts.common import add_results, add_workers, keep_reaches, make_parser, run_script

STREAM = "evaluation"

APART_M = 0.15
"""Least distance of two starts, in the space of base, torso height and aperture, metres."""

ROUND, ROUNDS = 10, 3
"""Starts at each goal in a round, and the largest number of rounds."""


def reached(results: Path, category: str, environments: int) -> BoolVector:
    """Returns in which environments any start reached the first goal, shape (environments,).

    The environment was as sampled; the start was a strategy's, or tried by this script.
    """
    evaluated = ExperienceLibrary(results / category / "reaches")
    scenario = evaluated.scenario()
    goals = np.array([scenario.sample_goal(STREAM, i, 0) for i in range(environments)])
    found = np.zeros(environments, dtype=bool)
    for library in (evaluated, ExperienceLibrary(results / "bounds" / category / "race")):
        if not library.path.exists():
            continue
        columns = library.columns()
        environment = columns["environment"].astype(int)
        won = columns["success"].astype(bool) & (environment < environments)
        won &= np.array([len(after) == 0 for after in columns["after"]])
        goal = np.column_stack([columns[name][won] for name in ("goal_x", "goal_y", "goal_z")])
        there = environment[won]
        found[there[np.all(goal == goals[there], axis=1)]] = True
    return found


def preferred_starts(selector: LicSelector, situation: Situation, count: int) -> Starts:
    """Returns the discrete starts with the highest estimates that are `APART_M` apart, in order."""
    grid = situation.starts.grid
    place = np.column_stack([grid.b0[:, 1:], grid.x0[:, 1:3]])
    left = selector.program(situation).estimates(grid)
    chosen: list[int] = []
    while len(chosen) < count and np.any(left > -np.inf):
        chosen.append(int(np.argmax(left)))
        left[np.linalg.norm(place - place[chosen[-1]], axis=1) < APART_M] = -np.inf
    return grid.take(np.array(chosen)).without_q()


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("category", help="one that was evaluated")
    parser.add_argument("--environments", type=int, required=True, help="the first ones")
    add_results(parser)
    add_workers(parser)
    args = parser.parse_args()
    scenario = ExperienceLibrary(args.results / args.category / "reaches").scenario()
    columns = ExperienceLibrary(shipped_library(args.category)).columns()
    selector = make_selector("gp", columns)
    assert isinstance(selector, LicSelector)
    requests = {}
    for i in np.flatnonzero(~reached(args.results, args.category, args.environments)).tolist():
        p_WG = scenario.sample_goal(STREAM, i, 0)
        starts = make_starts(scenario, scenario.sample_instance(STREAM, i))
        situation = Situation(p_WG=p_WG, starts=starts)
        preferred = preferred_starts(selector, situation, ROUND * ROUNDS)
        requests[i] = [ReachRequest(scenario, STREAM, i, p_WG, start) for start in preferred]
    folder = args.results / "bounds" / args.category / "race"
    for first in range(0, ROUND * ROUNDS, ROUND):
        tried = [r for several in requests.values() for r in several[first : first + ROUND]]
        won = {r.environment for r in keep_reaches(tried, folder, args.workers) if r.success}
        requests = {i: several for i, several in requests.items() if i not in won}
        print(f"{len(requests)} goals left after {first + ROUND} starts; kept in {folder}")


if __name__ == "__main__":
    run_script(main)
